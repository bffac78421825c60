//! Densities on the cube that can be sampled.

use rand_chacha::ChaCha8Rng;
use statrs::function::erf::{erf, erf_inv};

use super::fill::unit;
use super::space::bucket;

/// The largest number below 1, so that a point stays in the half-open cube.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Noise is clamped to this many standard deviations.
const FARTHEST: f64 = 4.0;

/// The distribution of one axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Marginal {
    /// Normal, truncated to [0, 1].
    Normal {
        /// Mean before truncation, in [0, 1].
        mean: f64,
        /// Standard deviation before truncation, positive.
        sigma: f64,
    },
    /// The quantile of a normally distributed number far from its mean. The distance is uniform
    /// from this many standard deviations to four.
    Far(f64),
    /// Normal about the value of an earlier axis, truncated to [0, 1].
    Beside {
        /// Index of that axis.
        axis: usize,
        /// Standard deviation before truncation, positive.
        sigma: f64,
    },
    /// Piecewise constant on equal intervals, one for each share. The shares sum to 1.
    Steps(Vec<f64>),
}

impl Marginal {
    /// Returns the nominal distribution.
    pub fn uniform() -> Self {
        Self::Steps(vec![1.0])
    }

    /// Returns a piecewise constant distribution with shares proportional to these numbers, or the
    /// uniform one if they are negative, not finite or all 0.
    pub fn steps(proportions: &[f64]) -> Self {
        let sum: f64 = proportions.iter().sum();
        if sum.is_finite() && sum > 0.0 && proportions.iter().all(|share| *share >= 0.0) {
            Self::Steps(proportions.iter().map(|share| share / sum).collect())
        } else {
            Self::uniform()
        }
    }

    /// Returns the density relative to the uniform one, given the values of earlier axes.
    fn density(&self, value: f64, earlier: &[f64]) -> f64 {
        match self {
            Self::Beside { axis, sigma } => beside(*axis, *sigma, earlier).density(value, earlier),
            Self::Normal { mean, sigma } => {
                let distance = (value - mean) / sigma;
                let (low, high) = cut(*mean, *sigma);
                let peak = 1.0 / (sigma * libm::sqrt(std::f64::consts::TAU));
                peak * libm::exp(-0.5 * distance * distance) / (high - low)
            }
            Self::Far(nearest) => {
                let deviation = quantile(value);
                if !(*nearest..=FARTHEST).contains(&deviation.abs()) {
                    return 0.0;
                }
                // Divide by the normal density, the derivative of the quantile with respect to the
                // deviation.
                let normal =
                    libm::exp(-0.5 * deviation * deviation) / libm::sqrt(std::f64::consts::TAU);
                0.5 / (FARTHEST - nearest) / normal
            }
            Self::Steps(shares) => shares[bucket(value, shares.len())] * shares.len() as f64,
        }
    }

    fn draw(&self, generator: &mut ChaCha8Rng, earlier: &[f64]) -> f64 {
        if let Self::Beside { axis, sigma } = self {
            return beside(*axis, *sigma, earlier).draw(generator, earlier);
        }
        let share = unit(generator);
        let value = match self {
            Self::Normal { mean, sigma } => {
                let (low, high) = cut(*mean, *sigma);
                mean + sigma * quantile(low + (high - low) * share)
            }
            // Handled above.
            Self::Beside { .. } => share,
            Self::Far(nearest) => {
                let along = (2.0 * share - 1.0) * (FARTHEST - nearest);
                below(along + nearest.copysign(along))
            }
            Self::Steps(shares) => {
                let mut below = 0.0;
                let mut step = 0;
                while step + 1 < shares.len() && below + shares[step] <= share {
                    below += shares[step];
                    step += 1;
                }
                let within = if shares[step] > 0.0 {
                    (share - below) / shares[step]
                } else {
                    0.5
                };
                (step as f64 + within.clamp(0.0, 1.0)) / shares.len() as f64
            }
        };
        value.clamp(0.0, BELOW_ONE)
    }
}

/// Returns the distribution about the value of an earlier axis, or about the middle if it has no
/// value.
fn beside(axis: usize, sigma: f64, earlier: &[f64]) -> Marginal {
    Marginal::Normal {
        mean: earlier.get(axis).copied().unwrap_or(0.5),
        sigma,
    }
}

/// Evaluates a normal distribution function at 0 and 1.
fn cut(mean: f64, sigma: f64) -> (f64, f64) {
    (below((0.0 - mean) / sigma), below((1.0 - mean) / sigma))
}

