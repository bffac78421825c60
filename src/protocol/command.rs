//! Commands for the robot's joints, checked against the robot's description.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};

use crate::hello::{Joints, Role};
use crate::message::short;
use actcheck_actions::{Controls, ExternalFault};

/// A command as it is on the wire.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WireCommand {
    #[serde(rename = "type")]
    _kind: serde::de::IgnoredAny,
    #[serde(default = "one")]
    ticks: u32,
    #[serde(default)]
    positions: Targets,
    #[serde(default)]
    velocities: Targets,
    #[serde(default)]
    efforts: Targets,
    #[serde(default)]
    base_velocity: Option<[f64; 3]>,
    #[serde(default)]
    gripper: Option<GripperTarget>,
    #[serde(default)]
    head: Option<HeadTarget>,
}

fn one() -> u32 {
    1
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct GripperTarget {
    opening_m: f64,
    #[serde(default)]
    force_n: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadTarget {
    #[serde(default)]
    pan_rad: Option<f64>,
    #[serde(default)]
    tilt_rad: Option<f64>,
}

/// Targets by joint name, in the order of the message. Duplicate names are kept, so that they can
/// be reported.
#[derive(Debug, Default)]
struct Targets(Vec<(String, f64)>);

impl<'de> Deserialize<'de> for Targets {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(TargetsVisitor)
    }
}

struct TargetsVisitor;

impl<'de> Visitor<'de> for TargetsVisitor {
    type Value = Targets;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object that maps joint names to numbers")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Targets, A::Error> {
        let mut targets = Vec::new();
        while let Some(target) = map.next_entry()? {
            targets.push(target);
        }
        Ok(Targets(targets))
    }
}

impl WireCommand {
    /// Returns the number of ticks the command lasts, and its controls.
    ///
    /// # Errors
    /// An unknown joint, a joint commanded by the wrong key, duplicate targets for a joint, or zero
    /// ticks.
    pub fn controls(self, joints: &Joints) -> Result<(u32, Controls), ExternalFault> {
        if self.ticks == 0 {
            return Err(wrong(
                "its command lasts 0 ticks; `ticks` must be at least 1".to_owned(),
            ));
        }
        let mut taken = CommandedJoints {
            joints,
            seen: Vec::new(),
        };
        let mut controls = Controls {
            positions: taken.positions(&self.positions)?,
            velocities: taken.list(&self.velocities)?,
            efforts: taken.list(&self.efforts)?,
            base_velocity: self.base_velocity,
            opening_m: self.gripper.as_ref().map(|gripper| gripper.opening_m),
            force_n: self.gripper.and_then(|gripper| gripper.force_n),
        };
        if controls.base_velocity.is_some() {
            taken.base()?;
        }
        if let Some(opening_m) = controls.opening_m {
            check_unit(
                "the gripper's opening",
                opening_m,
                ([0.0, joints.max_opening_m], "m"),
            )?;
        }
        for (number, (name, angle)) in self
            .head
            .into_iter()
            .flat_map(|head| head.targets())
            .enumerate()
        {
            let Some(angle) = angle else { continue };
            let joint = joints
                .head
                .get(number)
                .ok_or_else(|| wrong(format!("the robot's head has no {name}")))?;
            taken.once(*joint, name)?;
            taken.check_limits(*joint, angle)?;
            controls.positions.push((*joint, angle));
        }
        Ok((self.ticks, controls))
    }
}

impl HeadTarget {
    fn targets(&self) -> [(&'static str, Option<f64>); 2] {
        [("pan", self.pan_rad), ("tilt", self.tilt_rad)]
    }
}

/// Joints that already have a target.
struct CommandedJoints<'a> {
    joints: &'a Joints,
    seen: Vec<usize>,
}

impl CommandedJoints<'_> {
    fn list(&mut self, targets: &Targets) -> Result<Vec<(usize, f64)>, ExternalFault> {
        targets
            .0
            .iter()
            .map(|(name, value)| Ok((self.joint(name)?, *value)))
            .collect()
    }

    /// Target positions, which may be beyond limits, but not by another unit.
    fn positions(&mut self, targets: &Targets) -> Result<Vec<(usize, f64)>, ExternalFault> {
        let list = self.list(targets)?;
        for (joint, position) in &list {
            self.check_limits(*joint, *position)?;
        }
        Ok(list)
    }

    fn check_limits(&self, joint: usize, position: f64) -> Result<(), ExternalFault> {
        match (self.joints.names.get(joint), self.joints.limits.get(joint)) {
            (Some(name), Some(limits)) => check_unit(&format!("`{name}`"), position, *limits),
            _ => Ok(()),
        }
    }

    fn joint(&mut self, name: &str) -> Result<usize, ExternalFault> {
        let Some((joint, role)) = self.joints.by_name.get(name) else {
            let help =
                actcheck_base::did_you_mean(name, self.joints.by_name.keys().map(String::as_str));
            return Err(wrong(format!(
                "the robot has no joint `{}`: {help}",
                short(name)
            )));
        };
        if *role == Role::Gripper {
            return Err(wrong(format!(
                "`{name}` is a finger joint; command it with `gripper`"
            )));
        }
        self.once(*joint, name)?;
        Ok(*joint)
    }

    fn once(&mut self, joint: usize, name: &str) -> Result<(), ExternalFault> {
        if self.seen.contains(&joint) {
            return Err(wrong(format!(
                "its command has two targets for the joint `{name}`"
            )));
        }
        self.seen.push(joint);
        Ok(())
    }

    /// Checks that a base velocity is not combined with targets for the base's joints.
    fn base(&self) -> Result<(), ExternalFault> {
        if !self.joints.drives {
            return Err(wrong("the robot has no mobile base".to_owned()));
        }
        let of_base = self
            .joints
            .by_name
            .iter()
            .find(|(_, (idx, role))| *role == Role::Base && self.seen.contains(idx));
        match of_base {
            Some((name, _)) => Err(wrong(format!(
                "its command has a base velocity and a target for `{name}`"
            ))),
            None => Ok(()),
        }
    }
}

/// Refuses a target that is farther beyond its limits than they are apart: it is in another unit,
/// such as degrees or millimetres. Nearer ones stop at the limits.
fn check_unit(
    name: &str,
    target: f64,
    ([lower, upper], unit): ([f64; 2], &str),
) -> Result<(), ExternalFault> {
    let range = upper - lower;
    if !range.is_finite() || (lower - range..=upper + range).contains(&target) {
        return Ok(());
    }
    Err(wrong(format!(
        "its command has the target {target} {unit} for {name}, whose limits are {lower:.4} and {upper:.4} {unit}: is it in \
         another unit?"
    )))
}

fn wrong(reason: String) -> ExternalFault {
    ExternalFault {
        late: false,
        reason,
    }
}
