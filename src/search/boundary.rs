//! The boundary strategy: a model of the margin, and the boundary between pass and fail.

use nalgebra::{DMatrix, DVector};

use super::archive::Archive;
use super::proposal::{Component, Marginal, Proposal};
use super::space::{Dimension, Space, bucket};

/// Standard deviation about the model's minimum, as a share of an axis.
const MODEL_SIGMA: f64 = 0.12;

/// Standard deviation about a point near the boundary, as a share of an axis.
const EDGE_SIGMA: f64 = 0.07;

/// Number of boundary points followed at a time.
const EDGE_POINTS: usize = 4;

/// Minimum share of explained variance. A worse model is discarded, and points stay plain random.
const LEAST_EXPLAINED: f64 = 0.15;

/// Ridge penalty, as an equivalent number of points.
const RIDGE: f64 = 0.5;

/// Proposes points near the model's minimum and, after the first failure, near the points with
/// margins closest to 0.
pub(crate) fn propose(space: &Space, archive: &Archive, property: usize) -> Proposal {
    let mut components = Vec::new();
    let open = archive.open(space, property);
    if let Some(model) = Model::fit(space, &open) {
        components.push(model.least(space));
    }
    if open.first().is_some_and(|(_, margin)| *margin <= 0.0) {
        let mut edge = open;
        edge.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        components.extend(
            edge.iter()
                .take(EDGE_POINTS)
                .map(|(point, _)| about(space, point, EDGE_SIGMA)),
        );
    }
    Proposal(components)
}

/// Returns normal distributions about a point. Most draws keep the point's category.
fn about(space: &Space, point: &[f64], sigma: f64) -> Component {
    let axes = space
        .dimensions()
        .iter()
        .zip(point)
        .map(|(dimension, value)| match dimension.categories() {
            _ if !dimension.is_learnt() => Marginal::uniform(),
            None => Marginal::Normal {
                mean: *value,
                sigma,
            },
            Some(count) => {
                let mut shares = vec![sigma; count];
                shares[bucket(*value, count)] = 1.0;
                Marginal::steps(&shares)
            }
        });
    Component(axes.collect())
}

/// A model of the margin: the sum of a parabola for each continuous axis and a constant for each
/// category.
struct Model {
    coefficients: DVector<f64>,
}

impl Model {
    /// Fits a weighted ridge regression to all open points, in which low margins weigh most.
    /// Returns `None` if there are too few points or the model explains too little.
    fn fit(space: &Space, open: &[(&[f64], f64)]) -> Option<Self> {
        let width = 1 + space
            .dimensions()
            .iter()
            .map(|dimension| terms(*dimension))
            .sum::<usize>();
        if open.len() < width {
            return None;
        }
        let rows: Vec<DVector<f64>> = open
            .iter()
            .map(|(point, _)| features(space, point))
            .collect();
        // The weight decreases linearly with the rank, from 1 for the lowest margin to nearly 0 for
        // the highest.
        let weight = |rank: usize| 1.0 - rank as f64 / open.len() as f64;
        let total: f64 = (0..open.len()).map(weight).sum();
        let mean = open
            .iter()
            .enumerate()
            .map(|(rank, (_, margin))| weight(rank) * margin)
            .sum::<f64>()
            / total;
        let mut gram = DMatrix::<f64>::zeros(width, width);
        let mut moment = DVector::<f64>::zeros(width);
        for (rank, (row, (_, margin))) in rows.iter().zip(open).enumerate() {
            gram.ger(weight(rank), row, row, 1.0);
            moment.axpy(weight(rank) * (margin - mean), row, 1.0);
        }
        (1..width).for_each(|term| gram[(term, term)] += RIDGE);
        let coefficients = gram.cholesky()?.solve(&moment);
        let (mut missed, mut spread) = (0.0, 0.0);
        for (rank, (row, (_, margin))) in rows.iter().zip(open).enumerate() {
            let away = margin - mean;
            let residual = away - row.dot(&coefficients);
            missed += weight(rank) * residual * residual;
            spread += weight(rank) * away * away;
        }
        // Each coefficient also explains some noise: use Theil's adjusted R² (1961).
        let freedom = (open.len() as f64 - 1.0) / (open.len() as f64 - width as f64).max(1.0);
        (spread > 0.0 && 1.0 - freedom * missed / spread > LEAST_EXPLAINED)
            .then_some(Self { coefficients })
    }

    /// Returns normal distributions about the model's minimum, which is separable by axis.
    fn least(&self, space: &Space) -> Component {
        let mut at = 1;
        let mut point = Vec::with_capacity(space.dimensions().len());
        for dimension in space.dimensions() {
            let own = self.coefficients.rows(at, terms(*dimension));
            let value = match dimension.categories() {
                _ if !dimension.is_learnt() => 0.5,
                None => least_of_parabola(own[0], own[1]),
                Some(count) => (own.imin() as f64 + 0.5) / count as f64,
            };
            point.push(value);
            at += terms(*dimension);
        }
        about(space, &point, MODEL_SIGMA)
    }
}

fn terms(dimension: Dimension) -> usize {
    if dimension.is_learnt() {
        dimension.categories().unwrap_or(2)
    } else {
        0
    }
}

fn features(space: &Space, point: &[f64]) -> DVector<f64> {
    let mut row = vec![1.0];
    for (dimension, value) in space.dimensions().iter().zip(point) {
        match dimension.categories() {
            _ if !dimension.is_learnt() => {}
            None => row.extend([value - 0.5, (value - 0.5) * (value - 0.5)]),
            Some(count) => {
                row.extend(
                    (0..count)
                        .map(|category| f64::from(u8::from(category == bucket(*value, count)))),
                );
            }
        }
    }
    DVector::from_vec(row)
}

/// Returns the `x` in [0, 1] that minimises `a (x - ½) + b (x - ½)²`.
fn least_of_parabola(a: f64, b: f64) -> f64 {
    if b > 0.0 {
        (0.5 - a / (2.0 * b)).clamp(0.0, 1.0)
    } else if a > 0.0 {
        0.0
    } else {
        1.0
    }
}
