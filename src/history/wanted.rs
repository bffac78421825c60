//! The statements of a journal that an answer can depend on.
//!
//! A journal has up to some hundred thousand statements, most of them facts that few questions ask
//! for. An answer depends only on the statements that match a pattern of the question, so a reader
//! takes only these from the journal.

use std::collections::BTreeSet;

use oxigraph::model::vocab::xsd;
use oxigraph::model::{NamedOrBlankNode, Quad, Term};
use spargebra::Query;
use spargebra::algebra::{
    AggregateExpression, Expression, Function, GraphPattern, OrderExpression,
    PropertyPathExpression,
};
use spargebra::term::{NamedNodePattern, TermPattern, TriplePattern};

use crate::light::{parser, parts};
use crate::lists;
use crate::statements::iri;
use actcheck_base::names;

/// Number of runs above which a reader that asks for single runs takes the statements about all
/// runs: each time, it decodes the whole journal.
const MOST_RUNS: usize = 2;

/// Statements that a reader needs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Wanted {
    pub patterns: BTreeSet<Pattern>,
    /// IRIs of runs: all records that name one of them, or something below it, are needed.
    pub runs: BTreeSet<String>,
    /// Whether the names of all graphs are needed, also of those without a needed statement.
    pub graphs: bool,
}

/// Statements with some fixed terms.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Pattern {
    pub subject: Option<Fixed>,
    pub property: Option<Fixed>,
    pub value: Option<Fixed>,
    pub graph: InGraph,
}

/// A fixed term.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fixed {
    Iri(String),
    /// An IRI that begins with this text.
    Below(String),
    Text(String),
}

/// The graph of a statement.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum InGraph {
    #[default]
    Any,
    Default,
    Named,
    Is(String),
}

impl Wanted {
    /// All statements.
    pub(super) fn all() -> Self {
        Self {
            patterns: BTreeSet::from([Pattern::default()]),
            graphs: true,
            ..Self::default()
        }
    }

    /// All statements except facts.
    pub(super) fn details() -> Self {
        let of = |graph| Pattern {
            graph,
            ..Pattern::default()
        };
        Self::of([
            of(InGraph::Default),
            of(InGraph::Is(iri("act:rechecked").into_string())),
        ])
    }

    /// All statements in the records that name a run or something below it.
    pub(super) fn run(iri: &str) -> Self {
        Self {
            runs: BTreeSet::from([iri.to_owned()]),
            ..Self::default()
        }
    }

    /// All statements about campaigns.
    pub(super) fn campaigns() -> Self {
        Self::of([Pattern {
            subject: Some(Fixed::Below(names::CAMPAIGN.to_owned())),
            ..Pattern::default()
        }])
    }

    /// The values of properties.
    pub(super) fn values(properties: &[&str]) -> Self {
        Self::of(
            properties
                .iter()
                .map(|property| pattern(Some(iri(property).into_string()), InGraph::Default)),
        )
    }

    /// The values of a property in a named graph.
    pub(super) fn in_graph(property: &str, graph: &str) -> Self {
        Self::of([pattern(
            Some(iri(property).into_string()),
            InGraph::Is(iri(graph).into_string()),
        )])
    }

    /// The individuals of a class.
    pub(super) fn individuals(class: &str) -> Self {
        let value = Some(Fixed::Iri(iri(class).into_string()));
        Self::of([Pattern {
            value,
            ..pattern(Some(iri("rdf:type").into_string()), InGraph::Default)
        }])
    }

    fn of(patterns: impl IntoIterator<Item = Pattern>) -> Self {
        Self {
            patterns: patterns.into_iter().collect(),
            ..Self::default()
        }
    }

    /// The statements that a query's answer can depend on: all if the text is not a query.
    pub(super) fn query(text: &str) -> Self {
        parser()
            .parse_query(text)
            .map_or_else(|_| Self::all(), |query| Self::parsed(&query))
    }

    /// The statements that any of several queries' answers can depend on.
    pub(super) fn queries(texts: &[&str]) -> Self {
        let mut wanted = Self::default();
        texts.iter().for_each(|text| wanted.add(Self::query(text)));
        wanted
    }

