//! Makes a run from given choices, and turns a crash of the simulation into a broken run.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::finished_run::FinishedRun;
use crate::line::{crashed, simulate};
use crate::{Env, Failure, RunContext, RunInput};
use actcheck_actions::{Cut, Interference};
use actcheck_data::Choices;
use actcheck_world::{OtherEngine, Playback};

/// A run to make. Its choices can be made twice, because a crash consumes them.
pub(super) struct Attempt<'a> {
    /// Id of the campaign, for the program that performs actions.
    pub(super) campaign: &'a str,
    /// Position in the campaign, from 0.
    pub(super) index: u64,
    pub(super) choices: &'a dyn Fn() -> Choices,
    /// Limit at which the run is cut off.
    pub(super) cut: Cut,
}

/// The reason why there is no run.
#[derive(Debug, thiserror::Error)]
pub(super) enum AttemptFault {
    /// The scene gave no run.
    #[error("{}", of_failure(.0))]
    Failure(Failure),
    /// The simulation crashed, and its scene can't be drawn again to record the crash.
    #[error("{0}")]
    Crash(String),
}

fn of_failure(failure: &Failure) -> String {
    match failure {
        Failure::Interrupted => failure.to_string(),
        Failure::Discard(reason) | Failure::Overlap(reason) => {
            format!("its scene can no longer be built: {reason}")
        }
    }
}

impl Attempt<'_> {
    /// Makes the run. A simulation crash counts as a run too: every property is `broken`.
    pub(super) fn make(
        &self,
        env: &Env,
        context: &RunContext,
    ) -> Result<FinishedRun, AttemptFault> {
        self.make_played(env, context, None, None)
    }

    /// Makes the run, and takes the robot's part for another engine, which may also step the bodies
    /// instead of this one.
    pub(super) fn make_played(
        &self,
        env: &Env,
        context: &RunContext,
        playback: Option<&mut Option<Playback>>,
        other_engine: Option<Box<dyn OtherEngine>>,
    ) -> Result<FinishedRun, AttemptFault> {
        let input = || RunInput {
            campaign: self.campaign,
            index: self.index,
            choices: (self.choices)(),
        };
        let interference = Interference {
            cut: self.cut,
            playback,
            other_engine,
            ..Interference::default()
        };
        let start = context.clock.start();
        match catch_unwind(AssertUnwindSafe(|| {
            simulate(env, input(), context, start.clone(), interference)
        })) {
            Ok(made) => made.map_err(AttemptFault::Failure),
            Err(panic) => {
                let reason = format!("simulation crashed: {}", panic_text(panic.as_ref()));
                let recorded = catch_unwind(AssertUnwindSafe(|| {
                    crashed(env, input(), context, start, &reason)
                }));
                recorded.ok().flatten().ok_or(AttemptFault::Crash(reason))
            }
        }
    }
}

/// The time limit of a run that starts now.
pub(super) fn time_limit(env: &Env, context: &RunContext) -> Cut {
    let secs = context.clock.secs;
    env.campaign
        .limits
        .run_secs
        .map_or(Cut::Never, |limit| Cut::Clock {
            secs,
            at_secs: secs() + limit,
        })
}

/// The message of a panic.
fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}
