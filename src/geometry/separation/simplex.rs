//! A point, edge, triangle or tetrahedron, and its point that is nearest to the origin.

use nalgebra::{Matrix3, Vector3};

use super::Corner;

/// Most corners of a simplex in space.
const MAX_CORNERS: usize = 4;
/// Least share of the product of its edges that the area of a triangle or volume of a tetrahedron
/// must have, squared or not: flatter ones say nothing about where the origin is.
const FLAT: f64 = 1e-12;
/// Square of that share, above which the signs of weights are known in spite of rounding errors.
const NEARLY_FLAT: f64 = 1e-10;
/// A weight this far below 0 is below 0 however it is calculated.
const SURELY: f64 = 1e-9;

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
        Self {
            corners: [corner; MAX_CORNERS],
            n_corners: 1,
            weights: [1.0, 0.0, 0.0, 0.0],
            nearest: corner.point,
        }
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
            self.corners()
                .iter()
                .zip(&self.weights)
                .map(|(corner, weight)| corner.of[which] * *weight)
                .sum()
        };
        [weighted(0), weighted(1)]
    }

    pub(super) fn has(&self, corner: &Corner) -> bool {
        self.corners()
            .iter()
            .any(|known| known.point == corner.point)
    }

    pub(super) fn is_around_origin(&self) -> bool {
        self.n_corners == MAX_CORNERS
    }

    /// Adds a corner and drops those that are not needed for the nearest point.
    pub(super) fn add(&mut self, corner: Corner) {
        self.corners[self.n_corners] = corner;
        let n_known = self.n_corners;
        let points = self.corners.map(|corner| corner.point);
        let around = if n_known + 1 == MAX_CORNERS {
            weights_around_origin(&points)
        } else {
            None
        };
        let best = nearest_with_last(&points[..=n_known]);
        let best = match around {
            // Nothing is nearer, unless the origin is exactly on a side.
            Some(weights)
                if best
                    .as_ref()
                    .is_none_or(|side| side.at.norm_squared() > 0.0) =>
            {
                Some(Nearest {
                    subset: (1 << MAX_CORNERS) - 1,
                    weights,
                    at: weighted(&points, &weights),
                })
            }
            _ => best,
        };
        let Some(best) = best else { return };
        let mut n_kept = 0;
        for idx in (0..=n_known).filter(|idx| best.subset >> idx & 1 == 1) {
            self.corners[n_kept] = self.corners[idx];
            n_kept += 1;
        }
        (self.n_corners, self.weights, self.nearest) = (n_kept, best.weights, best.at);
    }
}

/// The point of a subset of the corners that is nearest to the origin.
struct Nearest {
    /// Bit `n` is set for the corner `n`.
    subset: usize,
    /// Weights of these corners, in their order.
    weights: [f64; MAX_CORNERS],
    at: Vector3<f64>,
}

fn weighted(points: &[Vector3<f64>], weights: &[f64]) -> Vector3<f64> {
    points
        .iter()
        .zip(weights)
        .map(|(point, weight)| point * *weight)
        .sum()
}

/// Finds the nearest point of the last corner, and of the edges and triangles of it and the others,
/// with the weights not below 0: the nearest point of the others alone is known and is not the
/// nearest of all.
fn nearest_with_last(points: &[Vector3<f64>]) -> Option<Nearest> {
    let (last, others) = points.split_last()?;
    let mut best = (
        last.norm_squared(),
        Nearest {
            subset: 1 << others.len(),
            weights: [1.0, 0.0, 0.0, 0.0],
            at: *last,
        },
    );
    // From each of the others to the last one, its square, and the way along it to the origin.
    let mut edges = [(Vector3::zeros(), 0.0, 0.0); MAX_CORNERS - 1];
    for (point, edge) in others.iter().zip(&mut edges) {
        let along = last - point;
        *edge = (along, along.norm_squared(), -point.dot(&along));
    }
    for known in 1_usize..1 << others.len() {
        let (first, rest) = (known.trailing_zeros() as usize, known & (known - 1));
        let (other, c, q) = edges[first];
        let subset = known | 1 << others.len();
        let found = if rest == 0 {
            weights_of_edge(c, q)
                .map(|[one, two]| ([one, two, 0.0, 0.0], points[first] * one + last * two))
        } else if rest & (rest - 1) == 0 {
            let second = rest.trailing_zeros() as usize;
            let one = points[second] - points[first];
            let (a, b, p) = (
                one.norm_squared(),
                one.dot(&other),
                -points[first].dot(&one),
            );
            weights_of_triangle([a, b, c], [p, q]).map(|[one, two, three]| {
                (
                    [one, two, three, 0.0],
                    points[first] * one + points[second] * two + last * three,
                )
            })
        } else {
            // A tetrahedron: the origin is not in it.
            None
        };
        let Some((weights, at)) = found else { continue };
        let far = at.norm_squared();
        if far < best.0 {
            best = (
                far,
                Nearest {
                    subset,
                    weights,
                    at,
                },
            );
        }
    }
    Some(best.1)
}

/// Weights of both ends of an edge for its point that is nearest to the origin, unless it is beyond
/// one of them. `square`: of the length of the edge; `way`: the product of the edge with the way
/// from its first end to the origin.
fn weights_of_edge(square: f64, way: f64) -> Option<[f64; 2]> {
    let second = way / square;
    let first = 1.0 - second;
    (square != 0.0 && first >= 0.0 && second >= 0.0).then_some([first, second])
}

