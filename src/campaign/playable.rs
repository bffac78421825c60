//! A stored run for another physics engine: its model and its setpoints.

use crate::attempt::Attempt;
use crate::replay::{cut_secs, refused};
use crate::{RunContext, StoredCampaign, mjcf};
use actcheck_actions::Cut;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::Choices;
use actcheck_history::{History, RunDetail};

/// A run that another engine can play.
#[derive(Debug, Clone, PartialEq)]
pub struct Playable {
    /// Robot and objects at the first frame, in MJCF.
    pub mjcf: String,
    /// The robot's setpoints in each control tick, as CSV.
    pub setpoints: String,
}

/// Simulates a stored run again, and returns what another engine needs to play it.
///
/// # Errors
/// `S040` if the configuration has no such test; `S041` if the run can't be run again, or not to
/// the same states; `S053` if it has something that MJCF has no equal for.
pub fn playable(
    history: &History,
    (env, record): &StoredCampaign,
    detail: &RunDetail,
    context: &RunContext,
) -> Result<Playable, Diagnostics> {
    if env.campaign.robot.suction.is_some() {
        let message = format!(
            "run {} can't be written as MJCF: its robot holds things by a suction cup, whose seal MuJoCo does not have",
            detail.row.run
        );
        let help = "runs of robots with fingers can be written";
        return Err(Diagnostic::error("S053", message).help(help).into());
    }
    let (choices, was) = history.traces().recorded(&detail.row.run)?;
    let index = env.index_of(&detail.row.test, &choices)?;
    let attempt = Attempt {
        campaign: &record.id,
        index,
        choices: &|| Choices::recorded(&choices),
        cut: cut_secs(&was).map_or(Cut::Never, |at_secs| Cut::Simulated { at_secs }),
    };
    let mut playback = None;
    let run = attempt
        .make_played(env, context, Some(&mut playback))
        .map_err(|why| refused(detail, &why.to_string()))?;
    let Some(playback) = playback else {
        return Err(refused(detail, "its scene could not be simulated").into());
    };
    if run.trace.hash != was.hash {
        let why = "it now has other states: a model, the configuration or the program changed";
        let help = "`actcheck replay RUN` names the first difference; a run made today can be written";
        return Err(refused(detail, why).help(help).into());
    }
    Ok(Playable {
        mjcf: mjcf::write(&detail.row.run, &env.robot, &run.scene, &playback),
        setpoints: mjcf::setpoints(&env.robot, &playback),
    })
}
