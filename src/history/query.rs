//! SPARQL queries of users: prefixes are predefined, faults have their place, updates are refused.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use oxigraph::model::{Literal, NamedNode, Term as StoreTerm};
use oxigraph::sparql::{
    PreparedSparqlQuery, QueryEvaluationError, QueryResults, SparqlEvaluator, SparqlSyntaxError,
};

use crate::evaluation::{Unfinished, evaluate};
use crate::syntax_fault::syntax_fault;
use crate::terms::{from_store, to_store};
use crate::view::{Dataset, Demand};
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

impl History {
    /// Answers a SPARQL query. The prefixes of [`actcheck_base::names::PREFIXES`] need no
    /// declaration.
    ///
    /// The default graph holds campaigns, runs, executions, scenes and outcomes; facts are in the
    /// graphs that `act:before`, `act:after` and `act:during` name.
    ///
    /// # Errors
    /// `H010` the text is not a query, `H011` it is an update, `H012` the evaluation failed, `H030`
    /// it needs too many statements.
    pub fn query(&self, sparql: &str) -> Result<QueryAnswer, Diagnostics> {
        self.query_from(&Source::new("query", sparql), &Cancel::new())
    }

    /// Like [`History::query`], for a source text with a name, and with a handle that stops the
    /// query.
    ///
    /// # Errors
    /// As [`History::query`]; `H013` the query was stopped.
    pub fn query_from(&self, text: &Source, cancel: &Cancel) -> Result<QueryAnswer, Diagnostics> {
        answer(self, text, cancel)
    }

    /// Returns the statements that a query demands, and maybe others.
    ///
    /// # Errors
    /// `H030` these are too many; a file is damaged or can't be read.
    pub(super) fn dataset(&self, demand: Demand) -> Result<Arc<Dataset>, Diagnostics> {
        let mut view = self.view.lock().unwrap_or_else(PoisonError::into_inner);
        view.dataset(&self.stored, self.threads(), demand)
    }
}

/// Answers a query.
fn answer(history: &History, text: &Source, cancel: &Cancel) -> Result<QueryAnswer, Diagnostics> {
    refuse_update(text)?;
    refuse_excess(text)?;
    let query = prepare(history, text, cancel)?;
    let dataset = history.dataset(Demand::query(&text.text))?;
    let prepared = query.prepared.clone();
    let evaluated = evaluate(dataset, cancel, move |dataset| {
        prepared
            .on_queryable_dataset(dataset)
            .execute()
            .and_then(collect)
    });
    query.check_texts(text)?;
    evaluated.map_err(|fault| unfinished(text, fault))
}

fn unfinished(text: &Source, fault: Unfinished) -> Diagnostics {
    match fault {
        Unfinished::Stopped => stopped(text).into(),
        Unfinished::Failed(error) => evaluation_fault(text, &error).into(),
        Unfinished::Crashed => Diagnostic::error("H012", "the query made the evaluator crash")
            .in_source(text)
            .into(),
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
/// Syntax errors; the runs that count can't be read.
pub(super) fn prepare(
    history: &History,
    text: &Source,
    cancel: &Cancel,
) -> Result<Prepared, Diagnostics> {
    // Places in the text that is evaluated differ from the original's, so errors are reported
    // before.
    let parsed = evaluator(cancel).parse_query(&*text.text);
    drop(parsed.map_err(|error| unparsed(text, &error))?);
    let counted = if text.text.contains("counts") {
        history.counted_runs()?
    } else {
        BTreeSet::new()
    };
    prepare_counting(counted, text, cancel)
}

/// Parses a query whose syntax is valid. `counted`: ids of the runs that count in rates.
///
/// # Errors
/// Syntax errors.
pub(super) fn prepare_counting(
    counted: BTreeSet<String>,
    text: &Source,
    cancel: &Cancel,
) -> Result<Prepared, Diagnostics> {
    let made = Arc::new(AtomicUsize::new(0));
    let evaluator = with_counts(evaluator(cancel), counted);
    let prepared = with_text_functions(evaluator, cancel, &made)
        .parse_query(&bounded_texts(&text.text))
        .map_err(|error| unparsed(text, &error))?;
    Ok(Prepared { prepared, made })
}

fn unparsed(text: &Source, error: &SparqlSyntaxError) -> Diagnostic {
    syntax_fault(text, &error.to_string())
}

/// Adds functions that make texts of limited length: the evaluator keeps them until the query ends.
/// Beyond the limit, they stop the query. `made`: their length so far, in bytes.
fn with_text_functions(
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

/// An evaluator with the predefined prefixes that can be stopped.
fn evaluator(cancel: &Cancel) -> SparqlEvaluator {
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
/// [`History::counted_runs`].
fn with_counts(evaluator: SparqlEvaluator, counted: BTreeSet<String>) -> SparqlEvaluator {
    evaluator.with_custom_function(
        NamedNode::new_unchecked(names::act("counts")),
        move |args: &[StoreTerm]| {
            let [StoreTerm::NamedNode(run)] = args else {
                return None;
            };
            let id = run.as_str().strip_prefix(names::RUN)?;
            Some(Literal::from(counted.contains(id)).into())
        },
    )
}

fn collect(results: QueryResults<'_>) -> Result<QueryAnswer, QueryEvaluationError> {
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
