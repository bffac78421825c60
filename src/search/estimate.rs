//! Estimates the probability of a failure under the nominal distribution from importance-weighted
//! points.

use statrs::distribution::{ContinuousCDF, Gamma};

/// Probability of each tail outside a 95 % interval.
const TAIL: f64 = 0.025;

/// A probability with its 95 % confidence interval. All three lie in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The unbiased estimate, clamped to 1.
    pub rate: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Sums of weights of failed and passed points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Weighted {
    points: u64,
    largest: f64,
    /// Sum of weights and sum of squared weights of the failed points, and of the passed points.
    failed: [f64; 2],
    passed: [f64; 2],
}

impl Weighted {
    /// Adds a point with its weight and the largest possible weight of a point in its generation.
    pub fn add(&mut self, weight: f64, largest: f64, failed: bool) {
        self.points += 1;
        self.largest = self.largest.max(largest);
        let sums = if failed {
            &mut self.failed
        } else {
            &mut self.passed
        };
        sums[0] += weight;
        sums[1] += weight * weight;
    }

    /// Number of points.
    pub fn points(&self) -> u64 {
        self.points
    }

    /// Estimates the probability of a failure. Returns `None` without points.
    ///
    /// The interval counts the event (failure or pass) with less total weight, so that it is valid
    /// for rare failures, rare passes, and unseen events: an unseen event may have up to the
    /// largest weight. Source: the conservative gamma interval of Fay and Feuer (1997) for weighted
    /// sums of counts.
    pub fn estimate(&self) -> Option<Estimate> {
        if self.points == 0 {
            return None;
        }
        let points = self.points as f64;
        let of = |sums: [f64; 2]| {
            let (low, high) = gamma_interval(sums[0], sums[1], self.largest);
            [sums[0], low, high].map(|sum| (sum / points).clamp(0.0, 1.0))
        };
        Some(if self.failed[0] <= self.passed[0] {
            let [rate, low, high] = of(self.failed);
            Estimate { rate, low, high }
        } else {
            // The rate is the unbiased one of the failures; the ends come from the passes.
            let [_, low, high] = of(self.passed);
            let rate = (self.failed[0] / points).clamp(0.0, 1.0);
            Estimate {
                rate,
                low: (1.0 - high).min(rate),
                high: (1.0 - low).max(rate),
            }
        })
    }
}

/// Returns the ends of the interval of a weighted sum of counts with this variance.
fn gamma_interval(sum: f64, variance: f64, largest: f64) -> (f64, f64) {
    let quantile = |sum: f64, variance: f64, level: f64| {
        let shape = sum * sum / variance;
        Gamma::new(shape, 1.0).map_or(sum, |gamma| variance / sum * gamma.inverse_cdf(level))
    };
    let low = if sum > 0.0 {
        quantile(sum, variance, TAIL)
    } else {
        0.0
    };
    (
        low.min(sum),
        quantile(sum + largest, variance + largest * largest, 1.0 - TAIL).max(sum),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(failed: u64, points: u64) -> Estimate {
        let mut sums = Weighted::default();
        (0..points).for_each(|index| sums.add(1.0, 1.0, index < failed));
        sums.estimate().expect("the sums have points")
    }

    /// For equal weights, the interval has Garwood's exact limits of a Poisson mean (table of
    /// 1936).
    #[test]
    fn equal_weights_give_the_exact_poisson_interval() {
        for (count, low, high) in [
            (0, 0.0, 3.689),
            (1, 0.025_32, 5.572),
            (5, 1.623, 11.668),
            (10, 4.795, 18.390),
        ] {
            let found = counted(count, 1000);
            assert!((found.low * 1000.0 - low).abs() < 2e-3, "{found:?}");
            assert!((found.high * 1000.0 - high).abs() < 2e-3, "{found:?}");
        }
    }

    #[test]
    fn interval_limits_are_ordered_for_every_count() {
        for failed in 0..=40 {
            let found = counted(failed, 40);
            assert!(0.0 <= found.low && found.low <= found.rate, "{found:?}");
            assert!(found.rate <= found.high && found.high <= 1.0, "{found:?}");
            assert!((found.rate - failed as f64 / 40.0).abs() < 1e-12);
        }
        assert_eq!(Weighted::default().estimate(), None);
    }
}
