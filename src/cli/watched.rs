//! Runs to be watched, read one behind the other: what a run is read and explained with takes most of the time of a report, so it is
//! shared out among the cores.

use std::ops::ControlFlow;

use crate::base::Diagnostics;
use crate::history::{History, RunDetail, Trace};
use crate::ontology::Ontology;
use crate::report::Explained;
use crate::rules::{Budget, RuleBook};
use crate::verdict::Outcome;

/// Runs that a worker reads before they are taken.
const RUNS_OF_A_WORKER: usize = 8;

/// A run with its trace and what explains its failures.
pub(super) type Watched = (RunDetail, Option<Trace>, Vec<Explained>);

/// Reads runs in their order until enough were taken.
///
/// # Errors
/// A run can't be read, or what takes it refuses.
pub(super) fn in_order(
    history: &History,
    ontology: &Ontology,
    order: &[String],
    mut take: impl FnMut(Watched) -> Result<ControlFlow<()>, Diagnostics>,
) -> Result<(), Diagnostics> {
    let budget = Budget::default();
    // Rules that can't be read today explain nothing; the outcomes are those of the history.
    let rules = RuleBook::prepare_within(ontology, &budget).ok();
    let read = |id: &String| -> Result<Watched, Diagnostics> {
        let run = history.run(id)?;
        // A run that was broken before its first state has no trace; all else is told of it.
        let trace = history.trace(id).ok();
        let explained = rules.as_ref().map(|rules| explained(history, rules, &run, &budget)).unwrap_or_default();
        Ok((run, trace, explained))
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    for runs in order.chunks(workers * RUNS_OF_A_WORKER) {
        let shares: Vec<Vec<Result<Watched, Diagnostics>>> = std::thread::scope(|scope| {
            let share = |runs: &'_ [String]| runs.iter().map(read).collect();
            let started: Vec<_> = runs.chunks(RUNS_OF_A_WORKER).map(|runs| scope.spawn(move || share(runs))).collect();
            started
                .into_iter()
                .map(|share| share.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        });
        for watched in shares.into_iter().flatten() {
            if take(watched?)?.is_break() {
                return Ok(());
            }
        }
    }
    Ok(())
}

/// Why the failed properties of a run failed. What today's rules can't explain is left out.
pub(super) fn explained(history: &History, rules: &RuleBook, run: &RunDetail, budget: &Budget) -> Vec<Explained> {
    let Ok(facts) = history.facts(&run.row.run) else { return Vec::new() };
    let mut found = Vec::new();
    for (idx, action) in run.actions.iter().enumerate() {
        let Some(seen) = facts.action(idx) else { continue };
        for judgement in action.judgements.iter().filter(|judgement| judgement.outcome == Outcome::Failed) {
            if let Ok(explanation) = rules.explain(&seen, &judgement.property, budget) {
                let (step, property) = (action.step, judgement.property.clone());
                found.push(Explained { step, property, text: explanation.to_text() });
            }
        }
    }
    found
}
