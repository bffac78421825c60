//! SPARQL queries of users: prefixes are predefined, faults have their place, updates are refused.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use oxigraph::model::{Literal, NamedNode, Term as StoreTerm};
use oxigraph::sparql::{
    PreparedSparqlQuery, QueryEvaluationError, QueryResults, SparqlEvaluator, SparqlSyntaxError,
};

use crate::columns::by_columns;
use crate::counted::counted_runs;
use crate::evaluation::{Unfinished, evaluate};
use crate::fault;
use crate::light::parser;
use crate::open::OpenStore;
use crate::outlined;
use crate::syntax_fault::syntax_fault;
use crate::terms::{from_store, to_store};
use crate::wanted::Wanted;
use crate::{Cancel, History, QueryAnswer};
use actcheck_base::{
    COUNTED_TEXT, Diagnostic, Diagnostics, MOST_NESTED_CALLS, Source, Span, TEXT_FUNCTIONS, Term,
    bounded_texts, check_calls, names, sparql_excess,
};

/// Words with which an update begins.
const UPDATES: [&str; 10] = [
    "INSERT", "DELETE", "LOAD", "CLEAR", "DROP", "CREATE", "ADD", "MOVE", "COPY", "WITH",
];

/// Maximum length of the texts that a query makes. Unit: bytes.
const MOST_TEXT: usize = 512 << 20;
/// Maximum length of one of these texts. Unit: bytes.
const LONGEST_TEXT: usize = 32 << 20;

/// Number of texts that are made once for equal arguments, and their longest length (unit: bytes):
/// a pattern takes long to compile, and most queries apply it to the names of a few properties.
const MOST_KNOWN: usize = 256;
const LONGEST_KNOWN: usize = 512;

/// Sizes of stores whose columns are joined. In smaller ones it does not matter; in larger ones the
/// columns may not fit in memory. Unit: bytes.
pub(super) const COLUMNS: Range<u64> = 16 << 20..1 << 30;

/// Answers a query.
pub(super) fn answer(
    history: &History,
    text: &Source,
    cancel: &Cancel,
) -> Result<QueryAnswer, Diagnostics> {
    refuse_update(text)?;
    refuse_excess(text)?;
    if history.shelf().exists()
        && let Some(answer) = outlined::answer(history, text, cancel)?
    {
        return Ok(answer);
    }
    let store = history.store_for_query(|| Wanted::query(&text.text))?;
    let query = prepare(text, &store, cancel)?;
    let prepared = query.prepared.clone();
    let evaluated = evaluate(&store, cancel, move |store| {
        prepared.on_store(store).execute().and_then(collect)
    });
    query.check_texts(text)?;
    evaluated.map_err(|fault| unfinished(history, text, fault))
}

pub(super) fn unfinished(history: &History, text: &Source, fault: Unfinished) -> Diagnostics {
    match fault {
        Unfinished::Stopped => stopped(text).into(),
        Unfinished::Failed(error) => evaluation_fault(text, &error).into(),
        Unfinished::Crashed => Diagnostic::error("H012", "the query made the evaluator crash")
            .in_source(text)
            .into(),
        Unfinished::Damaged(error) => fault::damaged(history.dir(), &error.to_string()),
    }
}

/// A query that can be evaluated, with limits on the texts that it makes.
pub(super) struct Prepared {
    pub prepared: PreparedSparqlQuery,
    /// Length of the texts so far. Unit: bytes.
    pub made: Arc<AtomicUsize>,
}

impl Prepared {
    /// Refuses a query that made too much text. Without this check, its answer lacks the texts
    /// beyond the limit.
    pub(super) fn check_texts(&self, text: &Source) -> Result<(), Diagnostics> {
        if self.made.load(Ordering::Relaxed) > MOST_TEXT {
            Err(too_much_text(text).into())
        } else {
            Ok(())
        }
    }
}

