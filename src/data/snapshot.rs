//! Snapshots of the world: plain data with names instead of handles.

use serde::{Deserialize, Serialize};

use crate::Pose;

/// The true state of the world at one moment. Frame: world. Units: SI.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Simulated time since the scene was built. Unit: seconds.
    pub time_secs: f64,
    /// Every object of the scene, in scene order.
    pub bodies: Vec<BodyState>,
    /// The robot.
    pub robot: RobotState,
}

/// One object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyState {
    /// Id in the scene.
    pub id: String,
    /// Name of its model.
    pub model: String,
    /// IRI of its class.
    pub category: String,
    /// Whether it is static.
    pub fixed: bool,
    /// Pose of the model's origin.
    pub pose: Pose,
    /// Unit: m/s.
    pub linear_velocity: [f64; 3],
    /// Unit: rad/s.
    pub angular_velocity: [f64; 3],
    /// Lower corner of its axis-aligned bounding box. Unit: metres.
    pub aabb_min: [f64; 3],
    /// Upper corner of its axis-aligned bounding box. Unit: metres.
    pub aabb_max: [f64; 3],
    /// Unit: kilograms.
    pub mass_kg: f64,
    /// Sliding friction coefficient.
    pub friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Bodies in contact with it, above the minimum contact force, sorted: ids of objects, `robot`
    /// or `floor`.
    pub touches: Vec<String>,
    /// Bodies that support it against gravity, sorted: ids of objects, `robot` or `floor`.
    pub rests_on: Vec<String>,
    /// Whether physics has put it to sleep.
    pub asleep: bool,
    /// Dimensions along its own axes, in its scaled size. Unit: metres.
    pub size_m: [f64; 3],
    /// Distance from the grasp point to the surface of its shapes; negative inside. Unit: metres.
    /// `None` for static bodies.
    pub grasp_distance_m: Option<f64>,
    /// If it is a part that a joint moves: the id of the whole, and the joint's position in metres
    /// or radians.
    pub part: Option<(String, f64)>,
    /// Whether the robot flung, pushed or dropped it out of the world, where it stays.
    pub left_world: bool,
}

/// The robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// True base pose: x, y, heading.
    pub base_true: [f64; 3],
    /// Believed base pose: x, y, heading.
    pub base_believed: [f64; 3],
    /// Every actuated joint.
    pub joints: Vec<JointState>,
    /// Pose of the grasp link.
    pub gripper: Pose,
    /// Gap between the fingers. Unit: metres.
    pub gripper_opening_m: f64,
    /// Ids of objects that the left finger touches, sorted.
    pub left_touches: Vec<String>,
    /// Ids of objects that the right finger touches, sorted.
    pub right_touches: Vec<String>,
    /// Poses of all links.
    pub links: Vec<LinkState>,
    /// Its suction cup; `None` if its gripper has fingers.
    pub cup: Option<CupState>,
}

/// A suction cup.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CupState {
    /// Greatest pull that its seal holds, at the commanded vacuum. Unit: newtons.
    pub force_n: f64,
    /// Mean pull on its seal along its axis in the last control tick; negative if it is pushed, 0
    /// without a seal. Unit: newtons.
    pub pull_n: f64,
}

/// One link of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkState {
    /// Name in the URDF.
    pub name: String,
    /// Its pose.
    pub pose: Pose,
}

/// One actuated joint. Units: metres or radians, newtons or newton metres, by kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Name in the URDF.
    pub name: String,
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
    /// Lower limit of the position.
    pub lower: f64,
    /// Upper limit of the position.
    pub upper: f64,
    /// Largest velocity.
    pub max_velocity: f64,
    /// Largest force or torque.
    pub max_effort: f64,
}
