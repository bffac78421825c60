//! The interface of a skill: joint commands, measurements and noisy perception. Ground truth is not
//! accessible.

use nalgebra::Isometry3;

use crate::controls::Drives;
use crate::grip::GripWatch;
use crate::memory::{Held, Memory, Standing};
use crate::pace::Course;
use crate::place::carried_n;
use crate::sabotage::IDLE_SECS;
use crate::{Cut, ExternalFault, Saboteur};
use actcheck_data::{
    ActionReport, ChoiceName, Choices, KnownKind, Look, Perceived, Percept, Phase, RobotProfile,
};
use actcheck_scenario::FloorPlan;
use actcheck_world::{
    Command, DepthImage, JointKind, Kinematics, Layout, Observation, RgbImage, Sighting, World,
};

/// Reason why a skill has to stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Interrupt {
    /// A fault of the simulation.
    Fault,
    /// The action's time budget is exhausted.
    Budget,
    /// Something holds back a joint of the robot, as the sentence says.
    HeldUp(String),
    /// The run is cut off.
    Cut,
    /// The external skill made more requests than the action's budget allows, as the sentence says.
    Requests(String),
    /// The campaign is interrupted: the run is not needed.
    Stopped,
    /// A fault of the external skill.
    ExternalSkill(ExternalFault),
}

/// A joint this far behind its target is held back. Unit: metres. Three times the lag of a joint
/// that carries a load.
const HELD_BACK_M: f64 = 0.03;
/// As [`HELD_BACK_M`], for revolute joints. Unit: radians.
const HELD_BACK_RAD: f64 = 0.1;
/// Time for which the base has to be that far behind: while its pose estimate changes, it falls
/// behind and catches up. Unit: seconds.
const BASE_BEHIND_SECS: f64 = 0.4;
/// Time for a robot that gives up to come to rest. Unit: seconds.
const GIVE_UP_SECS: f64 = 0.5;

/// The robot as a skill sees it, for the duration of one action.
pub struct Operator<'a> {
    pub(super) world: &'a mut World,
    choices: &'a mut Choices,
    memory: &'a mut Memory,
    pub(super) command: Command,
    start_secs: f64,
    pub(super) budget_secs: f64,
    /// Moving setpoints of an external controller.
    pub(super) drives: Drives,
    cut: Cut,
    /// Injects faults on purpose; usually `None`.
    saboteur: Option<&'a mut Saboteur>,
    /// Watches the grip while the hand holds an object.
    grip: Option<GripWatch>,
    /// Phases begun so far.
    pub phases: Vec<Phase>,
    /// Objects seen so far.
    pub percepts: Vec<Percept>,
    /// Interpretation of the pictures so far.
    pub perceived: Option<Perceived>,
    /// The moment of the last picture; `None` before the first.
    last_look: Option<Look>,
    /// Number of perceptions that an external skill requested.
    requests: u64,
}

impl<'a> Operator<'a> {
    /// The robot at the beginning of an action with a budget of `budget_secs` of simulated time,
    /// with optional interference.
    pub fn new(
        world: &'a mut World,
        choices: &'a mut Choices,
        memory: &'a mut Memory,
        budget_secs: f64,
        (cut, saboteur): (Cut, Option<&'a mut Saboteur>),
    ) -> Self {
        let (mut command, start_secs) = (world.hold(), world.time_secs());
        if memory.held.is_some() {
            // A hand that holds an object keeps pressing.
            command.gripper_opening_m = 0.0;
        }
        let (phases, percepts) = (Vec::new(), Vec::new());
        Self {
            world,
            choices,
            memory,
            command,
            start_secs,
            budget_secs,
            drives: Drives::default(),
            cut,
            saboteur,
            grip: None,
            phases,
            percepts,
            perceived: None,
            last_look: None,
            requests: 0,
        }
    }

    /// Runs a skill, unless the robot is sabotaged into doing nothing. The report can be sabotaged
    /// too.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn act(
        &mut self,
        skill: impl FnOnce(&mut Self) -> Result<ActionReport, Interrupt>,
    ) -> Result<ActionReport, Interrupt> {
        let believed = if self.saboteur.as_deref().is_some_and(Saboteur::idles) {
            self.wait(IDLE_SECS)?;
            ActionReport {
                succeeded: false,
                message: "did nothing".to_owned(),
            }
        } else {
            match skill(self) {
                Err(Interrupt::HeldUp(behind)) => self.give_up(&behind)?,
                done => done?,
            }
        };
        Ok(match &mut self.saboteur {
            None => believed,
            Some(saboteur) => saboteur.report(believed),
        })
    }

