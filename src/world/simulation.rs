//! The simulation of a scene, stepped by commands to the robot: a world of four parts, each with
//! its own state.
//!
//! - The engine ([`Engine`]) steps the bodies and finds faults. Mechanisms that the physics engine
//!   lacks are parts of it, as are the contacts of the last step.
//! - The drive ([`Drive`]) is the robot's side: commands, sensors, and where it believes to be.
//! - [`Proximity`] decides before each tick which things the robot can touch.
//! - The [`Recorder`] measures each tick.
//!
//! No part knows the world, and the parts know each other only in this order: proximity, engine,
//! drive, recorder.

use std::sync::{Arc, OnceLock};

use crate::camera::{self, DepthImage};
use crate::drive::{Command, Drive, Observation};
use crate::engine::Engine;
use crate::forms::forms;
use crate::observe::snapshot;
use crate::other_engine::OtherEngine;
use crate::overlaps::{Overlap, overlaps};
use crate::perturbation;
use crate::picture::{self, LazySkins, Skins, Stage};
use crate::proximity::Proximity;
use crate::reach::Shortcuts;
use crate::recorder::{Record, Recorder};
use crate::sense::{self, Sighting};
use crate::settle::{MOST_SECS, REST_SECS, Settling, moving};
use crate::{Fault, Kinematics, Layout, Perturbation, Poison, WorldError};
use actcheck_data::{Choices, Decor, KnownKind, Look, Part, RobotProfile, Scene, Snapshot};
use actcheck_geometry::RgbImage;
use actcheck_robot::Robot;

/// A simulation of one scene. Each worker has its own.
pub struct World {
    engine: Engine,
    drive: Drive,
    proximity: Proximity,
    recorder: Recorder,
    shown: Shown,
}

/// Surfaces and light of colour images, for which the simulation has no use.
#[derive(Default)]
struct Shown {
    skins: Option<Arc<LazySkins>>,
    decor: Option<Decor>,
    /// The bodies, once an image was taken.
    stage: OnceLock<Stage>,
}

/// Builds the simulation of a scene, before any step: see [`World::settle`].
///
/// # Errors
/// [`WorldError`] if the robot's files or the physics settings are unusable.
pub fn build(scene: &Scene) -> Result<World, WorldError> {
    build_with(scene, &Robot::compile(&scene.robot.profile)?)
}

/// As [`build`], with the scene's robot, which was compiled before. If the profile of the scene is
/// another one, its robot is compiled.
///
/// # Errors
/// As [`build`].
pub fn build_with(scene: &Scene, robot: &Robot) -> Result<World, WorldError> {
    if !Arc::ptr_eq(&robot.profile, &scene.robot.profile) {
        return build(scene);
    }
    let engine = Engine::build(scene, robot)?;
    let shortcuts = match scene.physics.shortcuts {
        true => Shortcuts::default(),
        false => Shortcuts::NONE,
    };
    Ok(World {
        recorder: Recorder::new(engine.bodies()),
        engine,
        drive: Drive::of(scene),
        proximity: Proximity::with(shortcuts),
        shown: Shown::default(),
    })
}

/// Starts a playback for another engine at the present state: see [`Recorder::playback`].
pub fn keep_playback(world: &mut World) {
    world.recorder.keep_playback(&world.engine);
}

/// Lets another engine step the bodies from now on, and starts the playback of its run. An engine
/// that can't begin is a fault.
pub fn move_by(world: &mut World, engine: Box<dyn OtherEngine>) {
    keep_playback(world);
    if let Some(start) = world.recorder.playback() {
        world.engine.move_by(engine, start);
    }
}

impl World {
    /// Returns the part that steps physics.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Returns the part that commands the robot, senses and believes.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Returns the part that decides which things the robot can touch.
    pub fn proximity(&self) -> &Proximity {
        &self.proximity
    }

    /// Returns the part that measures each tick.
    pub fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    /// Returns the simulated time since the scene was built. Unit: seconds.
    pub fn time_secs(&self) -> f64 {
        self.engine.bodies().time_secs()
    }

    /// Returns the length of a control tick. Unit: seconds.
    pub fn tick_secs(&self) -> f64 {
        self.engine.bodies().tick_secs()
    }

    /// Returns the fault of the simulation, or `None` if there is none. A fault is permanent.
    pub fn fault(&self) -> Option<&Fault> {
        self.engine.fault()
    }

    /// Returns the robot's geometry. Its root is the world's origin by the robot's own belief.
    pub fn kinematics(&self) -> &Kinematics {
        &self.engine.bodies().robot.kinematics
    }

    /// Returns the robot's joints by role.
    pub fn layout(&self) -> &Layout {
        &self.engine.bodies().robot.layout
    }

    /// Returns the robot's profile.
    pub fn profile(&self) -> &RobotProfile {
        &self.engine.bodies().robot.profile
    }

