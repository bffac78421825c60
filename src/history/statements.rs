//! Builds quads from prefixed names.

use oxigraph::model::{GraphName, Literal, NamedNode, NamedOrBlankNode, Quad, Term};

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

/// A literal for a count. (For a seed above `i64::MAX` the store keeps its digits.)
pub(super) fn count(value: u64) -> Literal {
    Literal::from(value)
}

/// Quads of one transaction.
#[derive(Debug, Default)]
pub(super) struct Statements {
    /// The quads so far.
    pub(super) quads: Vec<Quad>,
}

impl Statements {
    /// Starts statements about a subject, in the default graph.
    pub(super) fn about(&mut self, subject: impl Into<NamedOrBlankNode>) -> About<'_> {
        About {
            quads: &mut self.quads,
            subject: subject.into(),
        }
    }
}

/// Statements about one subject in the default graph.
pub(super) struct About<'a> {
    quads: &'a mut Vec<Quad>,
    subject: NamedOrBlankNode,
}

impl About<'_> {
    /// Adds the value of a property.
    pub(super) fn has(&mut self, property: &str, value: impl Into<Term>) -> &mut Self {
        self.quads.push(Quad::new(
            self.subject.clone(),
            iri(property),
            value,
            GraphName::DefaultGraph,
        ));
        self
    }

    /// Adds the value of a property unless it is `None`.
    pub(super) fn optional(&mut self, property: &str, value: Option<impl Into<Term>>) -> &mut Self {
        match value {
            Some(value) => self.has(property, value),
            None => self,
        }
    }

    /// Adds a text as the value of a property.
    pub(super) fn text(&mut self, property: &str, value: &str) -> &mut Self {
        self.has(property, Literal::new_simple_literal(value))
    }

    /// Adds a class.
    pub(super) fn is_a(&mut self, class: &str) -> &mut Self {
        self.has("rdf:type", iri(class))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outlines are exported as they are written, but another store returned `22.43Z` for
    /// `22.430Z`.
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
