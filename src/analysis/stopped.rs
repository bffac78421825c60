//! Intervals of rates from campaigns that outcomes have ended: at a number of failures, or when a
//! user interrupted it.
//!
//! Wilson's interval assumes that the number of runs does not depend on outcomes. After
//! `--max-failures 1` its coverage is 80 % at a rate of 0.8.

use statrs::function::beta::{beta_reg, ln_beta};

use crate::{Interval, wilson, wilson_share};

/// Probability that an interval misses the rate.
const MISSING: f64 = 0.05;
/// Both parameters of the prior of the mixture (Jeffreys's): its intervals are narrow also at rates
/// near 0 and 1.
const PRIOR: f64 = 0.5;

/// How the number of runs was decided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampling {
    /// A number that was chosen before, a time, or the width of an interval. (The last two change
    /// the coverage of Wilson's interval as little as the number of runs does: 92 % to 98 % at
    /// rates from 0.5 to 0.99.)
    #[default]
    Fixed,
    /// Outcomes of runs, in any way.
    Stopped,
}

impl Sampling {
    /// From the end of a campaign in the history: a budget, or an interrupt.
    pub fn of(ended_by: Option<&str>, interrupted: bool) -> Self {
        if interrupted || matches!(ended_by, Some("failures" | "comparison")) {
            Self::Stopped
        } else {
            Self::Fixed
        }
    }

    /// Returns the stronger of two: a sum of campaigns depends on outcomes if one of them does.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        if self == Self::Stopped { self } else { other }
    }

    /// Returns the share of successes with an interval that is valid for this kind of sampling. The
    /// share itself is biased if outcomes have ended the sampling. Returns `None` without trials.
    pub fn interval(self, successes: u64, trials: u64) -> Option<Interval> {
        match self {
            Self::Fixed => wilson(successes, trials),
            Self::Stopped => anytime(successes, trials),
        }
    }

    /// As [`Sampling::interval`], for a rate and a number of trials that need not be an integer.
    pub fn share(self, rate: f64, trials: f64) -> Option<Interval> {
        match self {
            Self::Fixed => wilson_share(rate, trials),
            Self::Stopped => anytime_share(rate, trials, MISSING),
        }
    }
}

/// Returns the share of successes with a 95 % interval that is valid whenever and for whatever
/// reason the trials ended. Returns `None` without trials. `successes` is clamped to `trials`.
///
/// Source: the confidence sequence of the mixture likelihood ratio, H. Robbins, "Statistical
/// methods related to the law of the iterated logarithm", Annals of Mathematical Statistics 41
/// (1970) 1397–1409: for the true rate p, the ratio of the likelihood averaged over a prior to that
/// of p is a martingale of mean 1, so by Ville's inequality it ever exceeds 20 with a probability
/// of at most 5 %. The interval has the rates at which it does not exceed 20.
pub fn anytime(successes: u64, trials: u64) -> Option<Interval> {
    if trials == 0 {
        return None;
    }
    let (successes, trials) = (successes.min(trials) as f64, trials as f64);
    anytime_share(successes / trials, trials, MISSING)
}

/// As [`anytime`], for a rate, a number of trials that need not be an integer, and the probability
/// that the interval misses the true rate.
pub(crate) fn anytime_share(rate: f64, trials: f64, missing: f64) -> Option<Interval> {
    if trials <= 0.0 || !(0.0..=1.0).contains(&rate) {
        return None;
    }
    let (passed, failed) = (rate * trials, (1.0 - rate) * trials);
    let mixture = ln_beta(passed + PRIOR, failed + PRIOR) - ln_beta(PRIOR, PRIOR);
    let least = mixture + libm::log(missing);
    let log = |count: f64, share: f64| {
        if count > 0.0 {
            count * libm::log(share)
        } else {
            0.0
        }
    };
    let is_in = |share: f64| log(passed, share) + log(failed, 1.0 - share) >= least;
    let low = if rate == 0.0 {
        0.0
    } else {
        last(rate, 0.0, is_in)
    };
    let high = if rate == 1.0 {
        1.0
    } else {
        last(rate, 1.0, is_in)
    };
    Some(Interval { rate, low, high })
}