    /// Returns the kind of the object with this id, which is part of the robot's task; it does not
    /// reveal the object's pose. Returns `None` if there is no such id.
    pub fn kind_of(&self, id: &str) -> Option<KnownKind> {
        let bodies = self.engine.bodies();
        let model = &bodies.objects[bodies.index_of(id)?].model;
        Some(KnownKind::of(model))
    }

    /// Lets the simulation come to rest, with the robot holding its posture, until every object is
    /// at rest or time is up.
    pub fn settle(&mut self) -> Settling {
        let start = self.time_secs();
        let mut rests_since = start;
        while self.time_secs() - start < MOST_SECS && self.fault().is_none() {
            self.tick();
            if !moving(self.engine.bodies()).is_empty() {
                rests_since = self.time_secs();
            }
            if self.time_secs() - rests_since >= REST_SECS {
                break;
            }
        }
        let secs = self.time_secs() - start;
        Settling::of(self.engine.bodies(), secs, self.fault().is_some())
    }

    /// Performs one control tick: passes the command to the controllers, steps physics, and records
    /// the state.
    ///
    /// Does not step the simulation after a fault.
    pub fn step(&mut self, command: &Command) {
        self.drive.take(&mut self.engine, command);
        self.recorder.tell(command);
        self.tick();
    }

    /// Performs one control tick with the previous command.
    fn tick(&mut self) {
        if self.engine.tick(&mut self.proximity) {
            self.record();
        }
    }

    /// Records the state after a tick.
    fn record(&mut self) {
        let (engine, drive) = (&mut self.engine, &self.drive);
        let reach = self.proximity.last_reach();
        if let Some(touches) = self.recorder.record(engine, drive, reach) {
            engine.end_tick(&touches);
            self.recorder.record_frame(engine, drive);
        }
    }

    /// Starts measuring the wall time of the engine's steps and of camera images, with a clock in
    /// seconds.
    pub fn watch(&mut self, clock_secs: fn() -> f64) {
        self.engine.start_watch(clock_secs);
    }

    /// Returns the robot's current measurements.
    pub fn observe(&self) -> Observation {
        self.drive.observe(&self.engine)
    }

    /// Returns the command that holds the current joint positions.
    pub fn hold(&self) -> Command {
        self.drive.hold(&self.engine)
    }

    /// Returns the base's target pose in terms of the robot's current belief, which changes with
    /// each correction of its pose estimate. Returns `None` if the base is fixed.
    pub fn aimed_base(&self) -> Option<[f64; 3]> {
        self.drive.aimed_base(&self.engine.bodies().robot)
    }

    /// Takes an image from the camera's current true pose.
    pub fn look(&self, choices: &mut Choices) -> DepthImage {
        self.look_at_every(1, choices)
    }

    /// Takes an image of which only every n-th pixel of every n-th row is measured, from the first
    /// on: the others are 0.
    pub fn look_at_every(&self, stride: usize, choices: &mut Choices) -> DepthImage {
        let watch = self.engine.watch();
        let began_secs = watch.now_secs();
        let image = camera::look(self.engine.bodies(), &self.drive, stride, choices);
        watch.looked(began_secs);
        image
    }

    /// Sets the surfaces of the bodies, the light and the colours of images. Without them, images
    /// show the collision shapes.
    pub fn show(&mut self, skins: Arc<LazySkins>, decor: Decor) {
        self.shown = Shown {
            skins: Some(skins),
            decor: Some(decor),
            stage: OnceLock::new(),
        };
    }

    /// Takes a colour image from the camera's current true pose.
    pub fn picture(&self, choices: &mut Choices) -> RgbImage {
        let watch = self.engine.watch();
        let began_secs = watch.now_secs();
        let bodies = self.engine.bodies();
        let stage = self.shown.stage.get_or_init(|| {
            let decor = self.shown.decor.unwrap_or(Decor::PLAIN);
            match &self.shown.skins {
                Some(skins) => picture::stage(bodies, skins, &decor),
                None => picture::stage(bodies, &Skins::default(), &decor),
            }
        });
        let image = picture::picture(bodies, &self.drive, stage, choices);
        watch.looked(began_secs);
        image
    }

    /// Returns the data by which a percept of this moment can be compared with the truth.
    pub fn current_look(&self) -> Look {
        self.drive.current_look(self.engine.bodies())
    }

    /// Samples the base's initial pose estimate. Its error stays constant while the base moves,
    /// unless the odometry drifts.
    pub fn localise(&mut self, choices: &mut Choices) {
        self.drive.localise(self.engine.bodies(), choices);
    }

    /// Updates the pose estimate with the base's motion since the last call. Call it after every
    /// tick.
    pub fn track_base(&mut self, choices: &mut Choices) {
        self.drive.track_base(self.engine.bodies(), choices);
    }

    /// Returns all objects with the true poses of their own frames, whose origins are at their
    /// feet.
    pub fn truth(&self) -> Vec<Sighting> {
        sense::truth(self.engine.bodies())
    }

