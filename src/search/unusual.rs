//! What is unusual before anything is known: much noise, and many things.

use super::proposal::{Component, Marginal, Proposal};
use super::space::{Dimension, Space};

/// What the spread of noise is multiplied with. With 2 a third of it is beyond two standard deviations.
const SPREAD: f64 = 2.0;

/// Noise is spread and what rises is drawn in proportion to its rank; everything else stays as it is. Nothing where the
/// space has neither.
///
/// Source: scaled-sigma sampling of Sun, Li and others (2015), which finds rare failures of circuits.
pub(crate) fn propose(space: &Space) -> Proposal {
    let known = |dimension: &Dimension| matches!(dimension, Dimension::Normal | Dimension::Rising(2..));
    if !space.dimensions().iter().any(known) {
        return Proposal::default();
    }
    let axis = |dimension: &Dimension| match dimension {
        Dimension::Normal => Marginal::Spread(SPREAD),
        Dimension::Rising(count) => Marginal::steps(&(1..=*count).map(|rank| rank as f64).collect::<Vec<_>>()),
        Dimension::Continuous | Dimension::Categorical(_) => Marginal::steps(&[1.0]),
    };
    Proposal(vec![Component(space.dimensions().iter().map(axis).collect())])
}
