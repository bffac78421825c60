//! Compares two rates over the same scenes: difference, confidence interval and exact tests.

use serde::Serialize;
use statrs::distribution::{Binomial, DiscreteCDF};
use statrs::function::beta::{beta_reg, ln_beta};

use crate::Sampling;
use crate::stopped::anytime_share;

/// The 97.5 % quantile of the normal distribution, for 95 % intervals.
const Z: f64 = 1.959_963_984_540_054;

/// Counts of the scenes that two campaigns share, by their outcomes in each.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct PairedTable {
    /// Passed in both.
    pub both: u64,
    /// Passed in the first, failed in the second.
    pub only_first: u64,
    /// Failed in the first, passed in the second.
    pub only_second: u64,
    /// Failed in both.
    pub neither: u64,
}

/// The second rate minus the first, with its 95 % confidence interval. All three lie in [-1, 1].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Positive if the second is better.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// P-values under the hypothesis that in discordant scenes either side fails with probability ½.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairedTest {
    /// McNemar's exact test, two-sided.
    pub two_sided: f64,
    /// Mid-p value: the observed table has half its weight. Less conservative, closer to the
    /// nominal level.
    pub mid_p: f64,
    /// One-sided p-value of "the second is worse".
    pub second_worse: f64,
}

impl PairedTable {
    /// Counts one scene.
    pub fn add(&mut self, first: bool, second: bool) {
        *match (first, second) {
            (true, true) => &mut self.both,
            (true, false) => &mut self.only_first,
            (false, true) => &mut self.only_second,
            (false, false) => &mut self.neither,
        } += 1;
    }

    /// Returns the number of scenes.
    pub fn pairs(self) -> u64 {
        self.both + self.only_first + self.only_second + self.neither
    }

    /// Returns the number of scenes passed in the first and in the second.
    pub fn passed(self) -> [u64; 2] {
        [self.both + self.only_first, self.both + self.only_second]
    }

    /// Computes the difference of the rates, or returns `None` without scenes.
    ///
    /// The interval is Tango's score interval, which keeps its coverage for few scenes and for
    /// tables with zeros. Source: T. Tango, "Equivalence test and confidence interval for the
    /// difference in proportions for the paired-sample design", Statistics in Medicine 17 (1998)
    /// 891–908.
    pub fn difference(self) -> Option<Difference> {
        if self.pairs() == 0 {
            return None;
        }
        let value = (self.only_second as f64 - self.only_first as f64) / self.pairs() as f64;
        // The score decreases with the hypothetical difference, and is 0 at the observed one.
        let low = if value == -1.0 {
            -1.0
        } else {
            crossing(-1.0, value, |supposed| self.score(supposed) > Z)
        };
        let high = if value == 1.0 {
            1.0
        } else {
            crossing(value, 1.0, |supposed| self.score(supposed) > -Z)
        };
        Some(Difference { value, low, high })
    }

    /// As [`PairedTable::difference`], valid for the way in which the number of scenes was decided.
    /// If outcomes did, the interval is that of the difference of two shares of scenes, of which
    /// each keeps to its own interval with 97.5 % at any time.
    pub fn difference_by(self, sampling: Sampling) -> Option<Difference> {
        if sampling == Sampling::Fixed {
            return self.difference();
        }
        let pairs = self.pairs() as f64;
        let share = |count: u64| anytime_share(count as f64 / pairs, pairs, 0.025);
        let (first, second) = (share(self.only_first)?, share(self.only_second)?);
        let value = (self.only_second as f64 - self.only_first as f64) / pairs;
        Some(Difference {
            value,
            low: second.low - first.high,
            high: second.high - first.low,
        })
    }

    /// As [`PairedTable::test`], valid for the way in which the number of scenes was decided.
    ///
    /// Source: if neither side is better, the likelihood of the directions of the discordant
    /// scenes, averaged over a uniform prior of the probability of one direction, divided by that
    /// under ½, is a martingale of mean 1. By Ville's inequality, its inverse is a valid p-value
    /// whenever the runs ended (Robbins, 1970). One-sided: the prior is uniform above ½.
    pub fn test_by(self, sampling: Sampling) -> PairedTest {
        if sampling == Sampling::Fixed {
            return self.test();
        }
        let (worse, better) = (self.only_first as f64 + 1.0, self.only_second as f64 + 1.0);
        let ratio =
            libm::exp(ln_beta(worse, better) + (worse + better - 2.0) * std::f64::consts::LN_2);
        let above = 2.0 * (1.0 - beta_reg(worse, better, 0.5));
        let p = |ratio: f64| if ratio > 1.0 { 1.0 / ratio } else { 1.0 };
        PairedTest {
            two_sided: p(ratio),
            mid_p: p(ratio),
            second_worse: p(ratio * above),
        }
    }

