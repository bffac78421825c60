//! The direction of an object's footprint: many a scanned box lies askew in its file.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::foreign::body::Body;
use actcheck_data::{Part, Pose, Shape};

/// Directions that are tried in a quarter turn.
const N_DIRECTIONS: u32 = 180;
/// A footprint is turned if the rectangle around it then has less than this share of its area.
const SMALLER: f64 = 0.95;

impl Body {
    /// Returns the turn about the vertical after which the sides of the smallest rectangle around
    /// the body at `pose` are along the axes: 0 for furniture, for bodies with moving parts, and
    /// where a turn gains little. Unit: radians.
    pub(crate) fn turn_of_footprint(&self, pose: &Isometry3<f64>) -> f64 {
        if self.fixed || !self.moving.is_empty() {
            return 0.0;
        }
        let (mut points, mut shapes) = (Vec::new(), Vec::new());
        for part in &self.parts {
            let at = pose * part.pose.to_isometry();
            let of_shape = match &part.shape {
                Shape::Hull { points, .. } => points,
                Shape::Mesh { mesh } => &mesh.vertices,
                _ => {
                    shapes.push((at, part));
                    continue;
                }
            };
            points.extend(
                of_shape
                    .iter()
                    .map(|point| at * Point3::from(*point))
                    .map(|at| [at.x, at.y]),
            );
        }
        let outline = outline(points);
        let area = |turn: f64| {
            let by = turned(turn);
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            let mut add = |lowest: [f64; 2], highest: [f64; 2]| {
                for axis in 0..2 {
                    low[axis] = low[axis].min(lowest[axis]);
                    high[axis] = high[axis].max(highest[axis]);
                }
            };
            for [x, y] in &outline {
                let at = by * Point3::new(*x, *y, 0.0);
                add([at.x, at.y], [at.x, at.y]);
            }
            for (at, part) in &shapes {
                let pose = Pose::from_isometry(&(by * at));
                let (lowest, highest) = Part {
                    pose,
                    shape: part.shape.clone(),
                }
                .bounds();
                add([lowest[0], lowest[1]], [highest[0], highest[1]]);
            }
            (high[0] - low[0]) * (high[1] - low[1])
        };
        let turns =
            (1..N_DIRECTIONS).map(|step| f64::from(step) / f64::from(N_DIRECTIONS) * FRAC_PI_2);
        let Some(best) = turns.min_by(|a, b| area(*a).total_cmp(&area(*b))) else {
            return 0.0;
        };
        // The smaller turn of the two that put the sides along the axes.
        let best = if best > FRAC_PI_2 / 2.0 {
            best - FRAC_PI_2
        } else {
            best
        };
        if area(best) < SMALLER * area(0.0) {
            best
        } else {
            0.0
        }
    }
}

/// A rotation about the vertical.
pub(crate) fn turned(by_rad: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), by_rad),
    )
}

/// The corners of the convex hull of points in a plane, by Andrew's monotone chain.
fn outline(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let turns_left = |a: &[f64; 2], b: &[f64; 2], c: &[f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    };
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain.as_slice()
                && !turns_left(a, b, point)
            {
                chain.pop();
            }
            chain.push(*point);
        }
        chain
    };
    let (lower, upper) = (half(&mut points.iter()), half(&mut points.iter().rev()));
    lower.into_iter().chain(upper).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(yaw_rad: f64, size: [f64; 3]) -> Body {
        let part = Part {
            pose: Pose::from_isometry(&turned(yaw_rad)),
            shape: Shape::Box { size },
        };
        Body {
            parts: vec![part],
            ..Body::default()
        }
    }

    #[test]
    fn a_box_that_lies_askew_is_turned_back() {
        for degrees in [-40.0f64, -28.0, -5.0, 10.0, 44.0] {
            let yaw = degrees.to_radians();
            let turn = boxes(yaw, [0.112, 0.089, 0.036]).turn_of_footprint(&Isometry3::identity());
            assert!((turn + yaw).abs() < 0.005, "{degrees}: {turn}");
        }
        assert_eq!(
            boxes(0.0, [0.112, 0.089, 0.036]).turn_of_footprint(&Isometry3::identity()),
            0.0
        );
    }

    #[test]
    fn round_bodies_and_furniture_stay() {
        let can = Part {
            pose: Pose::IDENTITY,
            shape: Shape::Cylinder {
                radius: 0.03,
                height: 0.1,
            },
        };
        let can = Body {
            parts: vec![can],
            ..Body::default()
        };
        assert_eq!(can.turn_of_footprint(&Isometry3::identity()), 0.0);
        let shelf = Body {
            fixed: true,
            ..boxes(0.5, [0.3, 0.2, 0.5])
        };
        assert_eq!(shelf.turn_of_footprint(&Isometry3::identity()), 0.0);
    }

    #[test]
    fn the_outline_of_a_mesh_is_that_of_its_hull() {
        let inside = (0..50).map(|n| [f64::from(n % 7) / 7.0, f64::from(n % 5) / 5.0]);
        let corners = [[-1.0, -1.0], [2.0, -1.0], [2.0, 2.0], [-1.0, 2.0]];
        let mut found = outline(inside.chain(corners).collect());
        found.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        found.dedup();
        assert_eq!(found, [[-1.0, -1.0], [-1.0, 2.0], [2.0, -1.0], [2.0, 2.0]]);
        let hull = |yaw: f64| {
            let points: Vec<[f64; 3]> = [-0.05, 0.05]
                .into_iter()
                .flat_map(|x| {
                    [-0.02, 0.02].map(|y| (turned(yaw) * Point3::new(x, y, 0.0)).coords.into())
                })
                .collect();
            let part = Part {
                pose: Pose::IDENTITY,
                shape: Shape::Hull {
                    points,
                    volume: 1e-5,
                },
            };
            Body {
                parts: vec![part],
                ..Body::default()
            }
            .turn_of_footprint(&Isometry3::identity())
        };
        assert!((hull(0.5) + 0.5).abs() < 0.005, "{}", hull(0.5));
    }
}
