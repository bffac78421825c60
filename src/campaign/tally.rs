//! Counts the runs of a campaign against its budgets.

use std::collections::BTreeMap;

use crate::{Env, ExhaustedBudget, RunResult};
use actcheck_base::Outcome;
use actcheck_config::Limits;
use actcheck_verdict::wilson_share;

/// Counts over the runs in the history. Runs are counted in the order of the schedule, so that a
/// campaign stops at the same run whatever the number of workers.
pub(super) struct Tally {
    limits: Limits,
    /// Runs of each scene.
    repeat: u32,
    failures: u64,
    /// Passed and decided outcomes of every property of the campaign, by IRI.
    decided: BTreeMap<String, [u64; 2]>,
}

impl Tally {
    /// Creates an empty tally for all success properties of the campaign's actions.
    pub(super) fn new(env: &Env) -> Self {
        let actions = env
            .campaign
            .tests
            .iter()
            .flatten()
            .filter_map(|step| env.ontology.actions.get(&step.action));
        let properties = actions.flat_map(|action| &action.success_properties);
        Self {
            limits: env.campaign.limits,
            repeat: env.campaign.repeat,
            failures: 0,
            decided: properties.map(|iri| (iri.clone(), [0, 0])).collect(),
        }
    }

    /// Counts a run. Returns the budget that it has spent, if any.
    pub(super) fn count(&mut self, result: &RunResult) -> Option<ExhaustedBudget> {
        self.failures += u64::from(
            result
                .outcomes
                .iter()
                .any(|one| one.outcome == Outcome::Failed),
        );
        for one in &result.outcomes {
            if let Some([passed, decided]) = self.decided.get_mut(&one.property) {
                *passed += u64::from(one.outcome == Outcome::Passed);
                *decided += u64::from(matches!(one.outcome, Outcome::Passed | Outcome::Failed));
            }
        }
        if let Some(most) = self.limits.max_failures
            && self.failures >= most
        {
            return Some(ExhaustedBudget::Failures(most));
        }
        self.limits
            .until_width
            .filter(|width| self.is_narrow(*width))
            .map(ExhaustedBudget::Width)
    }

    /// Whether the interval of every property is at most this wide. The runs of one scene count as
    /// one trial, because their correlation is not known beforehand.
    fn is_narrow(&self, width: f64) -> bool {
        let narrow = |[passed, decided]: &[u64; 2]| {
            let (passed, decided) = (*passed as f64, *decided as f64);
            let interval = wilson_share(passed / decided, decided / f64::from(self.repeat));
            interval.is_some_and(|interval| interval.high - interval.low <= width)
        };
        !self.decided.is_empty() && self.decided.values().all(narrow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PropertyOutcome;
    use actcheck_verdict::trials_for_width;

    fn result(outcomes: [Outcome; 2]) -> RunResult {
        let outcomes = ["a", "b"]
            .into_iter()
            .zip(outcomes)
            .map(|(property, outcome)| PropertyOutcome {
                property: property.to_owned(),
                outcome,
                margin: None,
            });
        RunResult {
            index: 0,
            discards: 0,
            outcomes: outcomes.collect(),
        }
    }

    fn tally(limits: Limits) -> Tally {
        Tally {
            limits,
            repeat: 1,
            failures: 0,
            decided: ["a", "b"].map(|name| (name.to_owned(), [0, 0])).into(),
        }
    }

    #[test]
    fn failed_runs_are_counted_not_failed_properties() {
        use Outcome::{Broken, Failed, Passed};
        let mut tally = tally(Limits {
            max_failures: Some(2),
            ..Limits::default()
        });
        assert_eq!(tally.count(&result([Failed, Failed])), None);
        assert_eq!(tally.count(&result([Passed, Broken])), None);
        assert_eq!(
            tally.count(&result([Passed, Failed])),
            Some(ExhaustedBudget::Failures(2))
        );
    }

    #[test]
    fn the_widest_interval_decides_and_undecided_properties_have_none() {
        use Outcome::{Failed, Inapplicable, Passed};
        let limits = Limits {
            until_width: Some(0.3),
            ..Limits::default()
        };
        // The interval of n passes out of n has the width z² / (n + z²): 0.3 from n = 9 on.
        let mut sure = tally(limits);
        let stops: Vec<bool> = (0..9)
            .map(|_| sure.count(&result([Passed, Passed])).is_some())
            .collect();
        assert_eq!(
            stops,
            [false, false, false, false, false, false, false, false, true]
        );
        let mut idle = tally(limits);
        assert!((0..100).all(|_| idle.count(&result([Passed, Inapplicable])).is_none()));
        let mut unsure = tally(limits);
        let mut runs = 0;
        while unsure
            .count(&result([
                Passed,
                if runs % 2 == 0 { Passed } else { Failed },
            ]))
            .is_none()
        {
            runs += 1;
        }
        let most = trials_for_width(0.3);
        assert!(
            (most - 1..=most + 1).contains(&(runs + 1)),
            "{runs} and {most}"
        );
    }
}
