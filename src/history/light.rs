//! Which queries may be evaluated inside a server: those that can be stopped at any moment and
//! can't exhaust memory before that.
//!
//! The evaluator checks whether it was cancelled only when it reads the store. A query is light if
//! every part of it reads statements all the time (patterns joined by shared variables, not products
//! or hash joins), and if no expression makes a term longer than the terms of the store. Sorting
//! and grouping then hold only rows that were read.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use spargebra::algebra::{
    AggregateExpression, AggregateFunction, Expression, Function, GraphPattern, OrderExpression,
};
use spargebra::term::{NamedNodePattern, TermPattern, TriplePattern};
use spargebra::{Query, SparqlParser};

use actcheck_base::{check_calls_within, names, sparql_excess};

/// Longest text of a light query. Unit: bytes. It bounds the depth of the parsed query.
const LONGEST: usize = 8192;
/// Deepest nesting of brackets in a light query: the parser needs memory for each level.
const DEEPEST: usize = 10;
/// Deepest nesting of calls in a light query: the time of the parser doubles with each level.
const MOST_CALLS: usize = 3;

/// Parses a light query. Returns `None` for any other text, valid or not.
pub(super) fn light(text: &str) -> Option<Query> {
    if text.len() > LONGEST
        || depth(text) > DEEPEST
        || check_calls_within(text, MOST_CALLS).is_err()
        || sparql_excess(text).is_some()
    {
        return None;
    }
    let query = parser().parse_query(text).ok()?;
    let (Query::Select { pattern, .. }
    | Query::Construct { pattern, .. }
    | Query::Describe { pattern, .. }
    | Query::Ask { pattern, .. }) = &query;
    is_light(pattern).then_some(query)
}

/// A parser that knows the predefined prefixes.
pub(super) fn parser() -> SparqlParser {
    static PARSER: OnceLock<SparqlParser> = OnceLock::new();
    let made = || {
        names::PREFIXES
            .iter()
            .fold(SparqlParser::new(), |parser, (prefix, namespace)| {
                // Our namespaces are valid IRIs, so none is omitted.
                parser
                    .clone()
                    .with_prefix(*prefix, *namespace)
                    .unwrap_or(parser)
            })
    };
    PARSER.get_or_init(made).clone()
}

/// Depth of nested brackets. Brackets in strings count too: such a query is only evaluated
/// elsewhere.
fn depth(text: &str) -> usize {
    let (mut depth, mut deepest) = (0usize, 0);
    for byte in text.bytes() {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    deepest
}

fn is_light(pattern: &GraphPattern) -> bool {
    match pattern {
        GraphPattern::Project { inner, .. }
        | GraphPattern::Distinct { inner }
        | GraphPattern::Reduced { inner }
        | GraphPattern::Slice { inner, .. } => is_light(inner),
        GraphPattern::OrderBy { inner, expression } => {
            let mut keys = expression
                .iter()
                .map(|(OrderExpression::Asc(key) | OrderExpression::Desc(key))| key);
            is_light(inner) && keys.all(is_bounded)
        }
        GraphPattern::Group {
            inner, aggregates, ..
        } => is_light(inner) && aggregates.iter().all(|(_, aggregate)| is_small(aggregate)),
        GraphPattern::Extend {
            inner, expression, ..
        } => is_light(inner) && is_bounded(expression),
        GraphPattern::Filter { inner, expr } => is_light(inner) && is_bounded(expr),
        GraphPattern::Union { left, right } => is_light(left) && is_light(right),
        _ => is_connected(pattern),
    }
}

/// Whether patterns are joined by shared variables, so that the evaluator looks each up in the
/// store.
fn is_connected(pattern: &GraphPattern) -> bool {
    let mut parts = Vec::new();
    if !collect(pattern, None, &mut parts) {
        return false;
    }
    // Parts without a variable are only tests.
    parts.retain(|variables: &BTreeSet<&str>| !variables.is_empty());
    let Some(mut reached) = parts.pop() else {
        return true;
    };
    while let Some(next) = parts
        .iter()
        .position(|variables| !variables.is_disjoint(&reached))
    {
        reached.extend(parts.swap_remove(next));
    }
    parts.is_empty()
}

/// Collects the variables of each triple pattern. Returns `false` if there is anything but triple
/// patterns.
fn collect<'a>(
    pattern: &'a GraphPattern,
    graph: Option<&'a str>,
    parts: &mut Vec<BTreeSet<&'a str>>,
) -> bool {
    match pattern {
        GraphPattern::Bgp { patterns } => {
            parts.extend(
                patterns
                    .iter()
                    .map(|triple| variables(triple).chain(graph).collect()),
            );
            patterns
                .iter()
                .all(|triple| is_plain(&triple.subject) && is_plain(&triple.object))
        }
        GraphPattern::Join { left, right } => {
            collect(left, graph, parts) && collect(right, graph, parts)
        }
        GraphPattern::Graph { name, inner } => {
            let graph = match name {
                NamedNodePattern::Variable(variable) => Some(variable.as_str()),
                NamedNodePattern::NamedNode(_) => None,
            };
            collect(inner, graph, parts)
        }
        _ => false,
    }
}

fn variables(triple: &TriplePattern) -> impl Iterator<Item = &str> {
    let predicate = match &triple.predicate {
        NamedNodePattern::Variable(variable) => Some(variable.as_str()),
        NamedNodePattern::NamedNode(_) => None,
    };
    [name_of(&triple.subject), predicate, name_of(&triple.object)]
        .into_iter()
        .flatten()
}

/// The name of a variable, or of a blank node, which is a variable too.
fn name_of(term: &TermPattern) -> Option<&str> {
    match term {
        TermPattern::Variable(variable) => Some(variable.as_str()),
        TermPattern::BlankNode(node) => Some(node.as_str()),
        _ => None,
    }
}

