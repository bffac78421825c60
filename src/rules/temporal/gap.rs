//! The distance between the surfaces of two things at each sample.
//!
//! Source: Gilbert, Johnson and Keerthi, "A fast procedure for computing the distance between
//! complex objects in three-dimensional space", 1988.

use crate::temporal::quantities::{place, recorded, turned_back};
use actcheck_base::{Course, Solid, names};

type Point = [f64; 3];

/// Iterations after which the nearest point so far counts. Solids of our sizes need about ten.
const MOST_ITERATIONS: usize = 64;
/// A gap is known if a further iteration shortens it by less than this share.
const ACCURACY: f64 = 1e-9;
/// Square of a distance below which two solids touch. Unit: square metres.
const TOUCHING: f64 = 1e-18;

/// Returns the smallest distance between the surfaces of two things; 0 if they touch or overlap.
/// The gripper is the point between its fingertips. Returns `None` if the shape or the poses of one
/// of them are not known.
pub(super) fn gaps(course: &Course, one: &str, other: &str) -> Option<Vec<f64>> {
    let (one, other) = (Body::of(course, one)?, Body::of(course, other)?);
    let mut guesses = Vec::new();
    let fixed = other.is_fixed().then(|| other.solids_at(0));
    let at_sample = |at: usize| {
        let moved;
        let others = match &fixed {
            Some(solids) => solids,
            None => {
                moved = other.solids_at(at);
                &moved
            }
        };
        gap(&one.solids_at(at), others, &mut guesses)
    };
    Some((0..course.count).map(at_sample).collect())
}

/// A thing with its solids and its poses.
struct Body {
    solids: Vec<Solid>,
    place: [Vec<f64>; 3],
    /// Components of its quaternions; `None` for a point.
    turn: Option<[Vec<f64>; 4]>,
}

impl Body {
    fn of(course: &Course, thing: &str) -> Option<Self> {
        let place = place(course, thing)?;
        if thing == names::w("gripper") {
            return Some(Self {
                solids: vec![Solid {
                    points: vec![[0.0; 3]],
                    radius: 0.0,
                }],
                place,
                turn: None,
            });
        }
        let [x, y, z, w] = ["qx", "qy", "qz", "qw"].map(|part| recorded(course, part, thing));
        let solids = course
            .solids(thing)
            .filter(|solids| !solids.is_empty())?
            .to_vec();
        Some(Self {
            solids,
            place,
            turn: Some([x?, y?, z?, w?]),
        })
    }

    /// Returns whether it has the same pose at all samples.
    fn is_fixed(&self) -> bool {
        let stays = |values: &Vec<f64>| values.iter().all(|value| Some(value) == values.first());
        self.place.iter().all(stays) && self.turn.iter().flatten().all(stays)
    }

    /// Returns its solids at a sample. Frame: world.
    fn solids_at(&self, at: usize) -> Vec<Solid> {
        let placed = |point: &Point| {
            let turned = match &self.turn {
                // The inverse of the inverse.
                Some([x, y, z, w]) => turned_back([-x[at], -y[at], -z[at], w[at]], *point),
                None => *point,
            };
            [0, 1, 2].map(|axis| turned[axis] + self.place[axis][at])
        };
        let moved = |solid: &Solid| Solid {
            points: solid.points.iter().map(placed).collect(),
            ..*solid
        };
        self.solids.iter().map(moved).collect()
    }
}

/// Returns the smallest distance of two sets of solids. `guesses` has the vector between the
/// nearest points of each pair at the sample before, from which the search begins.
fn gap(ones: &[Solid], others: &[Solid], guesses: &mut Vec<Point>) -> f64 {
    guesses.resize(ones.len() * others.len(), [1.0, 0.0, 0.0]);
    let pairs = ones
        .iter()
        .flat_map(|one| others.iter().map(move |other| (one, other)));
    let of_pair = |((one, other), guess): ((&Solid, &Solid), &mut Point)| {
        (hull_distance(&one.points, &other.points, guess) - one.radius - other.radius).max(0.0)
    };
    pairs
        .zip(guesses)
        .map(of_pair)
        .fold(f64::INFINITY, f64::min)
}