    /// The statements that the answer of a parsed query can depend on.
    pub(super) fn parsed(query: &Query) -> Self {
        let pattern = match query {
            Query::Select { pattern, .. }
            | Query::Construct { pattern, .. }
            | Query::Ask { pattern, .. } => pattern,
            // Everything about the resources that it finds.
            Query::Describe { .. } => return Self::all(),
        };
        let mut wanted = Self::default();
        // With `FROM`, the default graph of the query is another one.
        let graph = if query.dataset().is_some() {
            InGraph::Any
        } else {
            InGraph::Default
        };
        wanted.add_pattern(pattern, &graph);
        wanted
    }

    /// The properties of all wanted statements; `None` if they may have any property.
    pub(super) fn properties(&self) -> Option<Vec<&str>> {
        let mut properties = Vec::new();
        for pattern in &self.patterns {
            let Some(Fixed::Iri(iri)) = &pattern.property else {
                return None;
            };
            properties.push(iri.as_str());
        }
        self.runs.is_empty().then_some(properties)
    }

    /// Whether a statement in the default graph about a run is wanted.
    pub(super) fn has(&self, quad: &Quad) -> bool {
        let is_below = |run: &String| match &quad.subject {
            NamedOrBlankNode::NamedNode(node) => node
                .as_str()
                .strip_prefix(run.as_str())
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('/')),
            // It is not known of which run.
            NamedOrBlankNode::BlankNode(_) => true,
        };
        let fits = |pattern: &Pattern| {
            matches!(pattern.graph, InGraph::Any | InGraph::Default)
                && fits(&pattern.subject, &quad.subject.clone().into())
                && fits(&pattern.property, &quad.predicate.clone().into())
                && fits(&pattern.value, &quad.object)
        };
        self.patterns.iter().any(fits) || self.runs.iter().any(is_below)
    }

    pub(super) fn add(&mut self, other: Self) {
        self.patterns.extend(other.patterns);
        self.runs.extend(other.runs);
        self.graphs |= other.graphs;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.patterns.is_empty() && self.runs.is_empty() && !self.graphs
    }

    /// The wanted statements that another does not have. A reader that asks for several runs gets
    /// the statements about all runs.
    pub(super) fn beyond(mut self, other: &Self) -> Self {
        if self.runs.difference(&other.runs).count() + other.runs.len() > MOST_RUNS {
            self.runs.clear();
            self.add(Self::details());
        }
        let of = |wanted: &Self| wanted.patterns.contains(&Pattern::default());
        if of(other) {
            self.patterns.clear();
        }
        self.patterns
            .retain(|pattern| !other.patterns.contains(pattern));
        let has_details = Self::details().patterns.is_subset(&other.patterns);
        self.runs
            .retain(|run| !of(other) && !has_details && !other.runs.contains(run));
        self.graphs &= !other.graphs;
        self
    }

    fn add_pattern(&mut self, found: &GraphPattern, graph: &InGraph) {
        use GraphPattern as G;
        match found {
            G::Bgp { patterns } => self
                .patterns
                .extend(patterns.iter().map(|triple| of_triple(triple, graph))),
            G::Path { path, .. } => self.add_path(path, graph),
            G::Join { left, right } | G::Union { left, right } | G::Minus { left, right } => {
                self.add_pattern(left, graph);
                self.add_pattern(right, graph);
            }
            G::LeftJoin {
                left,
                right,
                expression,
            } => {
                self.add_pattern(left, graph);
                self.add_pattern(right, graph);
                expression
                    .iter()
                    .for_each(|expression| self.add_expression(expression, graph));
            }
            G::Filter { expr, inner }
            | G::Extend {
                inner,
                expression: expr,
                ..
            } => {
                self.add_pattern(inner, graph);
                self.add_expression(expr, graph);
            }
            G::Graph { name, inner } => {
                self.graphs = true;
                let named = match (graph, name) {
                    (InGraph::Any, _) => InGraph::Any,
                    (_, NamedNodePattern::NamedNode(node)) => InGraph::Is(node.as_str().to_owned()),
                    (_, NamedNodePattern::Variable(_)) => InGraph::Named,
                };
                self.add_pattern(inner, &named);
            }
            G::OrderBy { inner, expression } => {
                self.add_pattern(inner, graph);
                for OrderExpression::Asc(key) | OrderExpression::Desc(key) in expression {
                    self.add_expression(key, graph);
                }
            }
            G::Group {
                inner, aggregates, ..
            } => {
                self.add_pattern(inner, graph);
                for (_, aggregate) in aggregates {
                    if let AggregateExpression::FunctionCall { expr, .. } = aggregate {
                        self.add_expression(expr, graph);
                    }
                }
            }
            G::Project { inner, .. }
            | G::Distinct { inner }
            | G::Reduced { inner }
            | G::Slice { inner, .. } => {
                self.add_pattern(inner, graph);
            }
            G::Values { .. } => {}
            // `SERVICE` is refused later, and the others are rare.
            _ => self.add(Self::all()),
        }
    }

    fn add_path(&mut self, path: &PropertyPathExpression, graph: &InGraph) {
        use PropertyPathExpression as P;
        match path {
            P::NamedNode(node) => drop(
                self.patterns
                    .insert(pattern(Some(node.as_str().to_owned()), graph.clone())),
            ),
            P::Reverse(inner) | P::OneOrMore(inner) => self.add_path(inner, graph),
            P::Sequence(left, right) | P::Alternative(left, right) => {
                self.add_path(left, graph);
                self.add_path(right, graph);
            }
            // A path of no steps leads from each term of the graph to itself.
            P::ZeroOrMore(_) | P::ZeroOrOne(_) | P::NegatedPropertySet(_) => {
                self.patterns.insert(pattern(None, graph.clone()));
            }
        }
    }

    fn add_expression(&mut self, expression: &Expression, graph: &InGraph) {
        use Expression as E;
        parts(expression)
            .into_iter()
            .for_each(|part| self.add_expression(part, graph));
        match expression {
            E::Exists(pattern) => self.add_pattern(pattern, graph),
            E::FunctionCall(Function::Custom(function), _)
                if function.as_str() == names::act("counts") =>
            {
                self.add(Self::queries(&lists::COUNTED));
            }
            _ => {}
        }
    }
}

