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
            Self::Scene { .. } => {
                Diagnostic::error("W023", self.to_string()).help("see `[physics]` in the configuration")
            }
        }
    }
}
