//! Makes one planned run: draws scenes until one can be built, and records simulation crashes.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::line::{crashed, run_line_until};
use crate::{Env, Failure, Planned, RunContext, RunResult};
use actcheck_actions::Cut;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::RunRecord;

/// Maximum number of scenes drawn for one run; then the campaign stops.
///
/// If one scene in five of a space can be built, one run in 70,000 is left without a scene.
const SCENES_PER_RUN: u64 = 50;

/// The result of a planned run.
pub(super) enum Making {
    /// The run, with its discards.
    Run(Box<RunRecord>),
    /// The run is in the history already: the campaign was resumed.
    Stored(RunResult),
    /// The campaign was interrupted.
    Interrupted,
    /// The run can't be made, with the reason.
    Impossible(Diagnostics),
}

/// Makes a planned run. Draws scenes until one can be built.
pub(super) fn make_run(env: &Env, campaign: &str, planned: &Planned, context: &RunContext) -> Making {
    let mut discards = Vec::new();
    for attempt in 0..SCENES_PER_RUN {
        let index = planned.index;
        let choices = || planned.choices(env.campaign.seed, attempt);
        let cut = cut_of(env, context);
        let made = catch_unwind(AssertUnwindSafe(|| run_line_until(env, campaign, (index, choices()), context, cut)));
        let record = match made {
            Ok(Ok(record)) => Ok(record),
            Ok(Err(Failure::Interrupted)) => return Making::Interrupted,
            Ok(Err(Failure::Discard(reason))) => {
                discards.push(reason);
                continue;
            }
            Err(panic) => {
                let reason = format!("simulation crashed: {}", panic_text(panic.as_ref()));
                let redone = catch_unwind(AssertUnwindSafe(|| crashed(env, campaign, index, choices(), &reason)));
                redone.ok().flatten().ok_or(reason)
            }
        };
        return match record {
            Ok(record) => Making::Run(Box::new(kept(planned, record, discards))),
            Err(reason) => Making::Impossible(Diagnostic::error("S031", reason).into()),
        };
    }
    Making::Impossible(no_scene(env, planned, discards.last()).into())
}

/// Adds repetition and weight from the plan, and the discards, which only the first run of a scene has.
fn kept(planned: &Planned, record: RunRecord, discards: Vec<String>) -> RunRecord {
    let first = planned.repetition.is_none_or(|number| number == 0);
    let weight = planned.steering.as_ref().and_then(|steering| steering.weight);
    let discards = if first { discards } else { Vec::new() };
    RunRecord { discards, repetition: planned.repetition(), weight, ..record }
}

/// The time limit of a run that starts now.
pub(super) fn cut_of(env: &Env, context: &RunContext) -> Cut {
    let secs = context.clock.secs;
    env.campaign.limits.run_secs.map_or(Cut::Never, |limit| Cut::Clock { secs, at_secs: secs() + limit })
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

/// The message of a panic.
pub(super) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}
