//! Makes one planned run: draws scenes until one can be built, and encodes the run for the history.

use crate::attempt::{Attempt, AttemptFault, time_limit};
use crate::finished_run::{FinishedRun, RunPlace};
use crate::replay::cut_secs;
use crate::{Env, Failure, Planned, RunContext, RunResult};
use actcheck_actions::Cut;
use actcheck_base::{Diagnostic, Diagnostics, Outcome};
use actcheck_history::{Entry, RunRecord, RunStatus};

/// Maximum number of scenes drawn for one run; then the campaign stops.
///
/// If one scene in five of a space can be built, one run in 70,000 is left without a scene.
pub(super) const SCENES_PER_RUN: u64 = 50;

/// A new run.
pub(super) struct MadeRun {
    pub(super) record: RunRecord,
    /// The run as the history stores it.
    pub(super) entry: Entry,
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

/// Makes a planned run of a campaign that began at a time of the context's clock (unit: seconds).
/// Draws scenes until one can be built.
pub(super) fn make_run(
    env: &Env,
    campaign: &str,
    began_secs: f64,
    planned: Planned,
    context: &RunContext,
) -> Making {
    let (mut discards, mut n_overlaps) = (Vec::new(), 0);
    let last_secs = env
        .campaign
        .limits
        .time_secs
        .map(|limit| began_secs + limit + overtime_secs(limit));
    for number in 0..SCENES_PER_RUN {
        let choices = || planned.choices(env.campaign.seed, number);
        let own = time_limit(env, context);
        let (cut, ends_campaign) = match (own, last_secs) {
            (Cut::Clock { at_secs, .. }, Some(last_secs)) if at_secs <= last_secs => (own, false),
            (_, Some(at_secs)) => (
                Cut::Clock {
                    secs: context.clock.secs,
                    at_secs,
                },
                true,
            ),
            (_, None) => (own, false),
        };
        let attempt = Attempt {
            campaign,
            index: planned.index,
            choices: &choices,
            cut,
        };
        match attempt.make(env, context) {
            Ok(run) => {
                let record = record(
                    run,
                    campaign,
                    &planned,
                    discards,
                    (context.clock.secs)() - began_secs,
                );
                if ends_campaign && cut_secs(&record.trace).is_some() {
                    return Making::Interrupted;
                }
                return match entry(env, &record) {
                    Ok(entry) => Making::Run(Box::new(MadeRun { record, entry })),
                    Err(faults) => Making::Impossible(faults),
                };
            }
            Err(AttemptFault::Failure(Failure::Interrupted)) => return Making::Interrupted,
            Err(AttemptFault::Failure(Failure::Discard(reason))) => discards.push(reason),
            Err(AttemptFault::Failure(Failure::Overlap(reason))) => {
                discards.push(reason);
                n_overlaps += 1;
            }
            Err(AttemptFault::Crash(reason)) => {
                return Making::Impossible(Diagnostic::error("S031", reason).into());
            }
        }
    }
    let last = discards.last().map_or("", String::as_str);
    Making::Impossible(match n_overlaps {
        SCENES_PER_RUN => env.overlaps_at_start(last, SCENES_PER_RUN).into(),
        _ => no_scene(env, &planned, last).into(),
    })
}

/// Time for the runs in flight when the time of a campaign is up: usually they end by themselves,
/// so that slow ones count as others do. After it they are given up: a skill may go on for hours.
/// Unit: seconds.
fn overtime_secs(limit: f64) -> f64 {
    (limit / 2.0).clamp(10.0, 60.0)
}

/// The record of a run, with repetition and weight from its plan. Only the first run of a scene has
/// the discards.
fn record(
    run: FinishedRun,
    campaign: &str,
    planned: &Planned,
    discards: Vec<String>,
    elapsed_secs: f64,
) -> RunRecord {
    let is_first = planned.repetition.is_none_or(|number| number == 0);
    run.into_record(RunPlace {
        campaign: campaign.to_owned(),
        shrunk_from: None,
        repetition: planned.repetition(),
        weight: planned
            .steering
            .as_ref()
            .and_then(|steering| steering.weight),
        discards: if is_first { discards } else { Vec::new() },
        elapsed_secs,
    })
}

/// Encodes a run: whole, or without its motion, as the campaign's configuration says.
fn entry(env: &Env, record: &RunRecord) -> Result<Entry, Diagnostics> {
    let failed = record.status != RunStatus::Completed
        || record
            .judgements
            .iter()
            .flatten()
            .any(|judgement| judgement.outcome == Outcome::Failed);
    if env
        .campaign
        .keeping
        .keeps_whole(record.seed, record.index, failed)
    {
        Entry::whole(record)
    } else {
        Entry::outcomes(record)
    }
}

fn no_scene(env: &Env, planned: &Planned, last: &str) -> Diagnostic {
    let room = "put fewer objects on the surface (`[surfaceObjects] count`), smaller ones, or a larger surface";
    let help = match env.robot.profile.core.reach_m {
        Some([nearest, farthest]) => format!(
            "{room}; objects to pick must be {nearest} to {farthest} m from the robot's root, by `reach_m` in its profile"
        ),
        None => room.to_owned(),
    };
    Diagnostic::error(
        "S030",
        format!(
            "no scene could be built for run {} in {SCENES_PER_RUN} draws; the last failure: {}",
            planned.index + 1,
            last
        ),
    )
    .at(&env.campaign.source, 0..0)
    .help(help)
}
