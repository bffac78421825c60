//! Why a scene can't be simulated.

use crate::base::Diagnostic;

/// A scene or a robot that can't be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The URDF's text is not a robot.
    #[error("{name} is no usable URDF: {reason}")]
    Urdf {
        /// The URDF's path.
        name: String,
        /// What the parser says.
        reason: String,
    },
    /// The profile or the URDF names a joint or a link that is not there.
    #[error("{name} has no {kind} `{missing}`")]
    Missing {
        /// The URDF's path.
        name: String,
        /// `joint` or `link`.
        kind: &'static str,
        /// What was named.
        missing: String,
        /// Nearest names.
        help: String,
    },
    /// A part of a URDF that simulation has no counterpart for.
    #[error("{name}: {what} is not supported")]
    Unsupported {
        /// The URDF's path.
        name: String,
        /// Which part.
        what: String,
    },
    /// A number of the scene that physics can't be stepped with.
    #[error("{what}")]
    Scene {
        /// What is wrong with it.
        what: String,
    },
}

impl WorldError {
    /// The same as a fault that a user can mend.
    pub fn diagnostic(&self) -> Diagnostic {
        match self {
            Self::Urdf { .. } => Diagnostic::error("W020", self.to_string())
                .help("the profile's `urdf` must name a URDF file with one tree of links"),
            Self::Missing { help, .. } => Diagnostic::error("W021", self.to_string()).help(help.clone()),
            Self::Unsupported { .. } => Diagnostic::error("W022", self.to_string())
                .help("use fixed, revolute, continuous and prismatic joints, and boxes, cylinders, spheres, capsules or meshes"),
            Self::Scene { .. } => {
                Diagnostic::error("W023", self.to_string()).help("see `[physics]` in the configuration")
            }
        }
    }
}
