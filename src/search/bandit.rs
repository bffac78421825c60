//! The bandit strategy: each axis is divided into arms.

use super::archive::Archive;
use super::proposal::{Component, Marginal, Proposal};
use super::space::{Dimension, Space, bucket};

/// Number of arms of a continuous axis.
const SLICES: usize = 5;

/// Gives each arm a share that decreases with the number of standard errors of its mean above the
/// best arm's. So arms whose difference may be chance are explored, and clearly better ones are
/// exploited.
pub(crate) fn propose(space: &Space, archive: &Archive, property: usize) -> Proposal {
    let open = archive.open(space, property);
    if open.is_empty() {
        return Proposal::default();
    }
    let axes = space
        .dimensions()
        .iter()
        .enumerate()
        .map(|(axis, dimension)| {
            let arms = match dimension {
                Dimension::Continuous | Dimension::Normal | Dimension::Beside(_) => SLICES,
                Dimension::Categorical(count) | Dimension::Rising(count) => *count,
                Dimension::Aside => 1,
            };
            play(&open, axis, arms)
        });
    Proposal(vec![Component(axes.collect())])
}

/// Computes the shares of the arms of one axis.
fn play(open: &[(&[f64], f64)], axis: usize, arms: usize) -> Marginal {
    let mut sums = vec![0.0; arms];
    let mut counts = vec![0.0; arms];
    for (rank, (point, _)) in open.iter().enumerate() {
        // Use ranks instead of margins: their spread is known, and they don't depend on the
        // margin's unit.
        let arm = bucket(point[axis], arms);
        sums[arm] += (rank as f64 + 0.5) / open.len() as f64;
        counts[arm] += 1.0;
    }
    let scores: Vec<f64> = sums
        .iter()
        .zip(&counts)
        .map(|(sum, count)| {
            // Add one virtual point of middle rank, so that an arm without points is neither good
            // nor bad.
            let mean = (sum + 0.5) / (count + 1.0);
            mean / (RANK_DEVIATION / libm::sqrt(count + 1.0))
        })
        .collect();
    let best = scores.iter().copied().fold(f64::INFINITY, f64::min);
    Marginal::steps(
        &scores
            .iter()
            .map(|score| libm::exp(best - score))
            .collect::<Vec<_>>(),
    )
}

/// Standard deviation of a uniform number in [0, 1].
const RANK_DEVIATION: f64 = 0.288_675_134_594_812_9;
