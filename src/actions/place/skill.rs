//! The place skill: fold, drive, look, lower until contact, open, withdraw.

use nalgebra::{Point3, Vector3};

use crate::grip::feels;
use crate::memory::{Held, furniture};
use crate::operator::{Interrupt, Operator};
use crate::perceive::{Survey, survey};
use crate::pick::failed;
use crate::place::touch::Touch;
use crate::place::{carry, spot};
use crate::plan::{self, Plan, PlanRequest};
use crate::{ActionCall, cup, memory};
use actcheck_data::ActionReport;
use actcheck_world::Sighting;

/// Designators of the object to place and of the target surface.
const TARGET: &str = "pickObject";
const SURFACE: &str = "placeSurface";
/// Duration of a look, including the time to come to rest. Unit: seconds.
const LOOK_SECS: f64 = 0.5;
/// Shortest duration of folding a loaded arm. Unit: seconds.
const FOLD_SECS: f64 = 2.0;
/// Shortest duration of moving the arm into or out of its driving posture. Unit: seconds.
const TUCK_SECS: f64 = 3.0;
/// Shortest duration of moving down to a few centimetres above the surface. Unit: seconds.
const DOWN_SECS: f64 = 3.0;
/// How far the hand continues below the expected height of the surface. Unit: metres. Three times
/// the error of vision.
const DEEPER_M: f64 = 0.03;
/// Shortest duration of the last part of the descent, at about 2 cm/s. Unit: seconds.
const SETTLE_SECS: f64 = 3.0;
/// Time for the fingers to open. Unit: seconds.
const OPEN_SECS: f64 = 0.8;
/// Shortest duration of withdrawing from the object. Unit: seconds.
const LEAVE_SECS: f64 = 2.0;
/// How far the hand withdraws from the object if the base can't move it away. Unit: metres.
const LEAVE_M: f64 = 0.12;

/// Early end of the skill.
enum Halt {
    /// The skill has failed, with a sentence for the report.
    Failed(String),
    /// The action has to end.
    Interrupted(Interrupt),
}

impl From<Interrupt> for Halt {
    fn from(interrupt: Interrupt) -> Self {
        Self::Interrupted(interrupt)
    }
}

/// Sets the held object down on the designated surface and reports whether the robot believes it is
/// there.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn place(call: &ActionCall, robot: &mut Operator<'_>) -> Result<ActionReport, Interrupt> {
    match try_to_place(call, robot) {
        Ok(message) => Ok(ActionReport {
            succeeded: true,
            message,
        }),
        Err(Halt::Failed(reason)) => Ok(failed(reason)),
        Err(Halt::Interrupted(interrupt)) => Err(interrupt),
    }
}

fn try_to_place(call: &ActionCall, robot: &mut Operator<'_>) -> Result<String, Halt> {
    let target = call
        .value(TARGET)
        .ok_or_else(|| Halt::Failed("no object was named to be placed".to_owned()))?;
    let surface = call
        .value(SURFACE)
        .ok_or_else(|| Halt::Failed("no surface was named to place it on".to_owned()))?;
    robot.begin("feel");
    let held = in_hand(target, robot)?;
    robot.watch_grip(held.wall_m);
    robot.begin("fold");
    robot.follow(&carry::fold(robot), FOLD_SECS)?;
    let folded = robot.commanded().to_vec();
    let tucked = carry::tuck(robot, &held);
    robot.follow(&tucked, if tucked.is_empty() { 0.0 } else { TUCK_SECS })?;
    robot.begin("look out");
    robot.wait(LOOK_SECS)?;
    let (seen, others) = look_out(surface, &held, robot)?;
    still_in_hand(&held, robot)?;
    robot.begin("drive");
    let around: Vec<Sighting> = others.iter().cloned().chain([seen.clone()]).collect();
    if let Some(reason) = carry::drive_before(&seen, &around, robot)? {
        return Err(Halt::Failed(format!("{surface}: {reason}")));
    }
    robot.begin("look");
    let survey = look_at(surface, &seen, &others, robot)?;
    still_in_hand(&held, robot)?;
    robot.begin("unfold");
    robot.follow(
        &carry::untuck(robot, &tucked, &folded),
        if tucked.is_empty() { 0.0 } else { TUCK_SECS },
    )?;
    still_in_hand(&held, robot)?;
    let (plan, spot) = choose(surface, &held, &survey, &others, robot)?;
    set_down(surface, &held, &plan, &spot, robot)
}

