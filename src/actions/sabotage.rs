//! Deliberate faults between a skill and its robot, and between the robot and the world, to test
//! whether properties notice them.
//!
//! The skill is unmodified and the recorder sees only physics: neither is informed of the fault.

use crate::whereabouts::{
    before, body, box_distance, farther, holds, is_above, mistaken, others_by_distance, outside,
};
use crate::{ActionCall, forced, forced_hand, misperception};
use actcheck_data::{ActionReport, KnownKind, Perceived, RobotCore, Snapshot};
use actcheck_world::{Command, Observation, Perturbation, Sighting, World};

/// Designators of the object that the action handles and of the surface it is placed on.
const OBJECT: &str = "pickObject";
const PLACE: &str = "placeSurface";
/// Distance between the hand and the object's bounding box below which the hand is reaching for it.
/// Unit: metres. Every hand comes this close before it closes, and a neighbour that falls then has
/// already been seen upright.
const REACHING_M: f64 = 0.1;
/// Height above its place from which an object touched only by the hand counts as carried. Unit:
/// metres. More than half of the lowest lift: an object dropped there ends far from the hand.
const CARRIED_M: f64 = 0.05;
/// A base that has moved this far is driving. Unit: metres.
const DRIVEN_M: f64 = 0.5;
/// Duration of an action in which the robot does nothing. Unit: seconds.
pub(super) const IDLE_SECS: f64 = 1.0;

/// A combination of faults: every field that is `Some` applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sabotage {
    /// The sabotaged actions; empty for every action.
    pub actions: &'static [&'static str],
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
    /// Its joint and force sensors are frozen at their values at the start of the action; its
    /// camera repeats the first sighting of each object.
    FrozenSensors,
    /// It exchanges its percepts of the named object and of another one: the nearest, or the
    /// nearest of another kind if the camera perceives them.
    SwappedPercepts,
    /// The camera perceives an object, the named one if there is one, as an object of another kind.
    MistakenKind,
    /// The camera perceives every object above its place.
    FalseHeight,
}

/// When an accident happens: once per run, at the first control tick at which this holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// Before the skill begins.
    Starting,
    /// The hand is within reach of the object.
    Reaching,
    /// Both fingers hold the object in the air, and nothing else touches it.
    Carrying,
    /// Both fingers hold the object, and it is not lifted yet.
    Grasping,
    /// The base is half a metre from where the action began.
    Driving,
    /// The same, and the hand holds an object.
    DrivingLoaded,
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
    /// The base is pushed against the nearest furniture and back.
    PushedIntoFurniture,
    /// The arm moves through the robot's head and back.
    ArmThroughHead,
    /// The motor of the arm's last joint runs away with a multiple of its largest effort.
    RunawayMotor,
    /// The hand drags the object, lifts it by less than a centimetre, and the robot stays so.
    Drags,
    /// The object's nearest neighbour is moved aside and back.
    NeighbourMoved,
    /// The hand moves through the nearest object and back.
    Sweeps,
    /// The robot pushes another object with the one in its hand.
    PushesWithHeld,
}

impl Sabotage {
    /// Whether it needs an object in the hand before the action.
    pub fn needs_load(&self) -> bool {
        matches!(
            self.world,
            Some((Moment::DrivingLoaded, _) | (_, Accident::PushesWithHeld))
        )
    }

