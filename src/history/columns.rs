//! Queries that read most values of some properties, as joins of columns.
//!
//! The evaluator looks up the next pattern for each row so far, and a look-up in the store's tables
//! takes as long as reading three rows that follow each other there. A query without a fixed
//! subject or value reads nearly all values of its properties, so that reading each property once
//! and joining the rows in memory takes a sixth of the time. The evaluator joins subqueries in this
//! way.

use spargebra::Query;
use spargebra::algebra::GraphPattern;
use spargebra::term::{NamedNodePattern, TermPattern, TriplePattern, Variable};

use oxigraph::model::vocab::rdf;

/// Rewrites a query so that its patterns are joined as columns, if that takes less time. Its answer
/// remains the same, except for the order of unsorted rows.
pub(super) fn by_columns(query: Query) -> Query {
    match query {
        Query::Select {
            dataset: None,
            pattern,
            base_iri,
        } if is_wide(&pattern) => Query::Select {
            dataset: None,
            pattern: joined(pattern),
            base_iri,
        },
        other => other,
    }
}

/// Whether all patterns have a fixed property and nothing else that is fixed, and whether all rows
/// are needed.
fn is_wide(pattern: &GraphPattern) -> bool {
    use GraphPattern as G;
    match pattern {
        G::Bgp { patterns } => patterns.iter().all(is_column),
        G::Join { left, right }
        | G::Union { left, right }
        | G::LeftJoin {
            left,
            right,
            expression: None,
        } => is_wide(left) && is_wide(right),
        G::Slice { inner, .. } => is_wide(inner) && needs_all_rows(inner),
        G::Filter { inner, .. }
        | G::Extend { inner, .. }
        | G::OrderBy { inner, .. }
        | G::Project { inner, .. }
        | G::Distinct { inner }
        | G::Reduced { inner }
        | G::Group { inner, .. } => is_wide(inner),
        _ => false,
    }
}

/// Whether the first row depends on all rows of the patterns.
fn needs_all_rows(pattern: &GraphPattern) -> bool {
    use GraphPattern as G;
    match pattern {
        G::OrderBy { .. } | G::Group { .. } => true,
        G::Filter { inner, .. }
        | G::Extend { inner, .. }
        | G::Project { inner, .. }
        | G::Distinct { inner }
        | G::Reduced { inner } => needs_all_rows(inner),
        _ => false,
    }
}

fn is_column(triple: &TriplePattern) -> bool {
    let is_open =
        |term: &TermPattern| matches!(term, TermPattern::Variable(_) | TermPattern::BlankNode(_));
    match &triple.predicate {
        NamedNodePattern::Variable(_) => false,
        NamedNodePattern::NamedNode(node) => {
            is_open(&triple.subject) && (is_open(&triple.object) || *node == rdf::TYPE)
        }
    }
}

fn joined(pattern: GraphPattern) -> GraphPattern {
    use GraphPattern as G;
    let boxed = |inner: Box<G>| Box::new(joined(*inner));
    match pattern {
        G::Bgp { patterns } => join_of(patterns),
        G::Join { left, right } => G::Join {
            left: boxed(left),
            right: boxed(right),
        },
        G::Union { left, right } => G::Union {
            left: boxed(left),
            right: boxed(right),
        },
        G::LeftJoin {
            left,
            right,
            expression,
        } => G::LeftJoin {
            left: boxed(left),
            right: boxed(right),
            expression,
        },
        G::Slice {
            inner,
            start,
            length,
        } => G::Slice {
            inner: boxed(inner),
            start,
            length,
        },
        G::Filter { expr, inner } => G::Filter {
            expr,
            inner: boxed(inner),
        },
        G::Extend {
            inner,
            variable,
            expression,
        } => G::Extend {
            inner: boxed(inner),
            variable,
            expression,
        },
        G::OrderBy { inner, expression } => G::OrderBy {
            inner: boxed(inner),
            expression,
        },
        G::Project { inner, variables } => G::Project {
            inner: boxed(inner),
            variables,
        },
        G::Distinct { inner } => G::Distinct {
            inner: boxed(inner),
        },
        G::Reduced { inner } => G::Reduced {
            inner: boxed(inner),
        },
        G::Group {
            inner,
            variables,
            aggregates,
        } => G::Group {
            inner: boxed(inner),
            variables,
            aggregates,
        },
        other => other,
    }
}

/// The join of patterns, each of which shares a variable with an earlier one where possible.
fn join_of(mut patterns: Vec<TriplePattern>) -> GraphPattern {
    let mut known: Vec<Variable> = Vec::new();
    let mut join: Option<GraphPattern> = None;
    while !patterns.is_empty() {
        let is_next =
            |triple: &TriplePattern| variables(triple).any(|variable| known.contains(&variable));
        let triple = patterns.remove(patterns.iter().position(is_next).unwrap_or(0));
        known.extend(variables(&triple));
        let column = column(triple);
        join = Some(match join {
            None => column,
            Some(join) => GraphPattern::Join {
                left: Box::new(join),
                right: Box::new(column),
            },
        });
    }
    join.unwrap_or_default()
}

/// A subquery of one pattern.
fn column(triple: TriplePattern) -> GraphPattern {
    let variables: Vec<Variable> = variables(&triple).collect();
    let named = |term: TermPattern| variable(&term).map_or(term, TermPattern::Variable);
    let triple = TriplePattern {
        subject: named(triple.subject),
        object: named(triple.object),
        ..triple
    };
    GraphPattern::Project {
        inner: Box::new(GraphPattern::Bgp {
            patterns: vec![triple],
        }),
        variables,
    }
}

