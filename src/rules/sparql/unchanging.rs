//! Which queries read only facts that no action can change.

use spargebra::Query;
use spargebra::algebra::{
    AggregateExpression, Expression, GraphPattern, OrderExpression, PropertyPathExpression,
};
use spargebra::term::{NamedNodePattern, TriplePattern};

use crate::sparql::parsed::{parsed, parts};
use actcheck_base::{CONSTANT_PROPERTIES, names};

/// Graphs with facts that are the same whatever the robot does, by their local names.
const UNCHANGING: [&str; 3] = ["before", "parameters", "ontology"];

/// Whether a valid query reads only the state before the action, constant properties, designators
/// and the ontology.
pub(crate) fn is_unchanging(text: &str) -> bool {
    match parsed(text) {
        Some(
            Query::Ask {
                pattern,
                dataset: None,
                ..
            }
            | Query::Select {
                pattern,
                dataset: None,
                ..
            },
        ) => !changes(&pattern, ReadGraph::All),
        _ => false,
    }
}

/// The graph whose facts a pattern reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ReadGraph {
    /// All graphs together.
    All,
    /// The state after the action, in which only constant properties are unchanging.
    After,
    /// One with unchanging facts.
    Unchanging,
    /// Another one, or one that depends on the facts.
    Other,
}

impl ReadGraph {
    fn named(name: &NamedNodePattern) -> Self {
        let NamedNodePattern::NamedNode(node) = name else {
            return Self::Other;
        };
        match node.as_str().strip_prefix(names::ACT) {
            Some("after") => Self::After,
            Some(local) if UNCHANGING.contains(&local) => Self::Unchanging,
            _ => Self::Other,
        }
    }
}

/// Whether a pattern may read a fact that an action can change.
fn changes(pattern: &GraphPattern, graph: ReadGraph) -> bool {
    let of = |inner: &GraphPattern| changes(inner, graph);
    let by = |expression: &Expression| decides(expression, graph);
    match pattern {
        GraphPattern::Bgp { patterns } => {
            let constant = |triple: &TriplePattern| match &triple.predicate {
                NamedNodePattern::NamedNode(node) => is_constant(node.as_str()),
                NamedNodePattern::Variable(_) => false,
            };
            match graph {
                ReadGraph::Unchanging => false,
                ReadGraph::After => !patterns.iter().all(constant),
                ReadGraph::All | ReadGraph::Other => !patterns.is_empty(),
            }
        }
        GraphPattern::Path { path, .. } => match graph {
            ReadGraph::Unchanging => false,
            ReadGraph::After => {
                !matches!(path, PropertyPathExpression::NamedNode(node) if is_constant(node.as_str()))
            }
            ReadGraph::All | ReadGraph::Other => true,
        },
        GraphPattern::Graph { name, inner } => changes(inner, ReadGraph::named(name)),
        GraphPattern::Join { left, right }
        | GraphPattern::Union { left, right }
        | GraphPattern::Minus { left, right } => of(left) || of(right),
        GraphPattern::LeftJoin {
            left,
            right,
            expression,
        } => of(left) || of(right) || expression.as_ref().is_some_and(by),
        GraphPattern::Filter { expr, inner } => by(expr) || of(inner),
        GraphPattern::Extend {
            inner, expression, ..
        } => by(expression) || of(inner),
        GraphPattern::Values { .. } => false,
        GraphPattern::OrderBy { inner, expression } => {
            let key = |order: &OrderExpression| match order {
                OrderExpression::Asc(key) | OrderExpression::Desc(key) => by(key),
            };
            of(inner) || expression.iter().any(key)
        }
        GraphPattern::Group {
            inner, aggregates, ..
        } => {
            let counts = |aggregate: &AggregateExpression| match aggregate {
                AggregateExpression::CountSolutions { .. } => false,
                AggregateExpression::FunctionCall { expr, .. } => by(expr),
            };
            of(inner) || aggregates.iter().any(|(_, aggregate)| counts(aggregate))
        }
        GraphPattern::Project { inner, .. }
        | GraphPattern::Distinct { inner }
        | GraphPattern::Reduced { inner }
        | GraphPattern::Slice { inner, .. } => of(inner),
        _ => true,
    }
}

/// Whether an expression may read a fact that an action can change: it may contain `EXISTS`.
fn decides(expression: &Expression, graph: ReadGraph) -> bool {
    match expression {
        Expression::Exists(pattern) => changes(pattern, graph),
        _ => parts(expression)
            .into_iter()
            .any(|part| decides(part, graph)),
    }
}

/// Whether no action can change the values of a property.
fn is_constant(iri: &str) -> bool {
    iri.strip_prefix(names::W)
        .is_some_and(|local| CONSTANT_PROPERTIES.contains(&local))
        || iri.strip_prefix(names::RDF) == Some("type")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_that_read_only_unchanging_facts_are_known() {
        for (query, expected) in [
            (
                "ASK { GRAPH act:before { ?o w:z ?z } FILTER(?z > 0.5) }",
                true,
            ),
            (
                "ASK { GRAPH act:after { ?o w:mass ?m ; a ?class } GRAPH act:ontology { ?class ?p ?c } }",
                true,
            ),
            (
                "SELECT * { GRAPH act:before { ?o w:upright true } FILTER NOT EXISTS { GRAPH act:parameters { ?d ?p ?o } } }",
                true,
            ),
            (
                "SELECT (COUNT(*) AS ?n) { { GRAPH act:before { ?o w:z 1.0 } } UNION { GRAPH act:ontology { ?o ?p 1 } } }",
                true,
            ),
            (
                "ASK { GRAPH act:after { ?o w:z ?z } FILTER(?z > 0.5) }",
                false,
            ),
            (
                "ASK { GRAPH act:before { ?o w:z ?z } FILTER NOT EXISTS { ?o w:upright false } }",
                false,
            ),
            (
                "ASK { GRAPH act:before { ?o w:z ?z } OPTIONAL { GRAPH act:during { ?o w:maxTilt ?t } } }",
                false,
            ),
            ("ASK { GRAPH ?g { ?o w:z ?z } }", false),
            ("ASK { ?o w:mass ?m }", false),
            ("ASK { GRAPH act:after { ?o w:restsOn+ ?m } }", false),
            (
                "ASK FROM NAMED act:before { GRAPH act:before { ?o w:z ?z } }",
                false,
            ),
            ("not a query", false),
        ] {
            assert_eq!(is_unchanging(query), expected, "{query}");
        }
    }
}
