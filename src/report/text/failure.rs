//! A failed run for the terminal, while its campaign goes on.

use crate::RunSummary;
use crate::text::{Page, command};
use actcheck_base::{Outcome, ShellLine};
use actcheck_history::RunStatus;

/// The text about a run that failed or did not complete.
pub struct FailureLines<'a> {
    /// The run.
    pub run: &'a RunSummary,
    /// The command that shows the run.
    pub show: &'a ShellLine,
    /// Returns the name of a property.
    pub name: &'a dyn Fn(&str) -> String,
}

impl FailureLines<'_> {
    /// The run with its failed properties and their reasons, then the command.
    pub fn text(&self, page: Page) -> String {
        let run = self.run;
        let failed: Vec<(String, &str)> = run
            .actions
            .iter()
            .flat_map(|action| &action.judgements)
            .filter(|judgement| judgement.outcome == Outcome::Failed)
            .map(|judgement| ((self.name)(&judgement.property), judgement.witness.as_str()))
            .collect();
        let (word, colour) = match run.status {
            RunStatus::Completed => ("failed", "31"),
            other => (other.word(), "33"),
        };
        let mut out = format!("{} {} ({})", painted(word, colour, page), run.id, run.test);
        let mut reasons: Vec<String> = run.reason.iter().cloned().collect();
        reasons.extend(
            failed
                .iter()
                .map(|(name, witness)| format!("{name}: {witness}")),
        );
        for reason in reasons {
            out.push_str(&format!("\n  {reason}"));
        }
        page.set(&format!(
            "{out}\n  {}\n",
            painted(&format!("more: {}", command(self.show)), "2", page)
        ))
    }
}

fn painted(text: &str, style: &str, page: Page) -> String {
    if page.colour {
        format!("\u{1b}[{style}m{text}\u{1b}[0m")
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::campaign_samples::run;
    use Outcome::{Broken, Failed, Passed};

    fn lines(run: &RunSummary, page: Page) -> String {
        let name = |iri: &str| iri.rsplit('#').next().unwrap_or(iri).to_owned();
        let show = ShellLine::default().fixed("actcheck show k7f3-1 --history h");
        FailureLines {
            run,
            show: &show,
            name: &name,
        }
        .text(page)
    }

    #[test]
    fn a_failure_has_a_line_for_each_property_and_a_command() {
        let one = run(0, RunStatus::Completed, &[Passed, Failed]);
        let text = lines(&one, Page::default());
        let end = ": glass_1 moved 0.4 cm, needs more than 2 cm\n  more: actcheck show k7f3-1 --history h\n";
        assert!(
            text.starts_with("failed k7f3-1 (Pick)\n  ") && text.ends_with(end),
            "{text}"
        );
        let two = run(0, RunStatus::Completed, &[Failed, Failed]);
        let text = lines(&two, Page::default());
        assert_eq!(text.matches("\n  ").count(), 3, "{text}");
    }

    #[test]
    fn a_broken_run_is_printed_with_its_reason() {
        let text = lines(&run(0, RunStatus::Broken, &[Broken]), Page::default());
        assert!(
            text.starts_with("broken k7f3-1 (Pick)\n  body left the world\n"),
            "{text}"
        );
    }

    #[test]
    fn colours_and_narrow_pages_change_no_word() {
        let failed = run(0, RunStatus::Completed, &[Failed, Failed, Failed]);
        let plain = lines(&failed, Page::default());
        for width in [50, 200] {
            let page = Page {
                width: Some(width),
                colour: true,
            };
            let text = lines(&failed, page);
            assert!(
                text.starts_with("\u{1b}[31mfailed\u{1b}[0m k7f3-1"),
                "{text}"
            );
            let bare = text
                .replace("\u{1b}[31m", "")
                .replace("\u{1b}[2m", "")
                .replace("\u{1b}[0m", "");
            assert!(
                bare.lines().all(|line| line.chars().count() <= width),
                "{bare}"
            );
            let words = |text: &str| {
                text.split_whitespace()
                    .map(str::to_owned)
                    .collect::<Vec<_>>()
            };
            assert_eq!(words(&bare), words(&plain));
        }
    }
}
