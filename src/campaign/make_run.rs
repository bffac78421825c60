//! One planned run, made: its attempts at a scene, and what stands for a crash of simulation.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::actions::Cut;
use crate::base::{Diagnostic, Diagnostics};
use crate::campaign::line::{crashed, run_line_until};
use crate::campaign::{Env, Failure, Manner, Planned, Told};
use crate::history::RunRecord;

/// Scenes drawn for one run before the campaign is given up.
///
/// A space of which one scene in five can be built leaves a run without one once in 70,000 runs.
const SCENES_PER_RUN: u64 = 50;

/// What came of a planned run.
pub(super) enum Making {
    /// The run, with the discards before it.
    Run(Box<RunRecord>),
    /// It is in the history: somebody resumed the campaign.
    Stored(Told),
    /// Somebody asked for the end.
    Interrupted,
    /// There is no such run, and why.
    Impossible(Diagnostics),
}

/// Makes a planned run, after the scenes that have to be discarded for it.
pub(super) fn make_run(env: &Env, campaign: &str, planned: &Planned, manner: &Manner) -> Making {
    let mut discards = Vec::new();
    for attempt in 0..SCENES_PER_RUN {
        let index = planned.index;
        let choices = || planned.choices(env.campaign.seed, attempt);
        let cut = cut_of(env, manner);
        let made = catch_unwind(AssertUnwindSafe(|| run_line_until(env, campaign, (index, choices()), manner, cut)));
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

/// The record with what its plan says of it. Discards are of a scene: its first run has them.
fn kept(planned: &Planned, record: RunRecord, discards: Vec<String>) -> RunRecord {
    let first = planned.repetition.is_none_or(|number| number == 0);
    let weight = planned.steering.as_ref().and_then(|steering| steering.weight);
    let discards = if first { discards } else { Vec::new() };
    RunRecord { discards, repetition: planned.repetition(), weight, ..record }
}

/// When a run that begins now is cut off.
pub(super) fn cut_of(env: &Env, manner: &Manner) -> Cut {
    let secs = manner.clock.secs;
    env.campaign.limits.run_secs.map_or(Cut::Never, |limit| Cut::Clock { secs, at_secs: secs() + limit })
}

fn no_scene(env: &Env, planned: &Planned, last: Option<&String>) -> Diagnostic {
    Diagnostic::error(
        "S030",
        format!(
            "no scene could be built for run {} in {SCENES_PER_RUN} draws; the last one: {}",
            planned.index + 1,
            last.map_or("", String::as_str)
        ),
    )
    .at(&env.campaign.source, 0..0)
    .help("put fewer objects on the surface (`[surfaceObjects] count`), smaller ones, or a larger surface")
}

/// What a panic said.
pub(super) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}
