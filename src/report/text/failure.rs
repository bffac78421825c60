//! A failed run for the terminal, while its campaign goes on.

use crate::RunSummary;
use crate::text::{Page, command};
use actcheck_base::{Outcome, ShellLine};
use actcheck_history::RunStatus;

/// Longest reason of a failure in one line; of a longer one, only the first part is printed. Unit:
/// characters.
const LONGEST_REASON: usize = 90;

/// The text about a run that failed or did not complete.
pub struct FailureLines<'a> {
    /// The run.
    pub run: &'a RunSummary,
    /// The command that shows the run.
    pub show: &'a ShellLine,
    /// Whether all its failed properties are printed with their whole reasons.
    pub all: bool,
    /// Returns the name of a property.
    pub name: &'a dyn Fn(&str) -> String,
}

impl FailureLines<'_> {
    /// The run with the first of its failed properties and the reason, then the command.
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
        match reasons.first() {
            _ if self.all => reasons
                .iter()
                .for_each(|reason| out.push_str(&format!("\n  {reason}"))),
            Some(first) => {
                out.push_str(&format!(": {}", shortened(first)));
                match reasons.len() {
                    1 => {}
                    2 => out.push_str("; and 1 more property"),
                    all => out.push_str(&format!("; and {} more properties", all - 1)),
                }
            }
            None => {}
        }
        page.set(&format!(
            "{out}\n  {}\n",
            painted(&format!("more: {}", command(self.show)), "2", page)
        ))
    }

    /// The line after the last failure that is printed. `list` is a command that lists all.
    pub fn further(list: &ShellLine, page: Page) -> String {
        let list = painted(&command(list), "2", page);
        page.set(&format!(
            "… further failures are not printed here (`-v` prints all): {list}\n"
        ))
    }
}

/// The first part of a reason that is too long for a line.
fn shortened(reason: &str) -> String {
    let too_long = reason.chars().count() > LONGEST_REASON;
    match reason.split_once("; ").filter(|_| too_long) {
        Some((first, _)) => format!("{first}; …"),
        None => reason.to_owned(),
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

    fn lines(run: &RunSummary, all: bool, page: Page) -> String {
        let name = |iri: &str| iri.rsplit('#').next().unwrap_or(iri).to_owned();
        let show = ShellLine::default().fixed("actcheck show k7f3-1 --history h");
        FailureLines {
            run,
            show: &show,
            all,
            name: &name,
        }
        .text(page)
    }

    #[test]
    fn a_failure_is_one_line_with_its_first_reason_and_a_command() {
        let one = run(0, RunStatus::Completed, &[Passed, Failed]);
        let text = lines(&one, false, Page::default());
        let end = ": glass_1 moved 0.4 cm, needs more than 2 cm\n  more: actcheck show k7f3-1 --history h\n";
        assert!(
            text.starts_with("failed k7f3-1 (Pick): ") && text.ends_with(end),
            "{text}"
        );
        let two = run(0, RunStatus::Completed, &[Failed, Failed]);
        assert!(
            lines(&two, false, Page::default()).contains("; and 1 more property\n"),
            "{text}"
        );
        let all = lines(&two, true, Page::default());
        assert_eq!(
            all.matches("\n  ").count(),
            3,
            "one line for each property and the command:\n{all}"
        );
    }

    #[test]
    fn a_broken_run_is_printed_with_its_reason() {
        let text = lines(
            &run(0, RunStatus::Broken, &[Broken]),
            false,
            Page::default(),
        );
        assert!(
            text.starts_with("broken k7f3-1 (Pick): body left the world\n"),
            "{text}"
        );
    }

    #[test]
    fn colours_and_narrow_pages_change_no_word() {
        let failed = run(0, RunStatus::Completed, &[Failed, Failed, Failed]);
        let plain = lines(&failed, false, Page::default());
        for width in [50, 200] {
            let text = lines(
                &failed,
                false,
                Page {
                    width: Some(width),
                    colour: true,
                },
            );
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
        let long = shortened(&format!(
            "Detected: {} was seen; b was seen",
            "a".repeat(90)
        ));
        assert!(long.ends_with("was seen; …"), "{long}");
    }
}
