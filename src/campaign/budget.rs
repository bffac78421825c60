//! Budgets that end a campaign before all its runs are made: time, interval width, failures.

use std::collections::BTreeMap;
use std::fmt;

use crate::{Env, Told};
use actcheck_base::Outcome;
use actcheck_config::{Limits, Overrides};
use actcheck_verdict::{trials_for_width, wilson_share};

/// Runs per test of a campaign that only time ends: more than any campaign makes.
const MOST_RUNS: u32 = 10_000_000;

/// Without `--runs`, a campaign that waits for narrow intervals makes at most this many times the runs that a property
/// decided in every run needs. That is enough for properties that are decided in every fourth run.
const WIDTH_RESERVE: u64 = 4;

/// The budget that ended a campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spent {
    /// The time limit. Unit: seconds.
    Time(f64),
    /// The maximum interval width, which all properties have reached.
    Width(f64),
    /// The number of failed runs.
    Failures(u64),
}

impl Spent {
    /// Its name in the history.
    pub fn word(self) -> &'static str {
        match self {
            Self::Time(_) => "time",
            Self::Width(_) => "width",
            Self::Failures(_) => "failures",
        }
    }
}

impl fmt::Display for Spent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time(secs) => write!(f, "its time of {secs} s is up (--time)"),
            Self::Width(width) => {
                write!(f, "the 95 % interval of every property is at most {width} wide (--until-width)")
            }
            Self::Failures(1) => write!(f, "a run failed (--max-failures 1)"),
            Self::Failures(most) => write!(f, "{most} runs failed (--max-failures)"),
        }
    }
}

/// Returns the runs of each test if the command line sets a budget but no number of runs, and `None` if the
/// configuration decides.
pub(super) fn ceiling(overrides: &Overrides) -> Option<u32> {
    match (overrides.runs, overrides.until_width, overrides.time_secs) {
        (None, Some(width), _) => {
            let enough = trials_for_width(width).saturating_mul(WIDTH_RESERVE);
            Some(u32::try_from(enough).unwrap_or(MOST_RUNS).clamp(1, MOST_RUNS))
        }
        (None, None, Some(_)) => Some(MOST_RUNS),
        _ => None,
    }
}

/// Counts over the runs in the history. Runs are counted in the order of the schedule, so that a campaign stops at the
/// same run whatever the number of workers.
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
        let actions = env.campaign.tests.iter().flatten().filter_map(|name| env.ontology.actions.get(name));
        let properties = actions.flat_map(|action| &action.success_properties);
        Self {
            limits: env.campaign.limits,
            repeat: env.campaign.repeat,
            failures: 0,
            decided: properties.map(|iri| (iri.clone(), [0, 0])).collect(),
        }
    }

    /// Counts a run. Returns the budget that it has spent, or `None` if the campaign may continue.
    pub(super) fn count(&mut self, told: &Told) -> Option<Spent> {
        self.failures += u64::from(told.outcomes.iter().any(|one| one.outcome == Outcome::Failed));
        for one in &told.outcomes {
            if let Some([passed, decided]) = self.decided.get_mut(&one.property) {
                *passed += u64::from(one.outcome == Outcome::Passed);
                *decided += u64::from(matches!(one.outcome, Outcome::Passed | Outcome::Failed));
            }
        }
        if let Some(most) = self.limits.max_failures
            && self.failures >= most
        {
            return Some(Spent::Failures(most));
        }
        self.limits.until_width.filter(|width| self.is_narrow(*width)).map(Spent::Width)
    }

    /// Whether the interval of every property is at most this wide. The runs of one scene count as one trial, because
    /// their correlation is not known beforehand.
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
    use crate::ToldOutcome;

    fn told(outcomes: [Outcome; 2]) -> Told {
        let outcomes = ["a", "b"].into_iter().zip(outcomes).map(|(property, outcome)| ToldOutcome {
            property: property.to_owned(),
            outcome,
            margin: None,
        });
        Told { index: 0, discards: 0, outcomes: outcomes.collect() }
    }

    fn tally(limits: Limits) -> Tally {
        Tally { limits, repeat: 1, failures: 0, decided: ["a", "b"].map(|name| (name.to_owned(), [0, 0])).into() }
    }

    #[test]
    fn failed_runs_are_counted_not_failed_properties() {
        use Outcome::{Broken, Failed, Passed};
        let mut tally = tally(Limits { max_failures: Some(2), ..Limits::default() });
        assert_eq!(tally.count(&told([Failed, Failed])), None);
        assert_eq!(tally.count(&told([Passed, Broken])), None);
        assert_eq!(tally.count(&told([Passed, Failed])), Some(Spent::Failures(2)));
    }

    #[test]
    fn the_widest_interval_decides_and_undecided_properties_have_none() {
        use Outcome::{Failed, Inapplicable, Passed};
        let limits = Limits { until_width: Some(0.3), ..Limits::default() };
        // The interval of n passes out of n has the width z² / (n + z²): 0.3 from n = 9 on.
        let mut sure = tally(limits);
        let stops: Vec<bool> = (0..9).map(|_| sure.count(&told([Passed, Passed])).is_some()).collect();
        assert_eq!(stops, [false, false, false, false, false, false, false, false, true]);
        let mut idle = tally(limits);
        assert!((0..100).all(|_| idle.count(&told([Passed, Inapplicable])).is_none()));
        let mut unsure = tally(limits);
        let mut runs = 0;
        while unsure.count(&told([Passed, if runs % 2 == 0 { Passed } else { Failed }])).is_none() {
            runs += 1;
        }
        let most = trials_for_width(0.3);
        assert!((most - 1..=most + 1).contains(&(runs + 1)), "{runs} and {most}");
    }

    #[test]
    fn a_budget_without_a_run_count_has_a_maximum() {
        let asked =
            |runs, until_width, time_secs| ceiling(&Overrides { runs, until_width, time_secs, ..Overrides::default() });
        assert_eq!(asked(None, None, None), None);
        assert_eq!(asked(Some(3), Some(0.1), Some(1.0)), None);
        assert_eq!(asked(None, None, Some(60.0)), Some(MOST_RUNS));
        assert_eq!(asked(None, Some(0.05), Some(60.0)), Some(4 * 1_533));
        assert_eq!(asked(None, Some(1e-9), None), Some(MOST_RUNS));
    }
}
