//! The part of a user's program in a run: its output, its commands, and its questions.

use serde::{Deserialize, Serialize};

/// The record of a user's program in one run. Of too many entries, the first and the last are kept.
///
/// Its times are simulated, so that it is the same whatever the number of workers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SkillLog {
    /// In the order of their times.
    pub entries: Vec<SkillEntry>,
    /// Number of printed lines that were left out after the first ones.
    pub lines_left_out: u64,
    /// Number of other entries that were left out after the first ones.
    pub others_left_out: u64,
}

impl SkillLog {
    /// Whether nothing is in it.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The lines that the program printed, standard output and errors in their order.
    pub fn lines(&self) -> impl Iterator<Item = (f64, &str)> {
        self.entries.iter().filter_map(|entry| match &entry.deed {
            SkillDeed::Printed(line) => Some((entry.time_secs, line.as_str())),
            _ => None,
        })
    }
}

/// Something that a program did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SkillEntry {
    /// Simulated time since the scene was built. Unit: seconds.
    pub time_secs: f64,
    /// The deed.
    pub deed: SkillDeed,
}

/// Kinds of [`SkillEntry`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum SkillDeed {
    /// It printed a line, to standard output or errors.
    Printed(String),
    /// It sent commands.
    Commanded(CommandStretch),
    /// It asked for perception.
    Asked(AnsweredQuestion),
}

/// Commands in a row with targets for the same joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommandStretch {
    /// When the last command had been carried out, as simulated time since the scene was built.
    /// Unit: seconds.
    pub end_secs: f64,
    /// Number of commands.
    pub commands: u32,
    /// Targets of the last command, in the order of joints; empty if it only let time pass.
    pub targets: Vec<CommandTarget>,
}

/// One target of a command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommandTarget {
    /// The target's quantity.
    pub kind: TargetKind,
    /// Name of the joint; empty for the base and the gripper.
    pub joint: String,
    /// Units: those of the kind.
    pub value: f32,
}

/// Quantities that a program can set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TargetKind {
    /// Position of a joint. Unit: metres or radians.
    Position,
    /// Velocity of a joint. Unit: m/s or rad/s.
    Velocity,
    /// Effort of a joint. Unit: newtons or newton metres.
    Effort,
    /// Velocity of the base forwards. Unit: m/s.
    Forwards,
    /// Velocity of the base to the left. Unit: m/s.
    Left,
    /// Velocity of the base's heading. Unit: rad/s.
    Turning,
    /// Gap between the fingers. Unit: metres.
    Opening,
    /// Largest force of a finger. Unit: newtons.
    Force,
}

impl TargetKind {
    /// The word for the kind.
    pub fn word(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Effort => "effort",
            Self::Forwards => "forwards",
            Self::Left => "left",
            Self::Turning => "turning",
            Self::Opening => "opening",
            Self::Force => "force",
        }
    }
}

/// A question and the size of its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnsweredQuestion {
    /// The kind of data: `depth`, `cloud` or `objects`.
    pub what: String,
    /// Id of the object that it asked for; `None` for all.
    pub of: Option<String>,
    /// Number of pixels, points, or objects of the answer.
    pub count: u64,
    /// Size of the answer's binary data. Unit: bytes.
    pub bytes: u64,
    /// The first objects of the answer.
    pub objects: Vec<AnsweredObject>,
}

/// An object of an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnsweredObject {
    /// Its id.
    pub id: String,
    /// Position of its foot. Unit: metres. Frame: world, by the robot's belief.
    pub position_m: [f32; 3],
}
