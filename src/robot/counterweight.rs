//! Joints of an arm that are too weak for its weight.
//!
//! Springs or counterweights balance such arms, as those of the PR2. A URDF can't describe them.

use nalgebra::Isometry3;

use crate::description::{Joint, JointKind, RobotModel};
use crate::kinematics::{holding_efforts, motion};

/// Number of postures in which the weight is measured, besides that with all joints at 0.
pub(super) const N_POSTURES: usize = 64;
/// Part of a joint's range by which it differs from one posture to the next; that of each further
/// joint is the part of this one's multiple after the decimal point. It makes any number of
/// postures even: the golden ratio.
const STRIDE: f64 = 0.618_033_988_749_894_9;

/// A joint that can't hold the arm by its motor alone, and is simulated as balanced.
#[derive(Debug, Clone, PartialEq)]
pub struct BalancedJoint {
    /// Name of the joint.
    pub name: String,
    /// Largest effort of its motor. Unit: newtons or newton metres.
    pub effort: f64,
    /// The effort that holds the arm's own weight in the worst measured posture. Unit: newtons or
    /// newton metres.
    pub weight: f64,
}

/// Adds the arm's weight to the effort of each of its joints that can't hold it.
pub(super) fn balance(model: &mut RobotModel, arm: &[String]) {
    let weights = weights(model);
    for (joint, weight) in model.joints.iter_mut().zip(weights) {
        let is_of_arm = joint.mimic.is_none() && arm.contains(&joint.name);
        if is_of_arm && weight > joint.effort && joint.effort > 0.0 {
            model.balanced.push(BalancedJoint {
                name: joint.name.clone(),
                effort: joint.effort,
                weight,
            });
            joint.effort += weight;
        }
    }
}

/// The largest effort that each joint needs to hold the links beyond it.
fn weights(model: &RobotModel) -> Vec<f64> {
    let mut weights = vec![0.0_f64; model.joints.len()];
    for posture in 0..=N_POSTURES {
        let mut poses = vec![Isometry3::identity()];
        for (idx, joint) in model.joints.iter().enumerate() {
            let position = position_in(posture, idx, joint);
            poses.push(poses[joint.parent] * joint.origin * motion(joint, position));
        }
        for (weight, effort) in weights.iter_mut().zip(holding_efforts(model, &poses)) {
            *weight = weight.max(effort.abs());
        }
    }
    weights
}

/// Position of a joint in one of [`N_POSTURES`] postures that are spread over its range, or in the
/// posture 0, in which it is at 0 or at the limit nearest to it. Unit: metres or radians.
pub(super) fn position_in(posture: usize, idx: usize, joint: &Joint) -> f64 {
    let (lower, upper) = match joint.kind {
        JointKind::Revolute => (
            joint.lower.max(-std::f64::consts::PI),
            joint.upper.min(std::f64::consts::PI),
        ),
        JointKind::Prismatic if joint.upper - joint.lower < f64::INFINITY => {
            (joint.lower, joint.upper)
        }
        JointKind::Prismatic => (0.0, 0.0),
    };
    #[expect(clippy::cast_precision_loss, reason = "Both numbers are small.")]
    let part = (posture as f64 * ((idx + 1) as f64 * STRIDE).fract()).fract();
    if posture == 0 {
        0.0_f64.max(lower).min(upper)
    } else {
        lower + part * (upper - lower)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    /// A beam of 2 kg whose middle is 0.4 m from its hinge needs 2 kg · 9.81 m/s² · 0.4 m when it
    /// is level.
    #[test]
    fn a_beam_needs_its_weight_times_its_lever() {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        let mut profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        let shipped = RobotModel::read(profile.roles()).expect("it is valid");
        assert_eq!(shipped.balanced, []);
        let beam = |effort: f64| {
            format!(
                "<robot name=\"beam\"><link name=\"base\"/><link name=\"beam\"><inertial><origin xyz=\"0.4 0 0\"/>\
                 <mass value=\"2\"/><inertia ixx=\"1e-3\" ixy=\"0\" ixz=\"0\" iyy=\"1e-3\" iyz=\"0\" izz=\"1e-3\"/></inertial>\
                 </link><joint name=\"hinge\" type=\"revolute\"><parent link=\"base\"/><child link=\"beam\"/>\
                 <axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"{effort}\" velocity=\"1\"/></joint></robot>"
            )
        };
        let mut read = |effort: f64| {
            let urdf = Source::new("beam.urdf", beam(effort));
            profile.core = actcheck_config::robot::with_urdf(profile.core.clone(), urdf)
                .expect("it is a URDF");
            profile.arm_joints = vec!["hinge".to_owned()];
            RobotModel::read(profile.roles()).expect("it is valid")
        };
        let model = read(5.0);
        let [balanced] = model.balanced.as_slice() else {
            panic!("{:?}", model.balanced)
        };
        let expected = 2.0 * 9.81 * 0.4;
        assert!((balanced.weight - expected).abs() < 1e-9, "{balanced:?}");
        assert!((model.joints[0].effort - 5.0 - expected).abs() < 1e-9);
        assert_eq!(read(8.0).balanced, []);
    }
}
