//! Introduces a program to its robot: the URDF and the roles of the joints.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::message::PROTOCOL;
use actcheck_world::{Joint, JointKind, World};

/// Data that can be observed or requested.
const SENSORS: [&str; 7] = [
    "joints", "odometry", "gripper", "depth", "rgb", "cloud", "objects",
];

/// The first message to a program.
#[derive(Debug, Serialize)]
pub struct Introduction<'a> {
    r#type: &'static str,
    protocol: u32,
    actcheck: &'static str,
    worker: usize,
    control_period_s: f64,
    privileged: bool,
    robot: Robot<'a>,
    sensors: [&'static str; 7],
}

#[derive(Debug, Serialize)]
struct Robot<'a> {
    name: &'a str,
    urdf: &'a str,
    joints: Vec<WireJoint<'a>>,
    base_joints: Vec<&'a str>,
    arm_joints: Vec<&'a str>,
    gripper_joints: Vec<&'a str>,
    head_joints: Vec<&'a str>,
    mount_height_m: f64,
    home: &'a [f64],
    postures: &'a [Vec<f64>],
    tool_link: &'a str,
    tool_turned_rad: [f64; 3],
    max_opening_m: f64,
    grip_force_n: f64,
    camera: Camera<'a>,
}

#[derive(Debug, Serialize)]
struct WireJoint<'a> {
    name: &'a str,
    kind: &'static str,
    role: &'static str,
    lower: f64,
    upper: f64,
    velocity: f64,
    effort: f64,
}

#[derive(Debug, Serialize)]
struct Camera<'a> {
    link: &'a str,
    width: u32,
    height: u32,
    horizontal_fov_rad: f64,
    min_range_m: f64,
    max_range_m: f64,
}

/// The role of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Base,
    Arm,
    Gripper,
    Head,
    Other,
}

impl Role {
    fn word(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Arm => "arm",
            Self::Gripper => "gripper",
            Self::Head => "head",
            Self::Other => "other",
        }
    }
}

/// The joints of a robot by name.
#[derive(Debug, Clone, Default)]
pub struct Joints {
    /// Index and role.
    pub by_name: BTreeMap<String, (usize, Role)>,
    /// Names by index.
    pub names: Vec<String>,
    /// Limits of positions by index, with their unit; infinite if there are none.
    pub limits: Vec<([f64; 2], &'static str)>,
    /// Widest gap between the fingers. Unit: metres.
    pub max_opening_m: f64,
    /// Indices of the pan and tilt joints that exist.
    pub head: Vec<usize>,
    /// Whether the base is mobile.
    pub drives: bool,
}

impl Joints {
    /// The joints of the robot in a world.
    pub fn of(world: &World) -> Self {
        let roles = roles(world);
        let joints = world.kinematics().joints();
        let names: Vec<String> = joints.iter().map(|joint| joint.name.clone()).collect();
        let by_name = names
            .iter()
            .cloned()
            .zip(roles)
            .enumerate()
            .map(|(idx, (name, role))| (name, (idx, role)))
            .collect();
        Self {
            by_name,
            names,
            limits: joints.iter().map(limits).collect(),
            max_opening_m: world.profile().hand.max_opening_m,
            head: world.layout().head.clone(),
            drives: world.layout().base.is_some(),
        }
    }
}

fn limits(joint: &Joint) -> ([f64; 2], &'static str) {
    let unit = match joint.kind {
        JointKind::Prismatic => "m",
        JointKind::Revolute => "rad",
    };
    ([joint.lower, joint.upper], unit)
}

/// The introduction of the robot in a world to the program of one worker.
pub fn introduction(world: &World, worker: usize, privileged: bool) -> Introduction<'_> {
    let (profile, camera) = (world.profile(), world.drive().camera());
    let joints = world.kinematics().joints();
    let roles = roles(world);
    let names = |wanted: &[usize]| {
        wanted
            .iter()
            .filter_map(|idx| Some(joints.get(*idx)?.name.as_str()))
            .collect()
    };
    let layout = world.layout();
    Introduction {
        r#type: "hello",
        protocol: PROTOCOL,
        actcheck: env!("CARGO_PKG_VERSION"),
        worker,
        control_period_s: world.tick_secs(),
        privileged,
        robot: Robot {
            name: &profile.core.name,
            urdf: &profile.core.urdf.text,
            joints: joints
                .iter()
                .zip(roles)
                .map(|(joint, role)| wire_joint(joint, role))
                .collect(),
            base_joints: layout.base.map_or_else(Vec::new, |base| names(&base)),
            arm_joints: names(&layout.arm),
            gripper_joints: names(&layout.gripper.joints().collect::<Vec<_>>()),
            head_joints: names(&layout.head),
            mount_height_m: profile.core.mount_height_m,
            home: &profile.home,
            postures: &profile.postures,
            tool_link: &profile.hand.grasp.link,
            tool_turned_rad: profile.hand.grasp.turned_rad,
            max_opening_m: profile.hand.max_opening_m,
            grip_force_n: profile.hand.grip_force_n,
            camera: Camera {
                link: &profile.camera.link,
                width: camera.width,
                height: camera.height,
                horizontal_fov_rad: camera.field_of_view_rad,
                min_range_m: camera.min_range_m,
                max_range_m: camera.max_range_m,
            },
        },
        sensors: SENSORS,
    }
}

fn wire_joint(joint: &Joint, role: Role) -> WireJoint<'_> {
    let kind = match joint.kind {
        JointKind::Prismatic => "prismatic",
        JointKind::Revolute => "revolute",
    };
    let Joint {
        name,
        lower,
        upper,
        velocity,
        effort,
        ..
    } = joint;
    let [lower, upper, velocity, effort] = [*lower, *upper, *velocity, *effort].map(written);
    WireJoint {
        name,
        kind,
        role: role.word(),
        lower,
        upper,
        velocity,
        effort,
    }
}

/// JSON has no infinity; the largest finite number replaces it.
fn written(value: f64) -> f64 {
    value.clamp(f64::MIN, f64::MAX)
}

fn roles(world: &World) -> Vec<Role> {
    let layout = world.layout();
    let role = |idx: usize| match idx {
        idx if layout.base.is_some_and(|base| base.contains(&idx)) => Role::Base,
        idx if layout.arm.contains(&idx) => Role::Arm,
        idx if layout.gripper.contains(idx) => Role::Gripper,
        idx if layout.head.contains(&idx) => Role::Head,
        _ => Role::Other,
    };
    (0..world.kinematics().joints().len()).map(role).collect()
}