    /// Returns the distance of the observed difference above a hypothetical one in (-1, 1), in
    /// standard errors.
    fn score(self, supposed: f64) -> f64 {
        let (n, up, down) = (
            self.pairs() as f64,
            self.only_second as f64,
            self.only_first as f64,
        );
        // Maximum likelihood estimate of the share of scenes that only the first passes, given the
        // hypothetical difference: a root of ax² + bx + c.
        let a = 2.0 * n;
        let b = -up - down + (2.0 * n - up + down) * supposed;
        let c = -down * supposed * (1.0 - supposed);
        let share = (libm::sqrt((b * b - 4.0 * a * c).max(0.0)) - b) / (2.0 * a);
        let variance = n * (2.0 * share + supposed * (1.0 - supposed));
        let distance = up - down - n * supposed;
        // Without variance, any difference is infinitely significant.
        if distance == 0.0 {
            0.0
        } else {
            distance / libm::sqrt(variance.max(f64::MIN_POSITIVE))
        }
    }

    /// Performs McNemar's exact test: if neither side is better, either direction of a discordant
    /// scene has probability ½.
    ///
    /// Source: Q. McNemar, Psychometrika 12 (1947) 153–157; its exact form and the mid-p value as
    /// in Fagerland, Lydersen and Laake, BMC Medical Research Methodology 13 (2013) 91.
    pub fn test(self) -> PairedTest {
        let differing = self.only_first + self.only_second;
        let Ok(coins) = Binomial::new(0.5, differing) else {
            return PairedTest {
                two_sided: 1.0,
                mid_p: 1.0,
                second_worse: 1.0,
            };
        };
        let at_most = |count: u64| coins.cdf(count).min(1.0);
        let below = |count: u64| count.checked_sub(1).map_or(0.0, at_most);
        let fewer = self.only_first.min(self.only_second);
        let here = at_most(fewer) - below(fewer);
        // "At least `only_first` discordant scenes" is by symmetry as probable as "at most
        // `only_second`".
        PairedTest {
            two_sided: (2.0 * at_most(fewer)).min(1.0),
            mid_p: (2.0 * at_most(fewer) - here).min(1.0),
            second_worse: at_most(self.only_second),
        }
    }
}