fn variables(triple: &TriplePattern) -> impl Iterator<Item = Variable> + use<> {
    let (subject, object) = (variable(&triple.subject), variable(&triple.object));
    let object = object.filter(|object| subject.as_ref() != Some(object));
    subject.into_iter().chain(object)
}

/// The variable of a term. A blank node is one, too, but a subquery has no place for its value
/// without a name.
fn variable(term: &TermPattern) -> Option<Variable> {
    match term {
        TermPattern::Variable(variable) => Some(variable.clone()),
        TermPattern::BlankNode(node) => {
            Some(Variable::new_unchecked(format!("blank_{}", node.as_str())))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::parser;
    use crate::statements::iri;
    use oxigraph::model::{GraphName, Literal, NamedNode, Quad, Term};
    use oxigraph::sparql::{QueryResults, QuerySolution, SparqlEvaluator};
    use oxigraph::store::Store;

    /// The rows of a query over a small store, sorted.
    fn rows(store: &Store, query: Query) -> Vec<String> {
        let prepared = SparqlEvaluator::new().for_query(query);
        let QueryResults::Solutions(solutions) = prepared
            .on_store(store)
            .execute()
            .expect("it can be evaluated")
        else {
            panic!("it is no `SELECT`");
        };
        let row = |row: QuerySolution| format!("{:?}", row.values());
        let mut rows: Vec<String> = solutions
            .map(|solution| row(solution.expect("it can be evaluated")))
            .collect();
        rows.sort();
        rows
    }

    /// Runs with outcomes; some lack a value.
    fn sample() -> Store {
        let store = Store::new().expect("memory");
        let node = |name: String| NamedNode::new_unchecked(format!("http://x/{name}"));
        let insert = |subject: &NamedNode, property: &str, value: Term| {
            let quad = Quad::new(
                subject.clone(),
                iri(property),
                value,
                GraphName::DefaultGraph,
            );
            store.insert(&quad).expect("memory");
        };
        for run in 0..6 {
            let (of, test) = (
                node(format!("run{run}")),
                Literal::from(format!("test {}", run % 2)),
            );
            insert(&of, "rdf:type", iri("act:Run").into());
            insert(&of, "act:test", test.into());
            for outcome in 0..run {
                let result = node(format!("result{run}/{outcome}"));
                insert(&result, "act:ofRun", of.clone().into());
                insert(
                    &result,
                    "act:outcome",
                    Literal::from(["passed", "failed"][outcome % 2]).into(),
                );
                if outcome % 3 == 0 {
                    insert(&result, "act:margin", Literal::from(outcome as u64).into());
                }
            }
        }
        store
    }

    #[test]
    fn answers_of_joined_columns_are_those_of_look_ups() {
        let store = sample();
        for text in [
            "SELECT * { ?run a act:Run ; act:test ?test }",
            "SELECT * { ?result act:ofRun ?run ; act:outcome ?outcome . ?run act:test ?test OPTIONAL { ?result act:margin ?m } }",
            "SELECT ?outcome ?test { ?result act:outcome ?outcome ; act:ofRun/act:test ?test }",
            "SELECT DISTINCT ?outcome ?test { ?result act:outcome ?outcome ; act:ofRun/act:test ?test }",
            "SELECT ?test (COUNT(?m) AS ?n) (SUM(?m) AS ?sum) { ?result act:ofRun ?run ; act:margin ?m . ?run act:test ?test } GROUP BY ?test",
            "SELECT * { { ?r act:outcome ?o ; act:ofRun ?run } UNION { ?run act:test ?t . ?run a act:Run } FILTER(BOUND(?o)) }",
            "SELECT * { ?a act:ofRun ?run . ?b act:ofRun ?run . ?a act:margin ?m . ?b act:margin ?n FILTER(?m < ?n) }",
            "SELECT * { ?a act:margin ?m . ?b act:test ?t }",
        ] {
            let query = parser().parse_query(text).expect("it is valid");
            let (joined, plain) = (
                rows(&store, by_columns(query.clone())),
                rows(&store, query.clone()),
            );
            assert!(
                !plain.is_empty() && by_columns(query.clone()) != query,
                "{text}"
            );
            assert_eq!(joined, plain, "{text}");
        }
    }

    fn rewritten(text: &str) -> bool {
        let query = parser().parse_query(text).expect("it is valid");
        by_columns(query.clone()) != query
    }

    #[test]
    fn only_queries_that_read_most_values_of_their_properties_are_joined_as_columns() {
        for text in [
            "SELECT ?run ?index { ?run act:index ?index ; act:test ?test }",
            "SELECT * { ?a earl:result/act:outcome ?outcome OPTIONAL { ?a earl:test ?test } }",
            "SELECT ?test (COUNT(*) AS ?n) { ?a earl:test ?test ; earl:subject ?e FILTER(?test != act:x) } GROUP BY ?test LIMIT 3",
            "SELECT ?run { ?run a act:Run ; act:score ?score } ORDER BY ?score LIMIT 3",
        ] {
            assert!(rewritten(text), "{text}");
        }
        for text in [
            "SELECT * { ?run act:index ?index ; act:test ?test } LIMIT 3",
            "SELECT * { ?run act:test 'pick' ; act:index ?index }",
            "SELECT * { run:a act:test ?test }",
            "SELECT * { ?run act:test ?test ; ?p ?o }",
            "SELECT * { ?run act:test ?test . GRAPH ?g { ?a w:x ?x } }",
            "SELECT * { VALUES ?run { run:a } ?run act:test ?test ; act:index ?index }",
            "SELECT * FROM act:g { ?run act:test ?test ; act:index ?index }",
            "ASK { ?run act:test ?test ; act:index ?index }",
        ] {
            assert!(!rewritten(text), "{text}");
        }
    }
}
