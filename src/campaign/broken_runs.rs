//! Ends a campaign whose runs break again and again, because further runs would say nothing about
//! the robot.

use std::path::Path;

use actcheck_base::{Diagnostic, ShellLine};
use actcheck_config::Launcher;
use actcheck_history::{RunRecord, RunStatus};

/// Number of first runs after which a campaign ends if all of them were broken for the same reason.
const LEAST_ALIKE: u64 = 5;

/// Counts the broken runs of a campaign, in the order of the schedule, so that it ends at the same
/// run whatever the number of workers. A resumed campaign starts counting from 0.
#[derive(Debug)]
pub(super) struct BrokenRuns {
    /// Number of latest runs in a row that the program broke by a fault of its own.
    in_a_row: u64,
    /// Limit on `in_a_row`; `None` without a program.
    most: Option<u64>,
    /// Number of runs.
    runs: u64,
    /// The reason why all runs so far were broken, without numbers. `None` if one was not broken,
    /// or for another reason.
    alike: Option<String>,
}

impl BrokenRuns {
    pub(super) fn new(launcher: &Launcher) -> Self {
        let most = match launcher {
            Launcher::Reference => None,
            Launcher::Program(skill) => Some(skill.max_broken),
        };
        Self {
            in_a_row: 0,
            most,
            runs: 0,
            alike: None,
        }
    }

    /// Counts a run that was made before the campaign was interrupted.
    pub(super) fn resume(&mut self) {
        (self.runs, self.alike) = (self.runs + 1, None);
    }

    /// Counts a run. Returns the error that ends the campaign, if it has to end: `S033` if the
    /// program broke too many runs in a row, `S034` if all of the first runs were broken for the
    /// same reason.
    pub(super) fn count(&mut self, run: &RunRecord, history: &Path) -> Option<Diagnostic> {
        let reason = (run.status == RunStatus::Broken)
            .then(|| without_numbers(run.reason.as_deref().unwrap_or_default()));
        self.runs += 1;
        self.alike = if self.runs == 1 {
            reason
        } else {
            reason.filter(|reason| self.alike.as_ref() == Some(reason))
        };
        self.in_a_row = if run.program_output.is_some() {
            self.in_a_row + 1
        } else {
            0
        };
        let all_alike = self.alike.is_some();
        match self.most {
            Some(most) if self.in_a_row >= most => Some(too_many(most, run, all_alike, history)),
            _ if self.in_a_row == 0 && all_alike && self.runs >= LEAST_ALIKE => {
                Some(all_broken(run, history))
            }
            _ => None,
        }
    }
}

/// Reasons that differ only in numbers, such as times and positions, have the same cause.
fn without_numbers(reason: &str) -> String {
    reason
        .chars()
        .filter(|letter| !letter.is_ascii_digit())
        .collect()
}

fn all_broken(last: &RunRecord, history: &Path) -> Diagnostic {
    let reason = last.reason.as_deref().unwrap_or_default();
    let message =
        format!("the first {LEAST_ALIKE} runs were all broken for the same reason: {reason}");
    Diagnostic::error("S034", message).help(format!(
        "`{}` shows one of them; further runs would end in the same way",
        show(last, history)
    ))
}

/// The error of a campaign whose program broke `most` runs in a row. `alike`: all of its runs, for
/// the same reason.
fn too_many(most: u64, last: &RunRecord, alike: bool, history: &Path) -> Diagnostic {
    let reason = last.reason.as_deref().unwrap_or_default();
    let (runs, which) = match (most, alike) {
        (1, _) => ("a run was".to_owned(), "; the last one, "),
        (_, true) => (
            format!("the first {most} runs were all"),
            ", for the same reason, as in ",
        ),
        (_, false) => (format!("{most} runs in a row were"), "; the last one, "),
    };
    let message = format!(
        "{runs} broken by the program that performs actions{which}{}: {reason}",
        last.id
    );
    let install = if reason.contains("No module named") {
        "activate the Python environment that has the module before `actcheck run`, or name its Python in `test_launcher`; "
    } else {
        ""
    };
    Diagnostic::error("S033", message).help(format!(
        "{install}`{}` shows its output; `[skill] max_broken` is the allowed number of such runs in a row",
        show(last, history)
    ))
}

/// The command that shows a run.
fn show(run: &RunRecord, history: &Path) -> ShellLine {
    ShellLine::default()
        .fixed("actcheck show")
        .word(&run.id)
        .option("--history", history)
}