/// Parses a query that [`refuse_excess`] accepts.
///
/// # Errors
/// Syntax errors.
pub(super) fn prepare(
    text: &Source,
    store: &OpenStore,
    cancel: &Cancel,
) -> Result<Prepared, Diagnostics> {
    let syntax = |error: SparqlSyntaxError| syntax_fault(text, &error.to_string());
    drop(
        query_evaluator(store, cancel)
            .parse_query(&*text.text)
            .map_err(syntax)?,
    );
    // Places in the text that is evaluated differ from the original's, so errors were reported
    // before.
    let made = Arc::new(AtomicUsize::new(0));
    let bounded = with_text_functions(query_evaluator(store, cancel), cancel, &made);
    let bounded_text = bounded_texts(&text.text);
    let prepared = match store.size() {
        Some(size) if COLUMNS.contains(&size) => {
            let query = parser().parse_query(&bounded_text).map_err(syntax)?;
            bounded.for_query(by_columns(query))
        }
        _ => bounded.parse_query(&bounded_text).map_err(syntax)?,
    };
    Ok(Prepared { prepared, made })
}

/// Adds functions that make texts of limited length: the evaluator keeps them until the query ends.
/// Beyond the limit, they stop the query. `made`: their length so far, in bytes.
pub(super) fn with_text_functions(
    evaluator: SparqlEvaluator,
    cancel: &Cancel,
    made: &Arc<AtomicUsize>,
) -> SparqlEvaluator {
    let appended = (cancel.clone(), Arc::clone(made));
    let evaluator = evaluator.with_custom_function(
        NamedNode::new_unchecked(COUNTED_TEXT),
        move |args: &[StoreTerm]| {
            let [text] = args else { return None };
            let length = if let StoreTerm::Literal(literal) = text {
                literal.value().len()
            } else {
                0
            };
            let (cancel, made) = &appended;
            if made.fetch_add(length + 1, Ordering::Relaxed) > MOST_TEXT {
                cancel.cancel();
                return None;
            }
            Some(text.clone())
        },
    );
    TEXT_FUNCTIONS
        .into_iter()
        .fold(evaluator, |evaluator, (_, iri, function)| {
            let (cancel, made) = (cancel.clone(), Arc::clone(made));
            let known: Mutex<BTreeMap<Vec<Term>, Option<Term>>> = Mutex::default();
            evaluator.with_custom_function(
                NamedNode::new_unchecked(iri),
                move |args: &[StoreTerm]| {
                    let args: Vec<Term> = args.iter().map(from_store).collect();
                    let left =
                        LONGEST_TEXT.min(MOST_TEXT.saturating_sub(made.load(Ordering::Relaxed)));
                    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
                    let result = match known.get(&args) {
                        Some(found) => Ok(found.clone()),
                        None => function(&args, left),
                    };
                    let Ok(found) = result else {
                        made.fetch_add(MOST_TEXT + 1, Ordering::Relaxed);
                        cancel.cancel();
                        return None;
                    };
                    let is_short = |term: &Term| match term {
                        Term::String(text) | Term::LangString(text, _) => {
                            text.len() <= LONGEST_KNOWN
                        }
                        _ => true,
                    };
                    if known.len() < MOST_KNOWN && args.iter().chain(&found).all(is_short) {
                        known.insert(args, found.clone());
                    }
                    drop(known);
                    if let Some(Term::String(text) | Term::LangString(text, _)) = &found {
                        made.fetch_add(text.len(), Ordering::Relaxed);
                    }
                    found.as_ref().map(to_store)
                },
            )
        })
}

fn too_much_text(text: &Source) -> Diagnostic {
    let (one, all) = (LONGEST_TEXT >> 20, MOST_TEXT >> 20);
    let message = format!(
        "the query makes texts that are too long: over {one} MiB, or over {all} MiB together"
    );
    Diagnostic::error("H012", message)
        .in_source(text)
        .help("repeated concatenation doubles a text: write texts once, or filter the rows before")
}

