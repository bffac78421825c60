//! Each axis as a row of arms.

use super::archive::Archive;
use super::proposal::{Component, Marginal, Proposal};
use super::space::{Dimension, Space, bucket};

/// Arms of a continuous axis.
const SLICES: usize = 5;

/// Arms are played by how many standard errors their mean is above the best one's, so that a difference that may be
/// chance is tried on, and one that is not is used.
pub(crate) fn propose(space: &Space, archive: &Archive, property: usize) -> Proposal {
    let open = archive.open(space, property);
    if open.is_empty() {
        return Proposal::default();
    }
    let axes = space.dimensions().iter().enumerate().map(|(axis, dimension)| {
        let arms = match dimension {
            Dimension::Continuous | Dimension::Normal | Dimension::Beside(_) => SLICES,
            Dimension::Categorical(count) | Dimension::Rising(count) => *count,
            Dimension::Aside => 1,
        };
        play(&open, axis, arms)
    });
    Proposal(vec![Component(axes.collect())])
}

/// The shares of the arms of one axis.
fn play(open: &[(&[f64], f64)], axis: usize, arms: usize) -> Marginal {
    let mut sums = vec![0.0; arms];
    let mut counts = vec![0.0; arms];
    for (rank, (point, _)) in open.iter().enumerate() {
        // Ranks instead of margins: their spread is known, and no unit of a margin matters.
        let arm = bucket(point[axis], arms);
        sums[arm] += (rank as f64 + 0.5) / open.len() as f64;
        counts[arm] += 1.0;
    }
    let scores: Vec<f64> = sums
        .iter()
        .zip(&counts)
        .map(|(sum, count)| {
            // One imagined point of middle rank: an arm that was never played is neither good nor bad.
            let mean = (sum + 0.5) / (count + 1.0);
            mean / (RANK_DEVIATION / libm::sqrt(count + 1.0))
        })
        .collect();
    let best = scores.iter().copied().fold(f64::INFINITY, f64::min);
    Marginal::steps(&scores.iter().map(|score| libm::exp(best - score)).collect::<Vec<_>>())
}

/// Standard deviation of a uniform number in [0, 1].
const RANK_DEVIATION: f64 = 0.288_675_134_594_812_9;
