//! Faults put on purpose between a skill and its robot, and between the robot and the world, for tests of what notices them.
//!
//! The skill is the same as ever and the recorder sees physics only: neither is told.

use crate::actions::{ActionCall, ActionReport};
use crate::base::Pose;
use crate::world::{BodyState, Command, Mishap, Observation, Sighting, Snapshot, World};

/// Designator of the thing that the action is about.
const OBJECT: &str = "pickObject";
/// Distance of the hand from the box around the object at which it counts as reaching for it. Unit: metres. Every hand
/// comes so near before it closes, and no neighbour that falls then was seen lying.
const REACHING_M: f64 = 0.1;
/// Height above its place from which on an object that only the hand touches counts as carried. Unit: metres. More than
/// half of the lowest lift: what is dropped there ends far from the hand.
const CARRIED_M: f64 = 0.05;
/// How far a teleported object goes. Unit: metres. Out of any hand, and not out of the world.
const TELEPORT_M: f64 = 0.5;
/// How long a robot that does nothing takes for it. Unit: seconds.
pub(super) const IDLE_SECS: f64 = 1.0;
/// Room that the widest opening has to leave beside another object for it to be taken by mistake. Unit: metres.
const ROOM_M: f64 = 0.02;

/// What goes wrong: every part that is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sabotage {
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
}

/// Carries out sabotage in one run, and knows whether it came to it.
#[derive(Debug, Clone)]
pub struct Saboteur {
    sabotage: Sabotage,
    /// The named object.
    object: Option<String>,
    /// The world when the action began.
    start: Option<Snapshot>,
    frozen: Option<Observation>,
    first_sights: Vec<Sighting>,
    hand_open: bool,
    defective: bool,
    happened: bool,
    lied: bool,
}

impl Saboteur {
    /// A saboteur for one run.
    pub fn new(sabotage: Sabotage) -> Self {
        Self {
            sabotage,
            object: None,
            start: None,
            frozen: None,
            first_sights: Vec::new(),
            hand_open: false,
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
        let mut understood = call.clone();
        match self.sabotage.robot {
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
        self.sabotage.robot == Some(Defect::Idle)
    }

    /// One control tick.
    pub(super) fn step(&mut self, world: &mut World, command: &Command) {
        if let (Some((moment, accident)), false) = (self.sabotage.world, self.happened)
            && self.is_time_for(moment, world)
        {
            self.happened = self.happen(accident, world);
        }
        if self.hand_open {
            let gripper_opening_m = world.profile().max_opening_m;
            world.step(&Command { gripper_opening_m, ..command.clone() });
        } else {
            world.step(command);
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
            Some(succeeded) if succeeded != honest.succeeded => {
                self.lied = true;
                ActionReport { succeeded, message: if succeeded { "done" } else { "could not do it" }.to_owned() }
            }
            _ => honest,
        }
    }

    fn is_time_for(&self, moment: Moment, world: &World) -> bool {
        let (Some(object), Some(start)) = (&self.object, &self.start) else { return false };
        let now = world.snapshot();
        let (Some(was), Some(is)) = (body(start, object), body(&now, object)) else { return false };
        match moment {
            Moment::Reaching => box_distance(is, now.robot.gripper.position) < REACHING_M,
            Moment::Carrying => {
                let held = now.robot.left_touches.contains(object) && now.robot.right_touches.contains(object);
                let free = is.touches.iter().all(|other| other == "robot");
                held && free && is.pose.position[2] - was.pose.position[2] > CARRIED_M
            }
        }
    }

    /// True if it could happen.
    fn happen(&mut self, accident: Accident, world: &mut World) -> bool {
        let (Some(object), Some(start)) = (&self.object, &self.start) else { return false };
        match accident {
            Accident::HandOpens => {
                self.hand_open = true;
                true
            }
            Accident::Slippery => world.befall(object, Mishap::Friction(0.0)),
            Accident::Teleport => {
                let now = world.snapshot();
                body(&now, object)
                    .is_some_and(|is| world.befall(object, Mishap::Pose(farther(is, now.robot.base_true))))
            }
            Accident::NeighbourFalls => {
                let neighbour = others_by_distance(start, object).first().map(|body| body.id.clone());
                neighbour.is_some_and(|id| world.befall(&id, Mishap::Fall))
            }
        }
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

    fn report(succeeded: bool) -> ActionReport {
        ActionReport { succeeded, message: "so it is".to_owned() }
    }

    #[test]
    fn only_a_report_that_differs_from_what_the_action_believes_is_a_lie() {
        for (told, honest, lied) in
            [(true, false, true), (true, true, false), (false, true, true), (false, false, false)]
        {
            let mut saboteur = Saboteur::new(Sabotage { robot: None, world: None, report: Some(told) });
            assert_eq!(saboteur.report(report(honest)).succeeded, told);
            assert_eq!(saboteur.came_about(), lied);
        }
    }

    #[test]
    fn sabotage_of_which_a_part_is_missing_did_not_come_about() {
        let world = Some((Moment::Carrying, Accident::HandOpens));
        let mut saboteur = Saboteur::new(Sabotage { robot: None, world, report: Some(true) });
        saboteur.report(report(false));
        assert!(!saboteur.came_about(), "nothing was dropped");
    }
}
