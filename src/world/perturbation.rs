//! External disturbances of objects and of the robot.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::{Perturbation, World};
use actcheck_data::Pose;
use actcheck_geometry::{to_pose, to_real, to_vector};

/// Gap below an object that is laid down, so that it drops into contact instead of being pushed
/// out. Unit: metres.
const DROP_M: f64 = 2e-3;

impl World {
    /// Applies a perturbation to an object. Returns `false` if there is no such object.
    pub fn perturb(&mut self, id: &str, perturbation: Perturbation) -> bool {
        let Some(object) = self.objects.iter().find(|object| object.id == id) else {
            return false;
        };
        let pose = match perturbation {
            Perturbation::Pose(pose) => pose.to_isometry(),
            Perturbation::Fall => lying(&self.pose_of(object), object.model.size_m),
            Perturbation::Friction(friction) => {
                let colliders = self
                    .engine
                    .bodies
                    .get(object.body)
                    .map(rapier3d::prelude::RigidBody::colliders);
                for handle in colliders.unwrap_or_default() {
                    if let Some(collider) = self.engine.colliders.get_mut(*handle) {
                        collider.set_friction(to_real(friction));
                    }
                }
                return true;
            }
        };
        let Some(body) = self.engine.bodies.get_mut(object.body) else {
            return false;
        };
        body.set_position(to_pose(&pose), true);
        body.set_linvel(to_vector(&Vector3::zeros()), true);
        body.set_angvel(to_vector(&Vector3::zeros()), true);
        true
    }
}

impl World {
    /// Moves the robot to another pose (x, y, heading) without changing its pose estimate. Returns
    /// `false` if its base is fixed.
    pub fn kidnap(&mut self, to: [f64; 3]) -> bool {
        if self.robot.layout.base.is_none() {
            return false;
        }
        let from = self.base_true();
        let [x, y, heading] = self.believed(from);
        self.robot.shift_base(
            &mut self.engine,
            [0, 1, 2].map(|axis| to[axis] - from[axis]),
        );
        // The odometry does not register the move.
        let (believed, truth) = (
            Pose::upright([x, y, 0.0], heading),
            Pose::upright([to[0], to[1], 0.0], to[2]),
        );
        self.believed_from_true = believed.to_isometry() * truth.to_isometry().inverse();
        self.forget_way();
        true
    }
}

impl World {
    /// Lets the robot's links pass through each other, or collide again. Their depth in each other
    /// is still measured.
    pub fn let_links_pass(&mut self, pass: bool) {
        self.link_pairs.pass = pass;
    }

    /// Lets the motor of a joint, by its index, give a multiple of its largest effort. Fingers
    /// excepted.
    pub fn overdrive(&mut self, joint: usize, strength: f64) {
        self.robot.overdrive(joint, strength);
    }
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
