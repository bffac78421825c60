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
use actcheck_data::{
    Hand, LinkFrame, RobotCore, RobotProfile, RobotRoles, StatedHand, StatedRobot,
};

/// The basis of guesses, by the profile's key: lower-case sentences without a full stop.
pub type Notes = BTreeMap<&'static str, String>;

/// A robot with all roles assigned, but perhaps those of the hand, and the basis of its guesses.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Its links and joints, and its place.
    pub core: RobotCore,
    /// Joints that position the hand.
    pub arm_joints: Vec<String>,
    /// Its gripper, or the end of the arm if no gripper was found there.
    pub hand: Result<Hand, UnknownHand>,
    /// The depth camera.
    pub camera: LinkFrame,
    /// Arm posture for driving.
    pub home: Vec<f64>,
    /// Seeds of inverse kinematics.
    pub postures: Vec<Vec<f64>>,
    /// The basis of its guesses.
    pub notes: Notes,
    /// Links of the robot that carry other hands.
    pub other_hands: Vec<String>,
}

/// A complete profile.
#[derive(Debug, Clone, PartialEq)]
pub struct Completed {
    /// The profile.
    pub profile: RobotProfile,
    /// The defaults and measurements in it, which the robot's own profile does not state.
    pub notes: Notes,
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
pub fn propose(core: RobotCore, hand: Option<&str>) -> Result<Proposal, RobotError> {
    let bare = StatedRobot::bare(core);
    let name = bare.core.urdf.name.to_string();
    let mut effort = Effort::whole();
    let (model, found, unknown) = match thumb::find(&bare, hand, &mut effort) {
        Ok((model, found)) => (model, found, None),
        Err(NoHand::Gripper(fault)) if leaves_a_gap(&fault) => {
            let (model, found, unknown) =
                unknown_hand::find(&bare, hand, fault).map_err(|error| error.named(&name))?;
            (model, found, Some(unknown))
        }
        Err(error) => return Err(error.named(&name)),
    };
    let other_hands = found.others.clone();
    let Completed { profile, notes } = assembled(&bare, true, (&model, found), &mut effort)?;
    Ok(Proposal {
        core: profile.core,
        arm_joints: profile.arm_joints,
        hand: unknown.map_or(Ok(profile.hand), Err),
        camera: profile.camera,
        home: profile.home,
        postures: profile.postures,
        notes,
        other_hands,
    })
}

/// Returns the complete profile of a robot whose meshes are convex. The roles that its own profile
/// leaves out are found on the model: arm, fingers, grasp frame, opening, camera, home and
/// postures. Without a base, the robot is fixed.
///
/// # Errors
/// [`RobotError`] if the URDF can't be used, has no arm, or no gripper is found.
pub fn complete(stated: &StatedRobot) -> Result<Completed, RobotError> {
    let mut completed = match stated.complete() {
        Ok(profile) => Completed {
            profile,
            notes: Notes::new(),
        },
        Err(_) => {
            let mut effort = Effort::whole();
            let (model, hand) = thumb::find(stated, None, &mut effort)
                .map_err(|error| error.named(&stated.core.urdf.name))?;
            assembled(stated, false, (&model, hand), &mut effort)?
        }
    };
    if let StatedHand::Fingers(fingers) = &stated.hand {
        let defaults = [
            (
                "finger_friction",
                fingers.finger_friction,
                "that of rubber pads",
            ),
            (
                "grip_force_n",
                fingers.grip_force_n,
                "a usual setting of grippers",
            ),
        ];
        for (key, _, note) in defaults.iter().filter(|(_, stated, _)| stated.is_none()) {
            completed.notes.insert(key, (*note).to_owned());
        }
    }
    Ok(completed)
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

/// A robot whose postures are not known yet.
struct Draft {
    core: RobotCore,
    arm_joints: Vec<String>,
    hand: Hand,
    camera: LinkFrame,
}

impl Draft {
    fn roles(&self) -> RobotRoles<'_> {
        RobotRoles {
            core: &self.core,
            arm_joints: &self.arm_joints,
            hand: &self.hand,
            camera: &self.camera,
        }
    }

    /// The model with its base, so that inverse kinematics moves it too, and the frame of its
    /// grasp.
    fn with_grasp(&self) -> Result<(Arc<RobotModel>, GraspFrame), RobotError> {
        let model = Arc::new(RobotModel::read(self.roles())?);
        let grasp = frame(&model, &self.hand.grasp)?;
        Ok((model, grasp))
    }

    fn with_postures(self, home: Vec<f64>, postures: Vec<Vec<f64>>) -> RobotProfile {
        RobotProfile {
            core: self.core,
            arm_joints: self.arm_joints,
            hand: self.hand,
            camera: self.camera,
            home,
            postures,
        }
    }
}

/// The complete profile with this hand; its base, mount and head are found too if `all`.
fn assembled(
    partial: &StatedRobot,
    all: bool,
    (model, found): (&RobotModel, ProposedHand),
    effort: &mut Effort,
) -> Result<Completed, RobotError> {
    let ProposedHand {
        hand,
        palm,
        mut notes,
        others,
        thumb,
        ..
    } = found;
    let mut core = partial.core.clone();
    core.parked.extend(thumb);
    let mut of_body = Notes::new();
    let body = body::find(model, palm, &others, &mut of_body);
    of_body.retain(|key, _| match *key {
        "arm_joints" => partial.arm_joints.is_none(),
        "camera_link" => partial.camera.is_none(),
        _ => all,
    });
    notes.extend(of_body);
    let joint_names = |joints: &[usize]| {
        joints
            .iter()
            .map(|idx| model.joints[*idx].name.clone())
            .collect::<Vec<_>>()
    };
    if all {
        core.head_joints = joint_names(&body.head);
        core.mount_height_m = body.mount_height_m;
        let own_base = body
            .own_base
            .map(|joints| joints.map(|idx| model.joints[idx].name.clone()));
        core.planar_base = body.drives && own_base.is_none();
        core.base_joints = match core.planar_base {
            true => Some(RobotCore::PLANAR_JOINTS.map(str::to_owned)),
            false => own_base,
        };
    }
    let is_of_base = |joint: &String| core.base_joints.iter().flatten().any(|own| own == joint);
    let arm_joints = partial.arm_joints.clone().unwrap_or_else(|| {
        let mut found = joint_names(&body.arm);
        found.retain(|joint| !is_of_base(joint));
        found
    });
    if arm_joints.is_empty() {
        let name = core.urdf.name.to_string();
        return Err(RobotError::Armless { name });
    }
    let camera = partial.camera.clone().unwrap_or(body.camera);
    let mut draft = Draft {
        core,
        arm_joints,
        hand,
        camera,
    };
    let (mut model, grasp) = draft.with_grasp()?;
    let fingers = draft
        .hand
        .finger_links
        .clone()
        .map(|name| model.frame(&name).map_or(grasp.0, |(link, _)| link));
    let markers = if all && draft.hand.suction.is_none() {
        between_fingers(&model, fingers, grasp)
    } else {
        Vec::new()
    };
    if !markers.is_empty() {
        let note = "their shapes are between the fingers, where objects are held".to_owned();
        notes.insert("no_collision_links", note);
        draft.core.no_collision_links.extend(markers);
        model = draft.with_grasp()?.0;
    }
    let on_surface = if all && body.is_table_top {
        short_arm::on_surface(draft.roles(), &model, grasp, body.lowest_m, &mut notes)?
    } else {
        None
    };
    if let Some(place) = &on_surface {
        draft.core.on_surface = true;
        draft.core.mount_height_m = place.height_m;
        draft.core.mount_turned_rad = place.turned_rad;
    }
    let (home, postures) = match &partial.home {
        Some(home) => (home.clone(), partial.postures.clone()),
        None => postures::find(draft.roles(), &model, grasp, &mut notes)?,
    };
    if on_surface.is_some() {
        draft.core.reach_m =
            short_arm::reach_m(draft.roles(), &postures, &model, grasp, &mut notes)?;
    }
    if all {
        let parked = parked(partial, draft.roles(), &others, &mut notes, effort);
        draft.core.parked.extend(parked);
    }
    // Joints without a role are rigid from now on: a finger that no named joint moves may narrow
    // the opening.
    let narrower = Named::find(draft.roles(), &RobotModel::read(draft.roles())?)?
        .layout
        .gripper
        .widest_m();
    if partial.hand.lacks_opening() && narrower > LEAST_OPENING_M {
        let opening_m = &mut draft.hand.max_opening_m;
        *opening_m = opening_m.min(fingers::as_opening(narrower));
    }
    let profile = draft.with_postures(home, postures);
    Ok(Completed { profile, notes })
}

/// The joints of the other arms at their homes. Stretched out, as all joints are at 0 for some
/// robots, it is in the way.
fn parked(
    bare: &StatedRobot,
    own: RobotRoles<'_>,
    others: &[String],
    notes: &mut Notes,
    effort: &mut Effort,
) -> Vec<(String, f64)> {
    let own: Vec<&String> = own
        .core
        .base_joints
        .iter()
        .flatten()
        .chain(own.arm_joints)
        .chain(&own.core.head_joints)
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
    bare: &StatedRobot,
    palm: &str,
    effort: &mut Effort,
) -> Result<RobotProfile, RobotError> {
    let name = &bare.core.urdf.name;
    let model = thumb::without_roles(bare).map_err(|error| error.named(name))?;
    let found =
        fingers::find(&bare.hand, &model, Some(palm), effort).map_err(|error| error.named(name))?;
    let mut notes = Notes::new();
    let body = body::find(&model, found.palm, &found.others, &mut notes);
    let arm = body.arm.iter();
    let planar_base = body.drives && body.own_base.is_none();
    let draft = Draft {
        core: RobotCore {
            planar_base,
            base_joints: planar_base.then(|| RobotCore::PLANAR_JOINTS.map(str::to_owned)),
            mount_height_m: body.mount_height_m,
            ..bare.core.clone()
        },
        arm_joints: arm.map(|idx| model.joints[*idx].name.clone()).collect(),
        hand: found.hand,
        camera: body.camera,
    };
    let (model, grasp) = draft.with_grasp()?;
    let (home, postures) = postures::find(draft.roles(), &model, grasp, &mut notes)?;
    Ok(draft.with_postures(home, postures))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Files;
    use actcheck_data::{FINGER_FRICTION, GRIP_FORCE_N, StatedFingers};
    use std::path::Path;

    fn arm() -> StatedRobot {
        let path = Path::new("models/robots/fixed_arm.toml");
        actcheck_config::robot::read(&Files::Shipped, path).expect("the shipped robot is valid")
    }

    fn fingers(robot: &mut StatedRobot) -> &mut StatedFingers {
        match &mut robot.hand {
            StatedHand::Fingers(fingers) => fingers,
            StatedHand::Cup { .. } => panic!("the shipped robot has fingers"),
        }
    }

    fn completed(robot: &StatedRobot) -> Completed {
        complete(robot).unwrap_or_else(|error| panic!("{error}"))
    }

    fn named(completed: &Completed) -> Vec<&'static str> {
        completed.notes.keys().copied().collect()
    }

