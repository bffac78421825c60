//! The pick skill: see (or remember what was perceived), drive, reach, close, lift, take away.

use crate::actions::operator::{Interrupt, Operator};
use crate::actions::{ActionCall, ActionReport, grasp, memory, plan};
use crate::world::Sighting;

/// Designator of the thing to pick.
const TARGET: &str = "pickObject";
/// A gap under this means that the fingers met: nothing is between them. Unit: metres. Three times the usual noise.
const EMPTY_M: f64 = 0.006;
/// Time for looking. Unit: seconds.
const LOOK_SECS: f64 = 0.5;
/// Shortest time of the last part of the way, about 6 cm/s. Unit: seconds.
const APPROACH_SECS: f64 = 2.5;
/// Shortest time of the lift. Unit: seconds.
const LIFT_SECS: f64 = 2.0;
/// Longest time that fingers get to close. Unit: seconds.
const CLOSE_SECS: f64 = 2.5;
/// Fingers that close slower than this have stalled. Unit: m/s.
const STALLED: f64 = 0.003;
/// Share of the grip force that stalled fingers have to feel.
const FELT_SHARE: f64 = 0.7;

/// Picks the designated thing up and reports whether it believes to have it.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn pick(call: &ActionCall, robot: &mut Operator<'_>) -> Result<ActionReport, Interrupt> {
    let Some(target) = call.value(TARGET) else {
        return Ok(failed("no object was named to be picked"));
    };
    robot.begin("perceive");
    robot.wait(LOOK_SECS)?;
    let (seen, others) = match find(target, robot) {
        Ok(found) => found,
        Err(reason) => return Ok(failed(reason)),
    };
    let grasps = grasp::grasps(&seen, robot.profile().max_opening_m);
    if grasps.is_empty() {
        return Ok(failed(format!("{target} is too wide for the gripper")));
    }
    let way = match plan::plan(robot, &grasps, &others) {
        Ok(way) => way,
        Err(reason) => return Ok(failed(format!("{target}: {reason}"))),
    };
    robot.begin("drive");
    robot.follow(&way.drive, 0.0)?;
    robot.begin("reach");
    robot.set_opening(robot.profile().max_opening_m);
    robot.follow(&[way.reach], 0.0)?;
    robot.begin("approach");
    robot.follow(&way.near, 0.0)?;
    robot.follow(&way.approach, APPROACH_SECS)?;
    robot.begin("close");
    let held = close(robot)?;
    robot.begin("lift");
    robot.follow(&way.lift, LIFT_SECS)?;
    robot.begin("retract");
    robot.follow(&way.retreat, 0.0)?;
    robot.wait(LOOK_SECS)?;
    Ok(report(robot, target, held))
}

/// The target and everything else: as an earlier action of the run perceived it, otherwise by the abstract detector.
fn find(target: &str, robot: &mut Operator<'_>) -> Result<(Sighting, Vec<Sighting>), String> {
    if let Some(perceived) = &robot.memory().perceived {
        let kind = robot.kind_of(target).ok_or_else(|| format!("{target} is of no known kind"))?;
        let found = memory::recall(perceived, target, &kind, &robot.base().translation.vector)?;
        robot.take_for(&found.0);
        return Ok(found);
    }
    let seen = robot.see(target).ok_or_else(|| format!("{target} was not seen"))?;
    let others = robot.see_others(target);
    Ok((seen, others))
}

/// Closes the fingers until they stall. True if they stalled on something.
fn close(robot: &mut Operator<'_>) -> Result<bool, Interrupt> {
    robot.set_opening(0.0);
    let until = robot.elapsed_secs() + CLOSE_SECS;
    let mut still_ticks = 0;
    while robot.elapsed_secs() < until && still_ticks < 10 {
        robot.wait(1e-3)?;
        let speed = robot.layout().fingers.map(|idx| robot.observe().velocities[idx].abs());
        still_ticks = if speed[0].max(speed[1]) < STALLED && feels(robot) { still_ticks + 1 } else { 0 };
    }
    Ok(feels(robot))
}

/// Whether both fingers push with about the force that they were told.
fn feels(robot: &Operator<'_>) -> bool {
    let enough = FELT_SHARE * robot.profile().grip_force_n;
    robot.observe().finger_efforts_n.iter().all(|effort| *effort > enough)
}

fn report(robot: &mut Operator<'_>, target: &str, stalled: bool) -> ActionReport {
    let gap = robot.feel_opening();
    if !stalled {
        return failed(format!("the fingers did not close on {target}"));
    }
    if gap < EMPTY_M {
        return failed(format!("the hand is empty: its fingers are {:.1} mm apart", gap * 1e3));
    }
    if !feels(robot) {
        return failed(format!("{target} slipped out of the hand"));
    }
    let message = format!("holds {target}, the fingers are {:.1} cm apart", gap * 100.0);
    ActionReport { succeeded: true, message }
}

fn failed(message: impl Into<String>) -> ActionReport {
    ActionReport { succeeded: false, message: message.into() }
}
