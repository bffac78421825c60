//! Likelihood ratio score of patterns: separate failure rates within and outside a pattern against
//! one common rate.

/// Number of runs in the lower half, and of failures among them in the upper half. Counts can be
/// added.
pub(super) type Count = u64;

/// Returns the count of one run.
pub(super) fn one(failed: bool) -> Count {
    1 | (u64::from(failed) << 32)
}

/// Returns the runs and failures of a count.
pub(super) fn parts(count: Count) -> (usize, usize) {
    ((count & 0xFFFF_FFFF) as usize, (count >> 32) as usize)
}

/// Returns the failures of a count.
pub(super) fn failures_of(count: Count) -> u64 {
    count >> 32
}

/// Scores patterns among some runs.
///
/// The score is the logarithm of the likelihood ratio between one rate of failures within the
/// pattern and another outside it, and the same rate everywhere (binomial). It is largest for the
/// true boundary, regardless of the pattern's size, whereas weighted relative accuracy, which is
/// reported too, hardly penalises runs in a pattern that fail like all others. Unit: nats.
///
/// Source: M. Kulldorff, "A spatial scan statistic", Communications in Statistics – Theory and
/// Methods 26 (1997) 1481–1496.
pub(super) struct Likelihood {
    runs: u64,
    failed: u64,
    /// For each number of failures, of passes and of runs within a pattern: the sum of x ln x of
    /// this number and of those outside. Scores are asked for millions of times, and three sums
    /// take half the time of six logarithms.
    of_failed: Vec<f64>,
    of_passed: Vec<f64>,
    of_runs: Vec<f64>,
    /// Log-likelihood of a common rate.
    alike: f64,
}

impl Likelihood {
    /// Creates the scores for these runs.
    pub fn new(all: Count) -> Self {
        let (runs, failed) = parts(all);
        let x_ln_x: Vec<f64> = (0..=runs)
            .map(|x| {
                if x == 0 {
                    0.0
                } else {
                    x as f64 * libm::log(x as f64)
                }
            })
            .collect();
        let alike = x_ln_x[failed] + x_ln_x[runs - failed] - x_ln_x[runs];
        let of = |all: usize| {
            (0..=all)
                .map(|within| x_ln_x[within] + x_ln_x[all - within])
                .collect()
        };
        Self {
            runs: runs as u64,
            failed: failed as u64,
            of_failed: of(failed),
            of_passed: of(runs - failed),
            of_runs: of(runs),
            alike,
        }
    }

    /// Returns the score of a pattern, or 0 if its runs fail no more often than the others.
    pub fn gain(&self, within: Count) -> f64 {
        let (runs, failed) = parts(within);
        // No overflow: all counts are below 2^32.
        if (failed as u64).wrapping_mul(self.runs) <= (runs as u64).wrapping_mul(self.failed) {
            return 0.0;
        }
        self.of_failed[failed] + self.of_passed[runs.wrapping_sub(failed)]
            - self.of_runs[runs]
            - self.alike
    }

    /// Returns how many failures a pattern needs at least to score above `score`: as many as a
    /// pattern needs that has no passes.
    pub fn fewest_failures(&self, score: f64) -> u64 {
        // The score of a pattern without passes increases with its failures.
        let (mut below, mut above) = (0, self.failed + 1);
        while above - below > 1 {
            let failures = below + (above - below) / 2;
            if self.gain(failures | (failures << 32)) > score {
                above = failures;
            } else {
                below = failures;
            }
        }
        above
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_score_is_the_binomial_likelihood_ratio() {
        let count = |runs: u64, failed: u64| runs | (failed << 32);
        let likelihood = Likelihood::new(count(100, 20));
        let log = |p: f64, failed: f64, passed: f64| failed * p.ln() + passed * (1.0 - p).ln();
        let expected = log(0.6, 12.0, 8.0) + log(0.1, 8.0, 72.0) - log(0.2, 20.0, 80.0);
        assert!((likelihood.gain(count(20, 12)) - expected).abs() < 1e-12);
        assert_eq!(likelihood.gain(count(20, 4)), 0.0);
        assert_eq!(likelihood.gain(count(20, 1)), 0.0);
        for failed in 1..20 {
            let fewest = likelihood.fewest_failures(likelihood.gain(count(failed, failed)));
            assert_eq!(
                fewest,
                failed + 1,
                "a pattern of {failed} failures and no passes scores as much"
            );
        }
        assert_eq!(likelihood.fewest_failures(0.0), 1);
        assert_eq!(parts(one(true) + one(false) + one(true)), (3, 2));
    }
}