    /// Returns the ids of all objects, in scene order.
    pub fn visible(&self) -> Vec<String> {
        let objects = self.engine.bodies().objects.iter();
        objects.map(|object| object.id.clone()).collect()
    }

    /// Returns the furniture of the floor plan, without noise; it is off only by the error of the
    /// robot's pose estimate. Static objects that are not on the map must be perceived.
    pub fn known_furniture(&self) -> Vec<Sighting> {
        sense::known_furniture(self.engine.bodies())
    }

    /// Perceives one object. Returns `None` if there is no such id.
    pub fn perceive(&self, id: &str, choices: &mut Choices) -> Option<Sighting> {
        sense::perceive(self.engine.bodies(), &self.drive, id, choices)
    }

    /// Returns the gap between the fingers, measured with noise. Unit: metres.
    pub fn feel_opening(&self, choices: &mut Choices) -> f64 {
        self.drive.feel_opening(&self.engine, choices)
    }

    /// Returns the true state of the world.
    pub fn snapshot(&self) -> Snapshot {
        snapshot(&self.engine, &self.drive)
    }

    /// Returns the links of the robot that are inside furniture, objects or the floor, the deepest
    /// first. Things that touch do not count, nor do those that the engine lets pass through each
    /// other, such as wheels and the floor.
    pub fn overlaps(&self) -> Vec<Overlap> {
        overlaps(self.engine.bodies())
    }

    /// Returns the shapes of all objects and links by their names in traces, in the frame of the
    /// object or link. Pieces of meshes are reduced to their outermost points.
    pub fn forms(&self) -> Vec<(String, Vec<Part>)> {
        forms(self.engine.bodies())
    }

    /// Begins a record: resets contacts and extremes; frames continue.
    pub fn begin_record(&mut self) {
        self.recorder.begin(&self.engine, &self.drive);
    }

    /// Ends the record and returns it.
    pub fn end_record(&mut self) -> Record {
        self.recorder.end(self.engine.bodies())
    }

    /// Takes only these shortcuts from now on: for comparisons.
    pub fn take_shortcuts(&mut self, shortcuts: Shortcuts) {
        self.proximity.take(shortcuts);
    }

    /// Applies a perturbation to an object. Returns `false` if there is no such object.
    pub fn perturb(&mut self, id: &str, perturbation: Perturbation) -> bool {
        perturbation::perturb(self.engine.bodies_mut(), id, perturbation)
    }

    /// Disturbs the state of an object, for tests. Returns `false` if there is no such object.
    pub fn poison(&mut self, id: &str, poison: Poison) -> bool {
        let bodies = self.engine.bodies_mut();
        let Some(object) = bodies.index_of(id) else {
            return false;
        };
        let is_done = perturbation::poison(bodies, object, poison);
        if let (true, Poison::Decoy(pose)) = (is_done, poison) {
            self.drive.show_at(object, pose.to_isometry());
        }
        is_done
    }

    /// Moves the robot to another pose (x, y, heading) without changing its pose estimate. Returns
    /// `false` if its base is fixed.
    pub fn kidnap(&mut self, to: [f64; 3]) -> bool {
        self.drive.kidnap(self.engine.bodies_mut(), to)
    }

    /// Lets the robot's links pass through each other, or collide again. Their depth in each other
    /// is still measured.
    pub fn let_links_pass(&mut self, pass: bool) {
        self.engine.let_links_pass(pass);
    }

    /// Lets the motor of a joint, by its index, give a multiple of its largest effort. Fingers
    /// excepted.
    pub fn overdrive(&mut self, joint: usize, strength: f64) {
        self.engine.bodies_mut().robot.overdrive(joint, strength);
    }
}

/// The inside of a world, for the tests of its parts.
#[cfg(test)]
pub(super) mod tests {
    use super::World;
    use crate::Command;
    use crate::bodies::Bodies;
    use crate::reach::Reach;

    pub(crate) fn bodies(world: &World) -> &Bodies {
        world.engine.bodies()
    }

    pub(crate) fn bodies_mut(world: &mut World) -> &mut Bodies {
        world.engine.bodies_mut()
    }

    /// Sets the substeps in each step of the whole robot.
    pub(crate) fn set_substeps(world: &mut World, substeps: usize) {
        world.engine.set_substeps(substeps);
    }

    /// Performs one control tick with the previous command.
    pub(crate) fn tick(world: &mut World) {
        world.tick();
    }

    /// Performs a tick as if the robot could touch this.
    pub(crate) fn step_with(world: &mut World, command: &Command, reach: Reach) {
        world.drive.take(&mut world.engine, command);
        let robot = &world.engine.bodies().robot;
        let holding = robot.kinematics.holding_efforts(&robot.positions);
        if world.engine.step_all(&mut world.proximity, reach, &holding) {
            world.record();
        }
    }
}
