//! Reasons why an object can't be picked.

use crate::hindrance::NoPlan;

/// Why an object can't be picked: a sentence for the action's report.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PickFault {
    /// The abstract detector does not see it.
    #[error("{0} was not seen")]
    NotSeen(String),
    /// Its model is not among the known kinds.
    #[error("{0} has no known kind")]
    UnknownKind(String),
    /// No percept is of its kind.
    #[error("no perceived object matches {0}")]
    NoMatch(String),
    /// The fingers open less than its narrowest side.
    #[error("{0} is too wide for the gripper")]
    TooWide(String),
    /// No face is as wide as the suction cup.
    #[error(
        "{id} is too small for the suction cup: its top is {narrow_cm:.1} cm across, the cup {cup_cm:.1} cm"
    )]
    TooSmall {
        /// The object.
        id: String,
        /// Narrowest width of its top. Unit: centimetres.
        narrow_cm: f64,
        /// Diameter of the cup. Unit: centimetres.
        cup_cm: f64,
    },
    /// The arm does not reach a grasp without a collision.
    #[error("{id}: {why}")]
    NoPlan {
        /// The object.
        id: String,
        /// The hindrance of the best grasp.
        why: NoPlan,
    },
}
