//! Plans of the reference skills without moving the robot: for checks before a campaign.
//!
//! Never: moves the robot.

use nalgebra::{Point3, Vector3};

use crate::cut::Cut;
use crate::grasp::TIGHT_ROOM_M;
use crate::memory::Memory;
use crate::operator::Operator;
use crate::perceive::towards;
use crate::pick::planned;
use crate::pick_fault::PickFault;
use crate::rim;
use actcheck_data::{Choices, Rim};
use actcheck_world::{GRAVITY, World};

/// Effects of the load smaller than this don't count: the joint carries nothing of it. Unit:
/// metres, or 1.
const LEVER_M: f64 = 1e-3;

/// A planned pick.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeseenPick {
    /// Mass that the weakest joint of the arm can hold in the hand after lifting. Unit: kilograms.
    pub payload_kg: f64,
    /// Name of that joint.
    pub weakest: String,
}

/// A point as the camera sees it when the head is turned towards it.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeseenView {
    /// Height of the camera above the point. Unit: metres.
    pub above_m: f64,
    /// Distance of the point from the camera. Unit: metres.
    pub range_m: f64,
    /// Angles between the point and the optical axis, across and up. Unit: radians.
    pub off_rad: [f64; 2],
}

/// Least width that the gripper needs for an object of this width. Unit: metres.
pub fn needed_opening_m(width_m: f64) -> f64 {
    width_m + TIGHT_ROOM_M
}

/// Whether a gripper that opens this wide takes a vessel at its rim. Unit: metres.
pub fn takes_rim(rim: &Rim, max_opening_m: f64) -> bool {
    rim::opening_m(rim, max_opening_m).is_some()
}

/// Plans a pick of an object with the abstract detector, as the reference skill does at the start
/// of a run.
///
/// # Errors
/// The reason why the skill would fail.
pub fn foresee_pick(
    target: &str,
    world: &mut World,
    choices: &mut Choices,
) -> Result<ForeseenPick, PickFault> {
    world.localise(choices);
    let mut memory = Memory::default();
    let mut robot = Operator::new(
        world,
        choices,
        &mut memory,
        f64::INFINITY,
        (Cut::Never, None),
    );
    let seen = robot
        .see(target)
        .ok_or_else(|| PickFault::NotSeen(target.to_owned()))?;
    let others = robot.see_others(target);
    let plan = planned(&seen, &others, &mut robot)?;
    let posture = plan
        .lift
        .last()
        .map_or_else(|| robot.commanded().to_vec(), Clone::clone);
    Ok(payload(&robot, &posture))
}

/// The mass that the arm can hold in the hand in a posture.
fn payload(robot: &Operator<'_>, posture: &[f64]) -> ForeseenPick {
    let kinematics = robot.kinematics();
    let own = kinematics.holding_efforts(posture);
    let (_, jacobian) = kinematics.grasp_jacobian(posture);
    let mut found = ForeseenPick {
        payload_kg: f64::INFINITY,
        weakest: String::new(),
    };
    for idx in &robot.layout().arm {
        let joint = &kinematics.joints()[*idx];
        let lever_m = jacobian[*idx].z;
        if lever_m.abs() < LEVER_M {
            continue;
        }
        // The load pulls the joint in the direction of its lever.
        let spare = joint.effort - own[*idx] * lever_m.signum();
        let payload_kg = (spare / (lever_m.abs() * GRAVITY)).max(0.0);
        if payload_kg < found.payload_kg {
            found = ForeseenPick {
                payload_kg,
                weakest: joint.name.clone(),
            };
        }
    }
    found
}

/// Turns the head towards a point, in thought. Frame: world.
pub fn foresee_view(world: &World, point_m: [f64; 3]) -> ForeseenView {
    let (kinematics, point) = (world.kinematics(), Point3::from(point_m));
    let turned = towards(
        kinematics,
        world.layout(),
        &world.observe().positions,
        &point,
    );
    let camera = kinematics.camera(&turned);
    let seen = camera.inverse() * point;
    let off_rad = [libm::atan2(seen.y, seen.x), libm::atan2(seen.z, seen.x)];
    let above: Vector3<f64> = camera.translation.vector - point.coords;
    ForeseenView {
        above_m: above.z,
        range_m: above.norm(),
        off_rad,
    }
}
