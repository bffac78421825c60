//! Triangles of shapes.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector3};
use parry3d::transformation::try_convex_hull;

use crate::convert::{from_vector, to_vector};
use actcheck_data::Shape;

/// Sides of round shapes: their outline differs from a circle by half a percent of the radius.
const AROUND: u32 = 32;
/// Rings between the poles of a sphere.
const RINGS: u32 = 12;

/// The surface of a shape.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    /// Corners. Frame: the shape's.
    pub(super) points: Vec<Point3<f64>>,
    /// Indices, counterclockwise seen from outside if the surface is closed.
    pub(super) corners: Vec<[u32; 3]>,
    /// Whether only one side can be seen. That of a mesh of a file need not be closed.
    pub(super) is_closed: bool,
}

/// Returns the surface of a shape.
pub(super) fn triangles(shape: &Shape) -> Triangles {
    match shape {
        Shape::Box { size } => cuboid(*size),
        Shape::Cylinder { radius, height } => {
            let (radius, end) = (*radius, height / 2.0);
            revolved(&[[0.0, -end], [radius, -end], [radius, end], [0.0, end]])
        }
        Shape::Sphere { radius } => revolved(&arc(*radius, 0.0, -0.5..=0.5)),
        Shape::Capsule { radius, height } => {
            let mut profile = arc(*radius, -height / 2.0, -0.5..=0.0);
            profile.extend(arc(*radius, height / 2.0, 0.0..=0.5));
            revolved(&profile)
        }
        Shape::Tube {
            radius_low,
            radius_high,
            wall,
            height,
            ..
        } => {
            let (low, high, end) = (*radius_low, *radius_high, height / 2.0);
            let inner = |radius: f64| (radius - wall).max(0.0);
            revolved(&[
                [inner(low), -end],
                [low, -end],
                [high, end],
                [inner(high), end],
                [inner(low), -end],
            ])
        }
        Shape::Mesh { mesh } => Triangles {
            points: mesh.vertices.iter().map(|at| Point3::from(*at)).collect(),
            corners: mesh.triangles.clone(),
            is_closed: false,
        },
        Shape::Hull { points, .. } => hull(points),
    }
}

fn cuboid([x, y, z]: [f64; 3]) -> Triangles {
    let corner = |idx: u32| {
        let side = |bit: u32, size: f64| if idx >> bit & 1 == 1 { size } else { -size } / 2.0;
        Point3::new(side(0, x), side(1, y), side(2, z))
    };
    let sides = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    Triangles {
        points: (0..8).map(corner).collect(),
        corners: sides
            .into_iter()
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        is_closed: true,
    }
}

/// Points of a circle's arc about a height on the axis. Unit of the angles: half turns.
fn arc(radius: f64, height: f64, angles: std::ops::RangeInclusive<f64>) -> Vec<[f64; 2]> {
    let (from, to) = angles.into_inner();
    let at = |step: u32| {
        let angle = PI * (from + (to - from) * f64::from(step) / f64::from(RINGS));
        [
            (radius * libm::cos(angle)).max(0.0),
            height + radius * libm::sin(angle),
        ]
    };
    (0..=RINGS).map(at).collect()
}

/// The surface of a profile that turns about z: distances from the axis and heights, with the
/// outside on the right.
fn revolved(profile: &[[f64; 2]]) -> Triangles {
    let mut all = Triangles {
        is_closed: true,
        ..Triangles::default()
    };
    for [radius, height] in profile {
        let point = |step: u32| {
            let angle = TAU * f64::from(step) / f64::from(AROUND);
            Point3::new(
                radius * libm::cos(angle),
                radius * libm::sin(angle),
                *height,
            )
        };
        all.points.extend((0..AROUND).map(point));
    }
    for (ring, pair) in (0_u32..).zip(profile.windows(2)) {
        for step in 0..AROUND {
            let next = (step + 1) % AROUND;
            let [low, high] = [ring * AROUND, (ring + 1) * AROUND];
            if pair[0][0] > 0.0 {
                all.corners.push([low + step, low + next, high + next]);
            }
            if pair[1][0] > 0.0 {
                all.corners.push([low + step, high + next, high + step]);
            }
        }
    }
    all
}

/// The convex hull of points; no triangles if they are in a plane.
fn hull(points: &[[f64; 3]]) -> Triangles {
    let points: Vec<_> = points
        .iter()
        .map(|point| to_vector(&Vector3::from(*point)))
        .collect();
    let (points, corners) = try_convex_hull(&points).unwrap_or_default();
    Triangles {
        points: points
            .into_iter()
            .map(|point| Point3::from(from_vector(point)))
            .collect(),
        corners,
        is_closed: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(shape: &Shape) -> f64 {
        let all = triangles(shape);
        let of = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|idx| all.points[idx as usize].coords);
            a.dot(&b.cross(&c)) / 6.0
        };
        all.corners.iter().map(of).sum()
    }

    /// The volume is positive only if all triangles face outwards.
    #[test]
    fn triangles_enclose_the_volume_of_the_shape() {
        let tube = Shape::Tube {
            radius_low: 0.03,
            radius_high: 0.04,
            wall: 0.004,
            height: 0.1,
            staves: 64,
        };
        let hull = Shape::Hull {
            points: triangles(&Shape::Box {
                size: [0.3, 0.2, 0.1],
            })
            .points
            .iter()
            .map(|point| point.coords.into())
            .collect(),
            volume: 0.006,
        };
        let shapes = [
            Shape::Box {
                size: [0.3, 0.2, 0.1],
            },
            Shape::Cylinder {
                radius: 0.2,
                height: 0.5,
            },
            Shape::Sphere { radius: 0.3 },
            Shape::Capsule {
                radius: 0.1,
                height: 0.4,
            },
            tube,
            hull,
        ];
        for shape in shapes {
            let share = volume(&shape) / shape.volume();
            assert!((0.92..=1.03).contains(&share), "{shape:?}: {share}");
        }
    }
}
