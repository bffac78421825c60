//! Queries as the parser of SPARQL gives them, for the passes that look at them.

use spargebra::algebra::Expression;
use spargebra::{Query, SparqlParser};

use actcheck_base::{check_calls, names, sparql_excess};

/// Parses a query with the known prefixes. Returns `None` if it is invalid, or so deeply nested that
/// the parser could exhaust the stack.
pub(super) fn parsed(text: &str) -> Option<Query> {
    if sparql_excess(text).is_some() || check_calls(text).is_err() {
        return None;
    }
    let parser = names::PREFIXES
        .iter()
        .fold(SparqlParser::new(), |parser, (prefix, namespace)| {
            parser
                .clone()
                .with_prefix(*prefix, *namespace)
                .unwrap_or(parser)
        });
    parser.parse_query(text).ok()
}

/// The expressions of which an expression is made. The pattern of an `EXISTS` is not one of them.
pub(super) fn parts(expression: &Expression) -> Vec<&Expression> {
    match expression {
        Expression::NamedNode(_)
        | Expression::Literal(_)
        | Expression::Variable(_)
        | Expression::Bound(_)
        | Expression::Exists(_) => Vec::new(),
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
        | Expression::Divide(a, b) => vec![a, b],
        Expression::UnaryPlus(a) | Expression::UnaryMinus(a) | Expression::Not(a) => vec![a],
        Expression::If(a, b, c) => vec![a, b, c],
        Expression::In(a, others) => std::iter::once(&**a).chain(others).collect(),
        Expression::Coalesce(all) | Expression::FunctionCall(_, all) => all.iter().collect(),
    }
}
