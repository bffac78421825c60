//! Remarks on the properties of a campaign: outcomes that may be misleading.

use std::collections::BTreeMap;

use crate::CampaignSummary;
use actcheck_base::{Outcome, ShellLine};

/// Minimum number of judgements for a "never" remark: with 4 of 4, the lower bound of the interval
/// is still near one half.
const LEAST_FOR_NEVER: u64 = 5;
/// From this number of judgements on, "never failed" is a warning: a property that fails in a tenth
/// of all scenes would probably have failed (0.9³⁰ = 4 %).
const LEAST_FOR_SUSPICION: u64 = 30;

/// A remark on one property, or on several with the same counts, whose outcomes may be misleading.
#[derive(Debug, Clone, PartialEq)]
pub struct Remark {
    /// Kind of oddity.
    pub oddity: Oddity,
    /// IRI and label of each property.
    pub properties: Vec<(String, String)>,
    /// Number of odd judgements.
    pub count: u64,
    /// Number of judgements considered.
    pub of: u64,
    /// Whether the remark is a warning rather than a note.
    pub warning: bool,
    /// The first run that shows it, if any.
    pub run: Option<String>,
}

/// Kinds of oddities in a property's outcomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Oddity {
    /// It passed, but already held before the action.
    HeldBefore,
    /// It passed, but no left side of its `implies` held.
    Vacuous,
    /// It was decided often and never passed.
    NeverPassed,
    /// It never applied.
    NeverApplied,
    /// It was decided often and never failed.
    NeverFailed,
}

impl Oddity {
    /// Name of the oddity in the output.
    pub fn word(self) -> &'static str {
        match self {
            Self::HeldBefore => "held before",
            Self::Vacuous => "vacuous",
            Self::NeverPassed => "never passed",
            Self::NeverApplied => "never applied",
            Self::NeverFailed => "never failed",
        }
    }
}

impl CampaignSummary {
    /// Remarks on the properties. Properties with the same oddity and counts share a remark.
    pub fn remarks(&self) -> Vec<Remark> {
        let mut alike: BTreeMap<(Oddity, u64, u64), Vec<(String, String)>> = BTreeMap::new();
        for line in self.property_lines() {
            let (counts, decided, all) = (line.counts, line.counts.decided(), line.counts.total());
            let odd = [
                (
                    Oddity::HeldBefore,
                    line.held_before,
                    counts.passed,
                    line.held_before > 0,
                ),
                (
                    Oddity::Vacuous,
                    line.vacuous,
                    counts.passed,
                    line.vacuous > 0,
                ),
                (
                    Oddity::NeverPassed,
                    decided,
                    decided,
                    counts.passed == 0 && decided >= LEAST_FOR_NEVER,
                ),
                (
                    Oddity::NeverApplied,
                    all,
                    all,
                    counts.inapplicable == all && all >= LEAST_FOR_NEVER,
                ),
                (
                    Oddity::NeverFailed,
                    decided,
                    decided,
                    counts.failed == 0 && decided >= LEAST_FOR_NEVER,
                ),
            ];
            for (oddity, count, of, _) in odd.into_iter().filter(|(.., is)| *is) {
                alike
                    .entry((oddity, count, of))
                    .or_default()
                    .push((line.property.clone(), line.label.clone()));
            }
        }
        alike
            .into_iter()
            .map(|((oddity, count, of), properties)| Remark {
                run: properties
                    .first()
                    .and_then(|(property, _)| self.run_that_shows(oddity, property)),
                warning: oddity != Oddity::NeverFailed || of >= LEAST_FOR_SUSPICION,
                oddity,
                properties,
                count,
                of,
            })
            .collect()
    }

    fn run_that_shows(&self, oddity: Oddity, property: &str) -> Option<String> {
        let shows = |judgement: &&actcheck_base::Judgement| {
            judgement.property == property
                && match oddity {
                    Oddity::HeldBefore => judgement.held_before == Some(true),
                    Oddity::Vacuous => judgement.vacuous == Some(true),
                    Oddity::NeverPassed => judgement.outcome == Outcome::Failed,
                    Oddity::NeverApplied => judgement.outcome == Outcome::Inapplicable,
                    Oddity::NeverFailed => false,
                }
        };
        let mut runs = self.runs.iter();
        let run = runs.find(|run| {
            run.actions
                .iter()
                .flat_map(|action| &action.judgements)
                .any(|j| shows(&j))
        });
        run.map(|run| run.id.clone())
    }

