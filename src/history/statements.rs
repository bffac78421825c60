//! Builds statements from prefixed names, of which only demanded ones are kept.

use std::collections::HashMap;

use oxigraph::model::{BlankNode, GraphName, Literal, NamedNode, NamedOrBlankNode, Quad, Term};

use crate::view::Demand;
use actcheck_base::names;

/// Expands a prefixed name of [`names::PREFIXES`], such as `act:score`; any other text is used as
/// an IRI.
pub(super) fn iri(name: &str) -> NamedNode {
    let expanded = name.split_once(':').and_then(|(prefix, local)| {
        let (_, namespace) = names::PREFIXES.iter().find(|(known, _)| *known == prefix)?;
        Some(format!("{namespace}{local}"))
    });
    NamedNode::new_unchecked(expanded.unwrap_or_else(|| name.to_owned()))
}

/// A literal for a point in time, in the canonical form of XML Schema, which has no zeros at the
/// end of its seconds: stores return it in this form.
pub(super) fn time(rfc3339: &str) -> Literal {
    let canonical = match rfc3339.strip_suffix('Z') {
        Some(seconds) if seconds.contains('.') => {
            format!("{}Z", seconds.trim_end_matches('0').trim_end_matches('.'))
        }
        _ => rfc3339.to_owned(),
    };
    Literal::new_typed_literal(canonical, iri("xsd:dateTime"))
}

/// The value of a statement. A literal is only made if the statement is kept.
pub(super) enum Value<'a> {
    Text(&'a str),
    Number(f64),
    Count(u64),
    Boolean(bool),
    /// A point in time: RFC 3339.
    Time(&'a str),
    Node(NamedNode),
    Blank(BlankNode),
}

impl Value<'_> {
    fn into_term(self) -> Term {
        match self {
            Self::Text(text) => Literal::new_simple_literal(text).into(),
            Self::Number(value) => Literal::from(value).into(),
            Self::Count(value) => Literal::from(value).into(),
            Self::Boolean(value) => Literal::from(value).into(),
            Self::Time(text) => time(text).into(),
            Self::Node(node) => node.into(),
            Self::Blank(node) => node.into(),
        }
    }
}

impl<'a> From<&'a str> for Value<'a> {
    fn from(text: &'a str) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Value<'_> {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<u64> for Value<'_> {
    fn from(value: u64) -> Self {
        Self::Count(value)
    }
}

impl From<bool> for Value<'_> {
    fn from(value: bool) -> Self {
        Self::Boolean(value)
    }
}

impl From<NamedNode> for Value<'_> {
    fn from(node: NamedNode) -> Self {
        Self::Node(node)
    }
}

impl From<BlankNode> for Value<'_> {
    fn from(node: BlankNode) -> Self {
        Self::Blank(node)
    }
}

/// Statements in one graph.
#[derive(Debug)]
pub(super) struct Statements<'d> {
    demand: &'d Demand,
    graph: Option<NamedNode>,
    /// The properties that have occurred, by prefixed name: their IRIs, or `None` if no statement
    /// with them is demanded.
    properties: HashMap<String, Option<NamedNode>>,
    /// The statements so far.
    pub(super) quads: Vec<Quad>,
}

impl<'d> Statements<'d> {
    /// Begins statements in the default graph.
    pub(super) fn new(demand: &'d Demand) -> Self {
        Self::in_graph(demand, None)
    }

    /// Begins statements in a graph.
    pub(super) fn in_graph(demand: &'d Demand, graph: Option<NamedNode>) -> Self {
        Self {
            demand,
            graph,
            properties: HashMap::new(),
            quads: Vec::new(),
        }
    }

    /// Starts statements about a subject.
    pub(super) fn about<'s>(&'s mut self, subject: impl Into<NamedOrBlankNode>) -> About<'s, 'd> {
        About {
            statements: self,
            subject: subject.into(),
        }
    }

    /// Whether statements with any of these properties can be demanded.
    pub(super) fn wants(&mut self, properties: &[&str]) -> bool {
        properties
            .iter()
            .any(|property| self.property(property).is_some())
    }

    fn property(&mut self, name: &str) -> Option<NamedNode> {
        if let Some(known) = self.properties.get(name) {
            return known.clone();
        }
        let iri = iri(name);
        let graph = self.graph.as_ref().map(NamedNode::as_str);
        let kept = self.demand.has_property(iri.as_str(), graph).then_some(iri);
        self.properties.insert(name.to_owned(), kept.clone());
        kept
    }
}

/// Statements about one subject.
pub(super) struct About<'s, 'd> {
    statements: &'s mut Statements<'d>,
    subject: NamedOrBlankNode,
}

impl About<'_, '_> {
    /// Adds the value of a property.
    pub(super) fn has<'a>(&mut self, property: &str, value: impl Into<Value<'a>>) -> &mut Self {
        let statements = &mut *self.statements;
        if let Some(property) = statements.property(property) {
            let value = value.into().into_term();
            let graph = statements.graph.as_ref().map(NamedNode::as_str);
            let demand = statements.demand;
            if demand.has(
                self.subject.as_ref(),
                property.as_str(),
                value.as_ref(),
                graph,
            ) {
                let graph = statements.graph.clone();
                statements.quads.push(Quad {
                    subject: self.subject.clone(),
                    predicate: property,
                    object: value,
                    graph_name: graph.map_or(GraphName::DefaultGraph, GraphName::from),
                });
            }
        }
        self
    }

    /// Adds the value of a property unless it is `None`.
    pub(super) fn optional<'a>(
        &mut self,
        property: &str,
        value: Option<impl Into<Value<'a>>>,
    ) -> &mut Self {
        match value {
            Some(value) => self.has(property, value),
            None => self,
        }
    }

    /// Adds a class.
    pub(super) fn is_a(&mut self, class: &str) -> &mut Self {
        self.has("rdf:type", iri(class))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs were exported as they are written, but another store returned `22.43Z` for `22.430Z`.
    #[test]
    fn times_are_written_as_stores_return_them() {
        for (written, canonical) in [
            ("2026-11-25T05:15:22.430Z", "2026-11-25T05:15:22.43Z"),
            ("2026-11-25T05:15:20.000Z", "2026-11-25T05:15:20Z"),
            ("2026-11-25T05:15:20Z", "2026-11-25T05:15:20Z"),
            ("2026-11-25T05:15:20.125Z", "2026-11-25T05:15:20.125Z"),
        ] {
            assert_eq!(time(written).value(), canonical);
            let stored = oxigraph::store::Store::new().and_then(|store| {
                let node = iri("act:Run");
                let quad = Quad::new(
                    node.clone(),
                    node,
                    time(written),
                    oxigraph::model::GraphName::DefaultGraph,
                );
                store.insert(&quad)?;
                store.iter().next().unwrap_or(Ok(quad))
            });
            let stored = stored.expect("it is in memory").object.to_string();
            assert!(stored.starts_with(&format!("\"{canonical}\"")), "{stored}");
        }
    }
}
