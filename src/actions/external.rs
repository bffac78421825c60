//! External skills that replace the reference skills.

use crate::ActionCall;
use crate::operator::{Interrupt, Operator};
use actcheck_data::ActionReport;
use actcheck_world::World;

/// Performs actions with a skill that is not part of actcheck.
pub trait ExternalSkill {
    /// Begins a run in this world. The external skill learns no more about the world than a robot
    /// knows about itself.
    ///
    /// # Errors
    /// Returns an error if the run can't be performed; its first action then ends for this reason.
    fn begin_run(&mut self, world: &World) -> Result<(), ExternalFault>;

    /// Whether it performs the action. Valid once a run has begun.
    fn performs(&self, action: &str) -> bool;

    /// Performs an action through commands and observations.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end, possibly because of the external skill.
    fn perform(
        &mut self,
        call: &ActionCall,
        robot: &mut Operator<'_>,
    ) -> Result<ActionReport, Interrupt>;

    /// Ends the run: checks that the skill is ready for another one, so that its faults after the
    /// last action belong to this run. With `is_decided`, the run already broke or timed out, and
    /// such a fault is not reported.
    ///
    /// # Errors
    /// Returns an error if the skill is not ready.
    fn end_run(&mut self, is_decided: bool) -> Result<(), ExternalFault>;
}

/// A fault of an external skill.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct ExternalFault {
    /// Whether it failed to answer in time; otherwise it did something wrong.
    pub late: bool,
    /// The reason, for people.
    pub reason: String,
}
