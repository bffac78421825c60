//! Errors of building a simulation.

use actcheck_base::Diagnostic;

/// A scene or a robot that can't be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The URDF can't be used.
    #[error("{name} is not a usable URDF: {reason}")]
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
    #[error("{name}: {what}")]
    Gripper {
        /// The URDF's path.
        name: String,
        /// The message.
        what: String,
    },
    /// No joint carries the gripper.
    #[error("{name}: no joint carries its gripper: it is a hand without an arm")]
    Armless {
        /// The URDF's path.
        name: String,
    },
    /// The scene has an invalid physics setting.
    #[error("{what}")]
    Scene {
        /// The message.
        what: String,
    },
}

impl WorldError {
    /// Converts the error to a diagnostic for the user.
    pub fn diagnostic(&self) -> Diagnostic {
        match self {
            Self::Urdf { .. } => Diagnostic::error("W020", self.to_string())
                .help("the profile's `urdf` must name a URDF file with one tree of links"),
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
            Self::Scene { .. } => {
                Diagnostic::error("W023", self.to_string()).help("see `[physics]` in the configuration")
            }
        }
    }
}
