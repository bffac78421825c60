//! Runs cases: configurations with one fixed scene.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::attempt::{Attempt, time_limit};
use crate::finished_run::{FinishedRun, RunPlace};
use crate::workers::workers;
use crate::{Env, RunContext};
use actcheck_base::{Diagnostics, Outcome};
use actcheck_data::Choices;
use actcheck_history::{CampaignEnd, History, RunRecord, RunStatus};
use actcheck_verdict::{Counts, Recurrence, mean};

/// The result of a case.
#[derive(Debug, Clone)]
pub struct CaseRun {
    /// The run.
    pub record: RunRecord,
    /// Whether it fails as the case expects.
    pub recurrence: Recurrence,
    /// Whether all states are bitwise identical; `None` if the case has no trace digest.
    pub same_trace: Option<bool>,
}

/// Runs cases on several workers and stores each run as a campaign of its own with the case's name.
/// Calls `on_case` for each in the order of `cases`, with its position.
///
/// # Errors
/// `S064` if a scene can't be built or does not settle, `X010` if workers can't be started; or
/// writing failed.
pub fn run_cases(
    cases: &[(String, Env)],
    history: &History,
    jobs: usize,
    context: &RunContext,
    on_case: &mut dyn FnMut(usize, CaseRun),
) -> Result<(), Diagnostics> {
    let jobs = jobs.clamp(1, cases.len().max(1));
    let pool = workers(jobs)?;
    let mut faults = Diagnostics::new();
    // At most one trace for each worker is in memory.
    for (number, some) in cases.chunks(jobs).enumerate() {
        let made: Vec<_> =
            pool.install(|| some.par_iter().map(|(_, env)| make(env, context)).collect());
        for (at, ((name, env), made)) in some.iter().zip(made).enumerate() {
            match made {
                Ok(run) => on_case(number * jobs + at, store(env, history, name, run, context)?),
                Err(found) => faults.extend(found),
            }
        }
    }
    faults.or(())
}

fn make(env: &Env, context: &RunContext) -> Result<FinishedRun, Diagnostics> {
    let none = BTreeMap::new();
    let choices = env
        .campaign
        .case
        .as_ref()
        .map_or(&none, |case| &case.choices);
    let choices = || Choices::named(choices);
    let attempt = Attempt {
        campaign: "case",
        index: 0,
        choices: &choices,
        cut: time_limit(env, context),
    };
    attempt.make(env, context).map_err(|why| {
        env.campaign
            .fault("S064", "case", format!("the scene of this case can't be built: {why}"))
            .help("models, robot or program may have changed, or a value was edited: move the objects in the way")
            .into()
    })
}

fn store(
    env: &Env,
    history: &History,
    name: &str,
    run: FinishedRun,
    context: &RunContext,
) -> Result<CaseRun, Diagnostics> {
    let id = history.next_campaign_id(&actcheck_base::digest_of(&env.text), env.campaign.seed)?;
    let record = run.into_record(RunPlace::alone(&id));
    let mut campaign = env.record(id.clone(), name.to_owned(), record.started.clone());
    campaign.planned_runs = 1;
    history.begin_campaign(&campaign)?;
    history.commit(&record)?;
    history.finish_campaign(&id, &end_of(&record, (context.clock.now)()))?;
    let case = env.campaign.case.clone().unwrap_or_default();
    let recurrence = Recurrence::of(
        &case.expect.into_iter().collect(),
        record.judgements.iter().flatten(),
    );
    let same_trace = case.trace.map(|trace| trace == record.trace.hash);
    Ok(CaseRun {
        record,
        recurrence,
        same_trace,
    })
}

/// The end of a campaign of one run.
pub(super) fn end_of(record: &RunRecord, ended: String) -> CampaignEnd {
    end_of_all(std::slice::from_ref(record), ended, false)
}

/// The end of a campaign with these runs.
pub(super) fn end_of_all(runs: &[RunRecord], ended: String, interrupted: bool) -> CampaignEnd {
    let judgements = runs.iter().flat_map(|run| run.judgements.iter().flatten());
    let counts = Counts::of(judgements.map(|judgement| judgement.outcome));
    let whole = runs.iter().filter(|run| run.status != RunStatus::Broken);
    CampaignEnd {
        ended,
        score: mean(runs.iter().map(|run| run.score)),
        score_without_broken: mean(whole.map(|run| run.score)),
        outcomes: Outcome::ALL
            .into_iter()
            .map(|outcome| (outcome, counts.get(outcome)))
            .collect(),
        discards: 0,
        ended_by: None,
        interrupted,
    }
}
