//! Checks two objects for overlap: first their bounding boxes, then their exact shapes.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use parry3d::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d::math::{Pose as ParryPose, Rotation, Vector};
use parry3d::query;
use parry3d::shape::{Ball, Capsule, ConvexPolyhedron, Cuboid, Cylinder, Shape as ParryShape};

use actcheck_data::{ObjectModel, Part, Pose, Shape};

/// Minimum distance between objects. It is twice the prediction distance of contact detection, so
/// that nothing touches at the start. Unit: metres.
pub const CLEARANCE_M: f64 = 0.004;

/// The exact shape of an object at a pose in the scene.
pub struct Solid {
    parts: Vec<(ParryPose, Arc<dyn ParryShape>, Aabb)>,
    around: Aabb,
}

impl Solid {
    /// Creates the solid of a model whose origin has this pose, with its moving parts. Frame:
    /// world.
    pub fn new(model: &ObjectModel, pose: &Pose) -> Self {
        Self::of_parts(&model.all_solids(), pose)
    }

    /// Creates the solid of convex parts whose frame has this pose. Frame: world.
    pub(super) fn of_parts(parts: &[Part], pose: &Pose) -> Self {
        let world_from_model = pose.to_isometry();
        let parts: Vec<(ParryPose, Arc<dyn ParryShape>, Aabb)> = parts
            .iter()
            .filter_map(|part| {
                let (shape, model_from_shape) = convex_shape(&part.shape)?;
                let at = to_parry(&(world_from_model * part.pose.to_isometry() * model_from_shape));
                let around = shape.compute_aabb(&at);
                Some((at, shape, around))
            })
            .collect();
        let around = parts
            .iter()
            .map(|(.., around)| *around)
            .reduce(|a, b| a.merged(&b))
            .unwrap_or_else(Aabb::new_invalid);
        Self { parts, around }
    }

    /// Whether the other solid is nearer than the clearance.
    pub fn is_in_the_way_of(&self, other: &Self) -> bool {
        let clearance = to_real(CLEARANCE_M);
        if !self.around.loosened(clearance).intersects(&other.around) {
            return false;
        }
        self.parts.iter().any(|(at, shape, around)| {
            let around = around.loosened(clearance);
            other
                .parts
                .iter()
                .filter(|(.., theirs)| around.intersects(theirs))
                .any(|(other_at, other_shape, _)| {
                    // All these convex shapes are supported; an unsupported one would count as
                    // overlapping.
                    !query::distance(at, shape.as_ref(), other_at, other_shape.as_ref())
                        .is_ok_and(|gap| gap.distance >= clearance)
                })
        })
    }
}

/// Returns the engine's shape and its pose in our shape's frame (the engine's cylinders are along
/// y). Returns `None` for a tube, which is not a single convex shape.
pub fn convex_shape(shape: &Shape) -> Option<(Arc<dyn ParryShape>, Isometry3<f64>)> {
    let upright = Isometry3::identity();
    Some(match shape {
        Shape::Box { size: [x, y, z] } => {
            let half = Vector::new(to_real(x / 2.0), to_real(y / 2.0), to_real(z / 2.0));
            (Arc::new(Cuboid::new(half)), upright)
        }
        Shape::Cylinder { radius, height } => {
            let from_y =
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            let cylinder = Cylinder::new(to_real(height / 2.0), to_real(*radius));
            (
                Arc::new(cylinder),
                Isometry3::from_parts(upright.translation, from_y),
            )
        }
        Shape::Sphere { radius } => (Arc::new(Ball::new(to_real(*radius))), upright),
        Shape::Capsule { radius, height } => (
            Arc::new(Capsule::new_z(to_real(height / 2.0), to_real(*radius))),
            upright,
        ),
        Shape::Hull { points, .. } => (hull(points)?, upright),
        Shape::Mesh { mesh } => (hull(&mesh.vertices)?, upright),
        Shape::Tube { .. } => return None,
    })
}

/// Computes the convex hull of points. Returns `None` if they are coplanar.
fn hull(points: &[[f64; 3]]) -> Option<Arc<dyn ParryShape>> {
    let points: Vec<Vector> = points
        .iter()
        .map(|[x, y, z]| Vector::new(to_real(*x), to_real(*y), to_real(*z)))
        .collect();
    Some(Arc::new(ConvexPolyhedron::from_convex_hull(&points)?))
}

fn to_parry(pose: &Isometry3<f64>) -> ParryPose {
    let (t, q) = (pose.translation.vector, pose.rotation.quaternion());
    let rotation =
        Rotation::from_xyzw(to_real(q.i), to_real(q.j), to_real(q.k), to_real(q.w)).normalize();
    ParryPose::from_parts(
        Vector::new(to_real(t.x), to_real(t.y), to_real(t.z)),
        rotation,
    )
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the geometry library calculates in 32 bits"
)]
fn to_real(value: f64) -> f32 {
    value as f32
}
