//! The record of a run's actions, as plain data.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Part, Pose, RobotCourse, SceneMap, SkillLog, Snapshot};

/// A whole run as recorded by the simulation.
///
/// `snapshots` has one more element than there are reached actions: the state after one action is
/// the state before the next and is stored once. An action that was not performed has the same
/// state before and after it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// States before, between and after the actions.
    pub snapshots: Vec<Snapshot>,
    /// The actions in order, including those that were not performed or never reached.
    pub actions: Vec<ActionTrace>,
    /// The motion of all bodies, for replay and pictures.
    pub frames: Frames,
    /// Digest over the bits of every state at every control tick.
    pub hash: String,
    /// The names of places in the world.
    pub map: SceneMap,
    /// Shapes of objects and links, for pictures.
    pub forms: Vec<Form>,
    /// The robot's course during each performed action.
    pub robot_courses: Vec<RobotCourse>,
    /// Names of the facts in the world vocabulary that were not recorded, sorted; empty for runs of
    /// our own simulation. Values of these in the fields above mean nothing.
    ///
    /// The local name of a property (`tilt`), or of a thing about which nothing was recorded
    /// (`gripper`); of a quantity over time, `samples/z` if no thing has it, `samples/each/z` if some
    /// thing that can move lacks it, or `samples` if none was recorded.
    pub lacks: Vec<String>,
    /// The user's program in the run; empty if the reference skills performed all actions.
    pub skill: SkillLog,
}

impl Trace {
    /// Returns the shapes of the robot's links that no joint moves, such as the pedestal of a robot
    /// without a base, with their poses in a state of the trace. They have no track.
    pub fn still_links<'a>(
        &'a self,
        state: &'a Snapshot,
    ) -> impl Iterator<Item = (&'a Form, Pose)> + 'a {
        self.linked_forms(state)
            .filter(|(form, _)| !self.frames.names.contains(&form.name))
    }

    /// Returns the shapes of all links of the robot that have one, with their poses in a state of
    /// the trace.
    pub fn linked_forms<'a>(
        &'a self,
        state: &'a Snapshot,
    ) -> impl Iterator<Item = (&'a Form, Pose)> + 'a {
        let poses: BTreeMap<&str, Pose> = state
            .robot
            .links
            .iter()
            .map(|link| (link.name.as_str(), link.pose))
            .collect();
        self.forms.iter().filter_map(move |form| {
            let link = form.name.strip_prefix("robot/")?;
            Some((form, *poses.get(link)?))
        })
    }
}

/// The shape of a body, detailed enough for an outline. Mesh pieces are reduced to their outermost
/// points.
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
    /// The action's own report, if it made one.
    pub report: Option<ActionReport>,
    /// Simulated duration. Unit: seconds.
    pub duration_secs: f64,
    /// Contacts that overlap the action in time.
    pub contacts: Vec<ContactEpisode>,
    /// The results of perception, in order.
    pub percepts: Vec<Percept>,
    /// The interpretation of the camera's pictures, if any were taken.
    pub perceived: Option<Perceived>,
    /// Extremes during the action, one for each body of the scene, in scene order.
    pub extremes: Vec<Extremes>,
    /// Smallest and largest true x and y of the base during the action; `None` for a fixed base.
    /// Unit: metres.
    pub base: Option<[[f64; 2]; 2]>,
    /// Phases of the action with their start times, for the timeline.
    pub phases: Vec<Phase>,
}

impl ActionTrace {
    /// An action that was not reached.
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
    /// The action ended with its own report.
    Completed,
    /// A fault of the simulation or the tool, with the reason.
    Broken(String),
    /// The action exceeded its budget, which the text names.
    Timeout(String),
    /// An earlier action ended the run.
    NotReached,
    /// The run exceeded its wall-clock limit: a timeout that says nothing about the robot.
    Cut(String),
    /// A precondition of the action did not hold, as the text says: the action was not performed,
    /// and the run went on.
    NotPerformed(String),
}

