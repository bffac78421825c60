//! Limits of joints that a simulation can't use as a URDF states them.

use crate::description::{Joint, JointKind};

/// Largest effort of joints for which it is unknown, as for those of MJCF and SDF. Units: newtons
/// or newton metres.
pub const UNKNOWN_EFFORT: f64 = 100.0;

/// Largest speeds of joints for which they are unknown. Units: rad/s, m/s. Those of a slow arm.
pub const UNKNOWN_SPEEDS: [f64; 2] = [1.0, 0.25];

/// Widens the limits of joints that mimic others to the range of their couplings. A mechanism moves
/// its links together: limits that contradict the coupling, such as those of a mirrored joint that
/// are not mirrored, would block the leader.
pub(super) fn widen_followers(joints: &mut [Joint]) {
    // Each round widens the followers of those widened before; a chain that is longer than this is
    // a circle.
    for _ in 0..joints.len() {
        let mut is_changed = false;
        for idx in 0..joints.len() {
            let Some((leader, factor, offset)) = joints[idx].mimic else {
                continue;
            };
            let ends =
                [joints[leader].lower, joints[leader].upper].map(|end| factor * end + offset);
            let joint = &mut joints[idx];
            let (lower, upper) = (
                joint.lower.min(ends[0]).min(ends[1]),
                joint.upper.max(ends[0]).max(ends[1]),
            );
            is_changed |= lower < joint.lower || upper > joint.upper;
            (joint.lower, joint.upper) = (lower, upper);
        }
        if !is_changed {
            break;
        }
    }
}

/// Gives joints whose largest effort is 0 one that moves them: it is unknown, because a role needs
/// a motor. Returns the names of those that lead.
pub(super) fn assume_efforts(joints: &mut [Joint]) -> Vec<String> {
    let mut assumed = Vec::new();
    for joint in joints.iter_mut().filter(|joint| joint.effort == 0.0) {
        joint.effort = UNKNOWN_EFFORT;
        if joint.mimic.is_none() {
            assumed.push(joint.name.clone());
        }
    }
    assumed
}

/// As [`assume_efforts`], for joints whose largest speed is 0.
pub(super) fn assume_speeds(joints: &mut [Joint]) -> Vec<String> {
    let mut assumed = Vec::new();
    for joint in joints.iter_mut().filter(|joint| joint.velocity == 0.0) {
        joint.velocity = UNKNOWN_SPEEDS[usize::from(joint.kind == JointKind::Prismatic)];
        if joint.mimic.is_none() {
            assumed.push(joint.name.clone());
        }
    }
    assumed
}