/// Refuses a query that could exhaust the stack, or whose parsing takes too long.
pub(super) fn refuse_excess(text: &Source) -> Result<(), Diagnostics> {
    if let Some((span, message)) = sparql_excess(&text.text) {
        let help = "split it, or shorten it";
        return Err(Diagnostic::error("H010", message)
            .at(text, span)
            .help(help)
            .into());
    }
    if let Err(at) = check_calls(&text.text) {
        let message = format!("calls are nested more than {MOST_NESTED_CALLS} deep");
        let help = "name the inner values, as in `BIND(CONCAT(?a, ?b) AS ?c)`";
        return Err(Diagnostic::error("H010", message)
            .at(text, at..at + 1)
            .help(help)
            .into());
    }
    Ok(())
}

fn stopped(text: &Source) -> Diagnostic {
    Diagnostic::error("H013", "the query was stopped before it ended").in_source(text)
}

/// The evaluator of users' queries: [`evaluator`] with the function `act:counts`.
pub(super) fn query_evaluator(store: &OpenStore, cancel: &Cancel) -> SparqlEvaluator {
    with_counts(evaluator(cancel), store.clone())
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

/// Adds the function `act:counts(?run)`: whether the run counts in rates over all campaigns, see
/// [`History::counted_runs`](crate::History::counted_runs). The runs are read when a query first
/// calls it.
fn with_counts(evaluator: SparqlEvaluator, store: OpenStore) -> SparqlEvaluator {
    let counted = OnceLock::new();
    evaluator.with_custom_function(
        NamedNode::new_unchecked(names::act("counts")),
        move |args: &[StoreTerm]| {
            let [StoreTerm::NamedNode(run)] = args else {
                return None;
            };
            let counted = counted.get_or_init(|| counted_runs(&store).ok());
            Some(
                Literal::from(
                    counted
                        .as_ref()?
                        .contains(run.as_str().strip_prefix(names::RUN)?),
                )
                .into(),
            )
        },
    )
}

pub(super) fn collect(results: QueryResults<'_>) -> Result<QueryAnswer, QueryEvaluationError> {
    Ok(match results {
        QueryResults::Boolean(value) => QueryAnswer::Boolean(value),
        QueryResults::Solutions(solutions) => {
            let columns = solutions
                .variables()
                .iter()
                .map(|variable| variable.as_str().to_owned())
                .collect();
            let mut rows = Vec::new();
            for solution in solutions {
                rows.push(
                    solution?
                        .values()
                        .iter()
                        .map(|value| value.as_ref().map(from_store))
                        .collect(),
                );
            }
            QueryAnswer::Table { columns, rows }
        }
        QueryResults::Graph(triples) => {
            let mut graph: Vec<[Term; 3]> = Vec::new();
            for triple in triples {
                let triple = triple?;
                let property = Term::iri(triple.predicate.as_str());
                graph.push([
                    from_store(&triple.subject.into()),
                    property,
                    from_store(&triple.object),
                ]);
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
            Diagnostic::error(
                "H012",
                "`SERVICE` queries another endpoint, which is not supported",
            )
            .in_source(text)
            .help("query only the history, and join the results elsewhere")
        }
        other => Diagnostic::error("H012", format!("the query failed: {other}")).in_source(text),
    }
}

pub(super) fn refuse_update(text: &Source) -> Result<(), Diagnostics> {
    let Some((word, span)) = first_keyword(&text.text) else {
        return Ok(());
    };
    let word = word.to_uppercase();
    if !UPDATES.contains(&word.as_str()) {
        return Ok(());
    }
    Err(Diagnostic::error(
        "H011",
        format!("`{word}` is an update, but the history is read-only"),
    )
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
        let length = rest
            .find(|c: char| !c.is_ascii_alphabetic())
            .unwrap_or(rest.len());
        let word = &rest[..length];
        if !["PREFIX", "BASE"]
            .iter()
            .any(|known| word.eq_ignore_ascii_case(known))
        {
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
        assert_eq!(
            keyword("# DELETE\nPREFIX a: <http://b#> base <http://c> SELECT *"),
            Some("SELECT")
        );
        assert_eq!(keyword("insert data {}"), Some("insert"));
        assert_eq!(keyword("  # nothing"), None);
        assert_eq!(keyword("PREFIX a: http"), None);
        assert_eq!(keyword("é"), None);
    }
}