/// The object the robot believes to hold, if the fingers feel anything.
fn in_hand(target: &str, robot: &mut Operator<'_>) -> Result<Held, Halt> {
    let nothing = || Halt::Failed(format!("nothing is in the hand: {target} can't be placed"));
    let held = robot.memory().held.clone().ok_or_else(nothing)?;
    robot.wait(LOOK_SECS)?;
    let is_closed = !robot.has_cup() && robot.feel_opening() < held.least_gap_m();
    if is_closed || !feels(robot) {
        robot.hold(None);
        return Err(nothing());
    }
    Ok(held)
}

/// Fails if the object slipped on the way.
fn still_in_hand(held: &Held, robot: &mut Operator<'_>) -> Result<(), Halt> {
    if !robot.felt_slip() {
        return Ok(());
    }
    let lost = match &robot.profile().hand.suction {
        Some(suction) => cup::broken(robot, suction, &held.id),
        None => format!("{} slipped out of the hand on the way", held.id),
    };
    robot.hold(None);
    Err(Halt::Failed(lost))
}

/// The approximate pose of the surface, and all other objects. If the robot perceived its
/// surroundings earlier, these are the furniture of its floor plan and the perceived objects.
/// Otherwise mapped furniture comes from the map and everything else from the abstract detector.
fn look_out(
    surface: &str,
    held: &Held,
    robot: &mut Operator<'_>,
) -> Result<(Sighting, Vec<Sighting>), Halt> {
    let mut seen = match robot.memory().perceived.clone() {
        Some(perceived) => {
            let standing = perceived.things.iter().enumerate();
            let things =
                standing.map(|(idx, thing)| memory::sighting(format!("thing_{}", idx + 1), thing));
            things.chain(robot.known_furniture()).collect()
        }
        None => {
            let map = robot.map_of_furniture().unwrap_or_default();
            let mut seen =
                robot.see_where(|id| id != held.id && map.iter().all(|piece| piece.id != id));
            seen.extend(map);
            seen
        }
    };
    let at = seen
        .iter()
        .position(|thing| thing.id == surface && thing.furniture);
    let at = at.ok_or_else(|| Halt::Failed(format!("{surface} was not seen")))?;
    let place = seen.remove(at);
    // There may still be a percept of the object at its old position.
    let taken = held.foot.translation.vector;
    seen.retain(|thing| {
        thing.furniture
            || (Vector3::from(thing.pose.position) - taken).norm() > spot::radius(held.size_m)
    });
    Ok((place, seen))
}

/// The surface seen from in front of it: in pictures if the robot perceived its surroundings
/// earlier, otherwise by the abstract detector.
fn look_at(
    surface: &str,
    seen: &Sighting,
    others: &[Sighting],
    robot: &mut Operator<'_>,
) -> Result<Survey, Halt> {
    robot.wait(LOOK_SECS)?;
    let missing = || Halt::Failed(format!("{surface} was not found where it should be"));
    if robot.memory().perceived.is_some() {
        return survey(seen, robot)?.ok_or_else(missing);
    }
    let again = robot.see(surface).ok_or_else(missing)?;
    let things = others
        .iter()
        .filter(|thing| !thing.furniture)
        .cloned()
        .collect();
    Ok(Survey::of(&again, things))
}

/// A free spot, and the hand's path to it.
fn choose(
    surface: &str,
    held: &Held,
    survey: &Survey,
    others: &[Sighting],
    robot: &mut Operator<'_>,
) -> Result<(Plan, Point3<f64>), Halt> {
    let base = Point3::from(robot.base().translation.vector);
    let spots = spot::spots(
        &survey.plane,
        &survey.things,
        spot::radius(held.size_m),
        &base,
    );
    if spots.is_empty() {
        return Err(Halt::Failed(format!("there is no free place on {surface}")));
    }
    let mut around: Vec<Sighting> = others.iter().chain(&survey.things).cloned().collect();
    around.push(furniture(surface, &survey.plane));
    // Obstacles that the drive saw on the floor.
    around.extend(memory::obstacles(&robot.memory().floor));
    let ways = spot::ways(held, &spots, robot.profile().hand.max_opening_m);
    // An arm that can't unfold straight moves around obstacles; the held object may tilt meanwhile.
    let wanted = PlanRequest {
        grasps: &ways,
        all: &ways,
        taken: None,
    };
    let plan = plan::plan(robot, wanted, &spot::heightened(&around, held));
    let plan = plan.map_err(|reason| Halt::Failed(format!("{surface}: {reason}")))?;
    let lowest = plan.approach.last().map(|posture| {
        robot
            .kinematics()
            .grasp(posture)
            .translation
            .vector
            .xy()
            .into()
    });
    let spot = lowest.and_then(|at| spot::nearest(&spots, &at));
    spot.map(|spot| (plan, spot))
        .ok_or_else(|| Halt::Failed(format!("{surface}: no path down to it was found")))
}

