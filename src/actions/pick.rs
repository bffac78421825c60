//! The pick skill: look (or recall an earlier percept), drive, reach, close, lift, retreat.

use crate::grasp::Approach;
use crate::grip::{close, feels};
use crate::memory::Held;
use crate::operator::{Interrupt, Operator};
use crate::perceive::look_again;
use crate::pick_fault::PickFault;
use crate::plan::{self, Plan, PlanRequest};
use crate::{ActionCall, cup, grasp, memory, rim};
use actcheck_data::{ActionReport, Pose, Rim};
use actcheck_world::Sighting;

/// Designator of the object to pick.
const TARGET: &str = "pickObject";
/// Duration of a look. Unit: seconds.
const LOOK_SECS: f64 = 0.5;
/// Shortest duration of the last part of the approach, at about 6 cm/s. Unit: seconds.
const APPROACH_SECS: f64 = 2.5;
/// A vessel whose perceived height differs from its kind's by more lies. Unit: metres.
const UPRIGHT_M: f64 = 0.02;
/// Shortest duration of the lift. Unit: seconds.
const LIFT_SECS: f64 = 2.0;

/// Picks up the designated object and reports whether the robot believes it holds it.
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
        Ok((seen, others)) => (
            Sighting {
                angular: grasp::is_angular(&seen, robot),
                ..seen
            },
            others,
        ),
        Err(fault) => return Ok(failed(fault.to_string())),
    };
    let way = match planned(&seen, &others, robot) {
        Ok(way) => way,
        Err(fault) => return Ok(failed(fault.to_string())),
    };
    robot.begin("drive");
    robot.follow(&way.drive, 0.0)?;
    robot.begin("reach");
    let (widest_m, rim) = (grasp::opening_before_m(&seen, robot), rim_of(&seen, robot));
    robot.set_opening(
        rim.and_then(|rim| rim::opening_m(&rim, widest_m))
            .unwrap_or(widest_m),
    );
    robot.follow(&way.reach, 0.0)?;
    robot.begin("approach");
    robot.follow(&way.near, 0.0)?;
    let (way, seen) = put_right(way, seen, robot)?;
    match robot.profile().hand.suction {
        Some(suction) => cup::approach(&way.approach, APPROACH_SECS, &suction, robot)?,
        None => robot.follow(&way.approach, APPROACH_SECS)?,
    }
    robot.begin("close");
    robot.hold(None);
    let held = close(robot)?;
    if held {
        remember(robot, &seen, rim.map(|rim| rim.wall_m));
    }
    robot.begin("lift");
    robot.follow(&way.lift, LIFT_SECS)?;
    robot.begin("retract");
    robot.follow(&way.retreat, 0.0)?;
    robot.wait(LOOK_SECS)?;
    let report = report(
        robot,
        target,
        held,
        memory::least_gap_m(rim.map(|rim| rim.wall_m)),
    );
    // The settled object is as wide as the gap between the fingers.
    let opening_m = robot.observe().gripper_opening_m;
    let held = robot.memory().held.clone().filter(|_| report.succeeded);
    robot.hold(held.map(|held| Held { opening_m, ..held }));
    Ok(report)
}

/// Plans how to pick an object among others.
///
/// # Errors
/// [`PickFault`] if it can't be picked.
pub(super) fn planned(
    seen: &Sighting,
    others: &[Sighting],
    robot: &mut Operator<'_>,
) -> Result<Plan, PickFault> {
    let no_plan = |why| PickFault::NoPlan {
        id: seen.id.clone(),
        why,
    };
    if let Some(suction) = robot.profile().hand.suction {
        let all = cup::grasps(seen, &suction)?;
        let (tops, sides): (Vec<_>, Vec<_>) = all
            .iter()
            .cloned()
            .partition(|grasp| grasp.approach == Approach::Top);
        let grasps = if tops.is_empty() { sides } else { tops };
        let wanted = PlanRequest {
            grasps: &grasps,
            all: &all,
            taken: Some(seen),
        };
        return plan::plan(robot, wanted, others).map_err(no_plan);
    }
    let max_opening_m = grasp::opening_before_m(seen, robot);
    let (grasps, all) = (
        grasp::grasps(seen, max_opening_m),
        grasp::all_grasps(seen, max_opening_m),
    );
    let (grasps, all) = (
        grasp::centred(grasps, seen, robot),
        grasp::centred(all, seen, robot),
    );
    let (grasps, all) = match rim_of(seen, robot) {
        Some(rim) => {
            let at_rim = rim::grasps(seen, &rim, max_opening_m);
            (at_rim.clone(), at_rim)
        }
        None => (grasps, all),
    };
    if grasps.is_empty() {
        return Err(PickFault::TooWide(seen.id.clone()));
    }
    let wanted = PlanRequest {
        grasps: &grasps,
        all: &all,
        taken: Some(seen),
    };
    plan::plan(robot, wanted, others).map_err(no_plan)
}