    /// Stops all joints where they are, and reports that one of them is held back.
    fn give_up(&mut self, behind: &str) -> Result<ActionReport, Interrupt> {
        self.begin("held back");
        self.command.positions = self.observe().positions;
        self.wait(GIVE_UP_SECS)?;
        Ok(ActionReport {
            succeeded: false,
            message: format!("something holds the robot back: {behind}"),
        })
    }

    /// Begins a phase with this name.
    pub fn begin(&mut self, phase: &str) {
        self.phases.push(Phase {
            name: phase.to_owned(),
            start_secs: self.elapsed_secs(),
        });
    }

    /// Simulated time since the action began. Unit: seconds.
    pub fn elapsed_secs(&self) -> f64 {
        self.world.time_secs() - self.start_secs
    }

    /// The robot's geometry.
    pub fn kinematics(&self) -> &Kinematics {
        self.world.kinematics()
    }

    /// The roles of the joints.
    pub fn layout(&self) -> &Layout {
        self.world.layout()
    }

    /// The robot's knowledge about itself.
    pub fn profile(&self) -> &RobotProfile {
        self.world.profile()
    }

    /// Whether the gripper is a suction cup.
    pub fn has_cup(&self) -> bool {
        self.profile().hand.suction.is_some()
    }

    /// The robot's measurements of itself.
    pub fn observe(&self) -> Observation {
        let observed = self.world.observe();
        match &self.saboteur {
            None => observed,
            Some(saboteur) => saboteur.observation(observed),
        }
    }

    /// Pose of the base. Frame: world, by the robot's own belief.
    pub fn base(&self) -> Isometry3<f64> {
        self.base_of(&self.observe().positions)
    }

    /// Pose of the base for given joint positions.
    pub fn base_of(&self, positions: &[f64]) -> Isometry3<f64> {
        let links = self.kinematics().links(positions);
        // The link with this index is moved by the joint before it.
        let link = self.layout().base.map_or(0, |[.., heading]| heading + 1);
        links.get(link).copied().unwrap_or_else(Isometry3::identity)
    }

    /// The last commanded joint positions.
    pub fn commanded(&self) -> &[f64] {
        &self.command.positions
    }

    /// The kinds of objects that the robot can recognise.
    pub fn known_kinds(&self) -> &[KnownKind] {
        self.world.drive().known_kinds()
    }

    /// The robot's map of its world.
    pub fn floor_plan(&self) -> &FloorPlan {
        self.world.drive().floor_plan()
    }

    /// The kind of object that a designator's value refers to. Returns `None` if the scene has no
    /// object with this id.
    pub fn kind_of(&self, id: &str) -> Option<KnownKind> {
        self.world.kind_of(id)
    }

    /// Takes a picture with the camera.
    pub fn look(&mut self) -> DepthImage {
        self.look_at_every(1)
    }

    /// As [`Operator::look`], with only every n-th pixel of every n-th row measured, from the first
    /// on.
    pub fn look_at_every(&mut self, stride: usize) -> DepthImage {
        self.last_look = Some(self.world.current_look());
        self.world.look_at_every(stride, self.choices)
    }

    /// Takes a colour picture with the camera.
    pub fn picture(&mut self) -> RgbImage {
        self.last_look = Some(self.world.current_look());
        self.world.picture(self.choices)
    }

    /// Selects the sequence of postures that an arm planner samples: a number from 0 to 1, recorded
    /// like every choice.
    pub fn choose_samples(&mut self) -> f64 {
        self.choices.simple(ChoiceName::MotionSamples, 0.0, 1.0)
    }

    /// Knowledge from earlier actions of the run.
    pub fn memory(&self) -> &Memory {
        self.memory
    }

    /// Keeps the interpretation of pictures for later actions and for the trace, with the moment of
    /// the last picture.
    pub fn remember(&mut self, perceived: Perceived) {
        let mut perceived = Perceived {
            look: self.last_look,
            ..perceived
        };
        if let Some(saboteur) = &mut self.saboteur {
            perceived = saboteur.perceived(perceived, self.world.drive().known_kinds());
        }
        self.memory.perceived = Some(perceived.clone());
        self.perceived = Some(perceived);
    }

    /// Keeps the obstacles that a drive saw on the floor, for later drives and for the arm.
    pub fn remember_floor(&mut self, floor: Vec<Standing>) {
        self.memory.floor = floor;
    }

    /// Keeps the object now held, for later actions; `None` once the hand is empty.
    pub fn hold(&mut self, held: Option<Held>) {
        if held.is_none() {
            self.grip = None;
        }
        self.memory.held = held;
    }

