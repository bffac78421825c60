//! External disturbances of objects.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::bodies::Bodies;
use crate::fault::{Perturbation, Poison};
use actcheck_geometry::{to_pose, to_real, to_vector};

/// Gap below an object that is laid down, so that it drops into contact instead of being pushed
/// out. Unit: metres.
const DROP_M: f64 = 2e-3;

/// Applies a perturbation to an object. Returns `false` if there is no such object.
pub(super) fn perturb(bodies: &mut Bodies, id: &str, perturbation: Perturbation) -> bool {
    let Some(object) = bodies.objects.iter().find(|object| object.id == id) else {
        return false;
    };
    let pose = match perturbation {
        Perturbation::Pose(pose) => pose.to_isometry(),
        Perturbation::Fall => lying(&bodies.pose_of(object), object.model.size_m),
        Perturbation::Friction(friction) => {
            let colliders = bodies
                .physics
                .bodies
                .get(object.body)
                .map(rapier3d::prelude::RigidBody::colliders);
            for handle in colliders.unwrap_or_default() {
                if let Some(collider) = bodies.physics.colliders.get_mut(*handle) {
                    collider.set_friction(to_real(friction));
                }
            }
            return true;
        }
    };
    let Some(body) = bodies.physics.bodies.get_mut(object.body) else {
        return false;
    };
    body.set_position(to_pose(&pose), true);
    body.set_linvel(to_vector(&Vector3::zeros()), true);
    body.set_angvel(to_vector(&Vector3::zeros()), true);
    true
}

/// Disturbs the state of an object, by its index. Returns `false` if it has no body.
pub(super) fn poison(bodies: &mut Bodies, object: usize, poison: Poison) -> bool {
    let Some(body) = bodies.physics.bodies.get_mut(bodies.objects[object].body) else {
        return false;
    };
    match poison {
        Poison::NotFinite => body.set_linvel(to_vector(&Vector3::repeat(f64::NAN)), true),
        Poison::Velocity(velocity) => body.set_linvel(to_vector(&Vector3::from(velocity)), true),
        Poison::Teleport(position) => {
            body.set_translation(to_vector(&Vector3::from(position)), true)
        }
        // Only sensors see it.
        Poison::Decoy(_) => {}
    }
    true
}

/// Returns the pose of a standing object after it is laid on its side; its middle stays above the
/// same point.
fn lying(standing: &Isometry3<f64>, [width, _, height]: [f64; 3]) -> Isometry3<f64> {
    // Rotated about its y axis: its top now points along its former x axis, and its width is
    // vertical.
    let turned = standing.rotation
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
    let top = turned * Vector3::z();
    let foot =
        standing.translation.vector - top * (height / 2.0) + Vector3::z() * (width / 2.0 + DROP_M);
    Isometry3::from_parts(Translation3::from(foot), turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    #[test]
    fn a_fallen_object_lies_above_its_former_position() {
        let standing = Pose::upright([0.3, -0.2, 0.4], 0.7);
        let fallen = lying(&standing.to_isometry(), [0.06, 0.06, 0.2]);
        assert!((Pose::from_isometry(&fallen).tilt() - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
        let middle = fallen * nalgebra::Point3::new(0.0, 0.0, 0.1);
        assert!(
            (middle.coords - Vector3::new(0.3, -0.2, 0.432)).norm() < 1e-9,
            "{middle}"
        );
    }
}
