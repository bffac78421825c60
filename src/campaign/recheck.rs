//! Judges stored runs again by other rules, without simulation.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::workers::workers;
use crate::{Ending, RuleSet};
use actcheck_base::{Diagnostic, Diagnostics, RunFacts};
use actcheck_data::{ActionEnd, ActionTrace};
use actcheck_facts as facts;
use actcheck_history::{History, NewestJudgements, Recheck, RunRow, StoredJudgement};
use actcheck_rules::Budget;
use actcheck_verdict::judge_action;

/// Options of [`recheck`]. The number of workers does not change the result.
#[derive(Debug, Clone)]
pub struct RecheckOptions {
    /// Workers.
    pub jobs: usize,
    /// Number of runs whose judgements are written together.
    pub batch: usize,
    /// Timestamp of the judgements, as RFC 3339.
    pub at: String,
}

impl RecheckOptions {
    /// Default batch: a quarter of a second of work. This is short enough for a progress bar and
    /// Ctrl-C, and long enough to make the cost of writing negligible.
    pub const BATCH: usize = 256;
}

/// The result of [`recheck`].
#[derive(Debug)]
pub struct RecheckEnd {
    /// Why it ended.
    pub ending: Ending,
    /// Number of judged runs; their changed judgements are in the history.
    pub judged: u64,
    /// Faults of the runs that could not be judged, in the order of the runs.
    pub faults: Diagnostics,
}

/// Number of runs that a worker takes at once: few, so that no worker waits long for the others at
/// the end of a batch.
const SHARED: usize = 4;

/// The results of one batch of runs.
type Judged = Vec<Result<Vec<Recheck>, Diagnostics>>;

/// Judges runs by the rules that `rules_of` returns for each, and stores changed judgements, those
/// of a batch together.
///
/// `on_batch` is called once a batch is in the history, with all judgements (unchanged ones too) in
/// the order of the runs. When `stop` is set, it ends after the runs in flight; their judgements
/// are stored. A run that can't be judged (its trace is corrupt, or the rules' ontology lacks its
/// action) is left unchanged and does not stop the others. Actions that did not complete, or were
/// not performed, keep their outcomes.
pub fn recheck<'a>(
    history: &History,
    runs: &[RunRow],
    rules_of: impl Fn(&RunRow) -> &'a RuleSet + Sync,
    options: &RecheckOptions,
    stop: &AtomicBool,
    mut on_batch: impl FnMut(u64, &[Recheck]),
) -> RecheckEnd {
    let mut end = RecheckEnd {
        ending: Ending::Finished,
        judged: 0,
        faults: Diagnostics::new(),
    };
    let pool = match workers(options.jobs) {
        Ok(pool) => pool,
        Err(faults) => {
            return RecheckEnd {
                ending: Ending::Stopped(faults),
                ..end
            };
        }
    };
    let stopped = || stop.load(Ordering::Relaxed);
    let newest = NewestJudgements::of(history);
    let judge =
        |run: &RunRow| (!stopped()).then(|| judge_run(history, &newest, run, rules_of(run)));
    let mut chunks = runs.chunks(options.batch.max(1));
    let mut taken = 0;
    let mut judged: Option<Vec<Recheck>> = None;
    loop {
        let next = chunks.next().filter(|_| !stopped());
        if next.is_none() && judged.is_none() {
            break;
        }
        // One batch is written while the next is judged.
        let (written, fresh) = pool.install(|| {
            rayon::join(
                || {
                    judged
                        .as_ref()
                        .map_or(Ok(()), |batch| history.commit_rechecks(batch, &options.at))
                },
                || {
                    next.map(|runs| {
                        runs.par_iter()
                            .with_max_len(SHARED)
                            .filter_map(judge)
                            .collect::<Judged>()
                    })
                },
            )
        });
        if let Err(faults) = written {
            return RecheckEnd {
                ending: Ending::Stopped(faults),
                ..end
            };
        }
        if let Some(batch) = judged.take() {
            end.judged += taken;
            on_batch(taken, &batch);
        }
        judged = fresh.map(|batch| {
            let (rechecks, faults) = split_results(batch);
            taken = rechecks.len() as u64;
            end.faults.extend(faults);
            rechecks.into_iter().flatten().collect()
        });
    }
    end.ending = match history.finish_rechecks() {
        Err(faults) => Ending::Stopped(faults),
        Ok(()) if end.judged + (end.faults.len() as u64) < runs.len() as u64 => Ending::Interrupted,
        Ok(()) => Ending::Finished,
    };
    end
}

