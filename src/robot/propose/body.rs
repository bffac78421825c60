//! The arm, the base, the head and the camera.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::description::{Joint, JointKind, RobotModel};
use crate::kinematics::motion;
use actcheck_data::LinkFrame;

/// Words in the names of cameras, the best first.
const CAMERA_WORDS: [&str; 9] = [
    "rgbd",
    "depth",
    "xtion",
    "astra",
    "kinect",
    "realsense",
    "d435",
    "camera",
    "stereo",
];
/// A lift that takes longer from end to end is left at 0: actions have a minute. Unit: seconds.
const SLOW_SECS: f64 = 15.0;
/// An arm with fewer joints reaches only some orientations at each place.
pub(super) const FULL_ARM: usize = 6;
/// Height of a table-top arm's root. Unit: metres. That of a low table.
const TABLE_M: f64 = 0.4;
/// A root with shapes further below it than this is on its own pedestal. Unit: metres.
const PEDESTAL_M: f64 = 0.15;
/// An arm whose first joint is this far above the lowest shape is on a body of its own. Unit:
/// metres.
const SHOULDER_M: f64 = 0.6;
/// Rotation of a camera's frame in a link whose z axis points forwards and y axis down. Unit:
/// radians.
const Z_FORWARDS_RAD: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    -std::f64::consts::FRAC_PI_2,
    0.0,
];

/// The parts of a robot other than its hand.
pub(super) struct Body {
    pub(super) arm: Vec<usize>,
    pub(super) head: Vec<usize>,
    /// Joints of the base in the URDF: x, y, heading.
    pub(super) own_base: Option<[usize; 3]>,
    pub(super) drives: bool,
    pub(super) mount_height_m: f64,
    /// Height of its lowest shape in the frame of the root. Unit: metres.
    pub(super) lowest_m: f64,
    /// Whether it is fixed, without a pedestal of its own.
    pub(super) is_table_top: bool,
    pub(super) camera: LinkFrame,
}

/// Finds the body of the hand at `palm`. `others` are the names of links that carry other hands.
pub(super) fn find(
    model: &RobotModel,
    palm: usize,
    others: &[String],
    notes: &mut BTreeMap<&'static str, String>,
) -> Body {
    let mut path = chain(model, palm);
    let own_base = own_base(model, &path);
    if own_base.is_some() {
        path.drain(..3);
        notes.insert(
            "base_joints",
            "the first joints of the arm's chain slide in x and y and turn".to_owned(),
        );
    }
    let is_wheel = |name: &&str| {
        let name = name.to_lowercase();
        name.contains("wheel") || name.contains("caster")
    };
    let wheel = model.frames().map(|(name, _)| name).find(is_wheel);
    if let (Some(wheel), None) = (wheel, own_base) {
        notes.insert("base", format!("it has wheels, such as `{wheel}`"));
    }
    let drives = own_base.is_some() || wheel.is_some();
    let (slow, arm): (Vec<usize>, Vec<usize>) = path
        .into_iter()
        .filter(|idx| model.joints[*idx].mimic.is_none())
        .partition(|idx| is_slow(&model.joints[*idx]));
    let torso = torso(model, &arm, others);
    let (arm, torso): (Vec<usize>, Vec<usize>) =
        arm.into_iter().partition(|idx| !torso.contains(idx));
    let slow = slow.iter().map(|idx| &model.joints[*idx]).map(left_out);
    let of_torso = torso.iter().map(|idx| &model.joints[*idx].name);
    let of_torso = of_torso
        .map(|name| format!(", but not `{name}`, which moves the other arm too and stays at 0"));
    let left_out: String = slow.chain(of_torso).collect();
    notes.insert(
        "arm_joints",
        format!(
            "the joints between the root and the hand `{}`{left_out}",
            model.links[palm].name
        ),
    );
    let (camera, camera_at) = camera(model, palm, notes);
    let others: Vec<usize> = arm
        .iter()
        .copied()
        .chain(own_base.into_iter().flatten())
        .chain(torso)
        .collect();
    let head = head(model, camera_at, &others);
    let lowest_m = lowest(model);
    let shoulder_m = arm
        .first()
        .map_or(0.0, |first| poses_at_zero(model)[first + 1].translation.z);
    let on_floor = model.floats || lowest_m < -PEDESTAL_M || shoulder_m - lowest_m > SHOULDER_M;
    let mount_height_m = match (drives, on_floor) {
        (true, _) => (-lowest_m).clamp(0.0, 3.0),
        (false, true) => {
            notes.insert(
                "mount_height_m",
                "its lowest shape is then on the floor".to_owned(),
            );
            -lowest_m
        }
        (false, false) => {
            notes.insert(
                "mount_height_m",
                "the height of a low table; the mount itself is not simulated".to_owned(),
            );
            TABLE_M
        }
    };
    let mount_height_m = (mount_height_m * 1000.0).round() / 1000.0;
    let is_table_top = !drives && !on_floor;
    Body {
        arm,
        head,
        own_base,
        drives,
        mount_height_m,
        lowest_m,
        is_table_top,
        camera,
    }
}