    #[test]
    fn nothing_is_found_for_a_profile_that_states_all_roles() {
        let mut robot = arm();
        let own = fingers(&mut robot);
        (own.finger_friction, own.grip_force_n) = (Some(0.7), Some(20.0));
        let completed = completed(&robot);
        assert_eq!(named(&completed), Vec::<&str>::new());
        assert_eq!(Ok(completed.profile), robot.complete());
    }

    #[test]
    fn defaults_are_named() {
        let mut robot = arm();
        let own = fingers(&mut robot);
        (own.finger_friction, own.grip_force_n) = (None, None);
        let completed = completed(&robot);
        assert_eq!(named(&completed), ["finger_friction", "grip_force_n"]);
        let hand = completed.profile.hand;
        assert_eq!(
            (hand.finger_friction, hand.grip_force_n),
            (FINGER_FRICTION, GRIP_FORCE_N)
        );
    }

    /// Only the roles that are left out are found and named; the others stay as they are.
    #[test]
    fn measurements_are_named() {
        let mut robot = arm();
        let own = fingers(&mut robot);
        (own.finger_friction, own.grip_force_n) = (Some(0.7), Some(20.0));
        let whole = robot.complete().expect("it states all roles");
        robot.camera = None;
        let found = completed(&robot);
        assert_eq!(named(&found), ["camera_link"]);
        assert_eq!(found.profile.arm_joints, whole.arm_joints);
        assert_eq!(
            (found.profile.hand, found.profile.home),
            (whole.hand, whole.home)
        );
        robot.home = None;
        let found = named(&completed(&robot));
        assert_eq!(found, ["camera_link", "home", "postures"]);
        robot.arm_joints = None;
        let found = named(&completed(&robot));
        assert_eq!(found, ["arm_joints", "camera_link", "home", "postures"]);
    }
}
