//! Lets a new scene come to rest.

use crate::bodies::Bodies;
use crate::object::Object;
use actcheck_geometry::from_vector;

/// Time limit. Unit: seconds. Objects fall a few millimetres; a rolling object is detected within
/// this time.
pub(super) const MOST_SECS: f64 = 3.0;
/// Speed below which a body is at rest. Unit: m/s. The angular limit in rad/s is ten times this.
const REST_SPEED: f64 = 0.01;
/// Time for which all objects must be at rest. Unit: seconds.
pub(super) const REST_SECS: f64 = 0.25;
/// Distance from its initial position beyond which an object has left its place. Unit: metres.
const LEFT_M: f64 = 0.05;

/// The result of settling a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Settling {
    /// Whether everything came to rest in its place.
    pub settled: bool,
    /// Simulated time taken. Unit: seconds.
    pub secs: f64,
    /// Ids of objects that were still moving at the time limit.
    pub unsettled: Vec<String>,
    /// Ids of objects that left the place where the scene put them.
    pub left: Vec<String>,
}

impl Settling {
    /// Returns the result for these bodies, which took so long, and whose simulation may have a
    /// fault.
    pub(super) fn of(bodies: &Bodies, secs: f64, has_fault: bool) -> Self {
        let unsettled = moving(bodies);
        let left = left(bodies);
        Self {
            settled: unsettled.is_empty() && left.is_empty() && !has_fault,
            secs,
            unsettled,
            left,
        }
    }
}

/// Returns the ids of the objects that are not at rest.
pub(super) fn moving(bodies: &Bodies) -> Vec<String> {
    let moves = |object: &&Object| {
        bodies.physics.bodies.get(object.body).is_some_and(|body| {
            !body.is_sleeping()
                && (from_vector(body.linvel()).norm() > REST_SPEED
                    || from_vector(body.angvel()).norm() > 10.0 * REST_SPEED)
        })
    };
    bodies
        .objects
        .iter()
        .filter(|o| !o.fixed)
        .filter(moves)
        .map(|o| o.id.clone())
        .collect()
}

/// Returns the ids of the objects that are not in their places.
fn left(bodies: &Bodies) -> Vec<String> {
    let gone = |object: &&Object| {
        // A part hangs or falls shut by itself.
        if let Some(off_m) = bodies.off_its_joint_m(object) {
            return off_m.is_nan() || off_m > LEFT_M;
        }
        let way =
            (bodies.pose_of(object).translation.vector - object.placed.translation.vector).norm();
        way.is_nan() || way > LEFT_M
    };
    bodies
        .objects
        .iter()
        .filter(gone)
        .map(|o| o.id.clone())
        .collect()
}
