//! Queries over a history with outlines, without their statements in the store.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

use oxigraph::model::{Literal, NamedNode, Term as StoreTerm};
use oxigraph::sparql::{SparqlEvaluator, SparqlSyntaxError};

use crate::evaluation::{Unfinished, evaluate};
use crate::light::parser;
use crate::outlines::{MOST_STATEMENTS, too_many};
use crate::query::{
    Prepared, collect, evaluator, query_evaluator, unfinished, with_text_functions,
};
use crate::syntax_fault::syntax_fault;
use crate::vertical::{Counts, Plan, Stop, plan};
use crate::wanted::{InGraph, Wanted};
use crate::{Cancel, History, QueryAnswer, fault};
use actcheck_base::{Diagnostics, Source, bounded_texts, names};

/// Number of times that files are looked for again, if the owner has put them together meanwhile.
const TRIES: usize = 100;
/// Number of facts of a run: about.
const FACTS_OF_A_RUN: u64 = 500;

/// Answers a query. Returns `None` if it needs the store with the statements of outlines, and these
/// are few.
///
/// # Errors
/// As those of a query; `H030` it needs the store with too many statements.
pub(super) fn answer(
    history: &History,
    text: &Source,
    cancel: &Cancel,
) -> Result<Option<QueryAnswer>, Diagnostics> {
    let store = history.store_with(|| Wanted::query(&text.text))?;
    let syntax = |error: SparqlSyntaxError| syntax_fault(text, &error.to_string());
    drop(
        query_evaluator(&store, cancel)
            .parse_query(&*text.text)
            .map_err(syntax)?,
    );
    let query = parser()
        .parse_query(&bounded_texts(&text.text))
        .map_err(syntax)?;
    let made = Arc::new(AtomicUsize::new(0));
    let make = |counts: Option<Arc<Counts>>| {
        let evaluator = match counts {
            Some(counts) => with_counts(evaluator(cancel), counts),
            None => evaluator(cancel),
        };
        with_text_functions(evaluator, cancel, &made)
    };
    let needs_facts = {
        let wanted = Wanted::parsed(&query);
        wanted.graphs
            || wanted
                .patterns
                .iter()
                .any(|pattern| pattern.graph != InGraph::Default)
    };
    let mut tries = 0;
    let Plan { query, counts } = loop {
        let (stop, statements) = match plan(history, &store, query.clone(), &make, cancel) {
            Ok(planned) => break planned,
            Err(stopped) => stopped,
        };
        tries += 1;
        return match stop {
            Stop::Gone if tries < TRIES => continue,
            Stop::Gone => Err(fault::in_use(history.dir())),
            Stop::Damaged(file, why) => Err(fault::damaged(
                history.dir(),
                &format!("`{}`: {why}", file.display()),
            )),
            Stop::Unfit(part) => {
                let facts = if needs_facts {
                    FACTS_OF_A_RUN * History::count_outlines(history.dir())
                } else {
                    0
                };
                if statements + facts > MOST_STATEMENTS as u64 {
                    return Err(too_many(history, &part, statements + facts));
                }
                Ok(None)
            }
            Stop::Cancelled => Err(unfinished(history, text, Unfinished::Stopped)),
            Stop::Failed(error) => Err(unfinished(history, text, Unfinished::Failed(error))),
            Stop::Crashed => Err(unfinished(history, text, Unfinished::Crashed)),
            Stop::Store(error) => Err(unfinished(history, text, Unfinished::Damaged(error))),
        };
    };
    let query = Prepared {
        prepared: make(counts).for_query(query),
        made: Arc::clone(&made),
    };
    let prepared = query.prepared.clone();
    let evaluated = evaluate(&store, cancel, move |store| {
        prepared.on_store(store).execute().and_then(collect)
    });
    query.check_texts(text)?;
    evaluated
        .map(Some)
        .map_err(|fault| unfinished(history, text, fault))
}

/// Adds the function `act:counts(?run)` for known runs.
fn with_counts(evaluator: SparqlEvaluator, counts: Arc<Counts>) -> SparqlEvaluator {
    evaluator.with_custom_function(
        NamedNode::new_unchecked(names::act("counts")),
        move |args: &[StoreTerm]| {
            let [StoreTerm::NamedNode(run)] = args else {
                return None;
            };
            Some(Literal::from(counts.has(run.as_str().strip_prefix(names::RUN)?)).into())
        },
    )
}
