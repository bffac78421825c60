//! The reasons why a scene gives no run.

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
