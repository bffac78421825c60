//! Who performs actions instead of the reference skills.

use crate::actions::operator::{Interrupt, Operator};
use crate::actions::{ActionCall, ActionReport};
use crate::world::World;

/// Performs actions that somebody else wrote the skill of.
pub trait Outside {
    /// A run begins in this world. Of the world nobody outside is told more than a robot knows of itself.
    ///
    /// # Errors
    /// The run can't be performed: its first action ends for this reason.
    fn begin_run(&mut self, world: &World) -> Result<(), OutsideFault>;

    /// Whether it performs the action, once a run has begun.
    fn performs(&self, action: &str) -> bool;

    /// Performs an action by commands and observations.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end: what is outside may be the cause.
    fn perform(&mut self, call: &ActionCall, robot: &mut Operator<'_>) -> Result<ActionReport, Interrupt>;
}

/// What went wrong outside.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct OutsideFault {
    /// Whether it did not answer in time; otherwise it did something wrong.
    pub late: bool,
    /// For people.
    pub reason: String,
}
