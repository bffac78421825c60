//! A run as a bag.

use std::collections::BTreeMap;

use crate::bag::cdr::{Cdr, Stamp};
use crate::bag::motion::{Frames, record_joints, start_secs};
use crate::bag::recorder::{BagFault, Recorder};
use crate::bag::types::ROBOT_DESCRIPTION;
use crate::bag::{events, markers};
use actcheck_data::{Appearances, RobotCore, Trace};
use actcheck_history::RunDetail;

/// A run to export.
#[derive(Debug)]
pub struct BagInput<'a> {
    /// Its details, with its outcomes.
    pub run: &'a RunDetail,
    /// Its trace, with at least one state.
    pub trace: &'a Trace,
    /// Its robot; `None` if that can't be read any more, or is another one now.
    pub robot: Option<&'a RobotCore>,
    /// The appearance of its objects.
    pub appearances: &'a Appearances,
}

/// Returns the bytes of a bag with a run.
///
/// # Errors
/// The MCAP library can't write a record.
pub fn bag(input: &BagInput<'_>) -> Result<Vec<u8>, BagFault> {
    let (run, trace) = (input.run, input.trace);
    let mut recorder = Recorder::default();
    let at = Stamp::of_secs(start_secs(trace));
    let frames = Frames::of(trace, input.robot.map(|robot| &*robot.tree));
    frames.record(&mut recorder, trace);
    if let Some(robot) = input.robot {
        let mut message = Cdr::new();
        message.text(&robot.urdf.text);
        recorder.add(ROBOT_DESCRIPTION, at, message);
    }
    let bodies = markers::bodies(run, trace, &frames, input.appearances);
    events::record_markers(&mut recorder, at, &bodies);
    record_joints(&mut recorder, trace);
    events::record_contacts(&mut recorder, trace);
    events::record_percepts(&mut recorder, trace);
    events::record_outcomes(&mut recorder, run, trace);
    let about = [
        ("run", run.row.run.clone()),
        ("campaign", run.row.campaign.clone()),
        ("test", run.row.test.clone()),
        ("seed", run.seed.to_string()),
        ("program", run.program_version.clone()),
    ];
    recorder.finish(BTreeMap::from(
        about.map(|(key, value)| (key.to_owned(), value)),
    ))
}
