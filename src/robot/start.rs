//! A robot where a scene puts it: its geometry and its home posture.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::description::RobotModel;
use crate::layout::{Layout, Named};
use crate::{Kinematics, Robot, RobotError};
use actcheck_data::{Pose, RobotProfile, RobotStart};

/// Returns a robot's geometry, layout and home posture, without a simulation.
///
/// # Errors
/// [`RobotError`] if profile and URDF don't match.
pub fn geometry(start: &RobotStart) -> Result<(Kinematics, Layout, Vec<f64>), RobotError> {
    Ok(Robot::compile(&start.profile)?.at(start))
}

impl Robot {
    /// Returns its geometry, layout and home posture where a scene puts it.
    pub fn at(&self, start: &RobotStart) -> (Kinematics, Layout, Vec<f64>) {
        let (model, named) = (&self.model, &self.named);
        let positions = home(&self.profile, model, named, start.base);
        let root = root_of(start, &named.layout);
        let kinematics = Kinematics::new(Arc::clone(model), root, named.grasp, named.camera)
            .with_passing(self.passing.clone(), self.hand.clone())
            .with_followers(&named.layout.gripper);
        (kinematics, named.layout.clone(), positions)
    }

    /// Returns its start at the origin of a world, on its mount.
    pub(crate) fn start_at_origin(&self) -> RobotStart {
        RobotStart {
            profile: Arc::clone(&self.profile),
            base: [0.0; 3],
            root_height_m: self.profile.core.mount_height_m,
            knows: Arc::new([]),
        }
    }
}

/// Returns the home posture, with the base at its start pose and the fingers half open.
fn home(profile: &RobotProfile, model: &RobotModel, named: &Named, base: [f64; 3]) -> Vec<f64> {
    let mut positions: Vec<f64> = model
        .joints
        .iter()
        .map(|joint| 0.0_f64.clamp(joint.lower, joint.upper))
        .collect();
    for (idx, position) in named.layout.arm.iter().zip(&profile.home) {
        positions[*idx] = position.clamp(model.joints[*idx].lower, model.joints[*idx].upper);
    }
    for (idx, position) in named.layout.base.iter().flatten().zip(base) {
        positions[*idx] = position;
    }
    named
        .layout
        .gripper
        .set(&mut positions, profile.hand.max_opening_m / 2.0);
    for idx in named.layout.gripper.joints() {
        positions[idx] = positions[idx].clamp(model.joints[idx].lower, model.joints[idx].upper);
    }
    for (idx, joint) in model
        .joints
        .iter()
        .enumerate()
        .filter(|(idx, _)| !named.layout.gripper.contains(*idx))
    {
        if let Some((leader, factor, offset)) = joint.mimic {
            positions[idx] = (factor * positions[leader] + offset).clamp(joint.lower, joint.upper);
        }
    }
    positions
}

/// Pose of the root link. Frame: world.
fn root_of(start: &RobotStart, layout: &Layout) -> Isometry3<f64> {
    let [x, y, heading] = start.base;
    match layout.base {
        // The root of a mobile robot is above the world's origin, which is the frame of its
        // odometry.
        Some(_) => Isometry3::translation(0.0, 0.0, start.root_height_m),
        None => Pose::upright(
            [x, y, start.root_height_m],
            heading + start.profile.core.mount_turned_rad,
        )
        .to_isometry(),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::Path;

    use super::*;
    use actcheck_base::Files;

    /// The shipped mobile manipulator: its geometry, layout and home posture.
    pub(crate) fn lonely() -> (Kinematics, Layout, Vec<f64>) {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        let profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        let start = RobotStart {
            profile: Arc::new(profile),
            base: [-1.0, 0.3, 0.4],
            root_height_m: 0.0,
            knows: Arc::new([]),
        };
        geometry(&start).expect("the shipped robot is valid")
    }
}
