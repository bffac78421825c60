//! The number of runs that would decide whether two failure rates differ.

use statrs::distribution::{ContinuousCDF as _, Normal};

/// Probability with which that many runs would show the difference, if it is real.
pub const POWER: f64 = 0.8;

/// Two failure rates to be compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoRates {
    /// Failure rate within a group.
    pub within: f64,
    /// Failure rate outside it.
    pub outside: f64,
    /// Share of the group among all runs.
    pub share: f64,
}

impl TwoRates {
    /// Returns the number of runs, within and outside together, with which the one-sided exact test
    /// at a level shows the difference with a probability. `None` if the rates are equal, or one of
    /// the groups is empty.
    ///
    /// With rates P1 and P2, r runs outside for each run within, and P̄ = (P1 + r P2) / (r + 1),
    /// the number within is m = m'/4 · (1 + √(1 + 2 (r + 1) / (m' r |P1 − P2|)))², where m' =
    /// (z₁₋ₗₑᵥₑₗ √((r + 1) P̄ (1 − P̄)) + zₚₒᵥₑᵣ √(r P1 (1 − P1) + P2 (1 − P2)))² / (r (P1 − P2)²).
    ///
    /// Source: J. L. Fleiss, A. Tytun and H. K. Ury, "A simple approximation for calculating sample
    /// sizes for comparing independent proportions", Biometrics 36 (1980) 343–346.
    pub fn runs_needed(&self, level: f64, power: f64) -> Option<f64> {
        let (uncorrected, ratio) = (self.uncorrected(level, power)?, self.ratio());
        let apart = (self.within - self.outside).abs();
        let root = libm::sqrt(1.0 + 2.0 * (ratio + 1.0) / (uncorrected * ratio * apart));
        Some(uncorrected / 4.0 * (1.0 + root) * (1.0 + root) * (1.0 + ratio))
    }

    /// Number of runs outside for each run within.
    fn ratio(&self) -> f64 {
        (1.0 - self.share) / self.share
    }

    /// The number of runs within, without the correction for continuity.
    fn uncorrected(&self, level: f64, power: f64) -> Option<f64> {
        let normal = Normal::new(0.0, 1.0).ok()?;
        let (ratio, apart) = (self.ratio(), self.within - self.outside);
        if apart == 0.0 || !(ratio > 0.0 && ratio.is_finite()) || !(level > 0.0 && level < 1.0) {
            return None;
        }
        let varies = |rate: f64| rate * (1.0 - rate);
        let mean = (self.within + ratio * self.outside) / (ratio + 1.0);
        let alike = libm::sqrt((ratio + 1.0) * varies(mean));
        let apart_by = libm::sqrt(ratio * varies(self.within) + varies(self.outside));
        let root = normal.inverse_cdf(1.0 - level) * alike + normal.inverse_cdf(power) * apart_by;
        Some(root * root / (ratio * apart * apart))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TwoByTwo;

    /// Probability of k successes of n.
    fn binomial(n: u64, k: u64, rate: f64) -> f64 {
        (1..=k).fold(libm::pow(1.0 - rate, (n - k) as f64), |p, i| {
            p * rate * (n - k + i) as f64 / i as f64
        })
    }

    /// R's manual: `power.prop.test(p1 = .50, p2 = .75, power = .90)` gives n = 76.7 for each
    /// group, two-sided at 5 %. Table A.3 of Fleiss's "Statistical Methods for Rates and
    /// Proportions", corrected for continuity: 85.
    #[test]
    fn the_number_of_runs_equals_known_values() {
        let rates = TwoRates {
            within: 0.75,
            outside: 0.5,
            share: 0.5,
        };
        let uncorrected = rates.uncorrected(0.025, 0.9).expect("the rates differ");
        assert!((uncorrected - 76.7).abs() < 0.05, "{uncorrected}");
        let corrected = rates.runs_needed(0.025, 0.9).expect("the rates differ") / 2.0;
        assert_eq!(corrected.ceil(), 85.0);
    }

    #[test]
    fn the_exact_test_has_the_wanted_power_with_that_many_runs() {
        for (within, outside, share, level) in [
            (0.6, 0.2, 0.5, 0.05),
            (0.5, 0.1, 0.25, 0.01),
            (0.35, 0.05, 0.6, 0.001),
        ] {
            let needed = TwoRates {
                within,
                outside,
                share,
            }
            .runs_needed(level, POWER)
            .expect("the rates differ");
            let (n, m) = (
                (needed * share).ceil() as u64,
                (needed * (1.0 - share)).ceil() as u64,
            );
            let mut power = 0.0;
            for a in 0..=n {
                for b in 0..=m {
                    let table = TwoByTwo {
                        failed_in: a,
                        passed_in: n - a,
                        failed_out: b,
                        passed_out: m - b,
                    };
                    if table.fisher().greater <= level {
                        power += binomial(n, a, within) * binomial(m, b, outside);
                    }
                }
            }
            // The continuity correction errs on the side of more runs, most of all at a strict
            // level.
            assert!(
                (POWER - 0.03..POWER + 0.1).contains(&power),
                "{power} with {n} and {m} runs at {level}"
            );
        }
    }

    #[test]
    fn equal_rates_are_never_decided() {
        let rates = TwoRates {
            within: 0.5,
            outside: 0.5,
            share: 0.5,
        };
        assert_eq!(rates.runs_needed(0.05, POWER), None);
        assert_eq!(
            TwoRates {
                outside: 0.1,
                share: 1.0,
                ..rates
            }
            .runs_needed(0.05, POWER),
            None
        );
    }
}
