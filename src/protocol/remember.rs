//! Keeps the results of a program's action for later actions: its percepts and the held object.
//! They come from the program's report or from the robot's own perception and touch, never from
//! ground truth.

use nalgebra::Isometry3;

use crate::message::{End, WirePose};
use actcheck_actions::{ActionCall, ExternalFault, Held, Operator, feels_in};
use actcheck_base::names;
use actcheck_data::{Perceived, PerceivedPlane, PerceivedThing, Pose};
use actcheck_world::Observation;

/// Designator of the object to grasp.
const TARGET: &str = "pickObject";

/// State of the hand when it closed on the object that it now feels.
#[derive(Debug, Clone, Default)]
pub struct Grasped(Option<RememberedGrasp>);

#[derive(Debug, Clone)]
struct RememberedGrasp {
    grasp: Isometry3<f64>,
    heading: f64,
    /// Number of percepts at that time; in later percepts the object is already in the hand.
    n_percepts: usize,
}

impl Grasped {
    /// Updates with an observation; must be called for every observation.
    pub fn feel(&mut self, robot: &Operator<'_>, measured: &Observation) {
        if !feels_in(measured, robot.grip_force_n()) {
            self.0 = None;
        } else if self.0.is_none() {
            self.0 = Some(RememberedGrasp::now(robot));
        }
    }
}

impl RememberedGrasp {
    fn now(robot: &Operator<'_>) -> Self {
        let grasp = robot.kinematics().grasp(&robot.observe().positions);
        Self {
            grasp,
            heading: Pose::from_isometry(&robot.base()).yaw(),
            n_percepts: robot.percepts.len(),
        }
    }
}

/// Stores the content of an action's `end` message and the grip felt by the robot.
///
/// # Errors
/// A pose of the message is invalid.
pub fn remember(
    call: &ActionCall,
    end: &End,
    grasped: Grasped,
    robot: &mut Operator<'_>,
) -> Result<(), ExternalFault> {
    if end.perceived.is_some() || end.plane.is_some() {
        let perceived = perceived(end)?;
        robot.remember(perceived);
    }
    let told = end
        .held
        .map(|held| Ok((upright(&held.pose)?, held.size_m)))
        .transpose()?;
    let Some(taken) = grasped
        .0
        .or_else(|| told.map(|_| RememberedGrasp::now(robot)))
    else {
        robot.hold(None);
        return Ok(());
    };
    // An object grasped by an earlier action is already known.
    if told.is_none() && robot.memory().held.is_some() {
        return Ok(());
    }
    let Some(id) = call.value(TARGET) else {
        return Ok(());
    };
    let before = told
        .or_else(|| seen_before(id, &taken, robot))
        .map(|(foot, size_m)| (foot, size_m, taken));
    let Some((foot, size_m, taken)) = before.or_else(|| seen_now(id, robot)) else {
        return Ok(());
    };
    let opening_m = robot.observe().gripper_opening_m;
    let grasp_from_foot = foot.inverse() * taken.grasp;
    let held = Held {
        id: id.to_owned(),
        size_m,
        foot,
        grasp_from_foot,
        heading: taken.heading,
        opening_m,
        wall_m: None,
    };
    robot.hold(Some(held));
    Ok(())
}

/// Pose of an object's foot, and its size.
type Seen = (Isometry3<f64>, [f64; 3]);

/// The last percept of an object before the hand closed: from this action, or from the pictures of
/// an earlier one.
fn seen_before(id: &str, taken: &RememberedGrasp, robot: &Operator<'_>) -> Option<Seen> {
    let percept = robot
        .percepts
        .iter()
        .take(taken.n_percepts)
        .rev()
        .find(|percept| percept.id == id);
    match percept {
        Some(percept) => Some((percept.pose.to_isometry(), percept.size_m)),
        None => robot
            .recall(id)
            .map(|known| (known.pose.to_isometry(), known.size_m)),
    }
}

/// The held object as the reference perception sees it now, and the current state of the hand.
fn seen_now(
    id: &str,
    robot: &mut Operator<'_>,
) -> Option<(Isometry3<f64>, [f64; 3], RememberedGrasp)> {
    let now = robot.see(id)?;
    Some((
        now.pose.to_isometry(),
        now.size_m,
        RememberedGrasp::now(robot),
    ))
}

fn perceived(end: &End) -> Result<Perceived, ExternalFault> {
    let plane = end.plane.map(|plane| {
        Ok(PerceivedPlane {
            pose: plane.pose.pose()?,
            size_m: plane.size_m,
        })
    });
    let things = end.perceived.iter().flatten().map(|thing| {
        let pose = upright(&thing.pose)?;
        let category = thing.category.as_deref().map(names::category);
        Ok(PerceivedThing {
            category,
            pose: Pose::from_isometry(&pose),
            size_m: thing.size_m,
        })
    });
    Ok(Perceived {
        plane: plane.transpose()?,
        things: things.collect::<Result<_, ExternalFault>>()?,
        look: None,
    })
}

/// Reduces a pose to position and yaw: objects are upright on their foot.
fn upright(pose: &WirePose) -> Result<Isometry3<f64>, ExternalFault> {
    let pose = pose.pose()?;
    Ok(Pose::upright(pose.position, pose.yaw()).to_isometry())
}