/// Judges runs by other rules, and stores nothing. Returns the judgements in the order of the runs,
/// and the faults of the runs that can't be judged. When `stop` is set, the remaining runs are left
/// out.
///
/// # Errors
/// `X010` if the workers can't be started.
pub fn judge_stored(
    history: &History,
    runs: &[RunRow],
    rules: &RuleSet,
    jobs: usize,
    stop: &AtomicBool,
) -> Result<(Vec<Recheck>, Diagnostics), Diagnostics> {
    let newest = NewestJudgements::of(history);
    let judge = |run: &RunRow| {
        (!stop.load(Ordering::Relaxed)).then(|| judge_run(history, &newest, run, rules))
    };
    let judged: Judged = workers(jobs)?.install(|| runs.par_iter().filter_map(judge).collect());
    let (rechecks, faults) = split_results(judged);
    Ok((rechecks.into_iter().flatten().collect(), faults))
}

fn split_results(batch: Judged) -> (Vec<Vec<Recheck>>, Diagnostics) {
    let mut faults = Diagnostics::new();
    let mut rechecks = Vec::with_capacity(batch.len());
    for run in batch {
        match run {
            Ok(judged) => rechecks.push(judged),
            Err(found) => faults.extend(found),
        }
    }
    (rechecks, faults)
}

/// Judges all actions of a run. A run that can't be judged has exactly one fault.
fn judge_run(
    history: &History,
    newest: &NewestJudgements<'_>,
    run: &RunRow,
    rules: &RuleSet,
) -> Result<Vec<Recheck>, Diagnostics> {
    let trace = history.traces().of(run, rules.rules.reads_course())?;
    let facts = facts::extract(&trace);
    let mut rechecks = Vec::new();
    for (step, performed) in trace.actions.iter().enumerate() {
        rechecks.extend(judge_step(newest, run, step, performed, &facts, rules)?);
    }
    Ok(rechecks)
}

fn judge_step(
    newest: &NewestJudgements<'_>,
    run: &RunRow,
    step: usize,
    performed: &ActionTrace,
    facts: &RunFacts,
    rules: &RuleSet,
) -> Result<Vec<Recheck>, Diagnostics> {
    let Some(action) = rules.actions.get(&performed.action) else {
        let message = format!(
            "run {} performed `{}`, which the ontology does not have",
            run.run, performed.action
        );
        return Err(Diagnostic::error("X031", message)
            .help(
                "name the ontology that has it with `--ontology FILE`, or select other campaigns with `--campaign ID`",
            )
            .into());
    };
    if action.success_properties.is_empty() {
        return Ok(Vec::new());
    }
    // The length of a test is not limited.
    let number = u32::try_from(step + 1).unwrap_or(u32::MAX);
    let mut stored = newest.read(&run.run, number, &action.success_properties)?;
    let budget = Budget::default();
    let judged = judge_action(
        &rules.ontology,
        &rules.rules,
        action,
        &performed.end,
        (facts.start(), facts.action(step)),
        &budget,
    )
    .map_err(|failure| Diagnostic::error("R091", failure.to_string()))?;
    let rechecks = judged.into_iter().map(|judgement| {
        let before = take(&mut stored, &judgement.property);
        let now = match &before {
            Some(before) if performed.end != ActionEnd::Completed => before.judgement.clone(),
            _ => judgement,
        };
        Recheck {
            run: run.run.clone(),
            step: number,
            action: action.iri.clone(),
            before,
            now,
        }
    });
    Ok(rechecks.collect())
}

fn take(stored: &mut Vec<StoredJudgement>, property: &str) -> Option<StoredJudgement> {
    let place = stored
        .iter()
        .position(|stored| stored.judgement.property == property)?;
    Some(stored.swap_remove(place))
}