    /// Starts watching whether the held object stays in the hand; if it is held at a wall, with the
    /// thickness of this.
    pub fn watch_grip(&mut self, wall_m: Option<f64>) {
        let watch = GripWatch::new(&self.observe(), self.profile().hand.grip_force_n);
        self.grip = Some(match wall_m {
            Some(wall_m) => watch.of_wall(wall_m),
            None => watch,
        });
    }

    /// Whether a slip was felt since the watch began.
    pub fn felt_slip(&self) -> bool {
        self.grip.as_ref().is_some_and(GripWatch::slipped)
    }

    /// The load of the arm while the hold was last felt, since the watch began. Unit: newtons.
    pub fn felt_load_n(&self) -> f64 {
        self.grip.as_ref().map_or(0.0, GripWatch::load_n)
    }

    /// Fixed furniture and drive targets, according to the floor plan that the base uses.
    pub fn known_furniture(&self) -> Vec<Sighting> {
        self.world.known_furniture()
    }

    /// The same if the robot has a map of this world, otherwise `None`.
    pub fn map_of_furniture(&self) -> Option<Vec<Sighting>> {
        let has_map = self.world.drive().has_map();
        has_map.then(|| self.known_furniture())
    }

    /// Records a percept from the pictures of this action or, without any, from those of an earlier
    /// action.
    pub fn record_percept(&mut self, seen: &Sighting) {
        let recalled = self
            .memory
            .perceived
            .as_ref()
            .and_then(|perceived| perceived.look);
        self.record_percept_of(seen, self.last_look.or(recalled));
    }

    fn record_percept_of(&mut self, seen: &Sighting, look: Option<Look>) {
        self.percepts.push(Percept {
            id: seen.id.clone(),
            pose: seen.pose,
            size_m: seen.size_m,
            look,
        });
    }

    /// Looks at one object with an abstract detector: the true pose with noise, and never a missed
    /// detection. Returns `None` if the scene has no object with this id.
    pub fn see(&mut self, id: &str) -> Option<Sighting> {
        let seen = match &mut self.saboteur {
            None => self.world.perceive(id, self.choices)?,
            Some(saboteur) => {
                let seen = self
                    .world
                    .perceive(&saboteur.seen_instead(id), self.choices)?;
                saboteur.sighting(Sighting {
                    id: id.to_owned(),
                    ..seen
                })
            }
        };
        self.record_percept_of(&seen, Some(self.world.current_look()));
        Some(seen)
    }

    /// Looks at every object except one.
    pub fn see_others(&mut self, but: &str) -> Vec<Sighting> {
        self.see_where(|id| id != but)
    }

    /// Looks at every object whose id is accepted.
    pub fn see_where(&mut self, wanted: impl Fn(&str) -> bool) -> Vec<Sighting> {
        let ids = self.world.visible();
        ids.iter()
            .filter(|id| wanted(id))
            .filter_map(|id| self.see(id))
            .collect()
    }

    /// Senses the gap between the fingers. Unit: metres.
    pub fn feel_opening(&mut self) -> f64 {
        let felt = self.world.feel_opening(self.choices);
        match &self.saboteur {
            None => felt,
            // The sabotaged gap plus the sensor's error.
            Some(_) => {
                felt + self.observe().gripper_opening_m - self.world.observe().gripper_opening_m
            }
        }
    }

