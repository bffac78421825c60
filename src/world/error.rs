//! Errors of building a simulation.

use actcheck_base::Diagnostic;
use actcheck_robot::RobotError;

/// A scene or a robot that can't be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The robot can't be used.
    #[error(transparent)]
    Robot(#[from] RobotError),
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
            Self::Robot(error) => error.diagnostic(),
            Self::Scene { .. } => Diagnostic::error("W023", self.to_string())
                .help("see `[physics]` in the configuration"),
        }
    }
}
