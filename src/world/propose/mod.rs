//! Proposes the roles of a robot's joints and links, from its kinematics and from the names in its URDF.
//!
//! The gripper is measured: of all pairs of fingers and all likely grasp frames, the one that opens and closes best is
//! proposed. Postures come from inverse kinematics, and have no overlapping links.

mod body;
mod fingers;
mod frames;
mod postures;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::WorldError;
use crate::description::RobotModel;
use crate::layout::frame;
use actcheck_data::RobotProfile;

/// A profile with all roles assigned, and the basis of its guesses.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// The profile.
    pub profile: RobotProfile,
    /// The basis of guesses, by the profile's key: lower-case sentences without a full stop.
    pub notes: BTreeMap<&'static str, String>,
}

/// Proposes a profile for a robot without roles, whose meshes are convex.
///
/// # Errors
/// [`WorldError`] if the URDF can't be used, or no gripper is found.
pub fn propose(bare: &RobotProfile) -> Result<Proposal, WorldError> {
    let name = bare.urdf.name.to_string();
    let model = RobotModel::read(bare)?;
    let hand = fingers::find(bare, &model).map_err(|what| WorldError::Gripper { name: name.clone(), what })?;
    let mut notes = hand.notes;
    let mut profile = hand.profile;
    let body = body::find(&model, hand.palm, &mut notes);
    let joint_names = |joints: &[usize]| joints.iter().map(|idx| model.joints[*idx].name.clone()).collect::<Vec<_>>();
    profile.arm_joints = joint_names(&body.arm);
    profile.head_joints = joint_names(&body.head);
    profile.camera_link = body.camera_link;
    profile.camera_turned_rad = body.camera_turned_rad;
    profile.mount_height_m = body.mount_height_m;
    let own_base = body.own_base.map(|joints| joints.map(|idx| model.joints[idx].name.clone()));
    profile.planar_base = body.drives && own_base.is_none();
    profile.base_joints = match profile.planar_base {
        true => Some(["planar_x_joint", "planar_y_joint", "planar_heading_joint"].map(str::to_owned)),
        false => own_base,
    };
    // With the base, so that inverse kinematics moves it too.
    let model = Arc::new(RobotModel::read(&profile)?);
    let grasp = frame(&model, &profile.grasp_link, profile.grasp_offset_m, profile.grasp_turned_rad)?;
    let found = postures::find(&profile, &model, grasp, &mut notes)?;
    (profile.home, profile.postures) = found;
    Ok(Proposal { profile, notes })
}