fn pattern(property: Option<String>, graph: InGraph) -> Pattern {
    Pattern {
        property: property.map(Fixed::Iri),
        graph,
        ..Pattern::default()
    }
}

fn of_triple(triple: &TriplePattern, graph: &InGraph) -> Pattern {
    let property = match &triple.predicate {
        NamedNodePattern::NamedNode(node) => Some(node.as_str().to_owned()),
        NamedNodePattern::Variable(_) => None,
    };
    Pattern {
        subject: fixed(&triple.subject),
        value: fixed(&triple.object),
        ..pattern(property, graph.clone())
    }
}

fn fits(fixed: &Option<Fixed>, term: &Term) -> bool {
    match (fixed, term) {
        (None, _) => true,
        (Some(Fixed::Iri(wanted)), Term::NamedNode(node)) => node.as_str() == wanted,
        (Some(Fixed::Below(wanted)), Term::NamedNode(node)) => {
            node.as_str().starts_with(wanted.as_str())
        }
        (Some(Fixed::Text(wanted)), Term::Literal(literal)) => {
            literal.datatype() == xsd::STRING && literal.value() == wanted
        }
        _ => false,
    }
}

/// A term that matches only itself. The store also takes numbers and times with the same value for
/// the same.
fn fixed(term: &TermPattern) -> Option<Fixed> {
    match term {
        TermPattern::NamedNode(node) => Some(Fixed::Iri(node.as_str().to_owned())),
        TermPattern::Literal(literal) if literal.datatype() == xsd::STRING => {
            Some(Fixed::Text(literal.value().to_owned()))
        }
        _ => None,
    }
}