/// Finds by bisection the point between `from` and `to` at which a condition stops holding.
fn crossing(from: f64, to: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut holding, mut failing) = (from, to);
    // 60 halvings of an interval of at most 2 leave less than the last bit.
    for _ in 0..60 {
        let middle = 0.5 * (holding + failing);
        if holds(middle) {
            holding = middle
        } else {
            failing = middle
        }
    }
    0.5 * (holding + failing)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(both: u64, only_first: u64, only_second: u64, neither: u64) -> PairedTable {
        PairedTable {
            both,
            only_first,
            only_second,
            neither,
        }
    }

    /// The examples of Fagerland, Lydersen and Laake, "Recommended tests and confidence intervals
    /// for paired binomial proportions", Statistics in Medicine 33 (2014) 2850–2875: airway
    /// hyper-responsiveness (Bentur et al. 2009) and complete response (Cavo et al. 2012). Their
    /// difference is the first rate minus the second, ours the second minus the first.
    #[test]
    fn results_match_published_examples() {
        for (table, low, high, exact, mid_p) in [
            (table(1, 1, 7, 12), 0.026, 0.517, 0.0703, 0.0391),
            (table(59, 6, 16, 80), 0.0054, 0.124, 0.0525, 0.0347),
        ] {
            let difference = table.difference().expect("the table has pairs");
            assert!((difference.low - low).abs() < 5e-4, "{difference:?}");
            assert!((difference.high - high).abs() < 5e-4, "{difference:?}");
            let test = table.test();
            assert!((test.two_sided - exact).abs() < 5e-5, "{test:?}");
            assert!((test.mid_p - mid_p).abs() < 5e-5, "{test:?}");
        }
    }

    /// Compares with sums of integer binomial coefficients.
    #[test]
    fn the_exact_test_matches_binomial_sums() {
        for differing in 0..=40u64 {
            let mut row = vec![1u64];
            for _ in 0..differing {
                let next = row.windows(2).map(|pair| pair[0] + pair[1]);
                row = std::iter::once(1).chain(next).chain([1]).collect();
            }
            let all = (1u64 << differing) as f64;
            for only_second in 0..=differing {
                let at_most = row[..=only_second as usize].iter().sum::<u64>() as f64 / all;
                let test = table(3, differing - only_second, only_second, 5).test();
                assert!(
                    (test.second_worse - at_most).abs() < 1e-12,
                    "{test:?} {at_most}"
                );
                let fewer = only_second.min(differing - only_second) as usize;
                let two_sided = (2.0 * row[..=fewer].iter().sum::<u64>() as f64 / all).min(1.0);
                assert!(
                    (test.two_sided - two_sided).abs() < 1e-12,
                    "{test:?} {two_sided}"
                );
                assert!(test.mid_p <= test.two_sided);
            }
        }
    }

    #[test]
    fn the_interval_contains_the_difference_in_extreme_tables() {
        assert_eq!(PairedTable::default().difference(), None);
        for (table, value) in [
            (table(0, 5, 0, 0), -1.0),
            (table(0, 0, 5, 0), 1.0),
            (table(5, 0, 0, 0), 0.0),
            (table(0, 0, 0, 1), 0.0),
            (table(1, 1, 0, 0), -0.5),
        ] {
            let difference = table.difference().expect("the table has pairs");
            assert_eq!(difference.value, value);
            assert!(
                -1.0 <= difference.low && difference.low <= value,
                "{difference:?}"
            );
            assert!(
                value <= difference.high && difference.high <= 1.0,
                "{difference:?}"
            );
            assert!(difference.high - difference.low > 0.1, "{difference:?}");
        }
    }

    #[test]
    fn swapping_the_sides_negates_the_difference() {
        let (there, back) = (table(30, 12, 3, 9), table(30, 3, 12, 9));
        let [there, back] =
            [there, back].map(|table| table.difference().expect("the table has pairs"));
        assert!((there.low + back.high).abs() < 1e-12 && (there.high + back.low).abs() < 1e-12);
    }

    /// Simulates campaigns of 300 pairs that are looked at after each one. Returns the share in
    /// which a test is ever significant at 5 %, and the mean number of pairs until then.
    fn looked_at_always(worse: f64, better: f64, campaigns: u64) -> (f64, f64) {
        const PAIRS: u64 = 300;
        let (mut found, mut pairs) = (0, 0);
        // The p-value of each table is needed many times.
        let mut known = std::collections::HashMap::new();
        for campaign in 0..campaigns {
            let stream = actcheck_data::Stream::new(campaign);
            let mut seen = PairedTable::default();
            let mut until = PAIRS;
            for number in 1..=PAIRS {
                let drawn = stream.unit(number);
                match drawn {
                    _ if drawn < worse => seen.only_first += 1,
                    _ if drawn < worse + better => seen.only_second += 1,
                    _ => continue,
                }
                let p = *known
                    .entry((seen.only_first, seen.only_second))
                    .or_insert_with(|| seen.test_by(Sampling::Stopped).two_sided);
                if p <= 0.05 {
                    (found, until) = (found + 1, number);
                    break;
                }
            }
            pairs += until;
        }
        (
            f64::from(found) / campaigns as f64,
            pairs as f64 / campaigns as f64,
        )
    }

    /// A gate that is looked at after each pair has at most 5 % false alarms over all looks
    /// together, and finds a regression of 20 points early.
    #[test]
    fn a_gate_may_be_looked_at_at_any_time() {
        for discordant in [0.05, 0.1, 0.3] {
            let (alarms, _) = looked_at_always(discordant / 2.0, discordant / 2.0, 10_000);
            assert!(alarms <= 0.05, "{alarms} at {discordant}");
        }
        let (found, pairs) = looked_at_always(0.21, 0.01, 2_000);
        assert!(found > 0.99 && pairs <= 60.0, "{found} after {pairs} pairs");
    }
}