/// The rate of passes after runs that ended at a failure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassesUntilFailures {
    /// The unbiased estimate; `None` at the first failure, for which there is none.
    pub rate: Option<f64>,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// Returns the rate of passes of runs that ended at a failure, the number `failures` of `trials`.
/// Returns `None` if one of them is 0, or if there are fewer trials than failures.
///
/// Sources: the unbiased estimate of the rate of failures, (k - 1) / (n - 1), is from J. B. S.
/// Haldane, "On a method of estimating frequencies", Biometrika 33 (1945) 222–225. The interval is
/// that of Clopper and Pearson (Biometrika 26 (1934) 404–413) for the negative binomial
/// distribution of n: at its ends q, at most n trials are needed with a probability of 2.5 %,
/// I_q(k, n - k + 1), and at least n, 1 - I_q(k, n - k), where I is the regularised incomplete beta
/// function.
pub fn passes_until_failures(failures: u64, trials: u64) -> Option<PassesUntilFailures> {
    if failures == 0 || trials < failures {
        return None;
    }
    let (k, n) = (failures as f64, trials as f64);
    let low = last(0.0, 1.0, |q| {
        q <= 0.0 || beta_reg(k, n - k + 1.0, q) <= MISSING / 2.0
    });
    let high = if trials == failures {
        1.0
    } else {
        last(1.0, 0.0, |q| {
            q >= 1.0 || beta_reg(k, n - k, q) >= 1.0 - MISSING / 2.0
        })
    };
    let rate = (failures > 1).then(|| 1.0 - (k - 1.0) / (n - 1.0));
    Some(PassesUntilFailures {
        rate,
        low: 1.0 - high,
        high: 1.0 - low,
    })
}

