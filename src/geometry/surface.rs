//! Points on the robot's collision shapes, for distances in motion planning.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use crate::decompose::hull_surface;
use actcheck_data::Shape;

/// Samples points on a shape in its own frame. Tubes have none: robots do not contain them.
pub fn spread(shape: &Shape, spacing: f64) -> Vec<Point3<f64>> {
    match *shape {
        Shape::Box { size } => {
            let [xs, ys, zs] = size.map(|extent| steps(extent, spacing));
            let grid = |x: f64| {
                ys.iter()
                    .flat_map(|y| zs.iter().map(|z| Point3::new(x, *y, *z)))
                    .collect::<Vec<_>>()
            };
            xs.iter().flat_map(|x| grid(*x)).collect()
        }
        Shape::Cylinder { radius, height } => {
            let around = steps(std::f64::consts::TAU, spacing / radius.max(1e-6));
            let rings = steps(height, spacing);
            let ring = |z: f64| {
                around
                    .iter()
                    .map(move |a| Point3::new(radius * libm::cos(*a), radius * libm::sin(*a), z))
            };
            rings.iter().flat_map(|z| ring(*z)).collect()
        }
        Shape::Sphere { radius } => {
            let ends = [-radius, radius];
            ends.iter()
                .flat_map(|r| {
                    [
                        Point3::new(*r, 0.0, 0.0),
                        Point3::new(0.0, *r, 0.0),
                        Point3::new(0.0, 0.0, *r),
                    ]
                })
                .collect()
        }
        Shape::Capsule { radius, height } => {
            // Its bounding cylinder.
            spread(
                &Shape::Cylinder {
                    radius,
                    height: height + 2.0 * radius,
                },
                spacing,
            )
        }
        Shape::Hull { ref points, .. } => on_hull(points, spacing),
        Shape::Mesh { ref mesh } => on_hull(&mesh.vertices, spacing),
        Shape::Tube { .. } => Vec::new(),
    }
}

/// Returns numbers from −extent/2 to extent/2, both included, at most `spacing` apart.
fn steps(extent: f64, spacing: f64) -> Vec<f64> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few dozen steps"
    )]
    let n_steps = (extent / spacing).ceil().clamp(1.0, 200.0) as usize;
    (0..=n_steps)
        .map(|idx| extent * (idx as f64 / n_steps as f64 - 0.5))
        .collect()
}

/// Side of the cells of a grid with at most one corner of a hull, as a share of the spacing of
/// points on its faces.
const CORNER_CELL: f64 = 0.25;

/// Samples points on the convex hull of points: its corners, the outermost first, and a grid on its
/// faces. Leaves out those close to an earlier one.
fn on_hull(corners: &[[f64; 3]], spacing: f64) -> Vec<Point3<f64>> {
    // Points in a plane have no hull.
    let (vertices, faces) = hull_surface(corners).unwrap_or((corners.to_vec(), Vec::new()));
    let vertices: Vec<Vector3<f64>> = vertices.into_iter().map(Vector3::from).collect();
    let middle = vertices.iter().sum::<Vector3<f64>>() / vertices.len().max(1) as f64;
    let mut outermost: Vec<(f64, &Vector3<f64>)> =
        vertices.iter().map(|v| ((v - middle).norm(), v)).collect();
    outermost.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut taken = BTreeSet::new();
    let mut points: Vec<Point3<f64>> = Vec::new();
    for (_, vertex) in outermost {
        if taken.insert(cell(vertex, spacing * CORNER_CELL)) {
            points.push(Point3::from(*vertex));
        }
    }
    let mut taken: BTreeSet<[i64; 3]> = points
        .iter()
        .map(|point| cell(&point.coords, spacing))
        .collect();
    for face in faces {
        let [a, b, c] = face.map(|idx| vertices[idx as usize]);
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        let n_steps = steps(longest, spacing).len() - 1;
        for i in 0..=n_steps {
            for j in 0..=n_steps - i {
                let [u, v] = [i, j].map(|step| step as f64 / n_steps as f64);
                let point = a + (b - a) * u + (c - a) * v;
                if taken.insert(cell(&point, spacing)) {
                    points.push(Point3::from(point));
                }
            }
        }
    }
    points
}

/// The cell of a cubic grid that contains a point.
fn cell(point: &Vector3<f64>, side: f64) -> [i64; 3] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "links are metres long, cells millimetres"
    )]
    [0, 1, 2].map(|axis| (point[axis] / side).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A long thin wedge across the axes: its bounding box is mostly empty, and points stay on the
    /// wedge.
    #[test]
    fn points_on_a_hull_cover_its_surface_and_nothing_else() {
        let along = Vector3::new(1.0, 1.0, 1.0).normalize();
        let aside = Vector3::new(1.0, -1.0, 0.0).normalize() * 0.02;
        let corners: Vec<[f64; 3]> = [
            along * 0.5 + aside,
            along * 0.5 - aside,
            -along * 0.5,
            along.cross(&aside),
        ]
        .map(Into::into)
        .to_vec();
        let points = on_hull(&corners, 0.03);
        assert!((30..200).contains(&points.len()), "{} points", points.len());
        for point in &points {
            let off = (point.coords - along * point.coords.dot(&along)).norm();
            assert!(off < 0.021, "{point} is {off} off the wedge");
        }
        for step in -16..=16 {
            let on_axis = along * (0.03 * f64::from(step));
            let nearest = points
                .iter()
                .map(|point| (point.coords - on_axis).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.06, "no point near {on_axis}");
        }
    }
}
