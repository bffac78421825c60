//! The failures of a campaign, printed when they happen.

use crate::run_args::Verbosity;
use crate::terminal;
use actcheck_base::ShellLine;
use actcheck_campaign::Env;
use actcheck_report::{FailureLines, Page, RunSummary};

/// Number of failures that are printed, unless all are requested.
const MOST_SHOWN: u64 = 10;

/// Writes the text about each failed run, in the order in which runs are stored: that of their ids,
/// whatever the number of workers.
pub(super) struct LiveFailures<'a> {
    env: &'a Env,
    /// Id of the campaign.
    campaign: &'a str,
    /// The history, as commands name it.
    history: String,
    program: String,
    verbosity: Verbosity,
    page: Page,
    failures: u64,
    /// Whether a property failed in each of them: `list --failed` leaves out other runs.
    all_failed: bool,
}

impl<'a> LiveFailures<'a> {
    pub(super) fn new(env: &'a Env, campaign: &'a str, verbosity: Verbosity) -> Self {
        Self {
            env,
            campaign,
            history: env.campaign.history.display().to_string(),
            program: super::run::program(),
            verbosity,
            page: terminal::of_errors(),
            failures: 0,
            all_failed: true,
        }
    }

    /// Whether a failure was printed.
    pub(super) fn any(&self) -> bool {
        self.failures > 0
    }

    /// The text about a run. Returns `None` if there is nothing to print.
    pub(super) fn text(&mut self, run: &RunSummary) -> Option<String> {
        if self.verbosity == Verbosity::Quiet || !(run.failed() || run.reason.is_some()) {
            return None;
        }
        self.failures += 1;
        self.all_failed &= run.failed();
        let all = self.verbosity == Verbosity::Verbose;
        let Self {
            program,
            history,
            campaign,
            ..
        } = &*self;
        if self.failures == MOST_SHOWN + 1 && !all {
            let list = ShellLine::new(program).fixed(if self.all_failed {
                "list --failed"
            } else {
                "list"
            });
            let list = list
                .option("--campaign", campaign)
                .option("--history", history);
            return Some(FailureLines::further(&list, self.page));
        }
        if self.failures > MOST_SHOWN && !all {
            return None;
        }
        let name = |iri: &str| {
            self.env
                .ontology
                .properties
                .get(iri)
                .map_or_else(|| iri.to_owned(), |p| p.name.clone())
        };
        let show = ShellLine::new(program)
            .fixed("show")
            .word(&run.id)
            .option("--history", history);
        Some(
            FailureLines {
                run,
                show: &show,
                all,
                name: &name,
            }
            .text(self.page),
        )
    }
}
