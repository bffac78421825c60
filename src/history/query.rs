//! SPARQL over the history, for people: prefixes are known, faults have their place, updates are refused.

use oxigraph::sparql::{QueryEvaluationError, QueryResults, SparqlEvaluator};
use oxigraph::store::Store;

use crate::base::{Diagnostic, Diagnostics, Source, Span, Term, names};
use crate::history::terms::from_store;
use crate::history::{Cancel, QueryAnswer};

/// Words with which an update begins.
const UPDATES: [&str; 10] = ["INSERT", "DELETE", "LOAD", "CLEAR", "DROP", "CREATE", "ADD", "MOVE", "COPY", "WITH"];
/// Expected words that a message lists; a syntax error can have a hundred.
const EXPECTED_SHOWN: usize = 8;

/// Answers a query.
pub(super) fn answer(store: &Store, text: &Source, cancel: &Cancel) -> Result<QueryAnswer, Diagnostics> {
    refuse_update(text)?;
    let prepared =
        evaluator(cancel).parse_query(&*text.text).map_err(|error| syntax_fault(text, &error.to_string()))?;
    let results = prepared.on_store(store).execute().map_err(|error| evaluation_fault(text, &error))?;
    collect(results).map_err(|error| evaluation_fault(text, &error).into())
}

/// An evaluator that knows the prefixes and can be stopped.
pub(super) fn evaluator(cancel: &Cancel) -> SparqlEvaluator {
    let mut evaluator = SparqlEvaluator::new().with_cancellation_token(cancel.token());
    for (prefix, namespace) in names::PREFIXES {
        // Our namespaces are valid IRIs, so that none is left out.
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

fn evaluation_fault(text: &Source, error: &QueryEvaluationError) -> Diagnostic {
    match error {
        QueryEvaluationError::Cancelled => {
            Diagnostic::error("H013", "the query was stopped before it had ended").in_source(text)
        }
        QueryEvaluationError::UnsupportedService(_) | QueryEvaluationError::Service(_) => {
            Diagnostic::error("H012", "`SERVICE` asks another endpoint, which is not done here")
                .in_source(text)
                .help("ask the history alone, and join the results elsewhere")
        }
        other => Diagnostic::error("H012", format!("the query failed: {other}")).in_source(text),
    }
}

fn refuse_update(text: &Source) -> Result<(), Diagnostics> {
    let Some((word, span)) = first_keyword(&text.text) else { return Ok(()) };
    let word = word.to_uppercase();
    if !UPDATES.contains(&word.as_str()) {
        return Ok(());
    }
    Err(Diagnostic::error("H011", format!("`{word}` changes what it finds: the history can only be asked"))
        .at(text, span)
        .help("use `SELECT`, `ASK`, `CONSTRUCT` or `DESCRIBE`")
        .into())
}

/// The first word behind prefixes, base and comments.
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

/// A syntax error of the parser, which reads `error at 1:8: expected one of …`, at its place.
fn syntax_fault(text: &Source, error: &str) -> Diagnostic {
    let place = error.strip_prefix("error at ").and_then(|rest| {
        let (place, expected) = rest.split_once(": ")?;
        let (line, column) = place.split_once(':')?;
        Some((offset(&text.text, line.parse().ok()?, column.parse().ok()?), expected))
    });
    let Some((start, expected)) = place else {
        return Diagnostic::error("H010", format!("this is no SPARQL query: {error}")).in_source(text);
    };
    let rest = &text.text[start..];
    let length = rest.find(char::is_whitespace).filter(|length| *length > 0);
    let length = length.unwrap_or_else(|| if start < text.text.len() { rest.len() } else { 0 });
    let message = match &rest[..length] {
        "" => "the query ends too early".to_owned(),
        found => format!("this is no SPARQL query: `{}` can't stand here", found.chars().take(40).collect::<String>()),
    };
    let fault = Diagnostic::error("H010", message).at(text, start..start + length);
    if expected.contains("Prefix not found") || expected.contains("prefix not found") {
        let known: Vec<&str> = names::PREFIXES.iter().map(|(prefix, _)| *prefix).collect();
        return fault.help(format!(
            "its prefix is not known; declare it with `PREFIX`, or use one of {} which are",
            known.join(", ")
        ));
    }
    fault.help(shown(expected))
}

/// The expected words, shortened to a readable number.
fn shown(expected: &str) -> String {
    let Some(list) = expected.strip_prefix("expected one of ") else { return expected.to_owned() };
    let words: Vec<&str> = list.split(", ").collect();
    if words.len() <= EXPECTED_SHOWN {
        return expected.to_owned();
    }
    format!("expected one of {} and {} more", words[..EXPECTED_SHOWN].join(", "), words.len() - EXPECTED_SHOWN)
}

/// Byte offset of a line and a column (of characters), both counted from 1; the end where there is no such place.
fn offset(text: &str, line: usize, column: usize) -> usize {
    let start = match line.checked_sub(2) {
        None => 0,
        Some(idx) => text.match_indices('\n').nth(idx).map_or(text.len(), |(at, _)| at + 1),
    };
    text[start..].char_indices().nth(column.saturating_sub(1)).map_or(text.len(), |(at, _)| start + at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_keyword_is_behind_the_prologue() {
        let keyword = |text| first_keyword(text).map(|(word, _)| word);
        assert_eq!(keyword("# DELETE\nPREFIX a: <http://b#> base <http://c> SELECT *"), Some("SELECT"));
        assert_eq!(keyword("insert data {}"), Some("insert"));
        assert_eq!(keyword("  # nothing"), None);
        assert_eq!(keyword("PREFIX a: http"), None);
        assert_eq!(keyword("é"), None);
    }

    #[test]
    fn a_place_is_a_byte_offset() {
        assert_eq!(offset("äb\ncd", 1, 2), 2);
        assert_eq!(offset("äb\ncd", 2, 2), 5);
        assert_eq!(offset("äb\ncd", 9, 9), 6);
    }
}
