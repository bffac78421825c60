//! Faults put on purpose between a skill and its robot, and between the robot and the world, for tests of what notices them.
//!
//! The skill is the same as ever and the recorder sees physics only: neither is told.

use crate::actions::{ActionCall, ActionReport};
use crate::base::Pose;
use crate::world::{BodyState, Command, Mishap, Observation, Sighting, Snapshot, World};

/// Designators of the thing that the action is about, and of what it shall be placed on.
const OBJECT: &str = "pickObject";
const PLACE: &str = "placeSurface";
/// Distance of the hand from the box around the object at which it counts as reaching for it. Unit: metres. Every hand
/// comes so near before it closes, and no neighbour that falls then was seen lying.
const REACHING_M: f64 = 0.1;
/// Height above its place from which on an object that only the hand touches counts as carried. Unit: metres. More than
/// half of the lowest lift: what is dropped there ends far from the hand.
const CARRIED_M: f64 = 0.05;
/// How far a teleported object goes. Unit: metres. Out of any hand, and not out of the world.
const TELEPORT_M: f64 = 0.5;
/// A base that has gone so far drives. Unit: metres.
const DRIVEN_M: f64 = 0.5;
/// How far outside of the rooms a robot is carried off, and how far back where there are none. Unit: metres. Beyond the walls.
const CARRIED_OFF_M: f64 = 1.0;
/// Gap between a base and what is put before it. Unit: metres. A base that sees it can't stop any more.
const BEFORE_BASE_M: f64 = 0.03;
/// Radius of a base: that of a slim mobile manipulator. Unit: metres.
const BASE_RADIUS_M: f64 = 0.22;
/// Height of an object's foot above its new place down to which it is lowered fast. Unit: metres.
const LOWERED_M: f64 = 0.05;
/// How long a robot that does nothing takes for it. Unit: seconds.
pub(super) const IDLE_SECS: f64 = 1.0;
/// Room that the widest opening has to leave beside another object for it to be taken by mistake. Unit: metres.
const ROOM_M: f64 = 0.02;

/// What goes wrong: every part that is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sabotage {
    /// During which action: nothing for every one.
    pub action: Option<&'static str>,
    /// With the robot.
    pub robot: Option<Defect>,
    /// With the world, and when.
    pub world: Option<(Moment, Accident)>,
    /// What the action reports, whatever it believes.
    pub report: Option<bool>,
}

/// What can be wrong with a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Defect {
    /// It does nothing.
    Idle,
    /// It takes the nearest other object that fits into its hand for the one that was named.
    WrongObject,
    /// Its joint and force sensors give what they gave when the action began, its camera the first sight of each object.
    FrozenSensors,
}

/// When an accident happens: once in a run, at the first control tick at which this holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// The hand is about to take the object.
    Reaching,
    /// Both fingers hold the object in the air, and nothing else touches it.
    Carrying,
    /// The base is half a metre from where it began.
    Driving,
    /// The hand holds the object above the surface that it is to be placed on.
    Lowering,
    /// The hand has let go of what it held when the action began.
    LetGo,
}

/// What can happen to the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accident {
    /// The hand opens and stays open.
    HandOpens,
    /// The object has no friction any more.
    Slippery,
    /// The object is farther from the robot from one moment to the next.
    Teleport,
    /// The object's nearest neighbour lies on its side.
    NeighbourFalls,
    /// The object itself lies on its side.
    Falls,
    /// The fingers stay where they are.
    HandJams,
    /// Something stands right before the base.
    InTheWay,
    /// The robot is outside of its rooms and does not know.
    CarriedOff,
}

/// Carries out sabotage in one run, and knows whether it came to it.
#[derive(Debug, Clone)]
pub struct Saboteur {
    sabotage: Sabotage,
    /// Whether this is the action that is sabotaged.
    armed: bool,
    /// The named object, and what it is to be placed on.
    object: Option<String>,
    place: Option<String>,
    /// The world when the action began.
    start: Option<Snapshot>,
    frozen: Option<Observation>,
    first_sights: Vec<Sighting>,
    /// Gap between the fingers, whatever they are told. Unit: metres.
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

    /// Whether every part of the sabotage came about: a hand that never held anything can't drop it.
    pub fn came_about(&self) -> bool {
        (self.sabotage.robot.is_none() || self.defective)
            && (self.sabotage.world.is_none() || self.happened)
            && (self.sabotage.report.is_none() || self.lied)
    }

    /// An action begins. Gives what the robot understands of the call.
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