/// The joints of a torso that turns or bends below several arms, if the arm has enough others.
fn torso(model: &RobotModel, arm: &[usize], others: &[String]) -> Vec<usize> {
    let palms = others
        .iter()
        .filter_map(|other| model.links.iter().position(|link| link.name == *other));
    let chains: Vec<Vec<usize>> = palms.map(|palm| chain(model, palm)).collect();
    let is_shared = |idx: &&usize| chains.iter().any(|chain| chain.contains(idx));
    let turns = |idx: &&usize| model.joints[**idx].kind == JointKind::Revolute;
    let torso: Vec<usize> = arm
        .iter()
        .filter(turns)
        .filter(is_shared)
        .copied()
        .collect();
    if arm.len() - torso.len() >= FULL_ARM {
        torso
    } else {
        Vec::new()
    }
}

/// Whether a lift takes so long that most of an action would be spent on it.
fn is_slow(joint: &Joint) -> bool {
    joint.kind == JointKind::Prismatic
        && (joint.lower..=joint.upper).contains(&0.0)
        && travel_secs(joint) > SLOW_SECS
}

/// Time from one end to the other. Unit: seconds.
fn travel_secs(joint: &Joint) -> f64 {
    (joint.upper - joint.lower) / joint.velocity
}

fn left_out(joint: &Joint) -> String {
    format!(
        ", but not `{}`, which takes {:.0} s from end to end and stays at 0",
        joint.name,
        travel_secs(joint)
    )
}

/// Returns the joints between the root and a link, from the root outwards.
pub(super) fn chain(model: &RobotModel, link: usize) -> Vec<usize> {
    let parent = |joint: &usize| model.joints[*joint].parent.checked_sub(1);
    let mut path: Vec<usize> = std::iter::successors(link.checked_sub(1), parent).collect();
    path.reverse();
    path
}

/// Returns the first three joints of a chain if they move a base.
fn own_base(model: &RobotModel, path: &[usize]) -> Option<[usize; 3]> {
    let first: [usize; 3] = path.get(..3)?.try_into().ok()?;
    let level = |idx: usize, axis: Vector3<f64>| {
        let joint = &model.joints[idx];
        (joint.origin.rotation * joint.axis.into_inner()).dot(&axis) > 0.99
    };
    let slides = first[..2]
        .iter()
        .all(|idx| model.joints[*idx].kind == JointKind::Prismatic);
    let turns = model.joints[first[2]].kind == JointKind::Revolute;
    let is_base = slides && turns && level(first[0], Vector3::x()) && level(first[1], Vector3::y());
    (is_base && level(first[2], Vector3::z())).then_some(first)
}

/// Returns the poses of all links with the joints at 0, or at the limit nearest to it.
pub(super) fn poses_at_zero(model: &RobotModel) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity()];
    for joint in &model.joints {
        let position = 0.0_f64.clamp(joint.lower, joint.upper);
        poses.push(poses[joint.parent] * joint.origin * motion(joint, position));
    }
    poses
}

