//! The live progress of a campaign. Hidden if the error stream is not a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use actcheck_report::RunSummary;

/// A bar on the error stream: runs done, rate, time left, failures so far.
pub struct Progress {
    bar: ProgressBar,
    failed: u64,
    spoilt: u64,
}

impl Progress {
    /// Creates a bar for a number of runs. With a time budget, it shows the elapsed time instead of the remaining runs.
    pub fn new(runs: u64, time_secs: Option<f64>) -> Self {
        let bar = ProgressBar::with_draw_target(Some(runs), ProgressDrawTarget::stderr());
        let template = match time_secs {
            None => "{bar:32} {pos}/{len} runs  {per_sec}  {eta} left  {msg}".to_owned(),
            Some(secs) => format!("{{pos}} runs  {{per_sec}}  {{elapsed}} of {secs:.0}s  {{msg}}"),
        };
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        bar.set_message("0 failed");
        bar.enable_steady_tick(std::time::Duration::from_millis(200));
        Self { bar, failed: 0, spoilt: 0 }
    }

    /// Returns a handle for printing above the bar.
    pub fn bar(&self) -> ProgressBar {
        self.bar.clone()
    }

    /// Counts one more stored run.
    pub fn run(&mut self, run: &RunSummary) {
        self.failed += u64::from(run.failed());
        self.spoilt += u64::from(run.reason.is_some());
        let spoilt = if self.spoilt > 0 { format!(", {} did not complete", self.spoilt) } else { String::new() };
        self.bar.set_message(format!("{} failed{spoilt}", self.failed));
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
