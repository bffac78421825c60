//! Checks that the URDF's joints and links can fill the roles that a robot profile assigns to them.

use std::collections::BTreeMap;

use crate::{Located, Table};
use actcheck_base::{Span, did_you_mean};
use actcheck_data::{ModelTree, TreeJoint, TreeMotion};

/// Tolerance at joint limits, whose values are often rounded. Unit: metres or radians.
const SLACK: f64 = 1e-3;

/// The names in a profile, with their spans.
#[derive(Debug, Default)]
pub(super) struct Roles {
    /// Joints named by each key of the profile.
    pub(super) joints: Vec<(&'static str, Vec<Located<String>>)>,
    /// Links named by the profile.
    pub(super) links: Vec<Vec<Located<String>>>,
    /// Positions of the joints that a key of the profile names, each with its span.
    pub(super) postures: Vec<(Span, &'static str, Vec<f64>)>,
    /// The widest gap between the fingers, with its span.
    pub(super) opening: Option<(Span, f64)>,
}

impl Roles {
    /// Reports every role that its joint or link can't fill: an unknown name (W050), a joint with
    /// two roles (W052), a joint of the wrong type (W053), a position beyond the joint limits
    /// (W054).
    pub(super) fn check(&self, tree: &ModelTree, table: &mut Table) {
        for link in self.links.iter().flatten() {
            if tree.link(&link.value).is_none() {
                let known = tree.links.iter().map(|link| link.name.as_str());
                let help = did_you_mean(&link.value, known);
                table.fault(
                    "W050",
                    link.span.clone(),
                    format!("the robot has no link `{}`", link.value),
                    help,
                );
            }
        }
        let mut taken: BTreeMap<&str, &str> = BTreeMap::new();
        for (key, joints) in &self.joints {
            for (place, joint) in joints.iter().enumerate() {
                if let Some(other) = taken.insert(&joint.value, key) {
                    let message = if other == *key {
                        format!("the joint `{}` is named twice in `{key}`", joint.value)
                    } else {
                        format!(
                            "the joint `{}` is both in `{other}` and in `{key}`",
                            joint.value
                        )
                    };
                    table.fault(
                        "W052",
                        joint.span.clone(),
                        message,
                        "each joint has one role",
                    );
                }
                check_joint(key, place, joint, tree, table);
            }
        }
        self.check_postures(tree, table);
        self.check_opening(tree, table);
    }

    fn of(&self, key: &str) -> &[Located<String>] {
        self.joints
            .iter()
            .find(|(known, _)| *known == key)
            .map_or(&[], |(_, joints)| joints)
    }

    fn check_postures(&self, tree: &ModelTree, table: &mut Table) {
        for (span, key, positions) in &self.postures {
            for (joint, position) in self.of(key).iter().zip(positions) {
                let Some(limits) = tree.joint(&joint.value) else {
                    continue;
                };
                if *position < limits.lower - SLACK || *position > limits.upper + SLACK {
                    let message = format!("{position} is beyond the limits of `{}`", joint.value);
                    let radians = position.to_radians();
                    let is_large = turns(limits) && position.abs() > std::f64::consts::TAU;
                    let meant = is_large && (limits.lower..=limits.upper).contains(&radians);
                    let degrees = match meant {
                        true => format!(" rad; {position} degrees are {radians:.4} rad"),
                        false => String::new(),
                    };
                    let help = format!(
                        "its limits are {} and {}{degrees}",
                        limits.lower, limits.upper
                    );
                    table.fault("W054", span.clone(), message, help);
                }
            }
        }
    }

    /// Checks that two fingers that slide apart from 0 can open to `max_opening_m`. The opening of
    /// other grippers is measured by the simulation.
    fn check_opening(&self, tree: &ModelTree, table: &mut Table) {
        let Some((span, opening)) = &self.opening else {
            return;
        };
        let fingers: Vec<f64> = self
            .of("finger_joints")
            .iter()
            .filter_map(|joint| tree.joint(&joint.value))
            .filter(|joint| slides(joint) && joint.lower >= -SLACK && joint.upper > SLACK)
            .map(|joint| joint.upper)
            .collect();
        let widest = 2.0 * fingers.iter().copied().fold(f64::INFINITY, f64::min);
        if fingers.len() == 2 && *opening > widest + SLACK {
            let message = format!("the fingers open no wider than {widest} m");
            let help = "each finger slides from 0, where both meet, to half of `max_opening_m`";
            table.fault("W054", span.clone(), message, help);
        }
    }
}

/// Checks that a joint exists and has the type that its role requires.
fn check_joint(
    key: &str,
    place: usize,
    joint: &Located<String>,
    tree: &ModelTree,
    table: &mut Table,
) {
    let name = &joint.value;
    let Some(found) = tree.joint(name) else {
        let movable = tree.joints.iter().filter(|joint| joint.motion.moves());
        let help = did_you_mean(name, movable.map(|joint| joint.name.as_str()));
        table.fault(
            "W050",
            joint.span.clone(),
            format!("the robot has no joint `{name}`"),
            help,
        );
        return;
    };
    let must_slide = match (key, place) {
        ("base_joints", 0 | 1) => Some(true),
        ("base_joints", _) => Some(false),
        _ => None,
    };
    let (fault, help) = match must_slide {
        _ if !found.motion.moves() => (
            "does not move",
            "name a joint of the type prismatic, revolute or continuous",
        ),
        Some(true) if turns(found) => (
            "rotates, but must be prismatic",
            "`base_joints` are x, y and heading",
        ),
        Some(false) if slides(found) => (
            "is prismatic, but must be revolute or continuous",
            "`base_joints` are x, y and heading",
        ),
        _ => return,
    };
    table.fault(
        "W053",
        joint.span.clone(),
        format!("the joint `{name}` {fault}"),
        help,
    );
}

fn slides(joint: &TreeJoint) -> bool {
    joint.motion == TreeMotion::Prismatic
}

fn turns(joint: &TreeJoint) -> bool {
    matches!(joint.motion, TreeMotion::Revolute | TreeMotion::Continuous)
}
