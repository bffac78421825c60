//! The shapes of bodies as convex solids, for distances between surfaces.

use std::f64::consts::TAU;

use actcheck_base::Solid;
use actcheck_data::{Part, Shape};

/// Corners of the polygon that replaces a circle. With 48, it is inside the circle by at most 0.2 %
/// of the radius.
const CORNERS: u32 = 48;

/// Returns the solid of a part. A tube is filled: a hand between its walls is inside it.
pub(super) fn solid_of(part: &Part) -> Solid {
    let (points, radius) = match &part.shape {
        Shape::Box { size } => (corners(size.map(|side| side / 2.0)), 0.0),
        Shape::Cylinder { radius, height } => (rings(*radius, *radius, *height), 0.0),
        Shape::Tube {
            radius_low,
            radius_high,
            height,
            ..
        } => (rings(*radius_low, *radius_high, *height), 0.0),
        Shape::Sphere { radius } => (vec![[0.0; 3]], *radius),
        Shape::Capsule { radius, height } => (
            vec![[0.0, 0.0, -height / 2.0], [0.0, 0.0, height / 2.0]],
            *radius,
        ),
        Shape::Mesh { mesh } => (mesh.vertices.clone(), 0.0),
        Shape::Hull { points, .. } => (points.clone(), 0.0),
    };
    let pose = part.pose.to_isometry();
    let placed = points
        .into_iter()
        .map(|point| pose.transform_point(&point.into()).coords.into());
    Solid {
        points: placed.collect(),
        radius,
    }
}

/// Returns the box of a body of this size, whose origin is at the centre of its base.
pub(super) fn boxed([x, y, z]: [f64; 3]) -> Solid {
    let middle = corners([x / 2.0, y / 2.0, z / 2.0]);
    Solid {
        points: middle
            .into_iter()
            .map(|[x, y, up]| [x, y, up + z / 2.0])
            .collect(),
        radius: 0.0,
    }
}

fn corners([x, y, z]: [f64; 3]) -> Vec<[f64; 3]> {
    let sign = |idx: usize, bit: usize| if idx >> bit & 1 == 0 { -1.0 } else { 1.0 };
    (0..8)
        .map(|idx| [sign(idx, 0) * x, sign(idx, 1) * y, sign(idx, 2) * z])
        .collect()
}

/// Returns the corners of two polygons below and above the origin.
fn rings(low: f64, high: f64, height: f64) -> Vec<[f64; 3]> {
    let ring = |radius: f64, z: f64| {
        (0..CORNERS).map(move |idx| {
            let angle = TAU * f64::from(idx) / f64::from(CORNERS);
            [radius * libm::cos(angle), radius * libm::sin(angle), z]
        })
    };
    ring(low, -height / 2.0)
        .chain(ring(high, height / 2.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    #[test]
    fn solids_have_the_extents_of_their_shapes() {
        let pose = Pose::upright([1.0, 0.0, 0.5], std::f64::consts::FRAC_PI_2);
        let extent = |solid: &Solid, axis: usize| {
            let along = |point: &[f64; 3]| point[axis];
            let high = solid
                .points
                .iter()
                .map(along)
                .fold(f64::NEG_INFINITY, f64::max)
                + solid.radius;
            let low = solid.points.iter().map(along).fold(f64::INFINITY, f64::min) - solid.radius;
            [low, high]
        };
        let cases = [
            (
                Shape::Box {
                    size: [0.2, 0.4, 1.0],
                },
                [0.8, 1.2],
            ),
            (
                Shape::Cylinder {
                    radius: 0.1,
                    height: 1.0,
                },
                [0.9, 1.1],
            ),
            (
                Shape::Tube {
                    radius_low: 0.05,
                    radius_high: 0.1,
                    wall: 0.002,
                    height: 1.0,
                    staves: 12,
                },
                [0.9, 1.1],
            ),
            (Shape::Sphere { radius: 0.5 }, [0.5, 1.5]),
            (
                Shape::Capsule {
                    radius: 0.1,
                    height: 0.8,
                },
                [0.9, 1.1],
            ),
        ];
        for (shape, wanted) in cases {
            let solid = solid_of(&Part {
                pose,
                shape: shape.clone(),
            });
            for (found, wanted) in [(extent(&solid, 0), wanted), (extent(&solid, 2), [0.0, 1.0])] {
                assert!(
                    (0..2).all(|end| (found[end] - wanted[end]).abs() < 1e-9),
                    "{shape:?}: {found:?}"
                );
            }
        }
        let body = boxed([0.2, 0.4, 1.0]);
        assert_eq!(
            (extent(&body, 1), extent(&body, 2)),
            ([-0.2, 0.2], [0.0, 1.0])
        );
    }
}
