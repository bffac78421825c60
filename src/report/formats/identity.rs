//! Identity of results across campaigns: the property and the scene in which it was judged.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use actcheck_base::{digest_of, names};
use actcheck_history::{ActionDetail, RunDetail};

/// Number of characters of a scene's name: enough for a million scenes without collisions, and
/// short enough to read.
const SCENE_LETTERS: usize = 12;

/// Name of a run's scene: a digest of its objects with poses, masses, friction and restitution, the
/// robot's pose, and the test.
///
/// Noise is not included: it is the only difference between runs of a scene.
pub(super) fn scene(run: &RunDetail) -> String {
    let mut text = format!("{} {} {:?}", run.row.test, run.world, run.robot_base);
    for object in &run.objects {
        let (place, body) = (
            [object.x, object.y, object.z, object.yaw],
            [object.mass_kg, object.friction, object.restitution],
        );
        // Writing to a `String` does not fail.
        let _ = write!(
            text,
            " {} {} {:?} {place:?} {body:?}",
            object.id, object.model, object.role
        );
    }
    digest_of(&text).chars().take(SCENE_LETTERS).collect()
}

/// Name of a property of an action of a test: `Pick Place/2 Place: ObjectReleased`.
pub(super) fn case_name(run: &RunDetail, action: &ActionDetail, property: &str) -> String {
    format!(
        "{}/{} {}: {}",
        run.row.test,
        action.step,
        names::local(&action.action),
        names::local(property)
    )
}

/// Numbers the runs of each scene in the order of the calls, to distinguish repetitions.
#[derive(Debug, Clone, Default)]
pub struct Repetitions {
    seen: BTreeMap<String, u64>,
}

impl Repetitions {
    /// Creates an empty counter.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the number of a run among the runs of its scene, from 1.
    pub fn number(&mut self, run: &RunDetail) -> u64 {
        let seen = self.seen.entry(scene(run)).or_default();
        *seen += 1;
        *seen
    }
}
