//! Functions whose values are not the same each time: a property must be a function of the facts.

use spargebra::algebra::{AggregateExpression, Expression, Function, GraphPattern, OrderExpression};
use spargebra::{Query, SparqlParser};

use crate::sparql::query_text::scan;
use actcheck_base::{Diagnostic, Source, names};

/// Parses a query with the known prefixes. Returns `None` if it is invalid.
pub(crate) fn parsed(text: &str) -> Option<Query> {
    let parser = names::PREFIXES.iter().fold(SparqlParser::new(), |parser, (prefix, namespace)| {
        parser.clone().with_prefix(*prefix, *namespace).unwrap_or(parser)
    });
    parser.parse_query(text).ok()
}

/// Returns the error about the first function of a valid query that has another value each time.
pub(crate) fn varying(source: &Source) -> Option<Diagnostic> {
    let query = parsed(&source.text)?;
    let (Query::Ask { pattern, .. }
    | Query::Select { pattern, .. }
    | Query::Construct { pattern, .. }
    | Query::Describe { pattern, .. }) = &query;
    let (name, instead) = in_pattern(pattern)?;
    let message = format!("`{name}` has another value each time, so that equal facts would have different outcomes");
    let fault = Diagnostic::error("R064", message).help(instead);
    // A minus sign may be part of the word.
    let place = scan(&source.text)
        .into_iter()
        .find(|word| word.word.rsplit('-').next().is_some_and(|last| last.eq_ignore_ascii_case(name)));
    Some(match place {
        Some(word) => fault.at(source, word.span.end - name.len()..word.span.end),
        None => fault.in_source(source),
    })
}

/// A function with the remedy.
type Found = (&'static str, &'static str);

fn name(function: &Function) -> Option<Found> {
    const CHANCE: &str = "compare a fact of the run; the campaign's seed makes everything else that is random";
    const THING: &str = "compare the facts' own terms: a new node or identifier is equal to none of them";
    match function {
        Function::Rand => Some(("RAND", CHANCE)),
        Function::Now => {
            Some(("NOW", "compare a fact of the run, such as the seconds of an interval (`w:from`, `w:to`)"))
        }
        Function::Uuid => Some(("UUID", THING)),
        Function::StrUuid => Some(("STRUUID", THING)),
        Function::BNode => Some(("BNODE", THING)),
        _ => None,
    }
}

fn in_pattern(pattern: &GraphPattern) -> Option<Found> {
    match pattern {
        GraphPattern::Join { left, right }
        | GraphPattern::Union { left, right }
        | GraphPattern::Minus { left, right } => in_pattern(left).or_else(|| in_pattern(right)),
        GraphPattern::LeftJoin { left, right, expression } => {
            in_pattern(left).or_else(|| in_pattern(right)).or_else(|| in_expression(expression.as_ref()?))
        }
        GraphPattern::Filter { expr, inner } => in_pattern(inner).or_else(|| in_expression(expr)),
        GraphPattern::Extend { inner, expression, .. } => in_pattern(inner).or_else(|| in_expression(expression)),
        GraphPattern::OrderBy { inner, expression } => in_pattern(inner).or_else(|| {
            expression.iter().find_map(|order| match order {
                OrderExpression::Asc(key) | OrderExpression::Desc(key) => in_expression(key),
            })
        }),
        GraphPattern::Group { inner, aggregates, .. } => in_pattern(inner).or_else(|| {
            aggregates.iter().find_map(|(_, aggregate)| match aggregate {
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

fn in_expression(expression: &Expression) -> Option<Found> {
    let all = |parts: &[&Expression]| parts.iter().find_map(|part| in_expression(part));
    match expression {
        Expression::NamedNode(_) | Expression::Literal(_) | Expression::Variable(_) | Expression::Bound(_) => None,
        Expression::Exists(pattern) => in_pattern(pattern),
        Expression::Or(a, b)
        | Expression::And(a, b)
        | Expression::Equal(a, b)
        | Expression::SameTerm(a, b)
        | Expression::Greater(a, b)
        | Expression::GreaterOrEqual(a, b)
        | Expression::Less(a, b)
        | Expression::LessOrEqual(a, b)
        | Expression::Add(a, b)
        | Expression::Subtract(a, b)
        | Expression::Multiply(a, b)
        | Expression::Divide(a, b) => all(&[a, b]),
        Expression::UnaryPlus(a) | Expression::UnaryMinus(a) | Expression::Not(a) => in_expression(a),
        Expression::If(a, b, c) => all(&[a, b, c]),
        Expression::In(a, others) => in_expression(a).or_else(|| others.iter().find_map(in_expression)),
        Expression::Coalesce(parts) => parts.iter().find_map(in_expression),
        Expression::FunctionCall(function, args) => name(function).or_else(|| args.iter().find_map(in_expression)),
    }
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
            ("SELECT ?s { ?s w:z ?z { SELECT ?s (MAX(?z + RAND()) AS ?m) { ?s w:z ?z } GROUP BY ?s } }", "RAND"),
            ("SELECT ?s { ?s w:z ?z } ORDER BY STRUUID() LIMIT 1", "STRUUID"),
            ("SELECT ?s { ?s w:z ?z } GROUP BY ?s HAVING(COUNT(?z) > RAND())", "RAND"),
            ("ASK { GRAPH act:after { OPTIONAL { ?s w:z ?z FILTER(STR(UUID()) < STR(?z)) } } }", "UUID"),
            ("ASK { ?s w:z ?z FILTER NOT EXISTS { BIND(BNODE(\"a\") AS ?b) } }", "BNODE"),
            ("ASK { FILTER(IF(true, 1 IN (2, COALESCE(?x, YEAR(NOW()))), false)) }", "NOW"),
            ("ASK { { ?s w:z ?z } UNION { BIND(!(-RAND() > 0) AS ?x) } MINUS { ?s w:y 1 } }", "RAND"),
        ] {
            let source = Source::new("x.rq", query);
            let found = varying(&source).unwrap_or_else(|| panic!("none in {query}"));
            assert_eq!((found.code, found.span.map(|span| &query[span])), ("R064", Some(place)), "{query}");
        }
    }

    #[test]
    fn names_and_texts_are_not_functions() {
        for query in ["ASK { ?now w:rand \"NOW()\" ; <http://x/UUID> ?uuid } # RAND()", "not a query with NOW()"] {
            assert!(varying(&Source::new("x.rq", query)).is_none(), "{query}");
        }
    }
}
