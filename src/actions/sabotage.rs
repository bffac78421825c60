//! Deliberate faults between a skill and its robot, and between the robot and the world, to test whether properties
//! notice them.
//!
//! The skill is unmodified and the recorder sees only physics: neither is informed of the fault.

use crate::ActionCall;
use actcheck_data::{ActionReport, BodyState, Pose, Snapshot};
use actcheck_world::{Command, Observation, Perturbation, Sighting, World};

/// Designators of the object that the action handles and of the surface it is placed on.
const OBJECT: &str = "pickObject";
const PLACE: &str = "placeSurface";
/// Distance between the hand and the object's bounding box below which the hand is reaching for it. Unit: metres. Every
/// hand comes this close before it closes, and a neighbour that falls then has already been seen upright.
const REACHING_M: f64 = 0.1;
/// Height above its place from which an object touched only by the hand counts as carried. Unit: metres. More than half
/// of the lowest lift: an object dropped there ends far from the hand.
const CARRIED_M: f64 = 0.05;
/// Distance a teleported object moves. Unit: metres. Out of any hand, but still within the world.
const TELEPORT_M: f64 = 0.5;
/// A base that has moved this far is driving. Unit: metres.
const DRIVEN_M: f64 = 0.5;
/// How far outside the rooms a robot is carried off, or how far backwards if there are no rooms. Unit: metres. Beyond
/// the walls.
const CARRIED_OFF_M: f64 = 1.0;
/// Gap between a base and an object put in front of it. Unit: metres. Too short for the base to stop when it sees the
/// object.
const BEFORE_BASE_M: f64 = 0.03;
/// Radius of a base: that of a slim mobile manipulator. Unit: metres.
const BASE_RADIUS_M: f64 = 0.22;
/// Height of an object's foot above its new place at which the fast part of lowering ends. Unit: metres.
const LOWERED_M: f64 = 0.05;
/// Duration of an action in which the robot does nothing. Unit: seconds.
pub(super) const IDLE_SECS: f64 = 1.0;
/// Margin that the widest opening must leave beside another object for it to be picked by mistake. Unit: metres.
const ROOM_M: f64 = 0.02;

/// A combination of faults: every field that is `Some` applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sabotage {
    /// The sabotaged action; `None` for every action.
    pub action: Option<&'static str>,
    /// Fault of the robot.
    pub robot: Option<Defect>,
    /// Accident in the world, and its moment.
    pub world: Option<(Moment, Accident)>,
    /// The success that the action reports, regardless of its belief.
    pub report: Option<bool>,
}

/// Faults of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Defect {
    /// It does nothing.
    Idle,
    /// It mistakes the nearest other object that fits into its hand for the named one.
    WrongObject,
    /// Its joint and force sensors are frozen at their values at the start of the action; its camera repeats the first
    /// sighting of each object.
    FrozenSensors,
}

/// When an accident happens: once per run, at the first control tick at which this holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// The hand is within reach of the object.
    Reaching,
    /// Both fingers hold the object in the air, and nothing else touches it.
    Carrying,
    /// The base is half a metre from where the action began.
    Driving,
    /// The hand holds the object above the target surface.
    Lowering,
    /// The hand has released the object it held when the action began.
    LetGo,
}

/// Accidents in the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accident {
    /// The hand opens and stays open.
    HandOpens,
    /// The object's friction drops to zero.
    Slippery,
    /// The object jumps away from the robot within one tick.
    Teleport,
    /// The object's nearest neighbour falls onto its side.
    NeighbourFalls,
    /// The object itself falls onto its side.
    Falls,
    /// The hand closes and stays closed.
    HandJams,
    /// Another object appears right in front of the base.
    InTheWay,
    /// The robot is carried out of its rooms without noticing.
    CarriedOff,
}

/// Carries out sabotage in one run and records whether it took effect.
#[derive(Debug, Clone)]
pub struct Saboteur {
    sabotage: Sabotage,
    /// Whether the current action is sabotaged.
    armed: bool,
    /// The named object and its target surface.
    object: Option<String>,
    place: Option<String>,
    /// World state at the start of the action.
    start: Option<Snapshot>,
    frozen: Option<Observation>,
    first_sights: Vec<Sighting>,
    /// Forced gap between the fingers, regardless of the command. Unit: metres.
    opening_m: Option<f64>,
    defective: bool,
    happened: bool,
    lied: bool,
}

impl Saboteur {
    /// A saboteur for one run.
    pub fn new(sabotage: Sabotage) -> Self {
        Self {
            sabotage,
            armed: false,
            object: None,
            place: None,
            start: None,
            frozen: None,
            first_sights: Vec::new(),
            opening_m: None,
            defective: false,
            happened: false,
            lied: false,
        }
    }

    /// Whether every part of the sabotage took effect: a hand that never held an object can't drop it.
    pub fn came_about(&self) -> bool {
        (self.sabotage.robot.is_none() || self.defective)
            && (self.sabotage.world.is_none() || self.happened)
            && (self.sabotage.report.is_none() || self.lied)
    }

