//! Finds the roles of a robot's joints and links that its profile leaves out, from its kinematics
//! and from the names in its URDF.
//!
//! The gripper is measured: of all pairs of fingers and all likely grasp frames, the one that opens
//! and closes best is proposed. Postures come from inverse kinematics, and have no overlapping
//! links.

mod between;
mod beyond_body;
mod body;
mod cup;
mod effort;
mod fingers;
mod frames;
mod hands;
mod postures;
mod row;
mod seat;
mod short_arm;
mod stated;
mod thumb;
mod unknown_hand;
mod weights;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Isometry3;

use effort::Effort;
use fingers::ProposedHand;
use stated::NoHand;
pub use unknown_hand::{FingerJoint, UnknownHand};

use crate::description::RobotModel;
use crate::gripper::between_fingers;
use crate::layout::{Named, frame};
use crate::{GripperFault, RobotError};
use actcheck_data::RobotProfile;

/// A profile with all roles assigned, but perhaps those of the hand, and the basis of its guesses.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// The profile.
    pub profile: RobotProfile,
    /// The basis of guesses, by the profile's key: lower-case sentences without a full stop.
    pub notes: BTreeMap<&'static str, String>,
    /// Links of the robot that carry other hands.
    pub other_hands: Vec<String>,
    /// The end of the arm if no gripper was found there: the profile has no fingers and no grasp
    /// frame then.
    pub unknown_hand: Option<UnknownHand>,
}

/// A frame on a link, by its index: the pose of the grasp relative to the link.
type GraspFrame = (usize, Isometry3<f64>);

/// Openings narrower than this are measured between other parts than fingertips. Unit: metres.
const LEAST_OPENING_M: f64 = 0.02;
/// Most other hands whose arms are parked.
const MOST_OTHER_HANDS: usize = 4;

/// Proposes a profile for a robot without roles, whose meshes are convex. Of several hands, it
/// takes one with `hand` in the name of a link or joint of its arm. Without a gripper on an arm, the
/// roles of the hand are left open. Its work is limited in steps, so that the same robot gets the
/// same proposal on every machine.
///
/// # Errors
/// [`RobotError`] if the URDF can't be used, has no arm, or no hand with that name.
pub fn propose(bare: &RobotProfile, hand: Option<&str>) -> Result<Proposal, RobotError> {
    find(bare, true, hand)
}

/// Returns whether a profile leaves out roles that [`complete`] finds.
pub fn is_incomplete(profile: &RobotProfile) -> bool {
    let names = [
        &profile.grasp_link,
        &profile.camera_link,
        &profile.finger_links[0],
    ];
    let missing = names.iter().any(|name| name.is_empty()) || profile.arm_joints.is_empty();
    let no_hand = profile.suction.is_none() && profile.finger_joints.is_empty();
    missing || no_hand || profile.max_opening_m == 0.0 || profile.home.is_empty()
}

/// Finds the roles that a profile leaves out, on a model whose meshes are convex: arm, fingers,
/// grasp frame, opening, camera, home and postures. Without a base, the profile's robot is fixed.
///
/// # Errors
/// As [`propose`], and [`RobotError`] if no gripper is found.
pub fn complete(partial: &RobotProfile) -> Result<Proposal, RobotError> {
    find(partial, false, None)
}

/// Finds the roles that a profile leaves out; its base, mount and head too if `all`.
fn find(partial: &RobotProfile, all: bool, wanted: Option<&str>) -> Result<Proposal, RobotError> {
    let name = partial.urdf.name.to_string();
    let mut effort = Effort::whole();
    let found = thumb::find(partial, wanted, &mut effort);
    let (model, hand, unknown_hand) = match found {
        Ok((model, hand)) => (model, hand, None),
        Err(NoHand::Gripper(fault)) if all && leaves_a_gap(&fault) => {
            let (model, hand, unknown) =
                unknown_hand::find(partial, wanted, fault).map_err(|error| error.named(&name))?;
            (model, hand, Some(unknown))
        }
        Err(error) => return Err(error.named(&name)),
    };
    let mut proposal = assembled(partial, all, (&model, hand), &mut effort)?;
    if unknown_hand.is_some() {
        proposal.profile = unknown_hand::without_placeholder(proposal.profile, partial);
        proposal.unknown_hand = unknown_hand;
    }
    Ok(proposal)
}

/// Whether a profile can be proposed in spite of this fault, with a gap for the hand.
fn leaves_a_gap(fault: &GripperFault) -> bool {
    matches!(
        fault,
        GripperFault::NoNames
            | GripperFault::Stiff { .. }
            | GripperFault::NoShapes(_)
            | GripperFault::NoOpposition
            | GripperFault::CutShort
    )
}