/// Returns the distance of the convex hulls of two sets of points. The search begins along the
/// guess, which becomes the vector between the nearest points.
fn hull_distance(ones: &[Point], others: &[Point], guess: &mut Point) -> f64 {
    let start = (
        lowest(ones, *guess),
        lowest(others, guess.map(|part| -part)),
    );
    let (Some(first), Some(second)) = start else {
        return f64::INFINITY;
    };
    let mut nearest = minus(first, second);
    let mut simplex: Vec<Point> = vec![nearest];
    for _ in 0..MOST_ITERATIONS {
        let square = dot(nearest, nearest);
        if square < TOUCHING {
            return 0.0;
        }
        // The point of the difference of the hulls that is farthest towards the origin.
        let (Some(one), Some(other)) = (
            lowest(ones, nearest),
            lowest(others, nearest.map(|part| -part)),
        ) else {
            break;
        };
        let further = minus(one, other);
        if square - dot(nearest, further) <= ACCURACY * square || simplex.contains(&further) {
            break;
        }
        simplex.push(further);
        let Some((kept, point)) = nearest_of(&simplex) else {
            break;
        };
        if dot(point, point) >= square {
            break;
        }
        (simplex, nearest) = (kept, point);
    }
    *guess = nearest;
    dot(nearest, nearest).sqrt()
}

/// Returns the point that is lowest along a direction.
fn lowest(points: &[Point], direction: Point) -> Option<Point> {
    let mut best: Option<(Point, f64)> = None;
    for point in points {
        let along = dot(*point, direction);
        if best.is_none_or(|(_, lowest)| along < lowest) {
            best = Some((*point, along));
        }
    }
    best.map(|(point, _)| point)
}

/// Returns the point of a simplex that is nearest to the origin, and the corners of the face that
/// contains it.
fn nearest_of(simplex: &[Point]) -> Option<(Vec<Point>, Point)> {
    let mut best: Option<(usize, Point)> = None;
    for chosen in 1_usize..1 << simplex.len() {
        let mut corners = [[0.0; 3]; 4];
        let mut count = 0;
        for (_, corner) in simplex
            .iter()
            .enumerate()
            .filter(|(idx, _)| chosen >> idx & 1 == 1)
        {
            corners[count] = *corner;
            count += 1;
        }
        let Some(weights) = weights_of(&corners[..count]) else {
            continue;
        };
        if weights[..count].iter().any(|weight| *weight < 0.0) {
            continue;
        }
        let sum = |axis: usize| {
            (0..count)
                .map(|idx| corners[idx][axis] * weights[idx])
                .sum()
        };
        let point: Point = [sum(0), sum(1), sum(2)];
        if best.is_none_or(|(_, nearest)| dot(point, point) < dot(nearest, nearest)) {
            best = Some((chosen, point));
        }
    }
    let (chosen, point) = best?;
    let kept = simplex
        .iter()
        .enumerate()
        .filter(|(idx, _)| chosen >> idx & 1 == 1)
        .map(|(_, corner)| *corner);
    Some((kept.collect(), point))
}

/// Returns the weights of at most four corners, with sum 1, in the point of their plane that is
/// nearest to the origin. Returns `None` if the corners are not independent.
fn weights_of(corners: &[Point]) -> Option<[f64; 4]> {
    let (origin, rest) = corners.split_first()?;
    let mut edges = [[0.0; 3]; 3];
    edges
        .iter_mut()
        .zip(rest)
        .for_each(|(edge, corner)| *edge = minus(*corner, *origin));
    // The normal equations: the nearest point is perpendicular to every edge.
    let mut rows = [[0.0; 4]; 3];
    for (row, edge) in rows.iter_mut().zip(&edges) {
        row.iter_mut()
            .zip(&edges)
            .for_each(|(value, other)| *value = dot(*edge, *other));
        row[3] = -dot(*edge, *origin);
    }
    let solved = solved(&mut rows[..rest.len()])?;
    Some([
        1.0 - solved.iter().sum::<f64>(),
        solved[0],
        solved[1],
        solved[2],
    ])
}