/// As [`weights_of_edge`], for a triangle: the products of its first edge with itself, with the
/// second and of the second with itself, and those of both edges with the way to the origin.
fn weights_of_triangle([a, b, c]: [f64; 3], [p, q]: [f64; 2]) -> Option<[f64; 3]> {
    let area = a * c - b * b;
    let (second, third) = (p * c - q * b, q * a - p * b);
    if area <= FLAT * a * c || second < 0.0 || third < 0.0 {
        return None;
    }
    let (second, third) = (second / area, third / area);
    let first = 1.0 - (second + third);
    (first >= 0.0).then_some([first, second, third])
}

/// Weights of the corners of a tetrahedron with the origin in it; `None` if it is outside, or the
/// corners are in a plane.
fn weights_around_origin(points: &[Vector3<f64>; MAX_CORNERS]) -> Option<[f64; MAX_CORNERS]> {
    let base = points[0];
    let edges = [1, 2, 3].map(|idx| points[idx] - base);
    let [a, b, c] = edges;
    let across = [b.cross(&c), c.cross(&a), a.cross(&b)];
    let volume = a.dot(&across[0]);
    let squares = a.norm_squared() * b.norm_squared() * c.norm_squared();
    // Weights times the volume. In most cases one is far below 0.
    let parts = across.map(|across| -base.dot(&across) * volume.signum());
    let least = parts
        .into_iter()
        .fold(volume.abs() - parts.iter().sum::<f64>(), f64::min);
    if volume * volume > NEARLY_FLAT * squares && least < -SURELY * volume.abs() {
        return None;
    }
    if volume.abs() <= FLAT * squares.sqrt() {
        return None;
    }
    let found = Matrix3::from_columns(&edges).try_inverse()? * -base;
    let weights = [
        1.0 - (found.x + found.y + found.z),
        found.x,
        found.y,
        found.z,
    ];
    weights
        .iter()
        .all(|weight| *weight >= 0.0)
        .then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Choices;

    /// The nearest point of all subsets with the last corner, one by one.
    fn by_trial(points: &[Vector3<f64>]) -> Option<(usize, [f64; MAX_CORNERS], Vector3<f64>)> {
        let mut best: Option<(f64, usize, [f64; MAX_CORNERS], Vector3<f64>)> = None;
        for subset in (1_usize << (points.len() - 1))..(1 << points.len()) {
            let chosen: Vec<_> = (0..points.len())
                .filter(|idx| subset >> idx & 1 == 1)
                .map(|idx| points[idx])
                .collect();
            let Some(weights) = weights(&chosen) else {
                continue;
            };
            if weights.iter().any(|weight| *weight < 0.0) {
                continue;
            }
            let at: Vector3<f64> = chosen
                .iter()
                .zip(&weights)
                .map(|(point, weight)| point * *weight)
                .sum();
            let far = if chosen.len() == MAX_CORNERS {
                0.0
            } else {
                at.norm_squared()
            };
            if best.is_none_or(|(known, ..)| far < known) {
                best = Some((far, subset, weights, at));
            }
        }
        best.map(|(_, subset, weights, at)| (subset, weights, at))
    }

    /// Weights of the points, whose sum is 1, for the point of the plane, line or space through
    /// them that is nearest to the origin. Returns `None` if they don't span it.
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

    #[test]
    fn the_nearest_point_is_that_of_all_edges_triangles_and_the_tetrahedron() {
        let mut choices = Choices::random(5, 0);
        let mut subsets = std::collections::BTreeMap::new();
        for trial in 0..4000 {
            let mut number = || choices.real("at".into(), -1.0, 1.0, 0.0);
            let mut simplex: Option<Simplex> = None;
            for n in 0..6 {
                let mut point = Vector3::new(number(), number(), number());
                match trial % 4 {
                    // Many are in planes and on lines, also with the origin.
                    0 => point.apply(|at| *at = at.round()),
                    // Flat, as two faces that touch.
                    1 => point.z *= 1e-9,
                    2 => point *= 0.01,
                    _ => point.x += 0.5,
                }
                let corner = Corner {
                    point,
                    of: [point, Vector3::new(f64::from(n), 0.0, 0.0)],
                };
                let Some(simplex) = &mut simplex else {
                    simplex = Some(Simplex::new(corner));
                    continue;
                };
                if simplex.is_around_origin() || simplex.has(&corner) {
                    break;
                }
                let points: Vec<_> = simplex
                    .corners()
                    .iter()
                    .map(|known| known.point)
                    .chain([point])
                    .collect();
                simplex.add(corner);
                let Some((subset, weights, at)) = by_trial(&points) else {
                    panic!("trial {trial}: nothing")
                };
                let kept: Vec<_> = (0..points.len())
                    .filter(|idx| subset >> idx & 1 == 1)
                    .map(|idx| points[idx])
                    .collect();
                let found: Vec<_> = simplex
                    .corners()
                    .iter()
                    .map(|corner| corner.point)
                    .collect();
                assert_eq!(
                    (found, simplex.weights, simplex.nearest()),
                    (kept, weights, at),
                    "trial {trial}"
                );
                *subsets.entry(subset).or_insert(0) += 1;
            }
        }
        assert!(
            subsets.len() > 10 && subsets.values().all(|n| *n > 5),
            "all kinds of subsets: {subsets:?}"
        );
    }
}
