//! A point, edge, triangle or tetrahedron, and its point that is nearest to the origin.

use nalgebra::{Matrix3, Vector3};

use super::Corner;

/// Most corners of a simplex in space.
const MAX_CORNERS: usize = 4;
/// Least share of the product of its edges that the area of a triangle or volume of a tetrahedron must have, squared or
/// not: flatter ones say nothing about where the origin is.
const FLAT: f64 = 1e-12;

/// Up to four corners, of which each is needed for the point that is nearest to the origin.
#[derive(Debug, Clone)]
pub(super) struct Simplex {
    corners: [Corner; MAX_CORNERS],
    n_corners: usize,
    weights: [f64; MAX_CORNERS],
    nearest: Vector3<f64>,
}

impl Simplex {
    pub(super) fn new(corner: Corner) -> Self {
        Self { corners: [corner; MAX_CORNERS], n_corners: 1, weights: [1.0, 0.0, 0.0, 0.0], nearest: corner.point }
    }

    pub(super) fn corners(&self) -> &[Corner] {
        &self.corners[..self.n_corners]
    }

    /// The point of it that is nearest to the origin.
    pub(super) fn nearest(&self) -> Vector3<f64> {
        self.nearest
    }

    /// The points of both solids whose difference is the nearest one.
    pub(super) fn points(&self) -> [Vector3<f64>; 2] {
        let weighted = |which: usize| {
            self.corners().iter().zip(&self.weights).map(|(corner, weight)| corner.of[which] * *weight).sum()
        };
        [weighted(0), weighted(1)]
    }

    pub(super) fn has(&self, corner: &Corner) -> bool {
        self.corners().iter().any(|known| known.point == corner.point)
    }

    pub(super) fn is_around_origin(&self) -> bool {
        self.n_corners == MAX_CORNERS
    }

    /// Adds a corner and drops those that are not needed for the nearest point.
    pub(super) fn add(&mut self, corner: Corner) {
        self.corners[self.n_corners] = corner;
        let n_corners = self.n_corners + 1;
        let mut best: Option<(f64, usize, [f64; MAX_CORNERS], Vector3<f64>)> = None;
        // The new corner is in every candidate: the nearest point of the others is known and is not the nearest of all.
        for subset in (1_usize << self.n_corners)..(1 << n_corners) {
            let mut chosen = [Vector3::zeros(); MAX_CORNERS];
            let mut n_chosen = 0;
            for idx in (0..n_corners).filter(|idx| subset >> idx & 1 == 1) {
                chosen[n_chosen] = self.corners[idx].point;
                n_chosen += 1;
            }
            let Some(weights) = weights(&chosen[..n_chosen]) else { continue };
            if weights.iter().any(|weight| *weight < 0.0) {
                continue;
            }
            let at: Vector3<f64> = chosen.iter().zip(&weights).map(|(point, weight)| point * *weight).sum();
            let far = if n_chosen == MAX_CORNERS { 0.0 } else { at.norm_squared() };
            if best.is_none_or(|(known, ..)| far < known) {
                best = Some((far, subset, weights, at));
            }
        }
        let Some((_, subset, weights, at)) = best else { return };
        let mut n_kept = 0;
        for idx in (0..n_corners).filter(|idx| subset >> idx & 1 == 1) {
            self.corners[n_kept] = self.corners[idx];
            n_kept += 1;
        }
        (self.n_corners, self.weights, self.nearest) = (n_kept, weights, at);
    }
}

/// Weights of the points, whose sum is 1, for the point of the plane, line or space through them that is nearest to the
/// origin. Returns `None` if they don't span it.
fn weights(points: &[Vector3<f64>]) -> Option<[f64; MAX_CORNERS]> {
    let base = points[0];
    let edge = |idx: usize| points[idx] - base;
    let rest = match points.len() {
        1 => [0.0; 3],
        2 => {
            let along = edge(1);
            let square = along.norm_squared();
            if square == 0.0 {
                return None;
            }
            [-base.dot(&along) / square, 0.0, 0.0]
        }
        3 => {
            let (one, other) = (edge(1), edge(2));
            let (a, b, c) = (one.norm_squared(), one.dot(&other), other.norm_squared());
            let area = a * c - b * b;
            if area <= FLAT * a * c {
                return None;
            }
            let (p, q) = (-base.dot(&one), -base.dot(&other));
            [(p * c - q * b) / area, (q * a - p * b) / area, 0.0]
        }
        _ => {
            let edges = Matrix3::from_columns(&[edge(1), edge(2), edge(3)]);
            let lengths = edge(1).norm() * edge(2).norm() * edge(3).norm();
            if edges.determinant().abs() <= FLAT * lengths {
                return None;
            }
            let found = edges.try_inverse()? * -base;
            [found.x, found.y, found.z]
        }
    };
    Some([1.0 - rest.iter().sum::<f64>(), rest[0], rest[1], rest[2]])
}
