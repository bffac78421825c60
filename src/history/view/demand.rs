//! Demands: the statements that the answer of a query can depend on. Only these are made from the
//! segments.

use std::collections::BTreeSet;

use oxigraph::model::vocab::xsd;
use oxigraph::model::{NamedNode, NamedOrBlankNodeRef, TermRef};
use spargebra::Query;
use spargebra::algebra::{
    AggregateExpression, Expression, GraphPattern, OrderExpression, PropertyPathExpression,
};
use spargebra::term::{NamedNodePattern, TermPattern, TriplePattern};

use crate::light::{parser, parts};

/// Statements that a query needs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Demand {
    patterns: BTreeSet<Pattern>,
    /// The graphs whose names are needed, also if no statement of theirs is.
    graphs: BTreeSet<InGraph>,
}

/// Statements with some fixed terms.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Pattern {
    subject: Option<String>,
    property: Option<String>,
    value: Option<Fixed>,
    graph: InGraph,
}

/// A fixed value.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Fixed {
    Iri(String),
    Text(String),
}

/// The graph of a statement.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
enum InGraph {
    #[default]
    Any,
    Default,
    Named,
    Is(String),
}

impl InGraph {
    /// Whether it is, or includes, a graph; `None` is the default graph.
    fn has(&self, graph: Option<&str>) -> bool {
        match (self, graph) {
            (Self::Any, _) | (Self::Default, None) | (Self::Named, Some(_)) => true,
            (Self::Is(wanted), Some(name)) => wanted == name,
            _ => false,
        }
    }
}

impl Demand {
    /// All statements.
    pub(crate) fn all() -> Self {
        Self {
            patterns: BTreeSet::from([Pattern::default()]),
            graphs: BTreeSet::from([InGraph::Any]),
        }
    }

    /// The statements that a query's answer can depend on: all if the text is not a query.
    pub(crate) fn query(text: &str) -> Self {
        parser()
            .parse_query(text)
            .map_or_else(|_| Self::all(), |query| Self::parsed(&query))
    }

    /// The statements that the answer of a parsed query can depend on.
    pub(crate) fn parsed(query: &Query) -> Self {
        let pattern = match query {
            Query::Select { pattern, .. }
            | Query::Construct { pattern, .. }
            | Query::Ask { pattern, .. } => pattern,
            // Everything about the resources that it finds.
            Query::Describe { .. } => return Self::all(),
        };
        let mut demand = Self::default();
        // With `FROM`, the default graph of the query is another one.
        let graph = if query.dataset().is_some() {
            demand.graphs.insert(InGraph::Any);
            InGraph::Any
        } else {
            InGraph::Default
        };
        demand.add_pattern(pattern, &graph);
        demand
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.patterns.is_empty() && self.graphs.is_empty()
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.patterns.extend(other.patterns);
        self.graphs.extend(other.graphs);
    }

    /// The demanded statements that another demand does not have.
    pub(crate) fn beyond(mut self, other: &Self) -> Self {
        if other.patterns.contains(&Pattern::default()) {
            self.patterns.clear();
        }
        if other.graphs.contains(&InGraph::Any) {
            self.graphs.clear();
        }
        let known = |pattern: &Pattern| {
            other.patterns.contains(pattern) || other.patterns.contains(&pattern.of_any_values())
        };
        self.patterns.retain(|pattern| !known(pattern));
        self.graphs.retain(|graph| !other.graphs.contains(graph));
        self
    }

    /// Whether statements with a property in a graph can be demanded.
    pub(crate) fn has_property(&self, property: &str, graph: Option<&str>) -> bool {
        self.patterns.iter().any(|pattern| {
            pattern.graph.has(graph)
                && pattern
                    .property
                    .as_ref()
                    .is_none_or(|wanted| wanted == property)
        })
    }

