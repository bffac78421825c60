//! The reasons why a scene gives no run.

use actcheck_verdict::Interrupted;

/// The reason why a scene gave no run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The scene could not be generated or did not settle; another one may.
    #[error("{0}")]
    Discard(String),
    /// The robot overlaps something at the start.
    #[error("{0}")]
    Overlap(String),
    /// The run was interrupted while rules were evaluated.
    #[error("interrupted")]
    Interrupted,
}

impl From<Interrupted> for Failure {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}