/// Finds by bisection the last point from `from` towards `to` at which a condition holds. It must
/// hold at `from`.
fn last(from: f64, to: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(to) {
        return to;
    }
    let (mut holding, mut failing) = (from, to);
    // 60 halvings of an interval of at most 1 leave less than the last bit.
    for _ in 0..60 {
        let middle = 0.5 * (holding + failing);
        if holds(middle) {
            holding = middle
        } else {
            failing = middle
        }
    }
    holding
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Knuth's linear congruential generator; any generator would do.
    fn uniform(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Runs of a robot that passes with this probability until so many fail: their number.
    fn until(failures: u64, rate: f64, state: &mut u64) -> u64 {
        let (mut failed, mut runs) = (0, 0);
        while failed < failures {
            runs += 1;
            failed += u64::from(uniform(state) >= rate);
        }
        runs
    }

    #[test]
    fn rates_after_a_number_of_failures_are_unbiased_and_covered() {
        const CAMPAIGNS: usize = 20_000;
        let mut state = 62;
        for truth in [0.5, 0.8, 0.95] {
            for failures in [1, 2, 3, 5, 20] {
                let (mut sum, mut exact, mut any) = (0.0, 0, 0);
                let mut known = BTreeMap::new();
                for _ in 0..CAMPAIGNS {
                    let runs = until(failures, truth, &mut state);
                    let (found, sure) = known.entry(runs).or_insert_with(|| {
                        let found = passes_until_failures(failures, runs).expect("it has runs");
                        (found, anytime(runs - failures, runs).expect("it has runs"))
                    });
                    sum += found.rate.unwrap_or(f64::NAN);
                    exact += usize::from((found.low..=found.high).contains(&truth));
                    any += usize::from((sure.low..=sure.high).contains(&truth));
                }
                let mean = sum / CAMPAIGNS as f64;
                assert!(
                    if failures == 1 {
                        mean.is_nan()
                    } else {
                        (mean - truth).abs() < 0.01
                    },
                    "{failures}: {mean}"
                );
                for covered in [exact, any] {
                    assert!(
                        covered * 100 >= CAMPAIGNS * 94,
                        "{truth}, {failures}: {exact} {any} of {CAMPAIGNS}"
                    );
                }
            }
        }
    }

    /// A second property fails in some of the failed runs only, and a user may stop when the rate
    /// looks worst.
    #[test]
    fn anytime_intervals_cover_whatever_ends_the_runs() {
        const CAMPAIGNS: usize = 4_000;
        let (mut state, mut of_other, mut at_worst, mut wilson_at_worst) = (7, 0, 0, 0);
        let covers = |found: Option<Interval>| {
            found.is_some_and(|found| (found.low..=found.high).contains(&0.8))
        };
        let mut known = BTreeMap::new();
        for _ in 0..CAMPAIGNS {
            let (mut failed, mut other, mut runs) = (0, 0, 0);
            while failed < 3 {
                let drawn = uniform(&mut state);
                (runs, failed, other) = (
                    runs + 1,
                    failed + u64::from(drawn < 0.2),
                    other + u64::from(drawn < 0.08),
                );
            }
            let found = anytime(runs - other, runs).expect("it has runs");
            of_other += usize::from((found.low..=found.high).contains(&0.92));
            let mut passed = 0;
            let (mut covered, mut by_wilson) = (true, true);
            for runs in 1..=200 {
                passed += u64::from(uniform(&mut state) < 0.8);
                let found = known.entry((passed, runs));
                let found = found.or_insert_with(|| {
                    [covers(anytime(passed, runs)), covers(wilson(passed, runs))]
                });
                (covered, by_wilson) = (covered && found[0], by_wilson && found[1]);
            }
            (at_worst, wilson_at_worst) = (
                at_worst + usize::from(covered),
                wilson_at_worst + usize::from(by_wilson),
            );
        }
        assert!(
            of_other * 100 >= CAMPAIGNS * 95 && at_worst * 100 >= CAMPAIGNS * 95,
            "{of_other} {at_worst}"
        );
        assert!(
            wilson_at_worst * 100 < CAMPAIGNS * 80,
            "so the test can fail: {wilson_at_worst}"
        );
    }

    /// A stop by the width of Wilson's interval covers about as well as a number of runs: computed
    /// exactly, run by run.
    #[test]
    fn a_width_as_a_budget_needs_no_other_interval() {
        for width in [0.6, 0.3, 0.1] {
            for truth in [0.5, 0.7, 0.8, 0.9, 0.95, 0.99] {
                let (mut covered, mut runs, mut going) = (0.0, 0, vec![1.0]);
                while going.iter().any(|share| *share > 0.0) {
                    runs += 1;
                    let mut next = vec![0.0; going.len() + 1];
                    for (passed, share) in going.iter().enumerate() {
                        next[passed + 1] += share * truth;
                        next[passed] += share * (1.0 - truth);
                    }
                    for (passed, share) in next.iter_mut().enumerate() {
                        let found = wilson(passed as u64, runs).expect("it has runs");
                        if found.high - found.low <= width {
                            covered += if (found.low..=found.high).contains(&truth) {
                                *share
                            } else {
                                0.0
                            };
                            *share = 0.0;
                        }
                    }
                    going = next;
                }
                assert!(covered > 0.91, "{width} {truth}: {covered}");
            }
        }
    }

    /// Reference values by solving the binomial sums P(N ≤ n) and P(N ≥ n) = 0.025 with exact
    /// fractions.
    #[test]
    fn extreme_counts_have_the_known_ends() {
        let first = passes_until_failures(1, 1).expect("it has a run");
        assert_eq!((first.rate, first.low), (None, 0.0));
        assert!((first.high - 0.975).abs() < 1e-12, "{first:?}");
        // The first failure at the fifth run: 1 - (1 - q)^5 = 0.025, and (1 - q)^4 = 0.025.
        let fifth = passes_until_failures(1, 5).expect("it has runs");
        assert!(
            (fifth.high - libm::pow(0.975, 0.2)).abs() < 1e-12,
            "{fifth:?}"
        );
        assert!(
            (fifth.low - libm::pow(0.025, 0.25)).abs() < 1e-12,
            "{fifth:?}"
        );
        assert_eq!(
            passes_until_failures(3, 11).and_then(|found| found.rate),
            Some(0.8)
        );
        assert_eq!(
            (passes_until_failures(0, 5), passes_until_failures(3, 2)),
            (None, None)
        );
        assert_eq!(anytime(0, 0), None);
        assert_eq!(
            anytime(4, 4).map(|found| (found.rate, found.high)),
            Some((1.0, 1.0))
        );
        assert_eq!(anytime(0, 4).map(|found| found.low), Some(0.0));
        assert_eq!(Sampling::of(Some("width"), false), Sampling::Fixed);
        assert_eq!(
            Sampling::of(None, false).and(Sampling::of(Some("failures"), false)),
            Sampling::Stopped
        );
    }
}