    /// Whether a statement is demanded.
    pub(crate) fn has(
        &self,
        subject: NamedOrBlankNodeRef<'_>,
        property: &str,
        value: TermRef<'_>,
        graph: Option<&str>,
    ) -> bool {
        let is_subject = |wanted: &String| match subject {
            NamedOrBlankNodeRef::NamedNode(node) => node.as_str() == wanted,
            NamedOrBlankNodeRef::BlankNode(_) => false,
        };
        let is_value = |wanted: &Fixed| match (wanted, value) {
            (Fixed::Iri(wanted), TermRef::NamedNode(node)) => node.as_str() == wanted,
            (Fixed::Text(wanted), TermRef::Literal(literal)) => {
                literal.datatype() == xsd::STRING && literal.value() == wanted
            }
            _ => false,
        };
        self.patterns.iter().any(|pattern| {
            pattern.graph.has(graph)
                && pattern.property.as_ref().is_none_or(|own| own == property)
                && pattern.value.as_ref().is_none_or(is_value)
                && pattern.subject.as_ref().is_none_or(is_subject)
        })
    }

    /// Whether a statement about a run, or a node below it, can be demanded, apart from its facts.
    pub(crate) fn has_details_of(&self, run: &NamedNode, later: &str) -> bool {
        self.patterns.iter().any(|pattern| {
            (pattern.graph.has(None) || pattern.graph.has(Some(later)))
                && pattern.subject.as_ref().is_none_or(|of| is_below(of, run))
        })
    }

    /// Whether facts of a run, or the names of their graphs, can be demanded.
    pub(crate) fn has_facts_of(&self, run: &NamedNode) -> bool {
        let is_of_run = |graph: &InGraph| match graph {
            InGraph::Any | InGraph::Named => true,
            InGraph::Default => false,
            InGraph::Is(name) => is_below(name, run),
        };
        self.graphs.iter().any(is_of_run)
            || self
                .patterns
                .iter()
                .any(|pattern| is_of_run(&pattern.graph))
    }

    /// Whether the name of a graph is needed.
    pub(crate) fn has_graph(&self, name: &str) -> bool {
        self.graphs.iter().any(|graph| graph.has(Some(name)))
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
                let named = match (graph, name) {
                    (InGraph::Any, _) => InGraph::Any,
                    (_, NamedNodePattern::NamedNode(node)) => InGraph::Is(node.as_str().to_owned()),
                    (_, NamedNodePattern::Variable(_)) => InGraph::Named,
                };
                self.graphs.insert(match &named {
                    InGraph::Is(_) => named.clone(),
                    _ => InGraph::Any,
                });
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
                    .insert(of_property(Some(node.as_str().to_owned()), graph)),
            ),
            P::Reverse(inner) | P::OneOrMore(inner) => self.add_path(inner, graph),
            P::Sequence(left, right) | P::Alternative(left, right) => {
                self.add_path(left, graph);
                self.add_path(right, graph);
            }
            // A path of no steps leads from each term of the graph to itself.
            P::ZeroOrMore(_) | P::ZeroOrOne(_) | P::NegatedPropertySet(_) => {
                self.patterns.insert(of_property(None, graph));
            }
        }
    }

    fn add_expression(&mut self, expression: &Expression, graph: &InGraph) {
        parts(expression)
            .into_iter()
            .for_each(|part| self.add_expression(part, graph));
        if let Expression::Exists(pattern) = expression {
            self.add_pattern(pattern, graph);
        }
    }
}

impl Pattern {
    /// The same pattern without fixed subject and value.
    fn of_any_values(&self) -> Self {
        of_property(self.property.clone(), &self.graph)
    }
}

/// Whether an IRI is that of a run or of a node below it.
fn is_below(iri: &str, run: &NamedNode) -> bool {
    iri.strip_prefix(run.as_str())
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

fn of_property(property: Option<String>, graph: &InGraph) -> Pattern {
    Pattern {
        property,
        graph: graph.clone(),
        ..Pattern::default()
    }
}

fn of_triple(triple: &TriplePattern, graph: &InGraph) -> Pattern {
    let property = match &triple.predicate {
        NamedNodePattern::NamedNode(node) => Some(node.as_str().to_owned()),
        NamedNodePattern::Variable(_) => None,
    };
    let subject = match &triple.subject {
        TermPattern::NamedNode(node) => Some(node.as_str().to_owned()),
        _ => None,
    };
    // A term that matches only itself: numbers and times with the same value are the same.
    let value = match &triple.object {
        TermPattern::NamedNode(node) => Some(Fixed::Iri(node.as_str().to_owned())),
        TermPattern::Literal(literal) if literal.datatype() == xsd::STRING => {
            Some(Fixed::Text(literal.value().to_owned()))
        }
        _ => None,
    };
    Pattern {
        subject,
        value,
        ..of_property(property, graph)
    }
}
