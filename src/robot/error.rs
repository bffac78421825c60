//! Faults of a robot's file or profile.

use actcheck_base::Diagnostic;

/// A robot that can't be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RobotError {
    /// The URDF can't be used.
    #[error("{name} is not a usable robot: {reason}")]
    Urdf {
        /// The URDF's path.
        name: String,
        /// The reason.
        reason: String,
    },
    /// The profile or the URDF refers to a missing joint or link.
    #[error("{name} has no {kind} `{missing}`")]
    Missing {
        /// The URDF's path.
        name: String,
        /// `joint` or `link`.
        kind: &'static str,
        /// The missing name.
        missing: String,
        /// Nearest names.
        help: String,
    },
    /// The URDF has an element that the simulation does not support.
    #[error("{name}: {what} is not supported")]
    Unsupported {
        /// The URDF's path.
        name: String,
        /// The element.
        what: String,
    },
    /// The gripper's opening can't be measured.
    #[error("{name}: {fault}")]
    Gripper {
        /// The URDF's path.
        name: String,
        /// The reason.
        fault: GripperFault,
    },
    /// No joint carries the gripper.
    #[error("{name}: no joint carries its gripper: it is a hand without an arm")]
    Armless {
        /// The URDF's path.
        name: String,
    },
}

/// Why a gripper is not found, can't be measured or does not fit its profile.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GripperFault {
    /// The surfaces of the fingers come no closer to each other.
    #[error(
        "the opening of its gripper can't be measured: no two surfaces of `finger_links` that face each other at \
         the grasp frame come closer"
    )]
    NoTravel,
    /// The grasp frame moves with the fingers.
    #[error("its fingers can't be measured: the joints in `finger_joints` move the `grasp_link`")]
    MovesGraspLink,
    /// The joints do not move the fingers.
    #[error("none of its `finger_joints` moves one of its `finger_links`")]
    MovesNoFinger,
    /// This joint turns without end.
    #[error("the opening of its gripper can't be measured: `{0}` has no limits")]
    Unlimited(String),
    /// The profile states a larger opening than the fingers have. Unit: metres.
    #[error(
        "`max_opening_m` is {stated_m} m, but the fingers open no wider than {widest_m:.3} m at the grasp frame"
    )]
    TooNarrow {
        /// `max_opening_m` of the profile.
        stated_m: f64,
        /// The measured opening.
        widest_m: f64,
    },
    /// No name in the model is that of a part of a gripper.
    #[error(
        "no gripper was found: none of its movable joints or their links has a name with `finger`, `grip`, \
         `hand`, `jaw`, `knuckle` or `thumb`, and no link one with `suction` or `vacuum`"
    )]
    NoNames,
    /// The requested hand does not exist; the only other one is this suction cup.
    #[error("no hand has `{wanted}` in a name: there is `{cup}`")]
    UnknownHand {
        /// The requested name.
        wanted: String,
        /// The link of the cup.
        cup: String,
    },
    /// The requested hand does not exist among several.
    #[error("no hand has `{wanted}` in a name: there are `{}`", hands.join("`, `"))]
    UnknownHandOf {
        /// The requested name.
        wanted: String,
        /// The links that carry hands.
        hands: Vec<String>,
    },
    /// A joint of the fingers can't move. Unit: metres or radians.
    #[error(
        "no gripper was found: its joint `{joint}` can't move, its limits are {lower} and {upper}"
    )]
    Stiff {
        /// The joint.
        joint: String,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// The fingers, these links, touch nothing.
    #[error("no gripper was found: the links `{}` have no collision shapes", .0.join("`, `"))]
    NoShapes(Vec<String>),
    /// The links with the names of fingers do not close.
    #[error("no two links of its gripper face each other and come closer")]
    NoOpposition,
    /// No fingers were found with the work that a proposal may take.
    #[error(
        "no two links of its gripper that face each other were found before the search was cut short, because it has many \
         joints and shapes"
    )]
    CutShort,
}

impl RobotError {
    /// Converts the error to a diagnostic for the user.
    pub fn diagnostic(&self) -> Diagnostic {
        match self {
            Self::Urdf { .. } => Diagnostic::error("W020", self.to_string())
                .help("the profile's `urdf` must name a file of URDF, SDF or MJCF with one tree of links"),
            Self::Missing { help, .. } => Diagnostic::error("W021", self.to_string()).help(help.clone()),
            Self::Unsupported { .. } => Diagnostic::error("W022", self.to_string()).help(
                "use fixed, revolute, continuous or prismatic joints, and boxes, cylinders, spheres, capsules or \
                 meshes",
            ),
            Self::Gripper { .. } => Diagnostic::error("W024", self.to_string()).help(
                "name the joints that move the fingers in `finger_joints` and the links of the fingertips, left then \
                 right, in `finger_links`; the origin of `grasp_link`, moved by `grasp_offset_m`, must be between the \
                 fingertips, and its y axis, turned by `grasp_turned_rad`, must point from the right one to the left \
                 one",
            ),
            Self::Armless { .. } => Diagnostic::error("W024", self.to_string())
                .help("name a file with the arm and the hand on it, such as a xacro file that includes both"),
        }
    }
}