    /// One control tick.
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

    /// What the robot measures, from what is so.
    pub(super) fn observation(&self, honest: Observation) -> Observation {
        match &self.frozen {
            // Time is no sensor's.
            Some(frozen) => Observation { time_secs: honest.time_secs, ..frozen.clone() },
            None => honest,
        }
    }

    /// What the robot sees, from what it would see.
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

    /// What the action reports, from what it believes.
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

    /// True if it could happen.
    fn happen(&mut self, accident: Accident, world: &mut World) -> bool {
        let now = world.snapshot();
        let object = self.object.as_deref().unwrap_or_default();
        match accident {
            Accident::HandOpens => self.opening_m = Some(world.profile().max_opening_m),
            Accident::HandJams => self.opening_m = Some(0.0),
            Accident::Slippery => return world.befall(object, Mishap::Friction(0.0)),
            Accident::Falls => return world.befall(object, Mishap::Fall),
            Accident::Teleport => {
                let there = body(&now, object).map(|is| farther(is, now.robot.base_true));
                return there.is_some_and(|there| world.befall(object, Mishap::Pose(there)));
            }
            Accident::NeighbourFalls => {
                let neighbour = others_by_distance(&now, object).first().map(|body| body.id.clone());
                return neighbour.is_some_and(|id| world.befall(&id, Mishap::Fall));
            }
            Accident::InTheWay => {
                let thing = now.bodies.iter().find(|body| !body.fixed && body.id != object);
                let there = thing.map(|thing| (thing.id.clone(), before(thing, now.robot.base_true)));
                return there.is_some_and(|(id, there)| world.befall(&id, Mishap::Pose(there)));
            }
            Accident::CarriedOff => return world.carry_off(outside(world, now.robot.base_true)),
        }
        true
    }
}

/// Whether both fingers touch an object.
fn holds(snapshot: &Snapshot, object: &str) -> bool {
    let touches = |things: &[String]| things.iter().any(|thing| thing == object);
    touches(&snapshot.robot.left_touches) && touches(&snapshot.robot.right_touches)
}

/// Whether a body is well above another.
fn is_above(body: &BodyState, place: &BodyState) -> bool {
    let over = |axis: usize| {
        let middle = f64::midpoint(body.aabb_min[axis], body.aabb_max[axis]);
        (place.aabb_min[axis]..=place.aabb_max[axis]).contains(&middle)
    };
    over(0) && over(1) && body.aabb_min[2] - place.aabb_max[2] > LOWERED_M
}

/// The pose of a body that stands on the floor right before a base, as it is turned now.
fn before(body: &BodyState, [x, y, heading]: [f64; 3]) -> Pose {
    let half = |axis: usize| (body.aabb_max[axis] - body.aabb_min[axis]) / 2.0;
    let away = BASE_RADIUS_M + libm::hypot(half(0), half(1)) + BEFORE_BASE_M;
    let foot = body.pose.position[2] - body.aabb_min[2];
    Pose { position: [x + libm::cos(heading) * away, y + libm::sin(heading) * away, foot], ..body.pose }
}

/// Where a base is out of all rooms, or well behind where it is.
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

/// Distance of a point from the box around a body. Unit: metres.
fn box_distance(body: &BodyState, point: [f64; 3]) -> f64 {
    let outside = |axis: usize| (body.aabb_min[axis] - point[axis]).max(point[axis] - body.aabb_max[axis]).max(0.0);
    (0..3).map(|axis| outside(axis) * outside(axis)).sum::<f64>().sqrt()
}

/// The pose of a body, moved on a level line away from the robot's base.
fn farther(body: &BodyState, [base_x, base_y, _]: [f64; 3]) -> Pose {
    let [x, y, z] = body.pose.position;
    let (dx, dy) = (x - base_x, y - base_y);
    let scale = TELEPORT_M / libm::hypot(dx, dy).max(1e-6);
    Pose { position: [x + dx * scale, y + dy * scale, z], ..body.pose }
}

/// Everything that can move but one object, the nearest to it first.
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
        ActionReport { succeeded, message: "so it is".to_owned() }
    }

    #[test]
    fn only_a_report_that_differs_from_what_the_action_believes_is_a_lie() {
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
    fn sabotage_of_which_a_part_is_missing_did_not_come_about() {
        let mut saboteur = idle(Some((Moment::Carrying, Accident::HandOpens)), Some(true));
        saboteur.armed = true;
        saboteur.report(report(false));
        assert!(!saboteur.came_about(), "nothing was dropped");
    }
}
