//! What is unusual before anything is known: much noise, many things, and things close to each other.

use super::proposal::{Component, Marginal, Proposal};
use super::space::{Dimension, Space};

/// What the spread of noise is multiplied with. With 2.5 two fifths of it are beyond two standard deviations.
const SPREAD: f64 = 2.5;

/// Standard deviation of how far things lie from what they are put beside, in shares of the way that they could be.
const BESIDE: f64 = 0.15;

/// Noise is spread, what rises is drawn in proportion to its rank, and what can lie beside something else does; everything
/// else stays as it is. Nothing where the space has none of these.
///
/// Source: scaled-sigma sampling of Sun, Li and others (2015), which finds rare failures of circuits.
pub(crate) fn propose(space: &Space) -> Proposal {
    let known =
        |dimension: &Dimension| matches!(dimension, Dimension::Normal | Dimension::Rising(2..) | Dimension::Beside(_));
    if !space.dimensions().iter().any(known) {
        return Proposal::default();
    }
    let axis = |dimension: &Dimension| match dimension {
        Dimension::Normal => Marginal::Spread(SPREAD),
        Dimension::Rising(count) => Marginal::steps(&(1..=*count).map(|rank| rank as f64).collect::<Vec<_>>()),
        Dimension::Beside(axis) => Marginal::Beside { axis: *axis, sigma: BESIDE },
        Dimension::Continuous | Dimension::Categorical(_) => Marginal::steps(&[1.0]),
    };
    Proposal(vec![Component(space.dimensions().iter().map(axis).collect())])
}
