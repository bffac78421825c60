//! The hand of a robot without fingers that oppose each other, or without names for them: its
//! profile has everything else, and lists the joints that could move fingers.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::body::chain;
use super::fingers::{ProposedHand, is_called, others_than, rank, written};
use super::frames::corners;
use super::hands::groups;
use super::stated::NoHand;
use super::thumb;
use crate::GripperFault;
use crate::description::{JointKind, RobotModel};
use actcheck_data::{Hand, LinkFrame, ModelTree, StatedRobot, Suction};

/// Fewest joints of an arm whose hand has no names of fingers.
const FEWEST_BEFORE_HAND: usize = 3;
/// Most joints between a palm and the outer links of its fingers.
const LONGEST_FINGER: usize = 4;
/// Distance of the frame from a hand without shapes. Unit: metres.
const AHEAD_M: f64 = 0.1;
/// The tool that takes the place of the fingers while the postures are found.
const PLACEHOLDER: Suction = Suction {
    force_n: 1.0,
    radius_m: 0.02,
    friction: 0.5,
};

/// The hand of a robot whose fingers are not known.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownHand {
    /// Why no fingers were found.
    pub fault: GripperFault,
    /// A frame on the palm, the link at the end of the arm: its origin is between the links beyond
    /// the palm, and its x axis points from the palm to there.
    pub grasp: LinkFrame,
    /// The movable joints beyond the palm; parents come before their children.
    pub joints: Vec<FingerJoint>,
}

/// A joint that could move a finger.
#[derive(Debug, Clone, PartialEq)]
pub struct FingerJoint {
    /// Its name.
    pub name: String,
    /// The link that it moves.
    pub link: String,
    /// Whether it turns, rather than slides.
    pub turns: bool,
    /// Its limits. Units: metres or radians.
    pub limits: [f64; 2],
    /// The joint that it mimics, which has the motor.
    pub follows: Option<String>,
    /// Whether it is the outermost joint of its finger.
    pub is_last: bool,
    /// Whether its link has collision shapes.
    pub has_shapes: bool,
}

/// Finds the arm's end, with a tool in place of the fingers.
///
/// # Errors
/// [`NoHand`] with this fault if the robot has no arm, or with another if no arm has the wanted
/// name.
pub(super) fn find(
    partial: &StatedRobot,
    wanted: Option<&str>,
    fault: GripperFault,
) -> Result<(RobotModel, ProposedHand, UnknownHand), NoHand> {
    let model = thumb::without_roles(partial)?;
    let groups = groups(&model);
    let is_wanted = |palm: &usize| wanted.is_none_or(|wanted| is_called(&model, *palm, wanted));
    let named = groups.keys().copied().filter(is_wanted);
    let known = named.max_by_key(|palm| (rank(&model, *palm), std::cmp::Reverse(*palm)));
    let known = known.map(|palm| below_fingers(&model, palm, groups.keys()));
    let Some(palm) = known.or_else(|| end_of_arm(&model, wanted)) else {
        return Err(NoHand::Gripper(fault));
    };
    let beyond = beyond(&model, palm);
    let inside: BTreeSet<usize> = beyond.iter().map(|joint| joint + 1).collect();
    let frame = ahead(&model, palm, &beyond);
    let hand = UnknownHand {
        fault,
        grasp: written(model.links[palm].name.clone(), &frame),
        joints: beyond
            .iter()
            .map(|joint| candidate(&partial.core.tree, &model, *joint))
            .collect(),
    };
    let others = groups
        .into_iter()
        .filter(|(other, _)| !inside.contains(other));
    let placeholder = ProposedHand {
        others: others_than(&model, &others.collect(), palm),
        ..ProposedHand::known(Hand::of_cup(hand.grasp.clone(), PLACEHOLDER), palm)
    };
    Ok((model, placeholder, hand))
}

/// The link that carries several fingers, if this one is part of a finger: fingers of which only the
/// outer links have such names count as hands of their own.
fn below_fingers<'a>(
    model: &RobotModel,
    palm: usize,
    palms: impl Iterator<Item = &'a usize>,
) -> usize {
    let own = chain(model, palm);
    let n_common = |other: &usize| {
        let path = chain(model, *other);
        own.iter().zip(&path).take_while(|(a, b)| a == b).count()
    };
    let forks = palms.filter(|other| **other != palm).map(n_common);
    let fork = forks
        .filter(|n| *n >= FEWEST_BEFORE_HAND && own.len() - n <= LONGEST_FINGER)
        .min();
    fork.map_or(palm, |n| own[n - 1] + 1)
}

/// The link at the end of the longest arm: the last one from which several chains go on, or that
/// of the last joint.
fn end_of_arm(model: &RobotModel, wanted: Option<&str>) -> Option<usize> {
    let is_wanted = |link: &usize| wanted.is_none_or(|wanted| is_called(model, *link, wanted));
    let n_branches = |link: usize| {
        model
            .joints
            .iter()
            .filter(|joint| joint.parent == link)
            .count()
    };
    let links = || (1..model.links.len()).filter(is_wanted);
    let length = |link: &usize| (chain(model, *link).len(), std::cmp::Reverse(*link));
    let ends = || links().filter(|link| chain(model, *link).len() >= FEWEST_BEFORE_HAND);
    let forks = ends().filter(|link| n_branches(*link) >= 2);
    forks
        .max_by_key(length)
        .or_else(|| ends().max_by_key(length))
}

/// The joints beyond a link. Parents come before their children.
fn beyond(model: &RobotModel, palm: usize) -> Vec<usize> {
    let mut carried = BTreeSet::from([palm]);
    let mut joints = Vec::new();
    for (joint, own) in model.joints.iter().enumerate() {
        if carried.contains(&own.parent) {
            carried.insert(joint + 1);
            joints.push(joint);
        }
    }
    joints
}

/// A frame in the middle of the shapes beyond the palm, or of its own, with its x axis away from
/// the palm.
fn ahead(model: &RobotModel, palm: usize, beyond: &[usize]) -> Isometry3<f64> {
    let mut poses = vec![Isometry3::identity(); model.links.len()];
    let mut points: Vec<Point3<f64>> = Vec::new();
    for joint in beyond {
        let own = &model.joints[*joint];
        poses[joint + 1] = poses[own.parent] * own.origin;
        let at = poses[joint + 1];
        let solids = &model.links[joint + 1].solids;
        points.extend(solids.iter().flat_map(corners).map(|point| at * point));
    }
    if points.is_empty() {
        points.extend(model.links[palm].solids.iter().flat_map(corners));
    }
    let sum: Vector3<f64> = points.iter().map(|point| point.coords).sum();
    let way = sum / points.len().max(1) as f64;
    let way = match way.norm() > 1e-3 {
        true => way,
        false => Vector3::z() * AHEAD_M,
    };
    let turned = UnitQuaternion::rotation_between(&Vector3::x(), &way).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
    });
    Isometry3::from_parts(Translation3::from(way), turned)
}

fn candidate(tree: &ModelTree, model: &RobotModel, joint: usize) -> FingerJoint {
    let own = &model.joints[joint];
    let in_file = tree.joint(&own.name);
    FingerJoint {
        name: own.name.clone(),
        link: model.links[joint + 1].name.clone(),
        turns: own.kind == JointKind::Revolute,
        limits: in_file.map_or([own.lower, own.upper], |joint| [joint.lower, joint.upper]),
        follows: in_file.and_then(|joint| Some(joint.mimic.as_ref()?.leader.clone())),
        is_last: model.joints.iter().all(|other| other.parent != joint + 1),
        has_shapes: !model.links[joint + 1].solids.is_empty(),
    }
}
