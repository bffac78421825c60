//! What a program's action leaves behind for the actions after it: what it perceived and what the hand holds, by its own word or
//! by what the robot saw and feels, and never by the truth.

use nalgebra::Isometry3;

use crate::actions::{ActionCall, Held, Operator, OutsideFault, Perceived, PerceivedPlane, PerceivedThing, feels_in};
use crate::base::Pose;
use crate::protocol::message::{End, WirePose};
use crate::world::Observation;

/// Designator of the thing that is taken.
const TARGET: &str = "pickObject";

/// How the hand was when it closed on what it now feels.
#[derive(Debug, Clone, Default)]
pub struct Grasped(Option<Taken>);

#[derive(Debug, Clone)]
struct Taken {
    grasp: Isometry3<f64>,
    heading: f64,
}

impl Grasped {
    /// To be told of every observation.
    pub fn feel(&mut self, robot: &Operator<'_>, measured: &Observation) {
        if !feels_in(measured, robot.grip_force_n()) {
            self.0 = None;
        } else if self.0.is_none() {
            self.0 = Some(Taken::now(robot));
        }
    }
}

impl Taken {
    fn now(robot: &Operator<'_>) -> Self {
        let grasp = robot.kinematics().grasp(&robot.observe().positions);
        Self { grasp, heading: Pose::from_isometry(&robot.base()).yaw() }
    }
}

/// Keeps what an action's end says, and what the robot feels.
///
/// # Errors
/// A pose of the message is none.
pub fn remember(call: &ActionCall, end: &End, grasped: Grasped, robot: &mut Operator<'_>) -> Result<(), OutsideFault> {
    if end.perceived.is_some() || end.plane.is_some() {
        let perceived = perceived(end)?;
        robot.remember(perceived);
    }
    let told = end.held.map(|held| Ok((upright(&held.pose)?, held.size_m))).transpose()?;
    let Some(taken) = grasped.0.or_else(|| told.map(|_| Taken::now(robot))) else {
        robot.hold(None);
        return Ok(());
    };
    // What was taken by an action before is known from then.
    if told.is_none() && robot.memory().held.is_some() {
        return Ok(());
    }
    let Some(id) = call.value(TARGET) else { return Ok(()) };
    let Some((foot, size_m)) = told.or_else(|| seen(id, robot)) else { return Ok(()) };
    let opening_m = robot.observe().gripper_opening_m;
    let grasp_from_foot = foot.inverse() * taken.grasp;
    let held = Held { id: id.to_owned(), size_m, foot, grasp_from_foot, heading: taken.heading, opening_m };
    robot.hold(Some(held));
    Ok(())
}

/// Where the robot last saw a thing: in this action, or in an earlier one's pictures. Otherwise it looks now.
fn seen(id: &str, robot: &mut Operator<'_>) -> Option<(Isometry3<f64>, [f64; 3])> {
    let before = robot.percepts.iter().rev().find(|percept| percept.id == id);
    if let Some(percept) = before {
        return Some((percept.pose.to_isometry(), percept.size_m));
    }
    if let Some(known) = robot.recall(id) {
        return Some((known.pose.to_isometry(), known.size_m));
    }
    let now = robot.see(id)?;
    Some((now.pose.to_isometry(), now.size_m))
}

fn perceived(end: &End) -> Result<Perceived, OutsideFault> {
    let plane = end.plane.map(|plane| Ok(PerceivedPlane { pose: plane.pose.pose()?, size_m: plane.size_m }));
    let things = end.perceived.iter().flatten().map(|thing| {
        let pose = upright(&thing.pose)?;
        Ok(PerceivedThing { category: thing.category.clone(), pose: Pose::from_isometry(&pose), size_m: thing.size_m })
    });
    Ok(Perceived { plane: plane.transpose()?, things: things.collect::<Result<_, OutsideFault>>()? })
}

/// A thing stands upright on its foot: of a pose, its place and heading count.
fn upright(pose: &WirePose) -> Result<Isometry3<f64>, OutsideFault> {
    let pose = pose.pose()?;
    Ok(Pose::upright(pose.position, pose.yaw()).to_isometry())
}