/// The rim of an upright vessel that is too wide for the hand, as the robot knows its kind.
fn rim_of(seen: &Sighting, robot: &Operator<'_>) -> Option<Rim> {
    let is_too_wide = grasp::is_tight(seen, robot.profile().hand.max_opening_m);
    let name = robot
        .kind_of(&seen.id)
        .filter(|_| is_too_wide && !robot.has_cup())?
        .name;
    let rim = robot
        .known_kinds()
        .iter()
        .find(|kind| kind.name == name)?
        .rim;
    rim.filter(|rim| (seen.size_m[2] - rim.top_m).abs() < UPRIGHT_M)
}

/// The target and all other objects: as perceived by an earlier action of the run, otherwise from
/// the abstract detector.
fn find(target: &str, robot: &mut Operator<'_>) -> Result<(Sighting, Vec<Sighting>), PickFault> {
    if let Some(perceived) = &robot.memory().perceived {
        let kind = robot
            .kind_of(target)
            .ok_or_else(|| PickFault::UnknownKind(target.to_owned()))?;
        let (seen, mut others) =
            memory::recall(perceived, target, &kind, &robot.base().translation.vector)?;
        others.extend(memory::elsewhere(robot.known_furniture(), perceived));
        others.extend(memory::obstacles(&robot.memory().floor));
        robot.record_percept(&seen);
        return Ok((seen, others));
    }
    let seen = robot
        .see(target)
        .ok_or_else(|| PickFault::NotSeen(target.to_owned()))?;
    let others = robot.see_others(target);
    Ok((seen, others))
}

/// Looks again with the hand in front of the object and corrects the rest of the plan by the drift
/// of the base since the first look. Only objects seen in pictures can be looked at again; the
/// abstract detector would only draw a new error.
fn put_right(
    mut way: Plan,
    seen: Sighting,
    robot: &mut Operator<'_>,
) -> Result<(Plan, Sighting), Interrupt> {
    let plane = robot
        .memory()
        .perceived
        .as_ref()
        .and_then(|perceived| perceived.plane);
    let (Some(plane), Some(kind), Some([x, y, _])) =
        (plane, robot.kind_of(&seen.id), robot.layout().base)
    else {
        return Ok((way, seen));
    };
    robot.begin("look again");
    let Some(again) = look_again(&seen, &kind, &plane, robot)? else {
        return Ok((way, seen));
    };
    let [dx, dy] = [0, 1].map(|axis| again.pose.position[axis] - seen.pose.position[axis]);
    let Plan {
        near,
        approach,
        lift,
        retreat,
        ..
    } = &mut way;
    for posture in near.iter_mut().chain(approach).chain(lift).chain(retreat) {
        posture[x] += dx;
        posture[y] += dy;
    }
    robot.record_percept(&again);
    robot.begin("approach");
    let last: Vec<Vec<f64>> = way.near.last().cloned().into_iter().collect();
    robot.follow(&last, 0.0)?;
    Ok((way, again))
}

/// Keeps the grasped object in memory for later actions.
fn remember(robot: &mut Operator<'_>, seen: &Sighting, wall_m: Option<f64>) {
    let observed = robot.observe();
    let foot = seen.pose.to_isometry();
    let grasp = robot.kinematics().grasp(&observed.positions);
    let held = Held {
        id: seen.id.clone(),
        size_m: seen.size_m,
        foot,
        grasp_from_foot: foot.inverse() * grasp,
        heading: Pose::from_isometry(&robot.base()).yaw(),
        opening_m: observed.gripper_opening_m,
        wall_m,
    };
    robot.hold(Some(held));
    robot.watch_grip(wall_m);
}

/// Reports success if the fingers hold something that is not thinner than this. Unit: metres.
fn report(robot: &mut Operator<'_>, target: &str, stalled: bool, thinnest_m: f64) -> ActionReport {
    if let Some(suction) = robot.profile().hand.suction {
        return cup::report(robot, &suction, target, stalled);
    }
    let gap = robot.feel_opening();
    if !stalled {
        return failed(format!("the fingers did not close on {target}"));
    }
    if robot.felt_slip() {
        return failed(format!(
            "{target} slipped out of the hand: its fingers are {:.1} mm apart",
            gap * 1e3
        ));
    }
    if gap < thinnest_m {
        return failed(format!(
            "the hand is empty: its fingers are {:.1} mm apart",
            gap * 1e3
        ));
    }
    if !feels(robot) {
        return failed(format!("{target} slipped out of the hand"));
    }
    let message = format!(
        "holds {target}, the fingers are {:.1} cm apart",
        gap * 100.0
    );
    ActionReport {
        succeeded: true,
        message,
    }
}

/// A report of failure.
pub(super) fn failed(message: impl Into<String>) -> ActionReport {
    ActionReport {
        succeeded: false,
        message: message.into(),
    }
}
