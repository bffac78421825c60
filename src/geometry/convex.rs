//! Shapes of the library for convex solids.

use nalgebra::Vector3;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use crate::convert::{to_pose, to_real, to_vector};
use crate::hull::Hull;
use actcheck_data::{Part, Shape};

/// Returns the shape of a convex solid and its pose in the frame of its body. Returns `None` for
/// tubes, which the caller must decompose first, and for points without a volume.
pub fn convex_shape(solid: &Part) -> Option<(SharedShape, Pose)> {
    let mut pose = solid.pose.to_isometry();
    let shape = match &solid.shape {
        Shape::Box { size: [x, y, z] } => {
            SharedShape::cuboid(to_real(x / 2.0), to_real(y / 2.0), to_real(z / 2.0))
        }
        Shape::Cylinder { radius, height } => {
            // The axis of the library's cylinders is y.
            pose.rotation *= nalgebra::UnitQuaternion::from_axis_angle(
                &Vector3::x_axis(),
                std::f64::consts::FRAC_PI_2,
            );
            SharedShape::cylinder(to_real(height / 2.0), to_real(*radius))
        }
        Shape::Sphere { radius } => SharedShape::ball(to_real(*radius)),
        Shape::Capsule { radius, height } => {
            SharedShape::capsule_z(to_real(height / 2.0), to_real(*radius))
        }
        Shape::Hull { points, .. } => hull(points)?,
        Shape::Mesh { mesh } => hull(&mesh.vertices)?,
        Shape::Tube { .. } => return None,
    };
    Some((shape, to_pose(&pose)))
}

/// Returns whether a convex solid has a volume: a hull of points in a plane has none.
pub fn has_volume(solid: &Part) -> bool {
    convex_shape(solid).is_some()
}

/// Returns the convex hull of points, or `None` if they lie in a plane.
fn hull(points: &[[f64; 3]]) -> Option<SharedShape> {
    let points: Vec<_> = points
        .iter()
        .map(|point| to_vector(&Vector3::from(*point)))
        .collect();
    Some(SharedShape::new(Hull::of(&points)?))
}
