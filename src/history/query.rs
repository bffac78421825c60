//! SPARQL queries of users: prefixes are predefined, faults have their place, updates are refused.

use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use oxigraph::sparql::{QueryEvaluationError, QueryResults, SparqlEvaluator};
use oxigraph::store::Store;

use crate::syntax_fault::syntax_fault;
use crate::terms::from_store;
use crate::{Cancel, QueryAnswer};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, Term, names, sparql_excess};

/// Words with which an update begins.
const UPDATES: [&str; 10] = ["INSERT", "DELETE", "LOAD", "CLEAR", "DROP", "CREATE", "ADD", "MOVE", "COPY", "WITH"];
/// Interval at which a waiting query checks whether it was stopped: too short to notice.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Answers a query.
///
/// The evaluation checks its token only when it reads the store, which a join of large results may not do for minutes.
/// It therefore runs in its own thread; when the query is stopped, the thread is abandoned and ends at its next check.
pub(super) fn answer(store: &Store, text: &Source, cancel: &Cancel) -> Result<QueryAnswer, Diagnostics> {
    refuse_update(text)?;
    refuse_excess(text)?;
    let prepared =
        evaluator(cancel).parse_query(&*text.text).map_err(|error| syntax_fault(text, &error.to_string()))?;
    let (sender, receiver) = sync_channel(1);
    let store = store.clone();
    std::thread::spawn(move || {
        let answer = prepared.on_store(&store).execute().and_then(collect);
        drop(store);
        // If the query was stopped, the receiver is gone.
        let _ = sender.send(answer);
    });
    loop {
        match receiver.recv_timeout(LOOK_EVERY) {
            Ok(answer) => return answer.map_err(|error| evaluation_fault(text, &error).into()),
            Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => return Err(stopped(text).into()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Diagnostic::error("H012", "the query made the evaluator crash").in_source(text).into());
            }
        }
    }
}

/// Refuses a query that could exhaust the stack.
pub(super) fn refuse_excess(text: &Source) -> Result<(), Diagnostics> {
    match sparql_excess(&text.text) {
        Some((span, message)) => {
            let help = "split it, or shorten it";
            Err(Diagnostic::error("H010", message).at(text, span).help(help).into())
        }
        None => Ok(()),
    }
}

fn stopped(text: &Source) -> Diagnostic {
    Diagnostic::error("H013", "the query was stopped before it ended").in_source(text)
}

/// An evaluator with the predefined prefixes that can be stopped.
pub(super) fn evaluator(cancel: &Cancel) -> SparqlEvaluator {
    let mut evaluator = SparqlEvaluator::new().with_cancellation_token(cancel.token());
    for (prefix, namespace) in names::PREFIXES {
        // Our namespaces are valid IRIs, so none is omitted.
        evaluator = match evaluator.clone().with_prefix(prefix, namespace) {
            Ok(with) => with,
            Err(_) => evaluator,
        };
    }
    evaluator
}

fn collect(results: QueryResults<'_>) -> Result<QueryAnswer, QueryEvaluationError> {
    Ok(match results {
        QueryResults::Boolean(value) => QueryAnswer::Boolean(value),
        QueryResults::Solutions(solutions) => {
            let columns = solutions.variables().iter().map(|variable| variable.as_str().to_owned()).collect();
            let mut rows = Vec::new();
            for solution in solutions {
                rows.push(solution?.values().iter().map(|value| value.as_ref().map(from_store)).collect());
            }
            QueryAnswer::Table { columns, rows }
        }
        QueryResults::Graph(triples) => {
            let mut graph: Vec<[Term; 3]> = Vec::new();
            for triple in triples {
                let triple = triple?;
                let property = Term::iri(triple.predicate.as_str());
                graph.push([from_store(&triple.subject.into()), property, from_store(&triple.object)]);
            }
            graph.sort();
            graph.dedup();
            QueryAnswer::Graph(graph)
        }
    })
}

pub(super) fn evaluation_fault(text: &Source, error: &QueryEvaluationError) -> Diagnostic {
    match error {
        QueryEvaluationError::Cancelled => stopped(text),
        QueryEvaluationError::UnsupportedService(_) | QueryEvaluationError::Service(_) => {
            Diagnostic::error("H012", "`SERVICE` queries another endpoint, which is not supported")
                .in_source(text)
                .help("query only the history, and join the results elsewhere")
        }
        other => Diagnostic::error("H012", format!("the query failed: {other}")).in_source(text),
    }
}

pub(super) fn refuse_update(text: &Source) -> Result<(), Diagnostics> {
    let Some((word, span)) = first_keyword(&text.text) else { return Ok(()) };
    let word = word.to_uppercase();
    if !UPDATES.contains(&word.as_str()) {
        return Ok(());
    }
    Err(Diagnostic::error("H011", format!("`{word}` is an update, but the history is read-only"))
        .at(text, span)
        .help("use `SELECT`, `ASK`, `CONSTRUCT` or `DESCRIBE`")
        .into())
}

/// The first word after prefixes, base and comments.
fn first_keyword(text: &str) -> Option<(&str, Span)> {
    let mut at = 0;
    loop {
        at += text[at..].len() - text[at..].trim_start().len();
        let rest = &text[at..];
        if rest.starts_with('#') {
            at += rest.find('\n')?;
            continue;
        }
        let length = rest.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(rest.len());
        let word = &rest[..length];
        if !["PREFIX", "BASE"].iter().any(|known| word.eq_ignore_ascii_case(known)) {
            return (length > 0).then_some((word, at..at + length));
        }
        at += rest.find('>')? + 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_keyword_is_found_after_the_prologue() {
        let keyword = |text| first_keyword(text).map(|(word, _)| word);
        assert_eq!(keyword("# DELETE\nPREFIX a: <http://b#> base <http://c> SELECT *"), Some("SELECT"));
        assert_eq!(keyword("insert data {}"), Some("insert"));
        assert_eq!(keyword("  # nothing"), None);
        assert_eq!(keyword("PREFIX a: http"), None);
        assert_eq!(keyword("é"), None);
    }
}
