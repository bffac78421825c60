//! What makes a result the same as one of another day: the property, and the scene in which it was judged.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::base::{digest_of, names};
use crate::history::{ActionDetail, RunDetail};

/// Letters of a scene's name: enough for a million scenes without two alike, and few enough to read.
const SCENE_LETTERS: usize = 12;

/// A name of the scene of a run: what stands where, how heavy and how smooth it is, where the robot stands, and the test.
///
/// Noise is not part of it: runs of a scene differ by nothing else.
pub(super) fn scene(run: &RunDetail) -> String {
    let mut told = format!("{} {} {:?}", run.row.test, run.world, run.robot_base);
    for object in &run.objects {
        let (place, body) =
            ([object.x, object.y, object.z, object.yaw], [object.mass_kg, object.friction, object.restitution]);
        // Writing to a text does not fail.
        let _ = write!(told, " {} {} {:?} {place:?} {body:?}", object.id, object.model, object.role);
    }
    digest_of(&told).chars().take(SCENE_LETTERS).collect()
}

/// A property in an action of a test, as one name: `Pick Place/2 Place: ObjectReleased`.
pub(super) fn case_name(run: &RunDetail, action: &ActionDetail, property: &str) -> String {
    format!("{}/{} {}: {}", run.row.test, action.step, names::local(&action.action), names::local(property))
}

/// Numbers the runs of each scene, in the order in which they come, so that repetitions stay apart.
#[derive(Debug, Clone, Default)]
pub struct Repetitions {
    seen: BTreeMap<String, u64>,
}

impl Repetitions {
    /// None yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The number of a run among those of its scene so far, from 1.
    pub fn number(&mut self, run: &RunDetail) -> u64 {
        let seen = self.seen.entry(scene(run)).or_default();
        *seen += 1;
        *seen
    }
}
