//! The properties whose facts a query reads.

use std::collections::BTreeSet;

use spargebra::Query;
use spargebra::algebra::{
    AggregateExpression, Expression, GraphPattern, OrderExpression, PropertyPathExpression,
};
use spargebra::term::{NamedNodePattern, TermPattern, TriplePattern};

use crate::sparql::parsed::{parsed, parts};
use actcheck_base::names;

/// The facts that a query reads.
#[derive(Debug, Default)]
pub(crate) struct QueryFacts {
    /// Whether it reads facts of any property.
    pub(crate) of_any: bool,
    /// IRIs of the properties, and of the things of the world vocabulary that it names.
    pub(crate) properties: BTreeSet<String>,
}

/// Graphs without facts of a run, by their local names.
const OTHER_GRAPHS: [&str; 2] = ["parameters", "ontology"];

/// Returns the facts that a query reads. An invalid query reads none.
pub(crate) fn facts_read(text: &str) -> QueryFacts {
    let mut facts = QueryFacts::default();
    if let Some(
        Query::Ask { pattern, .. }
        | Query::Select { pattern, .. }
        | Query::Construct { pattern, .. }
        | Query::Describe { pattern, .. },
    ) = parsed(text)
    {
        read_pattern(&pattern, &mut facts);
    }
    facts
}

fn read_pattern(pattern: &GraphPattern, facts: &mut QueryFacts) {
    match pattern {
        GraphPattern::Bgp { patterns } => patterns
            .iter()
            .for_each(|triple| read_triple(triple, facts)),
        GraphPattern::Path { path, .. } => read_path(path, facts),
        GraphPattern::Graph { name, inner } => {
            let is_other = matches!(name, NamedNodePattern::NamedNode(node)
                if node.as_str().strip_prefix(names::ACT).is_some_and(|local| OTHER_GRAPHS.contains(&local)));
            if !is_other {
                read_pattern(inner, facts);
            }
        }
        GraphPattern::Join { left, right }
        | GraphPattern::Union { left, right }
        | GraphPattern::Minus { left, right } => {
            read_pattern(left, facts);
            read_pattern(right, facts);
        }
        GraphPattern::LeftJoin {
            left,
            right,
            expression,
        } => {
            read_pattern(left, facts);
            read_pattern(right, facts);
            expression
                .iter()
                .for_each(|expression| read_expression(expression, facts));
        }
        GraphPattern::Filter { expr, inner } => {
            read_pattern(inner, facts);
            read_expression(expr, facts);
        }
        GraphPattern::Extend {
            inner, expression, ..
        } => {
            read_pattern(inner, facts);
            read_expression(expression, facts);
        }
        GraphPattern::OrderBy { inner, expression } => {
            read_pattern(inner, facts);
            for order in expression {
                let (OrderExpression::Asc(key) | OrderExpression::Desc(key)) = order;
                read_expression(key, facts);
            }
        }
        GraphPattern::Group {
            inner, aggregates, ..
        } => {
            read_pattern(inner, facts);
            for (_, aggregate) in aggregates {
                if let AggregateExpression::FunctionCall { expr, .. } = aggregate {
                    read_expression(expr, facts);
                }
            }
        }
        GraphPattern::Project { inner, .. }
        | GraphPattern::Distinct { inner }
        | GraphPattern::Reduced { inner }
        | GraphPattern::Slice { inner, .. } => read_pattern(inner, facts),
        GraphPattern::Values { .. } => {}
        _ => facts.of_any = true,
    }
}

fn read_triple(triple: &TriplePattern, facts: &mut QueryFacts) {
    for term in [&triple.subject, &triple.object] {
        if let TermPattern::NamedNode(node) = term
            && node.as_str().starts_with(names::W)
        {
            facts.properties.insert(node.as_str().to_owned());
        }
    }
    match &triple.predicate {
        NamedNodePattern::NamedNode(node) => {
            facts.properties.insert(node.as_str().to_owned());
        }
        NamedNodePattern::Variable(_) => facts.of_any = true,
    }
}

fn read_path(path: &PropertyPathExpression, facts: &mut QueryFacts) {
    match path {
        PropertyPathExpression::NamedNode(node) => {
            facts.properties.insert(node.as_str().to_owned());
        }
        PropertyPathExpression::Reverse(inner)
        | PropertyPathExpression::ZeroOrMore(inner)
        | PropertyPathExpression::OneOrMore(inner)
        | PropertyPathExpression::ZeroOrOne(inner) => read_path(inner, facts),
        PropertyPathExpression::Sequence(a, b) | PropertyPathExpression::Alternative(a, b) => {
            read_path(a, facts);
            read_path(b, facts);
        }
        PropertyPathExpression::NegatedPropertySet(_) => facts.of_any = true,
    }
}

/// Reads the patterns of each `EXISTS` in an expression.
fn read_expression(expression: &Expression, facts: &mut QueryFacts) {
    if let Expression::Exists(pattern) = expression {
        read_pattern(pattern, facts);
    }
    parts(expression)
        .into_iter()
        .for_each(|part| read_expression(part, facts));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_properties_of_facts_are_found_wherever_they_are() {
        for (query, of_any, expected) in [
            ("ASK { GRAPH act:after { ?o w:z ?z } }", false, vec!["z"]),
            (
                "ASK { GRAPH act:after { ?o w:restsOn+/w:touches ?z } FILTER NOT EXISTS { ?o w:mass 1 } }",
                false,
                vec!["mass", "restsOn", "touches"],
            ),
            (
                "ASK { GRAPH act:parameters { ?d ?p ?o } GRAPH act:ontology { ?o ?q ?r } }",
                false,
                vec![],
            ),
            ("SELECT * { ?o ?p ?z }", true, vec![]),
            (
                "SELECT (MAX(?z) AS ?m) { { ?o w:x ?z } UNION { ?o w:y ?z } } GROUP BY ?o",
                false,
                vec!["x", "y"],
            ),
        ] {
            let found = facts_read(query);
            let expected: Vec<String> = expected.into_iter().map(names::w).collect();
            let properties: Vec<String> = found.properties.into_iter().collect();
            assert_eq!((found.of_any, properties), (of_any, expected), "{query}");
        }
    }
}
