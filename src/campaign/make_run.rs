//! Makes one planned run: draws scenes until one can be built.

use crate::attempt::{Attempt, AttemptFault, time_limit};
use crate::finished_run::{FinishedRun, RunPlace};
use crate::{Env, Failure, Planned, RunContext, RunResult};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::RunRecord;

/// Maximum number of scenes drawn for one run; then the campaign stops.
///
/// If one scene in five of a space can be built, one run in 70,000 is left without a scene.
pub(super) const SCENES_PER_RUN: u64 = 50;

/// A new run, and why each scene that was drawn before was discarded.
pub(super) struct MadeRun {
    planned: Planned,
    run: FinishedRun,
    discards: Vec<String>,
}

/// The result of a planned run.
pub(super) enum Making {
    /// The run, which is not stored yet.
    Run(Box<MadeRun>),
    /// The run is in the history already: the campaign was resumed.
    Stored(RunResult),
    /// The campaign was interrupted.
    Interrupted,
    /// The run can't be made, with the reason.
    Impossible(Diagnostics),
}

/// Makes a planned run. Draws scenes until one can be built.
pub(super) fn make_run(env: &Env, campaign: &str, planned: Planned, context: &RunContext) -> Making {
    let mut discards = Vec::new();
    for number in 0..SCENES_PER_RUN {
        let choices = || planned.choices(env.campaign.seed, number);
        let cut = time_limit(env, context);
        let attempt = Attempt { campaign, index: planned.index, choices: &choices, cut };
        match attempt.make(env, context) {
            Ok(run) => return Making::Run(Box::new(MadeRun { planned, run, discards })),
            Err(AttemptFault::Failure(Failure::Interrupted)) => return Making::Interrupted,
            Err(AttemptFault::Failure(Failure::Discard(reason))) => discards.push(reason),
            Err(AttemptFault::Crash(reason)) => {
                return Making::Impossible(Diagnostic::error("S031", reason).into());
            }
        }
    }
    Making::Impossible(no_scene(env, &planned, discards.last()).into())
}

impl MadeRun {
    /// The record of the run, with repetition and weight from its plan. Only the first run of a scene has the discards.
    pub(super) fn into_record(self, campaign: &str, elapsed_secs: f64) -> RunRecord {
        let planned = self.planned;
        let is_first = planned.repetition.is_none_or(|number| number == 0);
        self.run.into_record(RunPlace {
            campaign: campaign.to_owned(),
            shrunk_from: None,
            repetition: planned.repetition(),
            weight: planned.steering.as_ref().and_then(|steering| steering.weight),
            discards: if is_first { self.discards } else { Vec::new() },
            elapsed_secs,
        })
    }
}

fn no_scene(env: &Env, planned: &Planned, last: Option<&String>) -> Diagnostic {
    Diagnostic::error(
        "S030",
        format!(
            "no scene could be built for run {} in {SCENES_PER_RUN} draws; the last failure: {}",
            planned.index + 1,
            last.map_or("", String::as_str)
        ),
    )
    .at(&env.campaign.source, 0..0)
    .help("put fewer objects on the surface (`[surfaceObjects] count`), smaller ones, or a larger surface")
}
