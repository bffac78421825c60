//! Lets a new scene come to rest.

use crate::World;
use actcheck_geometry::from_vector;

/// Time limit. Unit: seconds. Objects fall a few millimetres; a rolling object is detected within
/// this time.
const MOST_SECS: f64 = 3.0;
/// Speed below which a body is at rest. Unit: m/s. The angular limit in rad/s is ten times this.
const REST_SPEED: f64 = 0.01;
/// Time for which all objects must be at rest. Unit: seconds.
const REST_SECS: f64 = 0.25;
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

impl World {
    /// Steps the simulation, with the robot holding its posture, until every object is at rest or
    /// time is up.
    pub fn settle(&mut self) -> Settling {
        let start = self.time_secs();
        let mut rests_since = start;
        while self.time_secs() - start < MOST_SECS && self.fault().is_none() {
            self.tick();
            if !self.moving().is_empty() {
                rests_since = self.time_secs();
            }
            if self.time_secs() - rests_since >= REST_SECS {
                break;
            }
        }
        let unsettled = self.moving();
        let left = self.left();
        let settled = unsettled.is_empty() && left.is_empty() && self.fault().is_none();
        Settling {
            settled,
            secs: self.time_secs() - start,
            unsettled,
            left,
        }
    }

    fn moving(&self) -> Vec<String> {
        let moves = |object: &&super::object::Object| {
            self.engine.bodies.get(object.body).is_some_and(|body| {
                !body.is_sleeping()
                    && (from_vector(body.linvel()).norm() > REST_SPEED
                        || from_vector(body.angvel()).norm() > 10.0 * REST_SPEED)
            })
        };
        self.objects
            .iter()
            .filter(|o| !o.fixed)
            .filter(moves)
            .map(|o| o.id.clone())
            .collect()
    }

    fn left(&self) -> Vec<String> {
        let gone = |object: &&super::object::Object| {
            // A part hangs or falls shut by itself.
            if let Some(off_m) = self.off_its_joint_m(object) {
                return off_m.is_nan() || off_m > LEFT_M;
            }
            let way =
                (self.pose_of(object).translation.vector - object.placed.translation.vector).norm();
            way.is_nan() || way > LEFT_M
        };
        self.objects
            .iter()
            .filter(gone)
            .map(|o| o.id.clone())
            .collect()
    }
}
