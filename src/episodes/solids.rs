//! Bounds and distances of bodies.

use std::sync::Arc;

use actcheck_data::{Part, Pose};
use actcheck_scenario::convex_shape;
use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::math::{Pose as ParryPose, Rotation, Vector};
use parry3d::query;
use parry3d::shape::Shape as ParryShape;

/// The convex solids of a body. Frame: the body's.
pub(crate) struct Solids {
    solids: Vec<Solid>,
    /// Radius of the ball about the body's origin that contains all solids. Unit: metres.
    radius_m: f64,
}

struct Solid {
    shape: Arc<dyn ParryShape>,
    at: Isometry3<f64>,
}

impl Solids {
    /// Creates the solids of parts. Flat hulls are left out: they have no inside.
    pub(crate) fn new(parts: &[Part]) -> Self {
        let solids = parts
            .iter()
            .flat_map(Part::solids)
            .filter_map(|part| {
                let (shape, from_shape) = convex_shape(&part.shape)?;
                let at = part.pose.to_isometry() * from_shape;
                Some(Solid { shape, at })
            })
            .collect();
        let radius_m = parts
            .iter()
            .map(|part| {
                let (low, high) = part.bounds();
                Vector3::from_fn(|axis, _| low[axis].abs().max(high[axis].abs())).norm()
            })
            .fold(0.0, f64::max);
        Self { solids, radius_m }
    }

    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.solids.is_empty()
    }

    /// Returns the distance of a point from the nearest surface; negative inside. Unit: metres.
    /// Frame of the point: the body's. Returns infinity without solids.
    pub(crate) fn distance_to(&self, point: &Point3<f64>) -> f64 {
        let distance = |solid: &Solid| {
            let point = to_parry_vector(&solid.at.inverse_transform_point(point).coords);
            let nearest = solid.shape.project_local_point(point, false);
            let way = f64::from((nearest.point - point).length());
            if nearest.is_inside { -way } else { way }
        };
        self.solids
            .iter()
            .map(distance)
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the smaller one of `most` and the distance of two bodies with these poses. Unit:
    /// metres.
    pub(crate) fn gap(
        &self,
        pose: &Isometry3<f64>,
        other: &Self,
        other_pose: &Isometry3<f64>,
        most: f64,
    ) -> f64 {
        let between = (pose.translation.vector - other_pose.translation.vector).norm();
        if between - self.radius_m - other.radius_m >= most {
            return most;
        }
        // Relative to one of the bodies, so that coordinates are small.
        let relative = pose.inv_mul(other_pose);
        let mut smallest = most;
        for one in &self.solids {
            for two in &other.solids {
                let at = one.at.inv_mul(&(relative * two.at));
                let found = query::distance(
                    &ParryPose::IDENTITY,
                    one.shape.as_ref(),
                    &to_parry(&at),
                    two.shape.as_ref(),
                );
                if let Ok(found) = found {
                    smallest = smallest.min(f64::from(found.distance));
                }
            }
        }
        smallest
    }
}

/// Returns the lowest and the highest corner of the box around parts whose frame has this pose, or
/// `None` if there are none. Unit: metres.
pub(crate) fn bounds(parts: &[Part], pose: &Isometry3<f64>) -> Option<[[f64; 3]; 2]> {
    let placed = parts.iter().map(|part| {
        let at = pose * part.pose.to_isometry();
        let part = Part {
            pose: Pose::from_isometry(&at),
            shape: part.shape.clone(),
        };
        part.bounds()
    });
    placed
        .map(|(low, high)| [low, high])
        .reduce(|[low, high], [lower, higher]| {
            let least = std::array::from_fn(|axis| f64::min(low[axis], lower[axis]));
            let most = std::array::from_fn(|axis| f64::max(high[axis], higher[axis]));
            [least, most]
        })
}

fn to_parry(pose: &Isometry3<f64>) -> ParryPose {
    let q = pose.rotation.quaternion();
    let rotation =
        Rotation::from_xyzw(to_real(q.i), to_real(q.j), to_real(q.k), to_real(q.w)).normalize();
    ParryPose::from_parts(to_parry_vector(&pose.translation.vector), rotation)
}

fn to_parry_vector(vector: &Vector3<f64>) -> Vector {
    Vector::new(to_real(vector.x), to_real(vector.y), to_real(vector.z))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the geometry library calculates in 32 bits"
)]
fn to_real(value: f64) -> f32 {
    value as f32
}