/// The proposal with this hand.
fn assembled(
    partial: &RobotProfile,
    all: bool,
    (model, hand): (&RobotModel, ProposedHand),
    effort: &mut Effort,
) -> Result<Proposal, RobotError> {
    let name = partial.urdf.name.to_string();
    let mut notes = hand.notes;
    let mut profile = hand.profile;
    let body = body::find(model, hand.palm, &hand.others, &mut notes);
    let joint_names = |joints: &[usize]| {
        joints
            .iter()
            .map(|idx| model.joints[*idx].name.clone())
            .collect::<Vec<_>>()
    };
    if all {
        profile.head_joints = joint_names(&body.head);
        profile.mount_height_m = body.mount_height_m;
        let own_base = body
            .own_base
            .map(|joints| joints.map(|idx| model.joints[idx].name.clone()));
        profile.planar_base = body.drives && own_base.is_none();
        profile.base_joints = match profile.planar_base {
            true => Some(RobotProfile::PLANAR_JOINTS.map(str::to_owned)),
            false => own_base,
        };
    }
    if profile.arm_joints.is_empty() {
        profile.arm_joints = joint_names(&body.arm);
        profile.arm_joints.retain(|joint| {
            !profile
                .base_joints
                .iter()
                .flatten()
                .any(|of_base| of_base == joint)
        });
    }
    if profile.arm_joints.is_empty() {
        return Err(RobotError::Armless { name });
    }
    if profile.camera_link.is_empty() {
        (profile.camera_link, profile.camera_turned_rad) =
            (body.camera_link, body.camera_turned_rad);
    }
    let (mut model, grasp) = with_grasp(&profile)?;
    let fingers = profile
        .finger_links
        .clone()
        .map(|name| model.frame(&name).map_or(grasp.0, |(link, _)| link));
    let markers = if all && profile.suction.is_none() {
        between_fingers(&model, fingers, grasp)
    } else {
        Vec::new()
    };
    if !markers.is_empty() {
        let note = "their shapes are between the fingers, where objects are held".to_owned();
        notes.insert("no_collision_links", note);
        profile.no_collision_links.extend(markers);
        model = with_grasp(&profile)?.0;
    }
    let is_short = all
        && body.is_table_top
        && short_arm::put_on_surface(&mut profile, &model, grasp, body.lowest_m, &mut notes)?;
    if profile.home.is_empty() {
        (profile.home, profile.postures) = postures::find(&profile, &model, grasp, &mut notes)?;
    }
    if is_short {
        short_arm::measure_reach(&mut profile, &model, grasp, &mut notes)?;
    }
    if all {
        let others = parked(partial, &profile, &hand.others, &mut notes, effort);
        profile.parked.extend(others);
    }
    // Joints without a role are rigid from now on: a finger that no named joint moves may narrow
    // the opening.
    let narrower = Named::find(&profile, &RobotModel::read(&profile)?)?
        .layout
        .gripper
        .widest_m();
    if partial.max_opening_m == 0.0 && narrower > LEAST_OPENING_M {
        profile.max_opening_m = profile.max_opening_m.min(fingers::as_opening(narrower));
    }
    Ok(Proposal {
        profile,
        notes,
        other_hands: hand.others,
        unknown_hand: None,
    })
}

/// The joints of the other arms at their homes. Stretched out, as all joints are at 0 for some
/// robots, it is in the way.
fn parked(
    bare: &RobotProfile,
    own: &RobotProfile,
    others: &[String],
    notes: &mut BTreeMap<&'static str, String>,
    effort: &mut Effort,
) -> Vec<(String, f64)> {
    let own: Vec<&String> = own
        .base_joints
        .iter()
        .flatten()
        .chain(&own.arm_joints)
        .chain(&own.head_joints)
        .collect();
    let mut parked: Vec<(String, f64)> = Vec::new();
    let mut hands = Vec::new();
    for (place, other) in others.iter().enumerate().take(MOST_OTHER_HANDS) {
        let n_left = others.len().min(MOST_OTHER_HANDS) - place;
        let mut part = effort.part(n_left);
        let found = home_of(bare, other, &mut part);
        effort.join(&part);
        let Ok(found) = found else { continue };
        let known = parked.len();
        for (joint, position) in found.arm_joints.into_iter().zip(found.home) {
            if !own.contains(&&joint) && parked.iter().all(|(known, _)| *known != joint) {
                parked.push((joint, position));
            }
        }
        if parked.len() > known {
            hands.push(format!("`{other}`"));
        }
    }
    let note = match hands.as_slice() {
        [] => return parked,
        [hand] => format!("the arm of the hand {hand} at its own home"),
        several => format!(
            "the arms of the hands {} at their own homes",
            several.join(", ")
        ),
    };
    let thumb = notes.remove("parked_joints");
    notes.insert(
        "parked_joints",
        thumb
            .into_iter()
            .chain([note])
            .collect::<Vec<_>>()
            .join("; "),
    );
    parked
}

/// A profile for the hand at a link, without one for the other hands.
fn home_of(
    bare: &RobotProfile,
    palm: &str,
    effort: &mut Effort,
) -> Result<RobotProfile, RobotError> {
    let name = bare.urdf.name.to_string();
    let model = thumb::without_roles(bare).map_err(|error| error.named(&name))?;
    let hand =
        fingers::find(bare, &model, Some(palm), effort).map_err(|error| error.named(&name))?;
    let mut notes = BTreeMap::new();
    let body = body::find(&model, hand.palm, &hand.others, &mut notes);
    let arm_joints = body
        .arm
        .iter()
        .map(|idx| model.joints[*idx].name.clone())
        .collect();
    let planar_base = body.drives && body.own_base.is_none();
    let base_joints = planar_base.then(|| RobotProfile::PLANAR_JOINTS.map(str::to_owned));
    let mount_height_m = body.mount_height_m;
    let mut profile = RobotProfile {
        arm_joints,
        planar_base,
        base_joints,
        mount_height_m,
        ..hand.profile
    };
    (profile.camera_link, profile.camera_turned_rad) = (body.camera_link, body.camera_turned_rad);
    let (model, grasp) = with_grasp(&profile)?;
    (profile.home, profile.postures) = postures::find(&profile, &model, grasp, &mut notes)?;
    Ok(profile)
}

/// The model of a profile with its base, so that inverse kinematics moves it too, and the frame of
/// its grasp.
fn with_grasp(profile: &RobotProfile) -> Result<(Arc<RobotModel>, GraspFrame), RobotError> {
    let model = Arc::new(RobotModel::read(profile)?);
    let grasp = frame(
        &model,
        &profile.grasp_link,
        profile.grasp_offset_m,
        profile.grasp_turned_rad,
    )?;
    Ok((model, grasp))
}