fn is_plain(term: &TermPattern) -> bool {
    matches!(
        term,
        TermPattern::NamedNode(_)
            | TermPattern::BlankNode(_)
            | TermPattern::Literal(_)
            | TermPattern::Variable(_)
    )
}

/// Whether an aggregate needs no more memory than a number or a term.
fn is_small(aggregate: &AggregateExpression) -> bool {
    match aggregate {
        AggregateExpression::CountSolutions { .. } => true,
        AggregateExpression::FunctionCall { name, expr, .. } => {
            let small = matches!(
                name,
                AggregateFunction::Count
                    | AggregateFunction::Sum
                    | AggregateFunction::Avg
                    | AggregateFunction::Min
                    | AggregateFunction::Max
                    | AggregateFunction::Sample
            );
            small && is_bounded(expr)
        }
    }
}

/// Whether the value of an expression is at most as long as a term of a statement or of the query.
fn is_bounded(expression: &Expression) -> bool {
    use Expression as E;
    let itself = match expression {
        E::FunctionCall(function, _) => keeps_length(function),
        E::Exists(_) => false,
        _ => true,
    };
    itself && parts(expression).into_iter().all(is_bounded)
}

/// The expressions directly inside an expression; patterns are left out.
pub(super) fn parts(expression: &Expression) -> Vec<&Expression> {
    use Expression as E;
    match expression {
        E::NamedNode(_) | E::Literal(_) | E::Variable(_) | E::Bound(_) | E::Exists(_) => Vec::new(),
        E::Or(a, b)
        | E::And(a, b)
        | E::Equal(a, b)
        | E::SameTerm(a, b)
        | E::Greater(a, b)
        | E::GreaterOrEqual(a, b)
        | E::Less(a, b)
        | E::LessOrEqual(a, b)
        | E::Add(a, b)
        | E::Subtract(a, b)
        | E::Multiply(a, b)
        | E::Divide(a, b) => vec![a, b],
        E::UnaryPlus(a) | E::UnaryMinus(a) | E::Not(a) => vec![a],
        E::If(a, b, c) => vec![a, b, c],
        E::In(a, list) => [&**a].into_iter().chain(list).collect(),
        E::Coalesce(list) | E::FunctionCall(_, list) => list.iter().collect(),
    }
}

fn keeps_length(function: &Function) -> bool {
    use Function as F;
    matches!(
        function,
        F::Str
            | F::Lang
            | F::LangMatches
            | F::Datatype
            | F::Abs
            | F::Ceil
            | F::Floor
            | F::Round
            | F::SubStr
            | F::StrLen
            | F::Contains
            | F::StrStarts
            | F::StrEnds
            | F::StrBefore
            | F::StrAfter
            | F::IsIri
            | F::IsBlank
            | F::IsLiteral
            | F::IsNumeric
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_that_read_all_the_time_are_light() {
        for text in [
            "ASK {}",
            "SELECT * { ?s ?p ?o } LIMIT 10",
            "SELECT ?run { ?run a act:Run ; act:score ?s FILTER(?s > 0.5 && CONTAINS(STR(?run), 'a')) } ORDER BY ?s",
            "SELECT ?p (COUNT(*) AS ?n) { ?a earl:test ?p ; earl:result/act:outcome ?o } GROUP BY ?p ORDER BY ?p",
            "SELECT * { ?run act:x ?g GRAPH ?g { ?a w:z ?z } }",
            "CONSTRUCT { ?s a ?c } WHERE { { ?s a ?c } UNION { ?s act:category ?c } }",
            "DESCRIBE <http://a>",
            "SELECT * { [] act:a [ act:b ?x ] }",
        ] {
            assert!(light(text).is_some(), "{text}");
        }
    }

    #[test]
    fn queries_that_may_not_stop_or_may_grow_are_not_light() {
        let growing: String = (0..36)
            .map(|n| format!("BIND(CONCAT(?x{n}, ?x{n}) AS ?x{})", n + 1))
            .collect();
        for text in [
            format!("SELECT ?x36 {{ BIND('x' AS ?x0) {growing} }}"),
            "SELECT * { ?a ?b ?c . ?d ?e ?f }".to_owned(),
            "SELECT * { ?a ?b ?c . ?c ?d ?e . ?f ?g ?h }".to_owned(),
            "SELECT * { GRAPH ?g { ?a ?b ?c } GRAPH ?h { ?d ?e ?f } }".to_owned(),
            "SELECT * { { SELECT ?a { ?a ?b ?c } } { SELECT ?d { ?d ?e ?f } } }".to_owned(),
            "SELECT * { ?a ?b ?c OPTIONAL { ?d ?e ?f } }".to_owned(),
            "SELECT * { ?a ?b ?c MINUS { ?a ?d ?e } }".to_owned(),
            "SELECT (GROUP_CONCAT(?c) AS ?all) { ?a ?b ?c }".to_owned(),
            "SELECT * { ?a ?b ?c FILTER(REGEX(?c, '(a*)*b')) }".to_owned(),
            "SELECT * { ?a ?b ?c FILTER NOT EXISTS { ?x ?y ?z . ?u ?v ?w } }".to_owned(),
            "SELECT * { SERVICE <http://a> { ?a ?b ?c } }".to_owned(),
            format!("ASK {{ FILTER({}1{}) }}", "(".repeat(40), ")".repeat(40)),
            format!("ASK {{ FILTER(1{}) }}", "+1".repeat(5000)),
            format!(
                "ASK {{ FILTER({}1{}) }}",
                "xsd:integer(".repeat(4),
                ")".repeat(4)
            ),
            "ASK {".to_owned(),
        ] {
            assert!(light(&text).is_none(), "{text}");
        }
    }
}
