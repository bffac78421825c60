//! The motion of runs whose motion is not kept.

use crate::History;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::{Choice, Trace};

/// Simulates a run (by its id) again from its recorded choices, and returns these with its trace.
/// `None`: this would start a program without consent.
pub type Restore =
    dyn Fn(&History, &str) -> Result<Option<(Vec<Choice>, Trace)>, Diagnostics> + Send + Sync;

impl History {
    /// Sets the function that makes the motion of runs whose motion is not kept. Without one, it
    /// can't be read. Only the first call has an effect.
    pub fn restore_with(&self, restore: Box<Restore>) {
        // A second function would do the same.
        let _ = self.restore.set(restore);
    }

    /// Simulates a run whose motion is not kept, and returns its choices and its whole trace.
    /// `None`: this would start a program without consent.
    ///
    /// # Errors
    /// `H031` it can't be simulated again, or the result differs from the recorded one.
    pub(crate) fn restored(&self, run: &str) -> Result<Option<(Vec<Choice>, Trace)>, Diagnostics> {
        let Some(restore) = self.restore.get() else {
            return Err(unrestored(run, "this command does not simulate runs"));
        };
        let Some((choices, trace)) = restore(self, run)? else {
            return Ok(None);
        };
        let recorded = self
            .stored
            .with_run(run, |_, run| Ok(run.row.trace_hash()))?;
        let recorded = recorded.unwrap_or_default();
        if trace.hash != recorded {
            let why = format!("its states have the digest {}, not {recorded}", trace.hash);
            return Err(unrestored(run, &why));
        }
        Ok(Some((choices, trace)))
    }
}

/// H031: a program would be started.
pub(crate) fn withheld(run: &str) -> Diagnostics {
    Diagnostic::error(
        "H031",
        format!("the motion of run {run} is not kept, and simulating it again starts a program"),
    )
    .help(
        "read the program, then give the same command with `--trust`; outcomes and states are kept",
    )
    .into()
}

fn unrestored(run: &str, why: &str) -> Diagnostics {
    Diagnostic::error("H031", format!("the motion of run {run} can't be simulated again: {why}"))
        .help("`actcheck replay` names the inputs that have changed since; its outcomes and states are intact")
        .into()
}