    /// Whether it can happen to a robot: one without a base can't be pushed against furniture.
    pub fn suits(&self, robot: &RobotCore) -> bool {
        match self.world {
            Some((_, Accident::PushedIntoFurniture)) => robot.base_joints.is_some(),
            Some((_, Accident::ArmThroughHead)) => !robot.head_joints.is_empty(),
            _ => true,
        }
    }
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
    /// A joint whose motor runs away, and its effort. Unit: newtons or newton metres.
    runaway: Option<(usize, f64)>,
    /// The command that the robot carries out, whatever its skill commands.
    stuck: Option<Command>,
    /// The kind of the named object.
    kind: Option<KnownKind>,
    /// The object whose percept is exchanged with that of the named object.
    swapped: Option<String>,
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
            runaway: None,
            stuck: None,
            kind: None,
            swapped: None,
            defective: false,
            happened: false,
            lied: false,
        }
    }

    /// Whether every part of the sabotage took effect: a hand that never held an object can't drop
    /// it.
    pub fn came_about(&self) -> bool {
        (self.sabotage.robot.is_none() || self.defective)
            && (self.sabotage.world.is_none() || self.happened)
            && (self.sabotage.report.is_none() || self.lied)
    }

    /// Begins an action and returns the call as the robot understands it.
    pub(super) fn begin(&mut self, call: &ActionCall, world: &mut World) -> ActionCall {
        self.armed = self.sabotage.actions.is_empty()
            || self.sabotage.actions.contains(&call.action.as_str());
        self.object = call.value(OBJECT).map(str::to_owned);
        self.place = call.value(PLACE).map(str::to_owned);
        if let (Some((Moment::Starting, accident)), true, false) =
            (self.sabotage.world, self.armed, self.happened)
        {
            self.happened = self.happen(accident, world);
        }
        let start = world.snapshot();
        self.kind = self
            .object
            .as_deref()
            .and_then(|object| world.kind_of(object));
        (self.frozen, self.swapped, self.runaway, self.stuck) = (None, None, None, None);
        let mut understood = call.clone();
        match self.sabotage.robot.filter(|_| self.armed) {
            Some(Defect::WrongObject) => {
                let other = self
                    .object
                    .as_deref()
                    .and_then(|object| mistaken(&start, object, world));
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
            Some(Defect::SwappedPercepts) => {
                let object = self.object.as_deref().unwrap_or_default();
                self.swapped = others_by_distance(&start, object)
                    .first()
                    .map(|other| other.id.clone());
            }
            Some(Defect::MistakenKind | Defect::FalseHeight) | None => {}
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
        if let (Some((moment, accident)), true, false) =
            (self.sabotage.world, self.armed, self.happened)
            && self.is_time_for(moment, world)
        {
            self.happened = self.happen(accident, world);
        }
        let mut forced = self.stuck.as_ref().unwrap_or(command).clone();
        if let Some(opening_m) = self.opening_m {
            forced.gripper_opening_m = opening_m;
        }
        forced.efforts.extend(self.runaway);
        world.step(&forced);
    }

    /// The object that the robot sees in place of the requested one.
    pub(super) fn seen_instead(&mut self, id: &str) -> String {
        let (Some(object), Some(other)) = (&self.object, &self.swapped) else {
            return id.to_owned();
        };
        if id == object {
            self.defective = true;
            other.clone()
        } else if id == other {
            object.clone()
        } else {
            id.to_owned()
        }
    }

    /// The interpretation of pictures that the robot gets, given the honest one.
    pub(super) fn perceived(&mut self, mut honest: Perceived, kinds: &[KnownKind]) -> Perceived {
        let category = self.kind.as_ref().map(|kind| kind.category.as_str());
        let changed = match self.sabotage.robot.filter(|_| self.armed) {
            Some(Defect::SwappedPercepts) => misperception::swap(&mut honest.things, category),
            Some(Defect::MistakenKind) => {
                misperception::mistake(&mut honest.things, category, kinds)
            }
            Some(Defect::FalseHeight) => misperception::raise(&mut honest.things),
            _ => false,
        };
        self.defective |= changed;
        honest
    }

    /// The robot's measurements, given the honest ones.
    pub(super) fn observation(&self, honest: Observation) -> Observation {
        match &self.frozen {
            // Time is not measured by a sensor, so it is not frozen.
            Some(frozen) => Observation {
                time_secs: honest.time_secs,
                ..frozen.clone()
            },
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
                ActionReport {
                    succeeded,
                    message: if succeeded { "done" } else { "could not do it" }.to_owned(),
                }
            }
            _ => honest,
        }
    }

    fn is_time_for(&self, moment: Moment, world: &World) -> bool {
        let Some(start) = &self.start else {
            return false;
        };
        let now = world.snapshot();
        if matches!(moment, Moment::Driving | Moment::DrivingLoaded) {
            let ([x0, y0, _], [x, y, _]) = (start.robot.base_true, now.robot.base_true);
            let is_loaded = moment == Moment::Driving || forced_hand::in_hand(&now).is_some();
            return is_loaded && libm::hypot(x - x0, y - y0) > DRIVEN_M;
        }
        let Some(object) = &self.object else {
            return false;
        };
        let (Some(was), Some(is)) = (body(start, object), body(&now, object)) else {
            return false;
        };
        let hangs = holds(&now, object) && is.touches.iter().all(|other| other == "robot");
        match moment {
            Moment::Reaching => box_distance(is, now.robot.gripper.position) < REACHING_M,
            Moment::Grasping => {
                holds(&now, object) && is.pose.position[2] - was.pose.position[2] < CARRIED_M
            }
            Moment::Carrying => hangs && is.pose.position[2] - was.pose.position[2] > CARRIED_M,
            Moment::Lowering => {
                let place = self.place.as_deref().and_then(|place| body(&now, place));
                hangs && place.is_some_and(|place| is_above(is, place))
            }
            Moment::LetGo => {
                holds(start, object) && !is.touches.iter().any(|other| other == "robot")
            }
            Moment::Starting | Moment::Driving | Moment::DrivingLoaded => false,
        }
    }

    /// Causes the accident. Returns `true` if it was possible.
    fn happen(&mut self, accident: Accident, world: &mut World) -> bool {
        let now = world.snapshot();
        let object = self.object.as_deref().unwrap_or_default();
        match accident {
            Accident::HandOpens => self.opening_m = Some(world.profile().hand.max_opening_m),
            Accident::HandJams => self.opening_m = Some(0.0),
            Accident::Slippery => return world.perturb(object, Perturbation::Friction(0.0)),
            Accident::Falls => return world.perturb(object, Perturbation::Fall),
            Accident::Teleport => {
                let there = body(&now, object).map(|is| farther(is, now.robot.base_true));
                return there.is_some_and(|there| world.perturb(object, Perturbation::Pose(there)));
            }
            Accident::NeighbourFalls => {
                let neighbour = others_by_distance(&now, object)
                    .first()
                    .map(|body| body.id.clone());
                return neighbour.is_some_and(|id| world.perturb(&id, Perturbation::Fall));
            }
            Accident::InTheWay => {
                let thing = now
                    .bodies
                    .iter()
                    .find(|body| !body.fixed && body.id != object);
                let there =
                    thing.map(|thing| (thing.id.clone(), before(thing, now.robot.base_true)));
                return there
                    .is_some_and(|(id, there)| world.perturb(&id, Perturbation::Pose(there)));
            }
            Accident::CarriedOff => return world.kidnap(outside(world, now.robot.base_true)),
            Accident::PushedIntoFurniture => return forced::push_base(world),
            Accident::ArmThroughHead => return forced::arm_through_head(world),
            Accident::Drags => {
                self.stuck = forced_hand::drag(world);
                return self.stuck.is_some();
            }
            Accident::NeighbourMoved => return forced_hand::move_neighbour(world, object),
            Accident::Sweeps => return forced_hand::sweep(world),
            Accident::PushesWithHeld => return forced_hand::push_with_held(world),
            Accident::RunawayMotor => {
                self.runaway = forced::run_away(world);
                return self.runaway.is_some();
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn idle(world: Option<(Moment, Accident)>, report: Option<bool>) -> Saboteur {
        Saboteur::new(Sabotage {
            actions: &[],
            robot: None,
            world,
            report,
        })
    }

    fn report(succeeded: bool) -> ActionReport {
        ActionReport {
            succeeded,
            message: "done".to_owned(),
        }
    }

    #[test]
    fn only_a_report_against_the_actions_belief_is_a_lie() {
        for (told, honest, lied) in [
            (true, false, true),
            (true, true, false),
            (false, true, true),
            (false, false, false),
        ] {
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