    /// Begins an action and returns the call as the robot understands it.
    pub(super) fn begin(&mut self, call: &ActionCall, world: &World) -> ActionCall {
        let start = world.snapshot();
        self.object = call.value(OBJECT).map(str::to_owned);
        self.place = call.value(PLACE).map(str::to_owned);
        self.armed = self.sabotage.action.is_none_or(|action| action == call.action);
        self.frozen = None;
        let mut understood = call.clone();
        match self.sabotage.robot.filter(|_| self.armed) {
            Some(Defect::WrongObject) => {
                let other = self.object.as_deref().and_then(|object| mistaken(&start, object, world));
                if let Some(other) = other {
                    understood.parameters.insert(OBJECT.to_owned(), vec![other]);
                    self.defective = true;
                }
            }
            Some(Defect::FrozenSensors) => {
                self.frozen = Some(world.observe());
                self.first_sights.clear();
                self.defective = true;
            }
            Some(Defect::Idle) => self.defective = true,
            None => {}
        }
        self.start = Some(start);
        understood
    }

    /// Whether the robot does nothing.
    pub(super) fn idles(&self) -> bool {
        self.armed && self.sabotage.robot == Some(Defect::Idle)
    }

    /// Advances one control tick.
    pub(super) fn step(&mut self, world: &mut World, command: &Command) {
        if let (Some((moment, accident)), true, false) = (self.sabotage.world, self.armed, self.happened)
            && self.is_time_for(moment, world)
        {
            self.happened = self.happen(accident, world);
        }
        match self.opening_m {
            Some(gripper_opening_m) => world.step(&Command { gripper_opening_m, ..command.clone() }),
            None => world.step(command),
        }
    }

    /// The robot's measurements, given the honest ones.
    pub(super) fn observation(&self, honest: Observation) -> Observation {
        match &self.frozen {
            // Time is not measured by a sensor, so it is not frozen.
            Some(frozen) => Observation { time_secs: honest.time_secs, ..frozen.clone() },
            None => honest,
        }
    }

    /// The sighting that the robot receives, given the honest one.
    pub(super) fn sighting(&mut self, honest: Sighting) -> Sighting {
        if self.frozen.is_none() {
            return honest;
        }
        match self.first_sights.iter().find(|first| first.id == honest.id) {
            Some(first) => first.clone(),
            None => {
                self.first_sights.push(honest.clone());
                honest
            }
        }
    }

    /// The action's report, given the honest one.
    pub(super) fn report(&mut self, honest: ActionReport) -> ActionReport {
        match self.sabotage.report {
            Some(succeeded) if self.armed && succeeded != honest.succeeded => {
                self.lied = true;
                ActionReport { succeeded, message: if succeeded { "done" } else { "could not do it" }.to_owned() }
            }
            _ => honest,
        }
    }

    fn is_time_for(&self, moment: Moment, world: &World) -> bool {
        let Some(start) = &self.start else { return false };
        let now = world.snapshot();
        if moment == Moment::Driving {
            let ([x0, y0, _], [x, y, _]) = (start.robot.base_true, now.robot.base_true);
            return libm::hypot(x - x0, y - y0) > DRIVEN_M;
        }
        let Some(object) = &self.object else { return false };
        let (Some(was), Some(is)) = (body(start, object), body(&now, object)) else { return false };
        let hangs = holds(&now, object) && is.touches.iter().all(|other| other == "robot");
        match moment {
            Moment::Reaching => box_distance(is, now.robot.gripper.position) < REACHING_M,
            Moment::Carrying => hangs && is.pose.position[2] - was.pose.position[2] > CARRIED_M,
            Moment::Lowering => {
                let place = self.place.as_deref().and_then(|place| body(&now, place));
                hangs && place.is_some_and(|place| is_above(is, place))
            }
            Moment::LetGo => holds(start, object) && !is.touches.iter().any(|other| other == "robot"),
            Moment::Driving => false,
        }
    }

    /// Causes the accident. Returns `true` if it was possible.
    fn happen(&mut self, accident: Accident, world: &mut World) -> bool {
        let now = world.snapshot();
        let object = self.object.as_deref().unwrap_or_default();
        match accident {
            Accident::HandOpens => self.opening_m = Some(world.profile().max_opening_m),
            Accident::HandJams => self.opening_m = Some(0.0),
            Accident::Slippery => return world.perturb(object, Perturbation::Friction(0.0)),
            Accident::Falls => return world.perturb(object, Perturbation::Fall),
            Accident::Teleport => {
                let there = body(&now, object).map(|is| farther(is, now.robot.base_true));
                return there.is_some_and(|there| world.perturb(object, Perturbation::Pose(there)));
            }
            Accident::NeighbourFalls => {
                let neighbour = others_by_distance(&now, object).first().map(|body| body.id.clone());
                return neighbour.is_some_and(|id| world.perturb(&id, Perturbation::Fall));
            }
            Accident::InTheWay => {
                let thing = now.bodies.iter().find(|body| !body.fixed && body.id != object);
                let there = thing.map(|thing| (thing.id.clone(), before(thing, now.robot.base_true)));
                return there.is_some_and(|(id, there)| world.perturb(&id, Perturbation::Pose(there)));
            }
            Accident::CarriedOff => return world.kidnap(outside(world, now.robot.base_true)),
        }
        true
    }
}

