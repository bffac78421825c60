//! The cross-entropy strategy: a distribution fitted repeatedly to the best points.

use super::archive::Archive;
use super::proposal::{Component, Marginal, Proposal};
use super::space::{Dimension, Space, bucket};

/// Number of lowest margins from which the elite is chosen: few enough to descend, many enough not
/// to lose a valley.
const CANDIDATES: usize = 24;

/// Number of points in a fit: the candidates nearest to the best one, so that two valleys are not
/// averaged.
const ELITE: usize = 8;

/// Minimum standard deviation of a fit, as a share of an axis, so that it does not stall.
const LEAST_SIGMA: f64 = 0.04;

/// Weight of the uniform prior of a categorical axis, in points.
const PRIOR: f64 = 0.5;

/// Fits independent normal distributions (and shares of categories) to the elite of the open
/// points.
///
/// Source: Rubinstein's cross-entropy method (1999), with an elite that is a neighbourhood.
pub(crate) fn propose(space: &Space, archive: &Archive, property: usize) -> Proposal {
    let open = archive.open(space, property);
    let Some((best, _)) = open.first() else {
        return Proposal::default();
    };
    let mut elite: Vec<&[f64]> = open
        .iter()
        .take(CANDIDATES)
        .map(|(point, _)| *point)
        .collect();
    elite.sort_by(|a, b| space.distance(best, a).total_cmp(&space.distance(best, b)));
    elite.truncate(ELITE);
    let axes = space.dimensions().iter().enumerate();
    Proposal(vec![Component(
        axes.map(|(axis, dimension)| fit(*dimension, &elite, axis))
            .collect(),
    )])
}

fn fit(dimension: Dimension, elite: &[&[f64]], axis: usize) -> Marginal {
    if !dimension.is_learnt() {
        return Marginal::uniform();
    }
    let count = elite.len() as f64;
    match dimension.categories() {
        None => {
            let mean = elite.iter().map(|point| point[axis]).sum::<f64>() / count;
            let variance = elite
                .iter()
                .map(|point| (point[axis] - mean) * (point[axis] - mean))
                .sum::<f64>()
                / count;
            Marginal::Normal {
                mean,
                sigma: libm::sqrt(variance).max(LEAST_SIGMA),
            }
        }
        Some(categories) => {
            let mut shares = vec![PRIOR / categories as f64; categories];
            elite
                .iter()
                .for_each(|point| shares[bucket(point[axis], categories)] += 1.0);
            Marginal::steps(&shares)
        }
    }
}