/// Carries the object over its spot, lowers it, releases it and withdraws.
fn set_down(
    surface: &str,
    held: &Held,
    plan: &Plan,
    spot: &Point3<f64>,
    robot: &mut Operator<'_>,
) -> Result<String, Halt> {
    robot.begin("approach");
    robot.follow(&plan.drive, 0.0)?;
    robot.follow(&plan.reach, FOLD_SECS)?;
    robot.follow(&plan.near, 0.0)?;
    still_in_hand(held, robot)?;
    robot.begin("lower");
    let stands = lower(plan, robot)?;
    still_in_hand(held, robot)?;
    robot.begin("open");
    let opening_m = (held.opening_m + spot::RELEASE_M).min(robot.profile().hand.max_opening_m);
    robot.hold(None);
    robot.set_opening(opening_m);
    robot.wait(OPEN_SECS)?;
    robot.begin("withdraw");
    withdraw(held, plan, robot)?;
    robot.wait(LOOK_SECS)?;
    if robot.has_cup() && feels(robot) {
        return Err(Halt::Failed(
            "the suction cup did not let go: its vacuum is still felt".to_owned(),
        ));
    }
    let gap = robot.feel_opening();
    if !robot.has_cup() && gap < held.opening_m + spot::RELEASE_M / 2.0 {
        return Err(Halt::Failed(format!(
            "the hand did not open: its fingers are {:.1} cm apart",
            gap * 100.0
        )));
    }
    if !stands {
        return Err(Halt::Failed(format!(
            "{} was let go, but {surface} was not felt below it",
            held.id
        )));
    }
    Ok(format!(
        "set {} down on {surface} at x = {:.2}, y = {:.2}",
        held.id, spot.x, spot.y
    ))
}

/// Lowers the hand until something else carries the object. Returns `true` if contact was felt.
fn lower(plan: &Plan, robot: &mut Operator<'_>) -> Result<bool, Halt> {
    robot.wait(LOOK_SECS)?;
    let Some((lowest, down)) = plan.approach.split_last() else {
        return Ok(false);
    };
    let mut touch = Touch::new(robot);
    if robot.follow_until(down, DOWN_SECS, |robot| touch.felt(robot))? {
        return Ok(true);
    }
    let mut deeper = vec![lowest.clone()];
    deeper.extend(carry::straight(
        robot,
        lowest,
        &Vector3::new(0.0, 0.0, -DEEPER_M),
    ));
    Ok(robot.follow_until(&deeper, SETTLE_SECS, |robot| touch.felt(robot))?)
}

/// Withdraws the open hand: horizontally and backwards from an object held from the side, otherwise
/// upwards first.
fn withdraw(held: &Held, plan: &Plan, robot: &mut Operator<'_>) -> Result<(), Halt> {
    if !spot::is_level(held) {
        robot.follow(&plan.lift, LEAVE_SECS)?;
        robot.follow(&plan.retreat, 0.0)?;
        return Ok(());
    }
    let mut back = robot.commanded().to_vec();
    let path = match (robot.layout().base, plan.reach.last().zip(plan.near.last())) {
        (Some([x, y, _]), Some((reach, above))) => {
            back[x] += reach[x] - above[x];
            back[y] += reach[y] - above[y];
            vec![back]
        }
        _ => {
            let forward = robot.kinematics().grasp(&back).rotation * Vector3::x();
            carry::straight(robot, &back, &(-forward * LEAVE_M))
        }
    };
    Ok(robot.follow(&path, LEAVE_SECS)?)
}
