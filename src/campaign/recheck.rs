//! Judges stored runs by other rules than those of their time, with no simulation.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::actions::{ActionEnd, ActionTrace};
use crate::base::{Diagnostic, Diagnostics};
use crate::campaign::judging::judge_action;
use crate::campaign::{Ending, RuleSet};
use crate::facts::{self, RunFacts};
use crate::history::{History, Recheck, RunRow, StoredJudgement};
use crate::rules::Budget;

/// How runs are judged anew. The number of workers changes nothing of what comes out.
#[derive(Debug, Clone)]
pub struct RecheckOptions {
    /// Workers.
    pub jobs: usize,
    /// Runs whose judgements are written in one transaction.
    pub batch: usize,
    /// The time that the judgements get, as RFC 3339.
    pub at: String,
}

impl RecheckOptions {
    /// A quarter of a second's work: soon enough for a progress bar and for Ctrl-C, and long enough that the transaction costs
    /// nothing.
    pub const BATCH: usize = 256;
}

/// What there is to say when no more runs are judged.
#[derive(Debug)]
pub struct RecheckEnd {
    /// Why there are no more.
    pub ending: Ending,
    /// Runs that were judged; what is news of them is in the history.
    pub judged: u64,
    /// Why the others could not be judged, in the order of the runs.
    pub faults: Diagnostics,
}

/// One batch of judged runs.
type Judged = Vec<Result<Vec<Recheck>, Diagnostics>>;

/// Judges runs by the rules that `rules_of` gives for each, and keeps what is news, a batch in one transaction.
///
/// `on_batch` is told of every run's judgements (the old ones among them) in the order of the runs, once they are in the
/// history. `stop` ends it after the runs in flight; what was judged is kept. A run that can't be judged (its trace is damaged,
/// the rules' ontology lacks its action) is left as it is and does not stop the others. Actions that did not come to their own
/// end keep the outcomes that they have.
pub fn recheck<'a>(
    history: &History,
    runs: &[RunRow],
    rules_of: impl Fn(&RunRow) -> &'a RuleSet + Sync,
    options: &RecheckOptions,
    stop: &AtomicBool,
    mut on_batch: impl FnMut(u64, &[Recheck]),
) -> RecheckEnd {
    let mut end = RecheckEnd { ending: Ending::Finished, judged: 0, faults: Diagnostics::new() };
    let pool = match workers(options.jobs) {
        Ok(pool) => pool,
        Err(faults) => return RecheckEnd { ending: Ending::Stopped(faults), ..end },
    };
    let stopped = || stop.load(Ordering::Relaxed);
    let judge = |run: &RunRow| (!stopped()).then(|| judge_run(history, run, rules_of(run)));
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
                || judged.as_ref().map_or(Ok(()), |batch| history.commit_rechecks(batch, &options.at)),
                || next.map(|runs| runs.par_iter().filter_map(judge).collect::<Judged>()),
            )
        });
        if let Err(faults) = written {
            return RecheckEnd { ending: Ending::Stopped(faults), ..end };
        }
        if let Some(batch) = judged.take() {
            end.judged += taken;
            on_batch(taken, &batch);
        }
        judged = fresh.map(|batch| {
            let (rechecks, faults) = parted(batch);
            taken = rechecks.len() as u64;
            end.faults.extend(faults);
            rechecks.into_iter().flatten().collect()
        });
    }
    end.ending = match history.flush() {
        Err(faults) => Ending::Stopped(faults),
        Ok(()) if end.judged + (end.faults.len() as u64) < runs.len() as u64 => Ending::Interrupted,
        Ok(()) => Ending::Finished,
    };
    end
}

fn workers(jobs: usize) -> Result<rayon::ThreadPool, Diagnostics> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.max(1)).build();
    pool.map_err(|error| Diagnostic::error("X010", format!("workers can't be started: {error}")).into())
}

fn parted(batch: Judged) -> (Vec<Vec<Recheck>>, Diagnostics) {
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

/// Every asked property of every action of a run. A run that can't be judged has exactly one fault.
fn judge_run(history: &History, run: &RunRow, rules: &RuleSet) -> Result<Vec<Recheck>, Diagnostics> {
    let trace = history.states(&run.run)?;
    let facts = facts::extract(&trace);
    let mut rechecks = Vec::new();
    for (step, performed) in trace.actions.iter().enumerate() {
        rechecks.extend(judge_step(history, run, step, performed, &facts, rules)?);
    }
    Ok(rechecks)
}

fn judge_step(
    history: &History,
    run: &RunRow,
    step: usize,
    performed: &ActionTrace,
    facts: &RunFacts,
    rules: &RuleSet,
) -> Result<Vec<Recheck>, Diagnostics> {
    let Some(action) = rules.actions.get(&performed.action) else {
        let message = format!("run {} performed `{}`, which the ontology does not have", run.run, performed.action);
        return Err(Diagnostic::error("X031", message)
            .help(
                "name the ontology that has it with `--ontology FILE`, or leave its campaign out with `--campaign ID`",
            )
            .into());
    };
    if action.success_properties.is_empty() {
        return Ok(Vec::new());
    }
    // A test has as many actions as somebody typed.
    let number = u32::try_from(step + 1).unwrap_or(u32::MAX);
    let mut stored = history.newest(&run.run, number, &action.success_properties)?;
    let (facts, budget) = (facts.action(step), Budget::default());
    let judged = judge_action(&rules.ontology, &rules.rules, action, &performed.end, facts, &budget)
        .map_err(|failure| Diagnostic::error("R091", failure.to_string()))?;
    let rechecks = judged.into_iter().map(|judgement| {
        let before = take(&mut stored, &judgement.property);
        let now = match &before {
            Some(before) if performed.end != ActionEnd::Completed => before.judgement.clone(),
            _ => judgement,
        };
        Recheck { run: run.run.clone(), step: number, action: action.iri.clone(), before, now }
    });
    Ok(rechecks.collect())
}

fn take(stored: &mut Vec<StoredJudgement>, property: &str) -> Option<StoredJudgement> {
    let place = stored.iter().position(|stored| stored.judgement.property == property)?;
    Some(stored.swap_remove(place))
}
