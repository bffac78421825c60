//! The joints of a URDF that the simulation moves: those with a role in the profile, and those
//! coupled to them.
//!
//! All others are rigid, so that a humanoid beside a table is as fast as its arm.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_data::{RobotCore, RobotRoles, TreeJoint, TreeMotion};

/// The movable joints of a robot, and the positions of the others.
pub(super) struct Needed<'a> {
    /// `None` if the roles are not known yet: all joints move, but those that are parked.
    moving: Option<BTreeSet<&'a str>>,
    joints: BTreeMap<&'a str, &'a TreeJoint>,
    /// Positions of rigid joints that the profile gives.
    parked: BTreeMap<&'a str, f64>,
}

impl<'a> Needed<'a> {
    pub(super) fn of(core: &'a RobotCore, roles: Option<RobotRoles<'a>>) -> Self {
        let joints = core.tree.joints.iter();
        let parked = core.parked.iter();
        Self {
            moving: roles.map(moving),
            joints: joints.map(|joint| (joint.name.as_str(), joint)).collect(),
            parked: parked
                .map(|(name, position)| (name.as_str(), *position))
                .collect(),
        }
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

/// The joints with a role, and those coupled to them.
fn moving(roles: RobotRoles<'_>) -> BTreeSet<&str> {
    let RobotCore {
        tree,
        base_joints,
        head_joints,
        other_joints,
        ..
    } = roles.core;
    let base = base_joints.iter().flatten();
    let named = base
        .chain(roles.arm_joints)
        .chain(head_joints)
        .chain(&roles.hand.finger_joints)
        .chain(other_joints);
    let mut moving: BTreeSet<&str> = named.map(String::as_str).collect();
    // A coupling moves both of its joints.
    loop {
        let n_known = moving.len();
        for joint in &tree.joints {
            if let Some(mimic) = &joint.mimic {
                let pair = [joint.name.as_str(), mimic.leader.as_str()];
                if pair.iter().any(|name| moving.contains(name)) {
                    moving.extend(pair);
                }
            }
        }
        if moving.len() == n_known {
            return moving;
        }
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
