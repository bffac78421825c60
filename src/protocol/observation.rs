//! The robot's measurements of itself, as sent to programs.

use serde::Serialize;

use crate::message::{Truth, WireObject, WirePose};
use actcheck_actions::Operator;
use actcheck_world::Observation;

/// An observation. Joints are in the order of the introduction.
#[derive(Debug, Serialize)]
pub struct Observed<'a> {
    time_s: f64,
    joints: JointStates<'a>,
    base: Base,
    gripper: Gripper,
    budget_left_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<Truth>,
}

#[derive(Debug, Serialize)]
struct JointStates<'a> {
    positions: &'a [f64],
    velocities: &'a [f64],
    efforts: &'a [f64],
}

#[derive(Debug, Serialize)]
struct Base {
    position_m: [f64; 2],
    heading_rad: f64,
    height_m: f64,
}

#[derive(Debug, Serialize)]
struct Gripper {
    opening_m: f64,
    force_n: f64,
}

/// An observation as a separate message.
#[derive(Debug, Serialize)]
pub struct ObservationMessage<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    #[serde(flatten)]
    observed: Observed<'a>,
}

impl<'a> Observed<'a> {
    /// The robot's measurements, with ground truth for privileged programs.
    pub fn of(robot: &Operator<'_>, measured: &'a Observation, privileged: bool) -> Self {
        let positions = &measured.positions;
        let (position_m, heading_rad) = match robot.layout().base {
            // Headings are not wrapped.
            Some([x, y, heading]) => ([positions[x], positions[y]], positions[heading]),
            None => {
                let root = actcheck_data::Pose::from_isometry(&robot.base_of(positions));
                ([root.position[0], root.position[1]], root.yaw())
            }
        };
        let height_m = robot.base_of(positions).translation.vector.z;
        let [left, right] = measured.finger_efforts_n;
        Self {
            time_s: robot.elapsed_secs(),
            joints: JointStates {
                positions,
                velocities: &measured.velocities,
                efforts: &measured.loads,
            },
            base: Base {
                position_m,
                heading_rad,
                height_m,
            },
            gripper: Gripper {
                opening_m: measured.gripper_opening_m,
                force_n: left.min(right),
            },
            budget_left_s: robot.budget_left_secs(),
            truth: privileged.then(|| truth(robot)),
        }
    }

    /// Converts the observation to a message.
    pub fn message(self) -> ObservationMessage<'a> {
        ObservationMessage {
            kind: "observation",
            observed: self,
        }
    }
}

fn truth(robot: &Operator<'_>) -> Truth {
    let objects = robot.truth().into_iter().map(|thing| WireObject {
        category: robot.kind_of(&thing.id).map(|kind| kind.category),
        id: thing.id,
        pose: WirePose::of(&thing.pose),
        size_m: thing.size_m,
        furniture: thing.furniture,
    });
    Truth {
        objects: objects.collect(),
    }
}
