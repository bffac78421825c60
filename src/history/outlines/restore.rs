//! The motion of runs that have only an outline.

use crate::History;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::{Choice, Trace};

/// Simulates a run (by its id) again from its recorded choices, and returns these with its trace.
pub type Restore = dyn Fn(&History, &str) -> Result<(Vec<Choice>, Trace), Diagnostics> + Send + Sync;

impl History {
    /// Sets the function that makes the motion of runs that have only an outline. Without one, such motion can't be
    /// read. Only the first call has an effect.
    pub fn restore_with(&self, restore: Box<Restore>) {
        // A second function would do the same.
        let _ = self.restore.set(restore);
    }

    /// Simulates a run that has only an outline, and returns its choices and its whole trace.
    ///
    /// # Errors
    /// `H031` it can't be simulated again, or the result differs from the recorded one.
    pub(crate) fn restored(&self, run: &str) -> Result<(Vec<Choice>, Trace), Diagnostics> {
        let Some(restore) = self.restore.get() else {
            return Err(unrestored(run, "this command does not simulate runs"));
        };
        let (choices, trace) = restore(self, run)?;
        let recorded = self.outlined_states(run)?.map(|(_, trace)| trace.hash).unwrap_or_default();
        if trace.hash != recorded {
            let why = format!("its states have the digest {}, not {recorded}", trace.hash);
            return Err(unrestored(run, &why));
        }
        Ok((choices, trace))
    }
}

fn unrestored(run: &str, why: &str) -> Diagnostics {
    Diagnostic::error("H031", format!("the motion of run {run} can't be simulated again: {why}"))
        .help("`actcheck replay` names the inputs that have changed since; its outcomes and states are intact")
        .into()
}
