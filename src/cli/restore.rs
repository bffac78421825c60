//! Simulates runs again whose motion is not kept, when a command needs it.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::{clock, output, trust};
use actcheck_base::Diagnostics;
use actcheck_campaign::{RunContext, restorer};
use actcheck_history::{History, RunRow};

/// Whether a note has said that runs are simulated again.
static IS_NOTED: AtomicBool = AtomicBool::new(false);

/// Lets a history simulate runs again. The first time, a note says so. Programs that this starts
/// need consent (`is_trusted`): without it, a warning names them, and the motion is missing.
pub fn allow(history: &History, is_trusted: bool) {
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let may_run =
        move |campaign: &str, starts: &_| is_trusted || trust::starts_none(campaign, starts);
    history.restore_with(restorer(context, Box::new(may_run), move |run| {
        if !IS_NOTED.swap(true, Ordering::Relaxed) {
            note(format!(
                "the motion of run {run} is not kept: it is simulated again"
            ));
        }
    }));
}

/// Prints the cost of simulating the runs whose motion is not kept, if there are many.
///
/// # Errors
/// The history can't be read.
pub fn announce(history: &History, runs: &[RunRow], jobs: usize) -> Result<(), Diagnostics> {
    let (runs, secs) = history.cost_of_motion(runs)?;
    if runs > 1 {
        IS_NOTED.store(true, Ordering::Relaxed);
        let secs = secs / jobs.max(1) as f64;
        let time = if secs < 100.0 {
            format!("{secs:.0} s")
        } else {
            format!("{:.0} min", secs / 60.0)
        };
        note(format!(
            "the motion of {runs} runs is not kept: they are simulated again, which takes about {time}"
        ));
    }
    Ok(())
}

fn note(message: String) {
    output::print_error_text(&format!("{message}\n"));
}