    /// Describes a remark and suggests what to do.
    pub fn remark_text(&self, remark: &Remark) -> String {
        let labels: Vec<&str> = remark
            .properties
            .iter()
            .map(|(_, label)| label.as_str())
            .collect();
        let names = labels.join(", ");
        // Upper bound of the rate of the outcome that never occurred.
        let most = self
            .sampling()
            .interval(0, remark.of)
            .map_or(100.0, |interval| interval.high * 100.0);
        let ask = match (&remark.run, labels.first()) {
            (Some(run), Some(label)) => {
                let why = ShellLine::new(&self.program)
                    .fixed("why")
                    .word(run)
                    .word(label);
                why.option("--history", &self.history).to_string()
            }
            _ => String::new(),
        };
        let (count, of) = (remark.count, remark.of);
        match remark.oddity {
            Oddity::HeldBefore => format!(
                "{names} already held before the action in {count} of {of} passes, which say nothing about the action: \
                 compare `after` with `before` in the rule, or require it to be false beforehand ({ask})"
            ),
            Oddity::Vacuous => format!(
                "{names} passed vacuously in {count} of {of} passes: no left side of an `implies` held, so that no right side \
                 was asked for; check whether it can hold, or run scenes in which it does ({ask})"
            ),
            Oddity::NeverPassed => format!(
                "{names} never passed in {of} judgements (so in at most {most:.0} % of such scenes): \
                 check its rule, and whether the action ever succeeds ({ask})"
            ),
            Oddity::NeverApplied => format!(
                "{names} applied in none of {of} judgements: check `applicable` in its rule and the preconditions of its \
                 action ({ask})"
            ),
            Oddity::NeverFailed if remark.warning => format!(
                "{names} never failed in {of} judgements (so in at most {most:.0} % of such scenes): \
                 check whether it can fail at all, with scenes that make it hard"
            ),
            Oddity::NeverFailed => {
                format!(
                    "{names} never failed in {of} judgements (so in at most {most:.0} % of such scenes)"
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::campaign_samples::{campaign, run};
    use actcheck_history::RunStatus;

    fn kinds(
        runs: u64,
        outcomes: [Outcome; 2],
        held_before: Option<bool>,
    ) -> Vec<(Oddity, u64, u64, bool)> {
        let runs = (0..runs).map(|index| {
            let mut run = run(index, RunStatus::Completed, &outcomes);
            // Set in every third run.
            if index.is_multiple_of(3) {
                run.actions[0].judgements[0].held_before = held_before;
            }
            run
        });
        let summary = campaign(runs.collect());
        summary
            .remarks()
            .iter()
            .map(|r| (r.oddity, r.count, r.of, r.warning))
            .collect()
    }

    #[test]
    fn a_property_that_never_applied_is_reported() {
        use Outcome::{Inapplicable, Passed};
        let never = |of| (Oddity::NeverApplied, of, of, true);
        assert_eq!(
            kinds(6, [Inapplicable, Passed], None),
            [never(6), (Oddity::NeverFailed, 6, 6, false)]
        );
        assert_eq!(kinds(4, [Inapplicable, Passed], None), []);
    }

    #[test]
    fn uninformative_outcomes_are_reported() {
        use Outcome::{Broken, Failed, Passed};
        let never = |of, warning| {
            vec![
                (Oddity::NeverPassed, of, of, true),
                (Oddity::NeverFailed, of, of, warning),
            ]
        };
        assert_eq!(kinds(15, [Passed, Failed], None), never(15, false));
        assert_eq!(kinds(30, [Passed, Failed], Some(false)), never(30, true));
        assert_eq!(kinds(4, [Passed, Failed], None), []);
        assert_eq!(kinds(40, [Broken, Broken], None), []);
        assert_eq!(
            kinds(4, [Passed, Passed], Some(true)),
            [(Oddity::HeldBefore, 2, 4, true)]
        );
        // Two properties with the same counts make one remark.
        assert_eq!(
            kinds(6, [Passed, Passed], None),
            [(Oddity::NeverFailed, 6, 6, false)]
        );
    }
}
