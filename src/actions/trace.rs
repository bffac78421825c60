//! What happened while the actions were performed, as plain data.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::base::Pose;
use crate::scenario::{Part, SceneMap};
use crate::world::{RobotCourse, Snapshot};

/// A whole run as it was observed by simulation.
///
/// `snapshots` has one more element than `actions` has performed ones: the state after one action is the
/// state before the next, and it is kept once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// States between the actions.
    pub snapshots: Vec<Snapshot>,
    /// The actions, in order. Those that were never reached are here too.
    pub actions: Vec<ActionTrace>,
    /// The course of all bodies, for replay and pictures.
    pub frames: Frames,
    /// Digest over the bits of every state at every control tick.
    pub hash: String,
    /// The names of the world's places.
    pub map: SceneMap,
    /// What objects and links look like, for pictures. Empty in traces of earlier versions.
    pub forms: Vec<Form>,
    /// What the robot went through, one for each action that was performed. Empty in traces of earlier versions.
    pub robot_courses: Vec<RobotCourse>,
}

/// What a body looks like: enough for an outline. Pieces of meshes are reduced to their outermost points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Form {
    /// Id of the object, or `robot/LINK`.
    pub name: String,
    /// Convex solids and tubes. Frame: the body's.
    pub parts: Vec<Part>,
}

/// One action as it was performed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActionTrace {
    /// Name of the action, as the test lists it (`Pick`).
    pub action: String,
    /// Values of the designators in force.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// How it ended.
    pub end: ActionEnd,
    /// What the action itself reported, if it came to that.
    pub report: Option<ActionReport>,
    /// Simulated time that it took. Unit: seconds.
    pub duration_secs: f64,
    /// Contacts that began, went on or ended meanwhile.
    pub contacts: Vec<ContactEpisode>,
    /// What perception returned, in order.
    pub percepts: Vec<Percept>,
    /// What was made of the camera's pictures, if any were taken.
    pub perceived: Option<Perceived>,
    /// Extremes along the way, one for each body of the scene, in scene order.
    pub extremes: Vec<Extremes>,
    /// Smallest and largest true x and y of the base along the way; nothing where it stands for good. Unit: metres.
    pub base: Option<[[f64; 2]; 2]>,
    /// Phases of the action with their start times, for the timeline.
    pub phases: Vec<Phase>,
}

impl ActionTrace {
    /// An action of which nothing happened.
    pub fn not_reached(action: &str, parameters: &BTreeMap<String, Vec<String>>) -> Self {
        Self {
            action: action.to_owned(),
            parameters: parameters.clone(),
            end: ActionEnd::NotReached,
            report: None,
            duration_secs: 0.0,
            contacts: Vec::new(),
            percepts: Vec::new(),
            perceived: None,
            extremes: Vec::new(),
            base: None,
            phases: Vec::new(),
        }
    }
}

/// How an action ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum ActionEnd {
    /// By its own report.
    Completed,
    /// By a fault of simulation or tool; the reason is for people.
    Broken(String),
    /// By its budget; the text names it.
    Timeout(String),
    /// An earlier action ended the run.
    NotReached,
    /// By the clock on the wall, which cut the run off: a timeout that says nothing of the robot.
    Cut(String),
}

/// What an action says of itself. It can be wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActionReport {
    /// Whether it believes that it succeeded.
    pub succeeded: bool,
    /// Why, in words.
    pub message: String,
}

/// One uninterrupted contact of two things.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ContactEpisode {
    /// The pair, sorted: ids of objects, `robot/LINK`, or `floor`.
    pub pair: [String; 2],
    /// Since the action began. Unit: seconds.
    pub start_secs: f64,
    /// Since the action began. Unit: seconds.
    pub end_secs: f64,
    /// Largest normal force. Unit: newtons.
    pub max_force_n: f64,
}

/// One object as perception saw it. Frame: world, by the base's belief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Percept {
    /// Which object was asked for, or the detection's own name.
    pub id: String,
    /// Seen pose of the object's foot.
    pub pose: Pose,
    /// Seen dimensions. Unit: metres.
    pub size_m: [f64; 3],
}

/// What the robot made of its pictures. Frame: world, by the base's belief.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Perceived {
    /// The surface, if one was found.
    pub plane: Option<PerceivedPlane>,
    /// What seems to stand on it, in no order that means anything.
    pub things: Vec<PerceivedThing>,
}

/// A level surface as it was perceived.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PerceivedPlane {
    /// Pose of its middle: z is its upper side's direction, x goes along its first side.
    pub pose: Pose,
    /// Lengths of its sides. Unit: metres.
    pub size_m: [f64; 2],
}

/// Something on a surface as it was perceived.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PerceivedThing {
    /// What it seems to be: a class of the ontology, an IRI. Nothing where no known kind is of its size.
    pub category: Option<String>,
    /// Upright pose of its foot's middle.
    pub pose: Pose,
    /// Dimensions along the axes of that pose; hidden sides as long as those of its kind. Unit: metres.
    pub size_m: [f64; 3],
}

/// What a body went through during one action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Id of the body.
    pub id: String,
    /// Largest angle from the vertical. Unit: radians.
    pub max_tilt_rad: f64,
    /// Largest speed of its origin. Unit: m/s.
    pub max_speed: f64,
    /// Largest height that its origin rose above where it was before. Unit: metres.
    pub max_rise_m: f64,
    /// Largest distance of its origin from where it was before. Unit: metres.
    pub max_displacement_m: f64,
}

/// A named part of an action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Such as `approach`.
    pub name: String,
    /// Since the action began. Unit: seconds.
    pub start_secs: f64,
}

/// Poses of everything that moves, sampled at a steady rate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// Time between two frames. Unit: seconds.
    pub period_secs: f64,
    /// What has a track: ids of objects that can move, then `robot/LINK`.
    pub names: Vec<String>,
    /// One row a frame: for each name x, y, z (metres) and qx, qy, qz, qw. Shape: frames × (7 · names).
    pub rows: Vec<Vec<f32>>,
}
