//! A recorded episode, as plain data.

use std::collections::BTreeMap;

use actcheck_data::{Part, Pose};

use crate::Lacks;

/// One recorded episode: the bodies and joints, and their states over time.
///
/// Frame: world, z up. Units: SI, radians.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Episode {
    /// Its origin: engine, versions, environment, task, source, notes. Keys are those of the
    /// metadata `actcheck.episode` of a file.
    pub about: BTreeMap<String, String>,
    /// The bodies and joints.
    pub model: Model,
    /// The states in order of time; the first is the state before anybody acts.
    pub states: Vec<State>,
    /// Begins and ends of actions, in order of time.
    pub marks: Vec<Mark>,
    /// The quantities that were not recorded.
    pub lacks: Lacks,
}

/// The bodies and joints that the states are about.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Model {
    /// All bodies; the first is the world itself.
    pub bodies: Vec<Body>,
    /// All joints.
    pub joints: Vec<Joint>,
    /// Names of the actuators.
    pub actuators: Vec<String>,
    /// Named points on bodies.
    pub sites: Vec<Site>,
}

/// A rigid body.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Body {
    /// Name in its model.
    pub name: String,
    /// Index of the body that carries it; `None` for the world.
    pub parent: Option<usize>,
    /// Whether it or a body that carries it has a joint.
    pub moves: bool,
    /// Unit: kilograms. `None` if unknown.
    pub mass_kg: Option<f64>,
    /// Its shapes. Frame: the body's.
    pub shapes: Vec<Shape>,
}

/// A shape of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Pose and geometry; `None` for a plane, which is part of the floor.
    pub part: Option<Part>,
    /// Whether it can touch other bodies.
    pub collides: bool,
    /// Sliding friction coefficient. `None` if unknown.
    pub friction: Option<f64>,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// About an axis.
    Hinge,
    /// Along an axis.
    Slide,
    /// About any axis.
    Ball,
    /// Freely: the body is carried by nothing.
    Free,
}

/// A joint, which moves a body relative to its parent.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name in its model.
    pub name: String,
    /// Index of the body that it moves.
    pub body: usize,
    /// How it moves.
    pub kind: JointKind,
    /// Lower and upper limit of its position; `None` if it has none, or they are unknown.
    pub limits: Option<[f64; 2]>,
    /// Largest force or torque. `None` if unknown.
    pub max_effort: Option<f64>,
    /// Largest velocity. `None` if unknown.
    pub max_velocity: Option<f64>,
}

impl Joint {
    /// Whether it has one position, which states list.
    pub fn is_scalar(&self) -> bool {
        matches!(self.kind, JointKind::Hinge | JointKind::Slide)
    }
}

/// A named point on a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// Name in its model.
    pub name: String,
    /// Index of its body.
    pub body: usize,
    /// Frame: the body's.
    pub pose: Pose,
}

/// The state at one moment.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Time since the first state. Unit: seconds.
    pub time_secs: f64,
    /// One pose for each body of the model.
    pub poses: Vec<Pose>,
    /// Linear and angular velocity of the origin of each body of the model; empty if they were not
    /// recorded. Units: m/s, rad/s.
    pub velocities: Vec<[[f64; 3]; 2]>,
    /// Positions of the scalar joints, in the model's order; empty if they were not recorded.
    pub positions: Vec<f64>,
    /// Their velocities; empty if they were not recorded.
    pub speeds: Vec<f64>,
    /// Their forces or torques; empty if they were not recorded.
    pub efforts: Vec<f64>,
    /// The contacts.
    pub contacts: Vec<Contact>,
    /// The environment's own view; `None` if it was not recorded.
    pub outcome: Option<Outcome>,
}

/// One contact point of two bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Indices of the bodies.
    pub bodies: [usize; 2],
    /// Unit: newtons.
    pub normal_n: f64,
    /// Force on the second body by the first. Unit: newtons. Frame: world.
    pub force_n: [f64; 3],
    /// Unit: metres. Frame: world.
    pub point_m: [f64; 3],
    /// Distance of the surfaces; negative if they penetrate each other. Unit: metres.
    pub distance_m: f64,
}

/// The environment's own verdict on a state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Outcome {
    /// Its reward.
    pub reward: f64,
    /// Whether its task succeeded; `None` if it does not say.
    pub success: Option<bool>,
    /// Whether it ended the episode.
    pub terminated: bool,
    /// Whether a limit of time ended the episode.
    pub truncated: bool,
}

/// The begin or the end of an action, as the recording program marked it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Time since the first state. Unit: seconds.
    pub time_secs: f64,
    /// Name of the action, such as `Pick`.
    pub action: String,
    /// Whether the action begins; otherwise it ends.
    pub begins: bool,
    /// Values of the designators, given where it begins.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// The action's own report, given where it ends.
    pub reported: Option<bool>,
    /// The report's words.
    pub message: String,
}