/// Solves at most three linear equations; the last number of each row is its right side. Unknowns
/// without an equation are 0.
fn solved(rows: &mut [[f64; 4]]) -> Option<[f64; 3]> {
    let count = rows.len();
    for column in 0..count {
        let size = |row: &usize| rows[*row][column].abs();
        let pivot = (column..count).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let scale = (0..count).map(|row| size(&row)).fold(0.0, f64::max);
        rows.swap(column, pivot);
        let divisor = rows[column][column];
        if divisor.abs() <= 1e-14 * scale || divisor == 0.0 {
            return None;
        }
        rows[column].iter_mut().for_each(|value| *value /= divisor);
        let row = rows[column];
        for (_, other) in rows
            .iter_mut()
            .enumerate()
            .filter(|(idx, _)| *idx != column)
        {
            let factor = other[column];
            other
                .iter_mut()
                .zip(&row)
                .for_each(|(value, part)| *value -= factor * part);
        }
    }
    let mut found = [0.0; 3];
    found
        .iter_mut()
        .zip(rows)
        .for_each(|(value, row)| *value = row[3]);
    Some(found)
}

fn minus(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn boxed(middle: Point, half: Point) -> Vec<Point> {
        let sign = |idx: usize, bit: usize| if idx >> bit & 1 == 0 { -1.0 } else { 1.0 };
        (0..8)
            .map(|idx| [0, 1, 2].map(|axis| middle[axis] + sign(idx, axis) * half[axis]))
            .collect()
    }

    fn apart_by(ones: &[Point], others: &[Point]) -> f64 {
        hull_distance(ones, others, &mut [0.3, -0.2, 0.1])
    }

    proptest! {
        /// The distance of two boxes along the axes is known.
        #[test]
        fn the_distance_of_boxes_is_that_of_their_sides(
            a in prop::array::uniform3(-2.0..2.0f64), b in prop::array::uniform3(-2.0..2.0f64),
            half_a in prop::array::uniform3(0.01..0.5f64), half_b in prop::array::uniform3(0.01..0.5f64),
        ) {
            let apart: Point = [0, 1, 2].map(|axis| ((a[axis] - b[axis]).abs() - half_a[axis] - half_b[axis]).max(0.0));
            let found = apart_by(&boxed(a, half_a), &boxed(b, half_b));
            prop_assert!((found - dot(apart, apart).sqrt()).abs() < 1e-6, "{found} {apart:?}");
        }

        /// So is that of a point from a turned box.
        #[test]
        fn the_distance_from_a_turned_box_is_that_in_its_frame(
            point in prop::array::uniform3(-1.0..1.0f64), half in prop::array::uniform3(0.01..0.5f64), angle in -3.0..3.0f64,
        ) {
            let (sin, cos) = (libm::sin(angle / 2.0), libm::cos(angle / 2.0));
            let corners: Vec<Point> =
                boxed([0.0; 3], half).into_iter().map(|corner| turned_back([0.0, -sin, 0.0, cos], corner)).collect();
            let local = turned_back([0.0, sin, 0.0, cos], point);
            let outside: Point = [0, 1, 2].map(|axis| (local[axis].abs() - half[axis]).max(0.0));
            let found = apart_by(&corners, &[point]);
            prop_assert!((found - dot(outside, outside).sqrt()).abs() < 1e-6, "{found} {outside:?}");
        }
    }

    #[test]
    fn crossing_rods_are_as_far_apart_as_their_axes() {
        let (one, other) = (
            [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
            [[0.0, -1.0, 0.3], [0.0, 1.0, 0.3]],
        );
        assert!((apart_by(&one, &other) - 0.3).abs() < 1e-9);
        let solid = |points: &[Point]| {
            [Solid {
                points: points.to_vec(),
                radius: 0.1,
            }]
        };
        assert!((gap(&solid(&one), &solid(&other), &mut Vec::new()) - 0.1).abs() < 1e-9);
        assert_eq!(apart_by(&one, &[[0.5, 0.0, 0.0]]), 0.0);
    }
}
