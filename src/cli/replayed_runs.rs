//! Runs to be replayed in a report, read in order, a batch at a time. Reading and explaining them
//! takes most of a report's time, so all cores share the work.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use crate::history_dir::unless_damaged;
use crate::output;
use crate::work::all_cores;
use actcheck_base::{Diagnostic, Diagnostics, Outcome};
use actcheck_data::Trace;
use actcheck_history::{History, RunDetail};
use actcheck_ontology::Ontology;
use actcheck_report::{Explained, ReplayedRun};
use actcheck_rules::{Budget, RuleBook};

/// Most runs of a report that are simulated again, because the history does not keep their motion.
pub(super) const MOST_RESTORED: usize = 10;
/// Number of runs that a worker reads ahead.
const RUNS_OF_A_WORKER: usize = 8;

/// Reads runs in the given order and passes those that were read at once to `take`, until `take`
/// returns [`ControlFlow::Break`]. Leaves out those whose motion a program would have to simulate
/// again without consent.
///
/// # Errors
/// A run can't be read, or `take` fails.
pub(super) fn for_each_batch(
    history: &History,
    ontology: &Ontology,
    order: &[String],
    mut take: impl FnMut(Vec<ReplayedRun>) -> Result<ControlFlow<()>, Diagnostics>,
) -> Result<(), Diagnostics> {
    let budget = Budget::default();
    // If the current rules can't be read, there are no explanations; the outcomes come from the
    // history.
    let rules = RuleBook::prepare_within(ontology, &budget).ok();
    let lost = Mutex::new(BTreeMap::new());
    let read = |id: &String| -> Result<Option<ReplayedRun>, Diagnostics> {
        let run = history.newest_run(id)?;
        // A run that broke before its first state has no trace; everything else about it is
        // reported.
        let whole = history.traces().whole_if_allowed(id);
        if let Err(faults) = &whole
            && let Some(fault) = faults.iter().find(|fault| fault.code == "H009")
        {
            let mut lost = lost.lock().unwrap_or_else(PoisonError::into_inner);
            lost.insert(id.clone(), fault.clone());
        }
        let trace = match unless_damaged(whole)? {
            Some(None) => return Ok(None),
            trace => trace.flatten(),
        };
        let explained = rules
            .as_ref()
            .zip(trace.as_ref())
            .map(|(rules, trace)| explained(trace, rules, &run, &budget));
        Ok(Some((run, trace, explained.unwrap_or_default())))
    };
    let order = affordable(history, order)?;
    for runs in order.chunks(all_cores() * RUNS_OF_A_WORKER) {
        let shares: Vec<Vec<Result<Option<ReplayedRun>, Diagnostics>>> =
            std::thread::scope(|scope| {
                let share = |runs: &'_ [String]| runs.iter().map(read).collect();
                let of_each = runs.len().div_ceil(all_cores()).max(1);
                let started: Vec<_> = runs
                    .chunks(of_each)
                    .map(|runs| scope.spawn(move || share(runs)))
                    .collect();
                started
                    .into_iter()
                    .map(|share| {
                        share
                            .join()
                            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                    })
                    .collect()
            });
        let runs = shares
            .into_iter()
            .flatten()
            .filter_map(Result::transpose)
            .collect::<Result<_, _>>()?;
        if take(runs)?.is_break() {
            break;
        }
    }
    let lost = lost.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(warning) = without_motion(&lost) {
        output::print_diagnostics(&warning.into());
    }
    Ok(())
}

/// Warns of runs that can't be replayed since files of the history were deleted.
fn without_motion(lost: &BTreeMap<String, Diagnostic>) -> Option<Diagnostic> {
    let (first, fault) = lost.first_key_value()?;
    let runs = match lost.len() {
        1 => format!("run {first}"),
        runs => format!("{runs} runs, such as {first},"),
    };
    let message = format!("{runs} can't be replayed in the report: {}", fault.message);
    Some(
        Diagnostic::warning("H009", message)
            .help("their outcomes are complete; restore the files from a backup to replay them"),
    )
}

/// Leaves out runs whose motion is not kept, except the first ones: each must be simulated again.
fn affordable(history: &History, order: &[String]) -> Result<Vec<String>, Diagnostics> {
    let mut left = MOST_RESTORED;
    let mut affordable = Vec::new();
    for id in order {
        let restored = !history.is_whole(id)?;
        if !restored || left > 0 {
            affordable.push(id.clone());
        }
        left -= usize::from(restored && left > 0);
    }
    Ok(affordable)
}

/// Explains the failed properties of a run, given its trace. Omits those that the current rules
/// can't explain.
pub(super) fn explained(
    trace: &Trace,
    rules: &RuleBook,
    run: &RunDetail,
    budget: &Budget,
) -> Vec<Explained> {
    if run
        .actions
        .iter()
        .flat_map(|action| &action.judgements)
        .all(|judgement| judgement.outcome != Outcome::Failed)
    {
        return Vec::new();
    }
    let facts = History::facts_of(trace);
    let mut found = Vec::new();
    for (idx, action) in run.actions.iter().enumerate() {
        let Some(seen) = facts.action(idx) else {
            continue;
        };
        let failed = action
            .judgements
            .iter()
            .filter(|judgement| judgement.outcome == Outcome::Failed);
        let failed: Vec<&str> = failed
            .map(|judgement| judgement.property.as_str())
            .collect();
        for (property, explanation) in failed.iter().zip(rules.explain_all(&seen, &failed, budget))
        {
            if let Ok(explanation) = explanation {
                let (step, property) = (action.step, (*property).to_owned());
                let text = explanation.to_text();
                found.push(Explained {
                    step,
                    property,
                    text,
                    deciding: explanation.deciding,
                });
            }
        }
    }
    found
}
