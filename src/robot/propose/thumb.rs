//! Thumbs that turn across the palm: a hand may open wider with its thumb parked opposite the
//! fingers.

use std::collections::BTreeSet;

use super::body::chain;
use super::effort::Effort;
use super::fingers::{self, ProposedHand};
use super::hands::groups;
use super::stated::NoHand;
use crate::description::{JointKind, RobotModel};
use actcheck_data::{RobotCore, StatedHand, StatedRobot};

/// Share of the way from 0 to a limit at which a thumb is parked: at the limit itself it may touch
/// the wrist.
const SHARE: f64 = 0.9;
/// A position nearer to 0 than this does not turn a thumb across the palm. Unit: radians.
const LEAST_TURN_RAD: f64 = 0.8;
/// Axes with a smaller angle between them than this are parallel, as those of a finger's joints
/// are. Unit: radians.
const PARALLEL_RAD: f64 = 0.5;
/// Most joints of thumbs that are tried.
const MOST_JOINTS: usize = 4;
/// A parked thumb must rate this many times higher than one at 0: it is one more joint that the
/// robot must hold.
const CLEARLY: f64 = 1.1;

/// Finds the best hand of a robot on its model without roles, with the thumb at 0 or turned.
/// Returns that model too, in which a turned thumb is rigid.
///
/// # Errors
/// [`NoHand`] as [`fingers::find`], with the thumb at 0, if there is none with a turned thumb
/// either.
pub(super) fn find(
    partial: &StatedRobot,
    wanted: Option<&str>,
    effort: &mut Effort,
) -> Result<(RobotModel, ProposedHand), NoHand> {
    let model = without_roles(partial)?;
    let mut part = effort.part(2);
    let at_zero = fingers::find(&partial.hand, &model, wanted, &mut part);
    effort.join(&part);
    if !partial.hand.is_unknown() {
        return at_zero.map(|hand| (model, hand));
    }
    let palms: Vec<usize> = match &at_zero {
        Ok(hand) => vec![hand.palm],
        Err(_) => groups(&model).into_keys().collect(),
    };
    let thumbs: Vec<(String, f64)> = palms
        .into_iter()
        .flat_map(|palm| turned(&model, palm))
        .collect();
    let mut best = at_zero.map(|hand| (model, hand));
    let n_thumbs = thumbs.len();
    for (place, (joint, position)) in thumbs.into_iter().enumerate() {
        let thumb = (joint.clone(), position);
        let other_model = with_rigid(&partial.core, vec![thumb.clone()])?;
        let mut part = effort.part(n_thumbs - place);
        let other = fingers::find(&partial.hand, &other_model, wanted, &mut part);
        effort.join(&part);
        let Ok(mut other) = other else { continue };
        if best
            .as_ref()
            .is_ok_and(|(_, known)| other.score < CLEARLY * known.score)
        {
            continue;
        }
        other.notes.insert(
            "parked_joints",
            format!("`{joint}` turns the thumb opposite the fingers"),
        );
        other.thumb = Some(thumb);
        best = Ok((other_model, other));
    }
    best
}

/// The model in which all joints move but those that the profile parks in its fingers.
pub(super) fn without_roles(partial: &StatedRobot) -> Result<RobotModel, NoHand> {
    let StatedRobot { core, hand, .. } = partial;
    let model = with_rigid(core, Vec::new())?;
    let (links, joints) = match hand {
        StatedHand::Cup { grasp, .. } => (vec![&grasp.link], Vec::new()),
        StatedHand::Fingers(fingers) => (
            fingers.finger_links.iter().flatten().collect(),
            fingers.finger_joints.iter().flatten().collect(),
        ),
    };
    let links = links
        .into_iter()
        .filter_map(|name| Some(model.frame(name).ok()?.0));
    let joints = joints
        .into_iter()
        .filter_map(|name| Some(model.joint(name).ok()? + 1));
    let in_fingers: BTreeSet<usize> = links
        .chain(joints)
        .flat_map(|link| chain(&model, link))
        .collect();
    let is_in_finger = |name: &str| {
        model
            .joint(name)
            .is_ok_and(|joint| in_fingers.contains(&joint))
    };
    let parked: Vec<(String, f64)> = core
        .parked
        .iter()
        .filter(|(name, _)| is_in_finger(name))
        .cloned()
        .collect();
    if parked.is_empty() {
        Ok(model)
    } else {
        with_rigid(core, parked)
    }
}

/// The model in which all joints move but these, which are rigid at their positions.
fn with_rigid(core: &RobotCore, parked: Vec<(String, f64)>) -> Result<RobotModel, NoHand> {
    Ok(RobotModel::without_roles(&RobotCore {
        planar_base: false,
        parked,
        ..core.clone()
    })?)
}

/// Joints of a hand that turn another one of the same finger about an axis that is not parallel to
/// its own, each with a position near one of its limits.
fn turned(model: &RobotModel, palm: usize) -> Vec<(String, f64)> {
    let n_inner = chain(model, palm).len();
    let beyond = |joint: &usize| {
        let path = chain(model, *joint + 1);
        path.len() > n_inner
            && (n_inner == 0 || path.get(n_inner - 1) == palm.checked_sub(1).as_ref())
    };
    let carries_across = |joint: usize| {
        let own = &model.joints[joint];
        model.joints.iter().any(|next| {
            let axis = next.origin.rotation * next.axis.into_inner();
            let between = axis.angle(&own.axis);
            next.parent == joint + 1 && between.min(std::f64::consts::PI - between) > PARALLEL_RAD
        })
    };
    let joints = (0..model.joints.len()).filter(beyond);
    let turning = joints.filter(|joint| {
        let own = &model.joints[*joint];
        own.kind == JointKind::Revolute && own.mimic.is_none() && carries_across(*joint)
    });
    let limits = turning.take(MOST_JOINTS).flat_map(|joint| {
        let own = &model.joints[joint];
        [own.lower, own.upper].map(|limit| (own.name.clone(), rounded(SHARE * limit)))
    });
    limits
        .filter(|(_, position)| position.is_finite() && position.abs() > LEAST_TURN_RAD)
        .collect()
}

fn rounded(position: f64) -> f64 {
    (position * 1e3).round() / 1e3
}
