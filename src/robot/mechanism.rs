//! Mechanisms: joints that couplings move together, and the joint that leads them.

use crate::description::{Joint, RobotModel};

/// Least factor of a joint that leads its mechanism: a slower one would need a large force.
const LEAST_FACTOR: f64 = 0.2;

impl RobotModel {
    /// Returns the joint at the end of a joint's chain of couplings, with the factor and the offset
    /// of the whole chain.
    pub fn leader_of(&self, joint: usize) -> (usize, f64, f64) {
        let (mut at, mut factor, mut offset) = (joint, 1.0, 0.0);
        // A chain that is longer than this is a circle.
        for _ in 0..self.joints.len() {
            let Some((leader, next_factor, next_offset)) = self.joints[at].mimic else {
                break;
            };
            offset += factor * next_offset;
            factor *= next_factor;
            at = leader;
        }
        (at, factor, offset)
    }
}

/// Lets a joint that carries another one of its mechanism lead it, if the leading joint carries
/// none: as the motor of a four-bar linkage, whose force arrives at the fingertips only through
/// couplings.
pub(super) fn lead_with_carriers(model: &mut RobotModel) {
    let carries = |model: &RobotModel, joint: usize, other: usize| {
        let above = |idx: &usize| model.joints[*idx].parent.checked_sub(1);
        joint != other && std::iter::successors(Some(other), above).any(|idx| idx == joint)
    };
    for leader in 0..model.joints.len() {
        let followers: Vec<usize> = (0..model.joints.len())
            .filter(|idx| {
                model.joints[*idx]
                    .mimic
                    .is_some_and(|(leads, ..)| leads == leader)
            })
            .collect();
        if followers.iter().any(|other| carries(model, leader, *other)) {
            continue;
        }
        let leads = |idx: &usize| {
            let joint = &model.joints[*idx];
            let is_strong = joint
                .mimic
                .is_some_and(|(_, factor, _)| factor.abs() > LEAST_FACTOR);
            let is_alike = joint.kind == model.joints[leader].kind;
            is_strong && is_alike && followers.iter().any(|other| carries(model, *idx, *other))
        };
        let Some(new) = followers.iter().copied().find(leads) else {
            continue;
        };
        let Some((_, factor, offset)) = model.joints[new].mimic.take() else {
            continue;
        };
        let Joint {
            lower,
            upper,
            effort,
            velocity,
            ..
        } = model.joints[leader];
        let ends = [lower, upper].map(|end| factor * end + offset);
        let joint = &mut model.joints[new];
        (joint.lower, joint.upper) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        (joint.effort, joint.velocity) = (effort / factor.abs(), velocity * factor.abs());
        model.own_leaders.insert(new, leader);
        model.joints[leader].mimic = Some((new, 1.0 / factor, -offset / factor));
        for other in followers.into_iter().filter(|other| *other != new) {
            if let Some((_, own, own_offset)) = model.joints[other].mimic {
                model.joints[other].mimic =
                    Some((new, own / factor, own_offset - own * offset / factor));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    /// The motor of a linkage is on a short link that carries nothing: the bar that carries the
    /// finger leads instead, and the same positions belong together.
    #[test]
    fn the_bar_that_carries_a_finger_leads() {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        let shipped = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid");
        let joint = |name: &str, parent: &str, more: &str| {
            format!(
                "<link name=\"{name}_link\"/><joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/>\
                 <child link=\"{name}_link\"/><axis xyz=\"0 0 1\"/>\
                 <limit lower=\"0\" upper=\"0.8\" effort=\"10\" velocity=\"2\"/>{more}</joint>"
            )
        };
        let text = format!(
            "<robot name=\"linkage\"><link name=\"palm\"/>{}{}{}</robot>",
            joint("driver", "palm", ""),
            joint(
                "bar",
                "palm",
                "<mimic joint=\"driver\" multiplier=\"0.5\" offset=\"0.1\"/>"
            ),
            joint(
                "finger",
                "bar_link",
                "<mimic joint=\"driver\" multiplier=\"-0.5\"/>"
            ),
        );
        let urdf = Source::new("linkage.urdf", text);
        let core = actcheck_config::robot::with_urdf(shipped.core, urdf).expect("it is a URDF");
        let model = RobotModel::without_roles(&core).expect("it is a URDF");
        let joints =
            ["driver", "bar", "finger"].map(|name| model.joint(name).expect("it has the joint"));
        let [driver, bar, finger] = joints.map(|idx| &model.joints[idx]);
        assert_eq!(bar.mimic, None);
        assert!(
            (bar.lower - 0.1).abs() < 1e-12 && (bar.upper - 0.5).abs() < 1e-12,
            "{} {}",
            bar.lower,
            bar.upper
        );
        assert!((bar.effort - 20.0).abs() < 1e-12, "{}", bar.effort);
        assert_eq!(model.own_leaders.get(&joints[1]), Some(&joints[0]));
        for at in [0.0, 0.3, 0.8] {
            let of_bar = 0.5 * at + 0.1;
            for (follower, expected) in [(driver, at), (finger, -0.5 * at)] {
                let (leader, factor, offset) = follower.mimic.expect("it follows");
                assert_eq!(leader, joints[1]);
                assert!(
                    (factor * of_bar + offset - expected).abs() < 1e-12,
                    "{}",
                    follower.name
                );
            }
        }
    }
}