impl ActionEnd {
    /// Whether the action began: neither a precondition nor an earlier action kept it from that.
    pub fn was_begun(&self) -> bool {
        !matches!(self, Self::NotReached | Self::NotPerformed(_))
    }

    /// Whether later actions of the test follow.
    pub fn lets_run_go_on(&self) -> bool {
        matches!(self, Self::Completed | Self::NotPerformed(_))
    }
}

/// The action's own report. It can be wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActionReport {
    /// Whether the action believes it succeeded.
    pub succeeded: bool,
    /// The reason, in words.
    pub message: String,
}

/// One uninterrupted contact between two bodies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ContactEpisode {
    /// The pair, sorted: ids of objects, `robot/LINK`, or `floor`.
    pub pair: [String; 2],
    /// Start, since the action began. Unit: seconds.
    pub start_secs: f64,
    /// End, since the action began. Unit: seconds.
    pub end_secs: f64,
    /// Largest normal force. Unit: newtons.
    pub max_force_n: f64,
    /// Position of the contact at its largest force. Unit: metres. Frame: world.
    pub point_m: [f64; 3],
}

/// The moment at which the robot took a picture or perceived an object.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Look {
    /// Simulated time since the scene was built. Unit: seconds.
    pub time_secs: f64,
    /// True base pose: x, y, heading.
    pub base_true: [f64; 3],
    /// Believed base pose: x, y, heading.
    pub base_believed: [f64; 3],
    /// True pose of the camera.
    pub camera: Pose,
}

/// One object as perceived. Frame: world, by the base's belief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Percept {
    /// Id of the requested object, or the name given to the detection.
    pub id: String,
    /// Perceived pose of the object's foot.
    pub pose: Pose,
    /// Perceived dimensions. Unit: metres.
    pub size_m: [f64; 3],
    /// The moment of perception. `None` if a program reported it without a picture of the
    /// simulated camera.
    pub look: Option<Look>,
}

/// Perception's interpretation of the pictures. Frame: world, by the base's belief.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Perceived {
    /// The surface, if one was found.
    pub plane: Option<PerceivedPlane>,
    /// The objects perceived on it, in no particular order.
    pub things: Vec<PerceivedThing>,
    /// The moment of the last picture. `None` if the simulated camera did not take any.
    pub look: Option<Look>,
}

/// A level surface as perceived.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PerceivedPlane {
    /// Pose of its centre: z is the normal of its upper side, x runs along its first side.
    pub pose: Pose,
    /// Lengths of its sides. Unit: metres.
    pub size_m: [f64; 2],
}

/// An object on a surface, as perceived.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PerceivedThing {
    /// The recognised category: the IRI of an ontology class. `None` if no known kind has its size.
    pub category: Option<String>,
    /// Upright pose of the centre of its foot.
    pub pose: Pose,
    /// Dimensions along the axes of that pose; hidden sides get the length known for its kind.
    /// Unit: metres.
    pub size_m: [f64; 3],
}

/// Extremes of a body's motion during one action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Extremes {
    /// Id of the body.
    pub id: String,
    /// Largest angle from the vertical. Unit: radians.
    pub max_tilt_rad: f64,
    /// Largest speed of its origin. Unit: m/s.
    pub max_speed: f64,
    /// Largest rise of its origin above the initial height. Unit: metres.
    pub max_rise_m: f64,
    /// Largest distance of its origin from the initial position. Unit: metres.
    pub max_displacement_m: f64,
}

/// A named part of an action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Name of the phase, such as `approach`.
    pub name: String,
    /// Start, since the action began. Unit: seconds.
    pub start_secs: f64,
}

/// Poses of all moving bodies, sampled at a fixed rate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// Time between two frames. Unit: seconds.
    pub period_secs: f64,
    /// Bodies with a track: ids of movable objects, then `robot/LINK`.
    pub names: Vec<String>,
    /// One row per frame: for each name x, y, z (metres) and qx, qy, qz, qw. Shape: frames × (7 ·
    /// names).
    pub rows: Vec<Vec<f32>>,
}
