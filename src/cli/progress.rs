//! The live progress of a campaign. Hidden if the error stream is not a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::{output, terminal};
use actcheck_report::RunSummary;

/// Narrowest terminal in which runs are drawn as a bar too. Unit: columns.
const WIDTH_OF_BAR: usize = 80;

/// A bar on the error stream: runs done, rate, time left, failures so far.
pub struct Progress {
    bar: ProgressBar,
    failed: u64,
    spoilt: u64,
}

impl Progress {
    /// Creates a bar for a number of runs. With a time budget, it shows the elapsed time instead of
    /// the remaining runs.
    pub fn new(runs: u64, time_secs: Option<f64>) -> Self {
        let bar = ProgressBar::with_draw_target(Some(runs), ProgressDrawTarget::stderr());
        let drawn = terminal::of_errors()
            .width
            .is_none_or(|width| width >= WIDTH_OF_BAR);
        let template = match time_secs {
            None if drawn => "{bar:24} {pos}/{len} runs  {rate}  {eta} left  {msg}".to_owned(),
            None => "{pos}/{len} runs  {rate}  {eta} left  {msg}".to_owned(),
            Some(secs) => format!("{{pos}} runs  {{rate}}  {{elapsed}} of {secs:.0}s  {{msg}}"),
        };
        let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // A line that can't be formatted is drawn without its rate.
            let _ = write!(out, "{:.1} runs/s", state.per_sec());
        };
        let style = ProgressStyle::with_template(&template)
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style.with_key("rate", rate));
        bar.set_message("0 failed");
        bar.enable_steady_tick(std::time::Duration::from_millis(200));
        Self {
            bar,
            failed: 0,
            spoilt: 0,
        }
    }

    /// A bar that is never drawn.
    pub fn hidden() -> Self {
        Self {
            bar: ProgressBar::hidden(),
            failed: 0,
            spoilt: 0,
        }
    }

    /// Returns a handle for printing above the bar.
    pub fn bar(&self) -> ProgressBar {
        self.bar.clone()
    }

    /// Prints a text of whole lines above the bar; if it is hidden, to the error stream.
    pub fn tell(&self, text: &str) {
        self.bar.suspend(|| output::print_error_text(text));
    }

    /// Counts one more stored run.
    pub fn run(&mut self, run: &RunSummary) {
        self.failed += u64::from(run.failed());
        self.spoilt += u64::from(run.reason.is_some());
        let spoilt = if self.spoilt > 0 {
            format!(", {} did not complete", self.spoilt)
        } else {
            String::new()
        };
        self.bar
            .set_message(format!("{} failed{spoilt}", self.failed));
        self.bar.inc(1);
    }

    /// Counts more judged runs, and shows the total number of failed outcomes.
    pub fn judged(&self, runs: u64, failed: u64) {
        self.bar.set_message(format!("{failed} failed"));
        self.bar.inc(runs);
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
