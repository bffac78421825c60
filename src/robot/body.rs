//! The space that the robot occupies, used to remove the robot itself from its camera images.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::Kinematics;
use actcheck_data::{Part, Pose, Shape};

/// The robot's collision shapes in one posture.
#[derive(Debug, Clone)]
pub struct RobotBody {
    /// Each shape with its transform from the world frame.
    solids: Vec<(Isometry3<f64>, Shape)>,
}

impl RobotBody {
    /// Returns the shapes at the given joint positions.
    pub fn new(kinematics: &Kinematics, positions: &[f64]) -> Self {
        let solids = kinematics
            .solids(positions)
            .into_iter()
            .map(|(pose, shape)| bounded(pose, shape));
        Self {
            solids: solids.collect(),
        }
    }

    /// Whether a point is inside a shape or within `margin` of it (slightly farther at edges).
    /// Unit: metres.
    pub fn is_near(&self, point: &Point3<f64>, margin: f64) -> bool {
        self.solids
            .iter()
            .any(|(from_world, shape)| is_within(&(from_world * point), shape, margin))
    }
}

/// Returns the transform from the world to a shape, and the shape. Replaces complex shapes by their
/// bounding box.
fn bounded(pose: Isometry3<f64>, shape: Shape) -> (Isometry3<f64>, Shape) {
    match shape {
        Shape::Box { .. } | Shape::Cylinder { .. } | Shape::Sphere { .. } => {
            (pose.inverse(), shape)
        }
        other => {
            let (low, high) = Part {
                pose: Pose::IDENTITY,
                shape: other,
            }
            .bounds();
            let (low, high) = (Vector3::from(low), Vector3::from(high));
            let middle = pose * Translation3::from((low + high) / 2.0);
            (
                middle.inverse(),
                Shape::Box {
                    size: (high - low).into(),
                },
            )
        }
    }
}

/// Whether a point is within `margin` of the shape. Frame: the shape's.
fn is_within(point: &Point3<f64>, shape: &Shape, margin: f64) -> bool {
    match *shape {
        Shape::Box { size } => point
            .iter()
            .zip(size)
            .all(|(along, extent)| along.abs() <= extent / 2.0 + margin),
        Shape::Cylinder { radius, height } => {
            let reach = radius + margin;
            point.z.abs() <= height / 2.0 + margin
                && point.x * point.x + point.y * point.y <= reach * reach
        }
        Shape::Sphere { radius } => point.coords.norm() <= radius + margin,
        // `bounded` has replaced all other shapes by boxes.
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_near_within_the_margin() {
        let near = |shape: Shape, x: f64, z: f64| is_within(&Point3::new(x, 0.0, z), &shape, 0.02);
        let cylinder = Shape::Cylinder {
            radius: 0.1,
            height: 0.4,
        };
        assert!(near(cylinder.clone(), 0.119, 0.219) && !near(cylinder.clone(), 0.121, 0.0));
        assert!(!near(cylinder, 0.0, 0.221));
        let block = Shape::Box {
            size: [0.2, 0.1, 0.4],
        };
        assert!(near(block.clone(), 0.119, 0.219) && !near(block, 0.121, 0.0));
        let (from_world, capsule) = bounded(
            Isometry3::identity(),
            Shape::Capsule {
                radius: 0.1,
                height: 0.2,
            },
        );
        assert!(is_within(
            &(from_world * Point3::new(0.0, 0.0, 0.219)),
            &capsule,
            0.02
        ));
        assert!(!is_within(
            &(from_world * Point3::new(0.0, 0.0, 0.221)),
            &capsule,
            0.02
        ));
        assert!(
            near(Shape::Sphere { radius: 0.1 }, 0.0, 0.119)
                && !near(Shape::Sphere { radius: 0.1 }, 0.0, 0.121)
        );
    }
}