    /// Moves through joint positions, at rest at both ends, within the joints' velocity limits and
    /// in at least `least_secs`.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn follow(&mut self, path: &[Vec<f64>], least_secs: f64) -> Result<(), Interrupt> {
        self.follow_until(path, least_secs, |_| false).map(|_| ())
    }

    /// Like [`Self::follow`], but stops as soon as `enough` returns `true`. Returns whether it
    /// stopped early.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn follow_until(
        &mut self,
        path: &[Vec<f64>],
        least_secs: f64,
        mut enough: impl FnMut(&Self) -> bool,
    ) -> Result<bool, Interrupt> {
        let mut course = vec![self.command.positions.clone()];
        course.extend_from_slice(path);
        let tick = self.world.tick_secs();
        let course = Course::new(course, self.kinematics());
        let secs = course.secs(self.kinematics(), &self.layout().arm, least_secs, tick);
        let (mut time, mut behind_secs) = (0.0, 0.0);
        while time < secs {
            time += tick;
            self.command.positions = course.at(time, secs);
            self.tick()?;
            let positions = self.observe().positions;
            if let Some(behind) = self.held_back(&positions, self.layout().arm.iter()) {
                return Err(Interrupt::HeldUp(behind));
            }
            match self.held_back(&positions, self.layout().base.iter().flatten()) {
                Some(behind) if behind_secs > BASE_BEHIND_SECS => {
                    return Err(Interrupt::HeldUp(behind));
                }
                Some(_) => behind_secs += tick,
                None => behind_secs = 0.0,
            }
            if enough(self) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// A sentence about one of these joints that is far behind its target.
    fn held_back<'b>(
        &self,
        positions: &[f64],
        mut joints: impl Iterator<Item = &'b usize>,
    ) -> Option<String> {
        joints.find_map(|idx| {
            let idx = *idx;
            let joint = &self.kinematics().joints()[idx];
            let most = if joint.kind == JointKind::Prismatic {
                HELD_BACK_M
            } else {
                HELD_BACK_RAD
            };
            let off = (positions[idx] - self.command.positions[idx]).abs();
            (off > most).then(|| {
                let (off, unit) = match joint.kind {
                    JointKind::Prismatic => (off * 100.0, "cm"),
                    JointKind::Revolute => (off.to_degrees(), "degrees"),
                };
                format!("{} is {off:.1} {unit} behind its target", joint.name)
            })
        })
    }

    /// Control period. Unit: seconds.
    pub fn tick_secs(&self) -> f64 {
        self.world.tick_secs()
    }

    /// Commands joints to positions and advances one tick; other joints keep their targets.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn send(&mut self, joints: &[usize], positions: &[f64]) -> Result<(), Interrupt> {
        self.aim(joints, positions);
        self.tick()
    }

    /// Sets the targets of joints.
    pub fn aim(&mut self, joints: &[usize], positions: &[f64]) {
        for (joint, position) in joints.iter().zip(positions) {
            if let Some(commanded) = self.command.positions.get_mut(*joint) {
                *commanded = *position;
            }
        }
    }

    /// Sets the target gap between the fingers, with the profile's grip force.
    pub fn set_opening(&mut self, opening_m: f64) {
        self.command.gripper_opening_m = opening_m;
        self.command.grip_force_n = self.profile().hand.grip_force_n;
    }

    /// Whether the run is cut off now. Ticks check it; a skill that waits or perceives must check
    /// it itself.
    ///
    /// # Errors
    /// [`Interrupt::Cut`].
    pub fn check_cut(&self) -> Result<(), Interrupt> {
        if self.cut.is_due(self.world.time_secs()) {
            Err(Interrupt::Cut)
        } else {
            Ok(())
        }
    }

    /// Counts a request of an external skill for perception, for which no simulated time passes. An
    /// action may make one for each control tick of its budget, so that a skill that polls without
    /// end is ended like one that moves without end, and the trace of an action is bounded.
    ///
    /// # Errors
    /// [`Interrupt::Requests`] if there are more, [`Interrupt::Cut`] if the run is cut off.
    pub fn count_request(&mut self) -> Result<(), Interrupt> {
        self.check_cut()?;
        self.requests += 1;
        let ticks = (self.budget_secs / self.world.tick_secs()).ceil().max(1.0);
        #[expect(clippy::cast_precision_loss, reason = "an hour has 216,000 ticks")]
        if self.requests as f64 > ticks {
            return Err(Interrupt::Requests(format!(
                "the action made more than {ticks} requests for perception, one for each control tick of its budget of {} s",
                self.budget_secs
            )));
        }
        Ok(())
    }

    /// Waits for a simulated time.
    ///
    /// # Errors
    /// [`Interrupt`] if the action has to end.
    pub fn wait(&mut self, secs: f64) -> Result<(), Interrupt> {
        let until = self.world.time_secs() + secs;
        while self.world.time_secs() < until {
            self.tick()?;
        }
        Ok(())
    }

    pub(super) fn tick(&mut self) -> Result<(), Interrupt> {
        match &mut self.saboteur {
            None => self.world.step(&self.command),
            Some(saboteur) => saboteur.step(self.world, &self.command),
        }
        self.world.track_base(self.choices);
        if self.world.fault().is_some() {
            return Err(Interrupt::Fault);
        }
        if let Some(mut watch) = self.grip.take() {
            watch.look(&self.observe(), carried_n(self));
            self.grip = Some(watch);
        }
        if self.elapsed_secs() > self.budget_secs {
            return Err(Interrupt::Budget);
        }
        if self.cut.is_due(self.world.time_secs()) {
            return Err(Interrupt::Cut);
        }
        Ok(())
    }
}
