//! Functions whose values are not the same each time: a property must be a function of the facts.

use spargebra::Query;
use spargebra::algebra::{
    AggregateExpression, Expression, Function, GraphPattern, OrderExpression,
};

use crate::sparql::parsed::{parsed, parts};
use crate::sparql::query_text::scan;
use actcheck_base::{Diagnostic, Source};

/// Returns the error about the first function of a valid query that has another value each time.
pub(crate) fn varying(source: &Source) -> Option<Diagnostic> {
    let query = parsed(&source.text)?;
    let (Query::Ask { pattern, .. }
    | Query::Select { pattern, .. }
    | Query::Construct { pattern, .. }
    | Query::Describe { pattern, .. }) = &query;
    let (name, instead) = in_pattern(pattern)?;
    let message = format!(
        "`{name}` has another value each time, so that equal facts would have different outcomes"
    );
    let fault = Diagnostic::error("R064", message).help(instead);
    // A minus sign may be part of the word.
    let place = scan(&source.text).into_iter().find(|word| {
        word.word
            .rsplit('-')
            .next()
            .is_some_and(|last| last.eq_ignore_ascii_case(name))
    });
    Some(match place {
        Some(word) => fault.at(source, word.span.end - name.len()..word.span.end),
        None => fault.in_source(source),
    })
}

/// A function with the remedy.
type VaryingFunction = (&'static str, &'static str);

fn name(function: &Function) -> Option<VaryingFunction> {
    const CHANCE: &str =
        "compare a fact of the run; the campaign's seed makes everything else that is random";
    const THING: &str =
        "compare the facts' own terms: a new node or identifier is equal to none of them";
    match function {
        Function::Rand => Some(("RAND", CHANCE)),
        Function::Now => Some((
            "NOW",
            "compare a fact of the run, such as the seconds of an interval (`w:from`, `w:to`)",
        )),
        Function::Uuid => Some(("UUID", THING)),
        Function::StrUuid => Some(("STRUUID", THING)),
        Function::BNode => Some(("BNODE", THING)),
        _ => None,
    }
}

fn in_pattern(pattern: &GraphPattern) -> Option<VaryingFunction> {
    match pattern {
        GraphPattern::Join { left, right }
        | GraphPattern::Union { left, right }
        | GraphPattern::Minus { left, right } => in_pattern(left).or_else(|| in_pattern(right)),
        GraphPattern::LeftJoin {
            left,
            right,
            expression,
        } => in_pattern(left)
            .or_else(|| in_pattern(right))
            .or_else(|| in_expression(expression.as_ref()?)),
        GraphPattern::Filter { expr, inner } => in_pattern(inner).or_else(|| in_expression(expr)),
        GraphPattern::Extend {
            inner, expression, ..
        } => in_pattern(inner).or_else(|| in_expression(expression)),
        GraphPattern::OrderBy { inner, expression } => in_pattern(inner).or_else(|| {
            expression.iter().find_map(|order| match order {
                OrderExpression::Asc(key) | OrderExpression::Desc(key) => in_expression(key),
            })
        }),
        GraphPattern::Group {
            inner, aggregates, ..
        } => in_pattern(inner).or_else(|| {
            aggregates
                .iter()
                .find_map(|(_, aggregate)| match aggregate {
                    AggregateExpression::CountSolutions { .. } => None,
                    AggregateExpression::FunctionCall { expr, .. } => in_expression(expr),
                })
        }),
        GraphPattern::Graph { inner, .. }
        | GraphPattern::Service { inner, .. }
        | GraphPattern::Project { inner, .. }
        | GraphPattern::Distinct { inner }
        | GraphPattern::Reduced { inner }
        | GraphPattern::Slice { inner, .. } => in_pattern(inner),
        _ => None,
    }
}

fn in_expression(expression: &Expression) -> Option<VaryingFunction> {
    let own = match expression {
        Expression::Exists(pattern) => in_pattern(pattern),
        Expression::FunctionCall(function, _) => name(function),
        _ => None,
    };
    own.or_else(|| parts(expression).into_iter().find_map(in_expression))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_with_another_value_each_time_are_found_wherever_they_are() {
        for (query, place) in [
            ("ASK { FILTER(RAND() < 0.5) }", "RAND"),
            ("ASK { ?s w:z ?z FILTER(?z-rand() < 0.5) }", "rand"),
            ("SELECT (NOW() AS ?n) { ?s ?p ?o }", "NOW"),
            (
                "SELECT ?s { ?s w:z ?z { SELECT ?s (MAX(?z + RAND()) AS ?m) { ?s w:z ?z } GROUP BY ?s } }",
                "RAND",
            ),
            (
                "SELECT ?s { ?s w:z ?z } ORDER BY STRUUID() LIMIT 1",
                "STRUUID",
            ),
            (
                "SELECT ?s { ?s w:z ?z } GROUP BY ?s HAVING(COUNT(?z) > RAND())",
                "RAND",
            ),
            (
                "ASK { GRAPH act:after { OPTIONAL { ?s w:z ?z FILTER(STR(UUID()) < STR(?z)) } } }",
                "UUID",
            ),
            (
                "ASK { ?s w:z ?z FILTER NOT EXISTS { BIND(BNODE(\"a\") AS ?b) } }",
                "BNODE",
            ),
            (
                "ASK { FILTER(IF(true, 1 IN (2, COALESCE(?x, YEAR(NOW()))), false)) }",
                "NOW",
            ),
            (
                "ASK { { ?s w:z ?z } UNION { BIND(!(-RAND() > 0) AS ?x) } MINUS { ?s w:y 1 } }",
                "RAND",
            ),
        ] {
            let source = Source::new("x.rq", query);
            let found = varying(&source).unwrap_or_else(|| panic!("none in {query}"));
            assert_eq!(
                (found.code, found.span.map(|span| &query[span])),
                ("R064", Some(place)),
                "{query}"
            );
        }
    }

    #[test]
    fn names_and_texts_are_not_functions() {
        for query in [
            "ASK { ?now w:rand \"NOW()\" ; <http://x/UUID> ?uuid } # RAND()",
            "not a query with NOW()",
        ] {
            assert!(varying(&Source::new("x.rq", query)).is_none(), "{query}");
        }
    }
}
