//! The joints of a URDF that the simulation moves: those with a role in the profile, and those
//! coupled to them.
//!
//! All others are rigid, so that a humanoid beside a table is as fast as its arm.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_data::{ModelTree, RobotProfile, TreeJoint, TreeMotion};

/// The movable joints of a robot, and the positions of the others.
pub(super) struct Needed<'a> {
    /// `None` if the profile has no roles yet: all joints move, but those that it parks.
    moving: Option<BTreeSet<&'a str>>,
    joints: BTreeMap<&'a str, &'a TreeJoint>,
    /// Positions of rigid joints that the profile gives.
    parked: BTreeMap<&'a str, f64>,
}

impl<'a> Needed<'a> {
    pub(super) fn of(robot: &'a ModelTree, profile: &'a RobotProfile) -> Self {
        let joints: BTreeMap<&str, &TreeJoint> = robot
            .joints
            .iter()
            .map(|joint| (joint.name.as_str(), joint))
            .collect();
        let parked = profile
            .parked
            .iter()
            .map(|(name, position)| (name.as_str(), *position))
            .collect();
        let has_hand = !profile.finger_joints.is_empty() || profile.suction.is_some();
        if profile.arm_joints.is_empty() || !has_hand {
            return Self {
                moving: None,
                joints,
                parked,
            };
        }
        let base = profile.base_joints.iter().flatten();
        let roles = base
            .chain(&profile.arm_joints)
            .chain(&profile.head_joints)
            .chain(&profile.finger_joints);
        let mut moving: BTreeSet<&str> = roles
            .chain(&profile.other_joints)
            .map(String::as_str)
            .collect();
        // A coupling moves both of its joints.
        loop {
            let n_known = moving.len();
            for joint in &robot.joints {
                if let Some(mimic) = &joint.mimic {
                    let pair = [joint.name.as_str(), mimic.leader.as_str()];
                    if pair.iter().any(|name| moving.contains(name)) {
                        moving.extend(pair);
                    }
                }
            }
            if moving.len() == n_known {
                break;
            }
        }
        Self {
            moving: Some(moving),
            joints,
            parked,
        }
    }

    /// Whether the profile has roles, which select the joints.
    pub(super) fn is_chosen(&self) -> bool {
        self.moving.is_some()
    }

    /// Whether the simulation moves a joint. A coupling with the factor 0 holds it where it is.
    pub(super) fn contains(&self, joint: &TreeJoint) -> bool {
        let is_held = joint
            .mimic
            .as_ref()
            .is_some_and(|mimic| mimic.factor == 0.0);
        let name = joint.name.as_str();
        !is_held
            && self
                .moving
                .as_ref()
                .map_or(!self.is_parked(joint), |moving| moving.contains(name))
    }

    /// Whether the profile parks a joint, or one that it follows.
    fn is_parked(&self, joint: &TreeJoint) -> bool {
        let leader = |own: &&TreeJoint| {
            let mimic = own.mimic.as_ref()?;
            self.joints.get(mimic.leader.as_str()).copied()
        };
        // A chain of couplings that is longer than this is a circle.
        std::iter::successors(self.joints.get(joint.name.as_str()).copied(), leader)
            .take(self.joints.len())
            .any(|own| self.parked.contains_key(own.name.as_str()))
    }

    /// The position of a rigid joint: that of the profile, otherwise 0 or the limit nearest to it;
    /// by its coupling if it has one.
    pub(super) fn rest(&self, joint: &TreeJoint) -> f64 {
        let mut at = joint;
        let (mut factor, mut offset) = (1.0, 0.0);
        // A chain of couplings that is longer than this is a circle.
        for _ in 0..self.joints.len() {
            let Some(mimic) = &at.mimic else { break };
            let Some(leader) = self.joints.get(mimic.leader.as_str()) else {
                break;
            };
            offset += factor * mimic.offset;
            factor *= mimic.factor;
            at = leader;
        }
        let parked = self.parked.get(at.name.as_str()).copied().unwrap_or(0.0);
        within(joint, factor * within(at, parked) + offset)
    }
}

/// The position nearest to this one within the limits of a joint.
fn within(joint: &TreeJoint, position: f64) -> f64 {
    let unlimited = joint.motion == TreeMotion::Continuous;
    let is_range = joint.lower <= joint.upper;
    if unlimited || !is_range {
        position
    } else {
        position.clamp(joint.lower, joint.upper)
    }
}