/// The standard normal distribution function.
fn below(deviation: f64) -> f64 {
    0.5 * (1.0 + erf(deviation / std::f64::consts::SQRT_2))
}

/// The inverse of [`below`].
fn quantile(share: f64) -> f64 {
    std::f64::consts::SQRT_2 * erf_inv(2.0 * share - 1.0)
}

/// A distribution with one marginal for each axis. Axes are independent, except for
/// [`Marginal::Beside`].
#[derive(Debug, Clone, PartialEq)]
pub struct Component(pub Vec<Marginal>);

impl Component {
    /// Returns the density relative to the uniform one.
    pub(super) fn density(&self, point: &[f64]) -> f64 {
        self.0
            .iter()
            .zip(point)
            .map(|(marginal, value)| marginal.density(*value, point))
            .product()
    }

    /// Draws a point.
    pub(super) fn draw(&self, generator: &mut ChaCha8Rng) -> Vec<f64> {
        let mut point = Vec::with_capacity(self.0.len());
        for marginal in &self.0 {
            let value = marginal.draw(generator, &point);
            point.push(value);
        }
        point
    }
}

/// An equally weighted mixture of components. An empty mixture is the uniform distribution.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Proposal(pub Vec<Component>);

impl Proposal {
    /// Returns the density relative to the uniform one. Its mean over the cube is 1.
    pub fn density(&self, point: &[f64]) -> f64 {
        if self.0.is_empty() {
            return 1.0;
        }
        self.0
            .iter()
            .map(|component| component.density(point))
            .sum::<f64>()
            / self.0.len() as f64
    }

    /// Draws a point.
    pub(crate) fn draw(&self, generator: &mut ChaCha8Rng, width: usize) -> Vec<f64> {
        let chosen = bucket(unit(generator), self.0.len());
        match self.0.get(chosen) {
            Some(component) => component.draw(generator),
            None => (0..width).map(|_| unit(generator)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fill::{random, stream};
    use super::*;

    fn skewed() -> Proposal {
        let normal = |mean, sigma| Marginal::Normal { mean, sigma };
        Proposal(vec![
            Component(vec![normal(0.1, 0.2), Marginal::steps(&[1.0, 3.0, 0.5])]),
            Component(vec![normal(0.9, 0.4), Marginal::steps(&[2.0, 1.0])]),
        ])
    }

    fn far() -> Proposal {
        let everywhere = Component(vec![Marginal::uniform(), Marginal::uniform()]);
        Proposal(vec![
            Component(vec![Marginal::Far(0.0), Marginal::Far(1.0)]),
            everywhere,
        ])
    }

    #[test]
    fn a_density_has_mean_one() {
        let density = skewed();
        let mean = (0..40_000)
            .map(|index| density.density(&random(1, index, 2)))
            .sum::<f64>()
            / 40_000.0;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }

    /// Samples follow the reported density: weighted by its inverse, every quarter has an equal
    /// share.
    #[test]
    fn samples_follow_the_density() {
        for density in [skewed(), far()] {
            let mut generator = stream(3, 9, 0);
            let mut quarters = [0.0; 4];
            for _ in 0..40_000 {
                let point = density.draw(&mut generator, 2);
                quarters[bucket(point[0], 2) * 2 + bucket(point[1], 2)] +=
                    1.0 / density.density(&point) / 40_000.0;
            }
            assert!(
                quarters.iter().all(|share| (share - 0.25).abs() < 0.01),
                "{quarters:?}"
            );
        }
    }

    /// Uses a grid, because random points estimate the mean of so steep a density poorly.
    #[test]
    fn a_tail_density_has_mean_one() {
        for nearest in [0.0, 1.0, 2.0, 3.0] {
            let at = |cell: u32| Marginal::Far(nearest).density((f64::from(cell) + 0.5) / 1e6, &[]);
            let mean = (0..1_000_000).map(at).sum::<f64>() / 1e6;
            assert!((mean - 1.0).abs() < 0.02, "{nearest}: {mean}");
        }
    }

    #[test]
    fn invalid_proportions_are_uniform() {
        assert_eq!(Marginal::steps(&[0.0, 0.0]), Marginal::Steps(vec![1.0]));
        assert_eq!(
            Marginal::steps(&[f64::NAN, 1.0]),
            Marginal::Steps(vec![1.0])
        );
        assert_eq!(Proposal::default().density(&[0.3]), 1.0);
    }
}
