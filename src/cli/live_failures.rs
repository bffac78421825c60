//! The failures of a campaign, printed when they happen.

use crate::terminal;
use actcheck_base::ShellLine;
use actcheck_campaign::Env;
use actcheck_report::{FailureLines, Page, RunSummary};

/// Writes the text about each failed run, in the order in which runs are stored: that of their ids,
/// whatever the number of workers.
pub(super) struct LiveFailures<'a> {
    env: &'a Env,
    /// The history, as commands name it.
    history: String,
    program: String,
    page: Page,
    any: bool,
}

impl<'a> LiveFailures<'a> {
    pub(super) fn new(env: &'a Env) -> Self {
        Self {
            env,
            history: env.campaign.history.display().to_string(),
            program: super::run::program(),
            page: terminal::of_errors(),
            any: false,
        }
    }

    /// Whether a failure was printed.
    pub(super) fn any(&self) -> bool {
        self.any
    }

    /// The text about a run. Returns `None` if it did not fail.
    pub(super) fn text(&mut self, run: &RunSummary) -> Option<String> {
        if !(run.failed() || run.reason.is_some()) {
            return None;
        }
        self.any = true;
        let name = |iri: &str| {
            self.env
                .ontology
                .properties
                .get(iri)
                .map_or_else(|| iri.to_owned(), |p| p.name.clone())
        };
        let show = ShellLine::new(&self.program)
            .fixed("show")
            .word(&run.id)
            .option("--history", &self.history);
        let lines = FailureLines {
            run,
            show: &show,
            name: &name,
        };
        Some(lines.text(self.page))
    }
}
