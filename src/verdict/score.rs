//! The paper's scores: A of an action, S of a test, T of a campaign (equations 1 to 3).

use serde::Serialize;

use actcheck_base::Outcome;

/// How often each outcome occurred.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// The property held.
    pub passed: u64,
    /// The property did not hold.
    pub failed: u64,
    /// The property did not apply.
    pub inapplicable: u64,
    /// The simulation or the tool failed.
    pub broken: u64,
    /// A budget was exhausted.
    pub timeout: u64,
    /// The action was never reached.
    pub untested: u64,
}

impl Counts {
    /// Counts outcomes.
    pub fn of(outcomes: impl IntoIterator<Item = Outcome>) -> Self {
        let mut counts = Self::default();
        for outcome in outcomes {
            counts.add(outcome);
        }
        counts
    }

    /// Counts one outcome.
    pub fn add(&mut self, outcome: Outcome) {
        *self.slot(outcome) += 1;
    }

    /// Adds the counts of another.
    pub fn add_all(&mut self, other: Self) {
        for outcome in Outcome::ALL {
            *self.slot(outcome) += other.get(outcome);
        }
    }

    /// Returns the count of one outcome.
    pub fn get(mut self, outcome: Outcome) -> u64 {
        *self.slot(outcome)
    }

    /// Returns the sum of all counts.
    pub fn total(self) -> u64 {
        Outcome::ALL
            .into_iter()
            .map(|outcome| self.get(outcome))
            .sum()
    }

    /// Returns the number of passed and failed outcomes, the denominator of a pass rate. Only these
    /// are evidence about the robot.
    pub fn decided(self) -> u64 {
        self.passed + self.failed
    }

    fn slot(&mut self, outcome: Outcome) -> &mut u64 {
        match outcome {
            Outcome::Passed => &mut self.passed,
            Outcome::Failed => &mut self.failed,
            Outcome::Inapplicable => &mut self.inapplicable,
            Outcome::Broken => &mut self.broken,
            Outcome::Timeout => &mut self.timeout,
            Outcome::Untested => &mut self.untested,
        }
    }
}

/// Computes A: the share of an action's properties that passed, in [0, 1].
///
/// Inapplicable properties are not counted in the denominator. An action without applicable
/// properties scores 0, like an action whose properties were all broken, timed out or untested: one
/// that was not performed never raises the score of a run. Source: the paper, equation 1.
pub fn action_score(outcomes: impl IntoIterator<Item = Outcome>) -> f64 {
    let counts = Counts::of(outcomes);
    let applicable = counts.total() - counts.inapplicable;
    if applicable == 0 {
        0.0
    } else {
        counts.passed as f64 / applicable as f64
    }
}

/// Computes S: the mean of A over a test's actions, in [0, 1]. Source: the paper, equation 2.
pub fn run_score(action_scores: &[f64]) -> f64 {
    mean(action_scores.iter().copied()).unwrap_or(0.0)
}

/// Returns the mean of the values, or `None` if there are none. T is the mean of S over runs (the
/// paper, equation 3).
pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values
        .into_iter()
        .fold((0.0, 0u64), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Passed properties of each action (of 5, 3, 5 and 4) in the paper's fifteen runs, Table IV.
    const TABLE_IV: [[u64; 4]; 15] = [
        [5, 3, 2, 1],
        [5, 2, 0, 0],
        [3, 1, 3, 1],
        [0, 0, 0, 0],
        [5, 3, 0, 0],
        [0, 0, 0, 0],
        [0, 0, 0, 0],
        [5, 3, 2, 1],
        [5, 3, 2, 1],
        [0, 0, 0, 0],
        [5, 3, 2, 1],
        [5, 3, 5, 3],
        [0, 0, 0, 0],
        [5, 3, 0, 0],
        [0, 0, 0, 0],
    ];

    #[test]
    fn scores_match_the_papers_total() {
        let runs = TABLE_IV.map(|row| {
            let scores: Vec<f64> = row
                .into_iter()
                .zip([5, 3, 5, 4])
                .map(|(passed, all)| {
                    action_score((0..all).map(|i| {
                        if i < passed {
                            Outcome::Passed
                        } else {
                            Outcome::Failed
                        }
                    }))
                })
                .collect();
            run_score(&scores)
        });
        let total = mean(runs).expect("fifteen runs");
        assert_eq!(format!("{total:.4}"), "0.3633");
    }

    #[test]
    fn a_run_that_tested_nothing_is_not_passed() {
        assert_eq!(
            action_score([Outcome::Inapplicable, Outcome::Inapplicable]),
            0.0
        );
        assert_eq!(
            action_score([Outcome::Broken, Outcome::Timeout, Outcome::Untested]),
            0.0
        );
        assert_eq!(action_score([]), 0.0);
        assert_eq!(action_score([Outcome::Passed, Outcome::Inapplicable]), 1.0);
        assert_eq!(action_score([Outcome::Passed, Outcome::Broken]), 0.5);
        assert_eq!(mean([]), None);
    }
}