/// Whether both fingers touch an object.
fn holds(snapshot: &Snapshot, object: &str) -> bool {
    let touches = |things: &[String]| things.iter().any(|thing| thing == object);
    touches(&snapshot.robot.left_touches) && touches(&snapshot.robot.right_touches)
}

/// Whether a body is well above another, within its outline.
fn is_above(body: &BodyState, place: &BodyState) -> bool {
    let over = |axis: usize| {
        let middle = f64::midpoint(body.aabb_min[axis], body.aabb_max[axis]);
        (place.aabb_min[axis]..=place.aabb_max[axis]).contains(&middle)
    };
    over(0) && over(1) && body.aabb_min[2] - place.aabb_max[2] > LOWERED_M
}

/// The pose of a body on the floor right in front of a base, with its current orientation.
fn before(body: &BodyState, [x, y, heading]: [f64; 3]) -> Pose {
    let half = |axis: usize| (body.aabb_max[axis] - body.aabb_min[axis]) / 2.0;
    let away = BASE_RADIUS_M + libm::hypot(half(0), half(1)) + BEFORE_BASE_M;
    let foot = body.pose.position[2] - body.aabb_min[2];
    Pose { position: [x + libm::cos(heading) * away, y + libm::sin(heading) * away, foot], ..body.pose }
}

/// A base pose outside all rooms, or well behind the current one if there are no rooms.
fn outside(world: &World, [x, y, heading]: [f64; 3]) -> [f64; 3] {
    let ends = world.floor_plan().rooms.iter().map(|room| room.high_m[0]);
    match ends.max_by(f64::total_cmp) {
        Some(end) => [end + CARRIED_OFF_M, y, heading],
        None => [x - libm::cos(heading) * CARRIED_OFF_M, y - libm::sin(heading) * CARRIED_OFF_M, heading],
    }
}

fn body<'a>(snapshot: &'a Snapshot, id: &str) -> Option<&'a BodyState> {
    snapshot.bodies.iter().find(|body| body.id == id)
}

/// Distance from a point to the bounding box of a body. Unit: metres.
fn box_distance(body: &BodyState, point: [f64; 3]) -> f64 {
    let outside = |axis: usize| (body.aabb_min[axis] - point[axis]).max(point[axis] - body.aabb_max[axis]).max(0.0);
    (0..3).map(|axis| outside(axis) * outside(axis)).sum::<f64>().sqrt()
}

/// The pose of a body, moved horizontally away from the robot's base.
fn farther(body: &BodyState, [base_x, base_y, _]: [f64; 3]) -> Pose {
    let [x, y, z] = body.pose.position;
    let (dx, dy) = (x - base_x, y - base_y);
    let scale = TELEPORT_M / libm::hypot(dx, dy).max(1e-6);
    Pose { position: [x + dx * scale, y + dy * scale, z], ..body.pose }
}

/// All movable bodies except one object, nearest to it first.
fn others_by_distance<'a>(snapshot: &'a Snapshot, object: &str) -> Vec<&'a BodyState> {
    let Some(own) = body(snapshot, object) else { return Vec::new() };
    let distance = |other: &BodyState| {
        let [x, y, _] = own.pose.position;
        libm::hypot(other.pose.position[0] - x, other.pose.position[1] - y)
    };
    let mut others: Vec<&BodyState> = snapshot.bodies.iter().filter(|body| !body.fixed && body.id != object).collect();
    others.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    others
}

/// The nearest other object that fits into the hand.
fn mistaken(start: &Snapshot, object: &str, world: &World) -> Option<String> {
    let widest = world.profile().max_opening_m - ROOM_M;
    let fits = |body: &&&BodyState| {
        let side = |axis: usize| body.aabb_max[axis] - body.aabb_min[axis];
        side(0).min(side(1)) <= widest
    };
    others_by_distance(start, object).iter().find(fits).map(|body| body.id.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn idle(world: Option<(Moment, Accident)>, report: Option<bool>) -> Saboteur {
        Saboteur::new(Sabotage { action: None, robot: None, world, report })
    }

    fn report(succeeded: bool) -> ActionReport {
        ActionReport { succeeded, message: "done".to_owned() }
    }

    #[test]
    fn only_a_report_against_the_actions_belief_is_a_lie() {
        for (told, honest, lied) in
            [(true, false, true), (true, true, false), (false, true, true), (false, false, false)]
        {
            let mut saboteur = idle(None, Some(told));
            saboteur.armed = true;
            assert_eq!(saboteur.report(report(honest)).succeeded, told);
            assert_eq!(saboteur.came_about(), lied);
        }
    }

    #[test]
    fn incomplete_sabotage_does_not_count_as_occurred() {
        let mut saboteur = idle(Some((Moment::Carrying, Accident::HandOpens)), Some(true));
        saboteur.armed = true;
        saboteur.report(report(false));
        assert!(!saboteur.came_about(), "nothing was dropped");
    }
}
