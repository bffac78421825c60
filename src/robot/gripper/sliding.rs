//! The usual gripper: two fingers that slide apart from 0, where they meet.

use crate::description::{JointKind, RobotModel};
use crate::gripper::gap::Probe;
use crate::gripper::opening::{Gripper, Leader};

/// Two sliding fingers whose measured opening differs by less than this from the sum of their
/// positions need no table. Unit: metres.
const SLIDING_SLACK_M: f64 = 0.005;
/// Tolerance of limits, which are often rounded. Unit: metres.
const LIMIT_SLACK_M: f64 = 1e-3;

/// Returns the gripper if it is of this kind.
pub(super) fn sliding(named: &[usize], model: &RobotModel, probe: &Probe<'_>) -> Option<Gripper> {
    let [left, right] = *named else { return None };
    if !(slides_from_0(left, named, model) && slides_from_0(right, named, model)) {
        return None;
    }
    let opens_as_known = |end: fn(f64, f64) -> f64| {
        let mut positions = vec![0.0; model.joints.len()];
        for joint in [left, right] {
            positions[joint] = end(model.joints[joint].lower, model.joints[joint].upper);
        }
        let known = positions[left] + positions[right];
        probe
            .gap(&positions)
            .is_none_or(|gap| (gap.width_m() - known).abs() < SLIDING_SLACK_M)
    };
    if !(opens_as_known(f64::min) && opens_as_known(f64::max)) {
        return None;
    }
    let leaders = [left, right].map(|idx| {
        let joint = &model.joints[idx];
        Leader {
            joint: idx,
            closed: joint.lower,
            open: joint.upper,
            lever_m: 1.0,
            force_share: 1.0,
        }
    });
    Some(Gripper {
        leaders: leaders.to_vec(),
        n_measured: 2,
        followers: Vec::new(),
        sides: [0, 1],
        table: Vec::new(),
        widest_m: 2.0 * model.joints[left].upper.min(model.joints[right].upper),
    })
}

/// Whether a joint slides from 0 upwards, on its own or as much as the other finger.
fn slides_from_0(joint: usize, named: &[usize], model: &RobotModel) -> bool {
    let joint = &model.joints[joint];
    let as_the_other = joint.mimic.is_none_or(|(leader, factor, offset)| {
        named.contains(&leader) && (factor - 1.0).abs() < 1e-9 && offset.abs() < 1e-9
    });
    as_the_other
        && joint.kind == JointKind::Prismatic
        && joint.lower > -LIMIT_SLACK_M
        && joint.upper > 0.0
}