/// Height of the lowest shape with the joints at 0.
fn lowest(model: &RobotModel) -> f64 {
    let poses = poses_at_zero(model);
    let corners = model.links.iter().zip(&poses).flat_map(|(link, pose)| {
        let points = link.solids.iter().flat_map(super::frames::corners);
        points.map(|point| (pose * point).z).collect::<Vec<f64>>()
    });
    corners.fold(0.0, f64::min)
}

/// Chooses a camera by its name and place: on a head rather than on a base or hand. Returns its
/// frame and the merged link.
fn camera(
    model: &RobotModel,
    palm: usize,
    notes: &mut BTreeMap<&'static str, String>,
) -> (LinkFrame, usize) {
    let poses = poses_at_zero(model);
    let on_hand = |link: usize| {
        let above = chain(model, link);
        palm.checked_sub(1)
            .is_some_and(|joint| above.contains(&joint))
    };
    let rate = |name: &str, link: usize, at: &Isometry3<f64>| {
        let lower = name.to_lowercase();
        let word = CAMERA_WORDS.iter().position(|word| lower.contains(word))?;
        let forwards = looks_forwards(&(poses[link] * at))?;
        let mut points = 20 - i32::try_from(word).unwrap_or(0);
        points += if lower.contains("head") || lower.contains("optical") {
            4
        } else {
            0
        };
        points -= if lower.contains("base") || lower.contains("torso") {
            12
        } else {
            0
        };
        points -= if on_hand(link) { 30 } else { 0 };
        Some((points, name.to_owned(), link, forwards))
    };
    let rated = model
        .frames()
        .filter_map(|(name, (link, at))| rate(name, *link, at));
    let (link, at, turned_rad) = match rated.max_by(|a, b| a.0.cmp(&b.0).then(b.1.cmp(&a.1))) {
        Some((_, name, link, turned)) => {
            notes.insert("camera_link", "its name".to_owned());
            (name, link, turned)
        }
        None => {
            let root = model.links[0].name.clone();
            notes.insert(
                "camera_link",
                "no camera was found: put one here before you test perception".to_owned(),
            );
            (root, 0, [0.0; 3])
        }
    };
    let frame = LinkFrame {
        link,
        offset_m: [0.0; 3],
        turned_rad,
    };
    (frame, at)
}

/// Returns the rotation of a camera in a frame: along its x or its z axis, whichever is level or
/// lower and points forwards. Returns `None` if neither does.
fn looks_forwards(frame: &Isometry3<f64>) -> Option<[f64; 3]> {
    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| frame.rotation * axis);
    let fits = |forwards: Vector3<f64>, up: Vector3<f64>| forwards.x > 0.3 && up.z > 0.3;
    if fits(x, z) {
        Some([0.0; 3])
    } else if fits(z, -y) {
        Some(Z_FORWARDS_RAD)
    } else {
        None
    }
}

/// Two joints above the camera, other than those of arm and base: pan, then tilt.
fn head(model: &RobotModel, camera: usize, others: &[usize]) -> Vec<usize> {
    let poses = poses_at_zero(model);
    let path: Vec<usize> = chain(model, camera)
        .into_iter()
        .filter(|idx| !others.contains(idx) && model.joints[*idx].kind == JointKind::Revolute)
        .filter(|idx| model.joints[*idx].mimic.is_none())
        .collect();
    let is_upright = |idx: usize| {
        let joint = &model.joints[idx];
        let turned: UnitQuaternion<f64> = poses[joint.parent].rotation * joint.origin.rotation;
        (turned * joint.axis.into_inner()).z.abs() > 0.7
    };
    let pan = path.iter().copied().find(|idx| is_upright(*idx));
    let tilt = path.iter().copied().rfind(|idx| !is_upright(*idx));
    pan.zip(tilt)
        .map(|(pan, tilt)| vec![pan, tilt])
        .unwrap_or_default()
}
