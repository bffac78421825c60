//! The simulation of a scene, stepped by commands to the robot.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::{PhysicsWorld, RigidBodyHandle};

use crate::attach::attach;
use crate::departure::Motions;
use crate::engine::{Owner, add_floor, engine};
use crate::furniture::Sliding;
use crate::link_pairs::LinkPairs;
use crate::object::{self, Object};
use crate::odometry::Tracker;
use crate::patches::Patch;
use crate::proximity::ProximityCache;
use crate::reach::Reach;
use crate::recorder::Recorder;
use crate::robot::SimulatedRobot;
use crate::suction::Cup;
use crate::{Fault, Kinematics, Layout, Poison, WorldError, fault};
use actcheck_data::{CONTROL_HZ, Camera, KnownKind, Pose, RobotProfile, Scene, Sensing};
use actcheck_geometry::{from_pose, from_vector, to_vector};
use actcheck_robot::Robot;
use actcheck_scenario::FloorPlan;

/// A command to the robot's controllers. Positions are clamped to the joint limits; the controllers
/// limit speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Target position of each joint, in the order of [`Kinematics::joints`]; for the base, by its
    /// own belief. Finger joints follow `gripper_opening_m` instead. Units: metres or radians.
    pub positions: Vec<f64>,
    /// Gap between the fingers; 0 switches the vacuum of a suction cup on. Unit: metres.
    pub gripper_opening_m: f64,
    /// Largest force of one finger, or greatest pull of a suction cup. Unit: newtons.
    pub grip_force_n: f64,
    /// Effort-controlled joints, by index, each with its effort in addition to gravity
    /// compensation. Joints stay within their largest speed. Not for fingers. Units: newtons or
    /// newton metres.
    pub efforts: Vec<(usize, f64)>,
}

/// The robot's own measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Simulated time since the scene was built. Unit: seconds.
    pub time_secs: f64,
    /// Joint positions; for the base, by its own belief. Units: metres or radians.
    pub positions: Vec<f64>,
    /// Joint velocities.
    pub velocities: Vec<f64>,
    /// Gap between the fingers, measured by their encoders; for a suction cup, 0 while its vacuum
    /// is on, otherwise its diameter. Unit: metres.
    pub gripper_opening_m: f64,
    /// Force of each finger's motor, left and right; positive closes. For a suction cup, twice the
    /// force of its vacuum by its pressure sensor, 0 without a seal. Unit: newtons.
    pub finger_efforts_n: [f64; 2],
    /// Effort of each joint's motor, without gravity compensation. Units: newtons or newton metres.
    pub loads: Vec<f64>,
}

/// A simulation of one scene. Each worker has its own.
pub struct World {
    pub(super) engine: PhysicsWorld,
    pub(super) objects: Vec<Object>,
    pub(super) robot: SimulatedRobot,
    /// Its suction cup; `None` if its gripper has fingers.
    pub(super) cup: Option<Cup>,
    pub(super) sensing: Sensing,
    /// Transform from the base's true pose to its believed pose. Frame: world.
    pub(super) believed_from_true: Isometry3<f64>,
    pub(super) tracker: Tracker,
    pub(super) recorder: Recorder,
    pub(super) proximity: ProximityCache,
    pub(super) fault: Option<Fault>,
    /// The known motion of each object; empty before the first record.
    pub(super) motions: Vec<Motions>,
    /// The words of a panic in the engine.
    panicked: Option<String>,
    /// The furniture that slides at the moment, by its index.
    pub(super) sliding: BTreeMap<usize, Sliding>,
    /// The links of the robot that collide with each other.
    pub(super) link_pairs: LinkPairs,
    /// Poses at which sensors see objects, by their index, if they differ from the true poses.
    pub(super) decoys: BTreeMap<usize, Isometry3<f64>>,
    knows: Arc<[KnownKind]>,
    /// Whether the robot has a map of the world's furniture.
    pub(super) has_map: bool,
    plan: FloorPlan,
    n_steps: u64,
    pub(super) steps_per_tick: u32,
    steps_per_second: u32,
    /// The engine's substeps in each step of the whole robot.
    pub(super) substeps: usize,
    /// The friction of areas in contact.
    pub(super) patches: BTreeMap<(Owner, Owner), Patch>,
    /// A fixed body for the joints of objects to the floor.
    pub(super) floor: RigidBodyHandle,
    watch: Option<Watch>,
}

/// Measures the engine's time with a clock supplied by the caller.
struct Watch {
    clock_secs: fn() -> f64,
    spent_secs: f64,
    /// In a cell, because taking an image does not change the world.
    camera_secs: Cell<f64>,
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
    let mut engine = engine(&scene.physics)?;
    let floor = add_floor(&mut engine);
    let robot = SimulatedRobot::insert(&mut engine, robot, &scene.robot)?;
    let mut objects: Vec<Object> = scene
        .objects
        .iter()
        .enumerate()
        .map(|(idx, object)| object::insert(&mut engine, idx, object))
        .collect();
    attach(&mut engine, &scene.objects, &mut objects);
    let steps_per_second = scene.physics.steps_per_second;
    let steps_per_tick = (steps_per_second / CONTROL_HZ).max(1);
    let tick_secs = f64::from(steps_per_tick) / f64::from(steps_per_second);
    let tracks = tracks(&objects, &robot);
    let mut world = World {
        engine,
        recorder: Recorder::new(objects.len(), tracks, tick_secs),
        objects,
        cup: robot.profile.suction.map(Cup::new),
        robot,
        sensing: scene.sensing.clone(),
        believed_from_true: Isometry3::identity(),
        tracker: Tracker::default(),
        proximity: ProximityCache::default(),
        fault: None,
        motions: Vec::new(),
        panicked: None,
        sliding: BTreeMap::new(),
        link_pairs: LinkPairs::default(),
        decoys: BTreeMap::new(),
        knows: Arc::clone(&scene.robot.knows),
        has_map: !scene.map.is_empty(),
        plan: FloorPlan::of(scene),
        n_steps: 0,
        steps_per_tick,
        steps_per_second,
        substeps: scene.physics.iterations as usize,
        patches: BTreeMap::new(),
        floor,
        watch: None,
    };
    if !scene.physics.shortcuts {
        world.leave_to_engine();
    }
    world.link_pairs = world.find_link_pairs();
    world.link_pairs.wholes = world.wholes();
    world.link_pairs.step_secs = world.engine.integration_parameters.dt;
    world.group_links();
    Ok(world)
}

/// Returns the bodies that can move with their names in traces: objects, then links with shapes.
fn tracks(objects: &[Object], robot: &SimulatedRobot) -> Vec<(String, RigidBodyHandle)> {
    let objects = objects
        .iter()
        .filter(|object| !object.fixed || object.slides)
        .map(|o| (o.id.clone(), o.body));
    let links = robot
        .model
        .links
        .iter()
        .zip(&robot.bodies)
        .skip(1)
        .filter(|(link, _)| !link.solids.is_empty());
    objects
        .chain(links.map(|(link, body)| (format!("robot/{}", link.name), *body)))
        .collect()
}

impl World {
    /// Returns the simulated time since the scene was built. Unit: seconds.
    pub fn time_secs(&self) -> f64 {
        self.n_steps as f64 / f64::from(self.steps_per_second)
    }

    /// Returns the length of a control tick. Unit: seconds.
    pub fn tick_secs(&self) -> f64 {
        f64::from(self.steps_per_tick) / f64::from(self.steps_per_second)
    }

    /// Returns the fault of the simulation, or `None` if there is none. A fault is permanent.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// Returns the robot's geometry. Its root is the world's origin by the robot's own belief.
    pub fn kinematics(&self) -> &Kinematics {
        &self.robot.kinematics
    }

    /// Returns the robot's joints by role.
    pub fn layout(&self) -> &Layout {
        &self.robot.layout
    }

    /// Returns the robot's profile.
    pub fn profile(&self) -> &RobotProfile {
        &self.robot.profile
    }

    /// Returns the kinds of objects that the robot can recognise.
    pub fn known_kinds(&self) -> &Arc<[KnownKind]> {
        &self.knows
    }

    /// Returns the robot's map of its world: walls, furniture and named locations.
    pub fn floor_plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Returns the kind of the object with this id, which is part of the robot's task; it does not
    /// reveal the object's pose. Returns `None` if there is no such id.
    pub fn kind_of(&self, id: &str) -> Option<KnownKind> {
        let model = &self.objects.iter().find(|object| object.id == id)?.model;
        Some(KnownKind::of(model))
    }

    /// Performs one control tick: passes the command to the controllers, steps physics, and records
    /// the state.
    ///
    /// Does not step the simulation after a fault.
    pub fn step(&mut self, command: &Command) {
        self.take(command);
        self.recorder.motion.tell(command);
        self.tick();
    }

    /// Performs one control tick with the previous command.
    pub(super) fn tick(&mut self) {
        if self.fault.is_some() {
            return;
        }
        self.seal_surface();
        let poses = self.robot.kinematics.links(&self.robot.positions);
        let holding = self.robot.kinematics.holding_efforts_at(&poses);
        let reach = self.update_proximity(poses);
        self.close_hollows(reach);
        self.step_all(reach, &holding);
    }

    /// Performs the steps of a tick in which the robot can touch this, and records the state.
    fn step_all(&mut self, mut reach: Reach, holding: &[f64]) {
        let dt = 1.0 / f64::from(self.steps_per_second);
        self.robot.begin_tick();
        self.prepare_contacts();
        self.rub(reach);
        for step in 0..self.steps_per_tick {
            if reach == Reach::Hand && self.is_pushed_hard() {
                self.need_whole();
                reach = Reach::All;
            }
            // The engine and the equations of free motion fail on numbers that are not finite.
            if let Some(joint) = self.robot.invalid_joint() {
                self.fault = Some(Fault::Joint(joint.to_owned()));
                return;
            }
            self.set_substeps(reach);
            self.robot.hand_over(&mut self.engine, reach.ownership());
            self.robot
                .control(&mut self.engine, holding, dt, self.steps_per_tick - step);
            let ends_tick = step + 1 == self.steps_per_tick;
            self.step_robot(reach, dt, ends_tick);
            let share = 1.0 / f64::from(self.steps_per_tick);
            self.robot.measure(&self.engine, holding, share);
            self.measure_seal(share, step == 0);
            self.n_steps += 1;
            // Without the engine, no body moves before the end of the tick.
            if ends_tick || reach != Reach::Nothing {
                self.check_faults();
            }
            if self.fault.is_some() {
                return;
            }
        }
        self.judge_seal();
        self.record();
    }

    /// Performs a tick as if the robot could touch this, for tests.
    #[cfg(test)]
    pub(super) fn step_with(&mut self, command: &Command, reach: Reach) {
        self.take(command);
        let holding = self.robot.kinematics.holding_efforts(&self.robot.positions);
        self.step_all(reach, &holding);
    }

    /// Performs one step of physics; links that the engine does not move follow at the end of the
    /// tick.
    fn step_robot(&mut self, reach: Reach, dt: f64, ends_tick: bool) {
        if reach != Reach::All {
            self.robot.move_freely(&self.engine);
        }
        match reach {
            Reach::Nothing if ends_tick => self.robot.place_links(&mut self.engine),
            Reach::Nothing => {}
            Reach::Apart | Reach::Hand => {
                self.robot.lead_hand(&mut self.engine, dt);
                if ends_tick {
                    self.robot.lead_links(&mut self.engine);
                }
                self.step_engine();
            }
            Reach::All => self.step_engine(),
        }
        self.robot.take_state(&self.engine);
        self.robot.push_on_hand = self.push_on_hand();
    }

    fn step_engine(&mut self) {
        let start = self.watch.as_ref().map(|watch| (watch.clock_secs)());
        let (engine, link_pairs) = (&mut self.engine, &self.link_pairs);
        // After a panic, the world has a fault and takes no further step.
        let step = catch_unwind(AssertUnwindSafe(|| {
            engine.step_with_events(link_pairs, &())
        }));
        if let Err(panic) = step {
            self.panicked = Some(words_of(panic.as_ref()));
        }
        if let (Some(watch), Some(start)) = (&mut self.watch, start) {
            watch.spent_secs += (watch.clock_secs)() - start;
        }
    }

    /// Starts measuring the wall time of the engine's steps, with a clock in seconds.
    pub fn watch(&mut self, clock_secs: fn() -> f64) {
        self.watch = Some(Watch {
            clock_secs,
            spent_secs: 0.0,
            camera_secs: Cell::new(0.0),
        });
    }

    /// Returns the wall time of the engine's steps since [`World::watch`]; 0 without it. Unit:
    /// seconds.
    pub fn engine_secs(&self) -> f64 {
        self.watch.as_ref().map_or(0.0, |watch| watch.spent_secs)
    }

    /// Returns the wall time of camera images since [`World::watch`]; 0 without it. Unit: seconds.
    pub fn camera_secs(&self) -> f64 {
        self.watch
            .as_ref()
            .map_or(0.0, |watch| watch.camera_secs.get())
    }

    /// Returns the clock's time, or `None` without a clock. Unit: seconds.
    pub(super) fn watch_secs(&self) -> Option<f64> {
        self.watch.as_ref().map(|watch| (watch.clock_secs)())
    }

    /// Adds the time of an image that was started at this time. Unit: seconds.
    pub(super) fn looked(&self, began_secs: Option<f64>) {
        if let (Some(watch), Some(began)) = (&self.watch, began_secs) {
            watch
                .camera_secs
                .set(watch.camera_secs.get() + (watch.clock_secs)() - began);
        }
    }

    /// Returns the robot's current measurements.
    pub fn observe(&self) -> Observation {
        let (mut positions, velocities) = self.robot.state();
        let gripper_opening_m = self.opening_m(&positions);
        let loads = self.robot.loads();
        if let Some(base) = self.robot.layout.base {
            let believed = self.believed(base.map(|idx| positions[idx]));
            for (idx, value) in base.into_iter().zip(believed) {
                positions[idx] = value;
            }
        }
        Observation {
            time_secs: self.time_secs(),
            positions,
            velocities,
            gripper_opening_m,
            finger_efforts_n: self.grip_forces_n(),
            loads,
        }
    }

    /// Returns the command that holds the current joint positions.
    pub fn hold(&self) -> Command {
        let observed = self.observe();
        Command {
            positions: observed.positions,
            gripper_opening_m: observed.gripper_opening_m,
            grip_force_n: self.robot.profile.grip_force_n,
            efforts: Vec::new(),
        }
    }

    /// Returns the base's target pose in terms of the robot's current belief, which changes with
    /// each correction of its pose estimate. Returns `None` if the base is fixed.
    pub fn aimed_base(&self) -> Option<[f64; 3]> {
        let base = self.robot.layout.base?;
        Some(self.believed(base.map(|idx| self.robot.target(idx))))
    }

    /// Returns the depth camera's settings.
    pub fn camera(&self) -> &Camera {
        &self.sensing.camera
    }

    /// Disturbs the state of an object, for tests. Returns `false` if there is no such object.
    pub fn poison(&mut self, id: &str, poison: Poison) -> bool {
        let Some(idx) = self.objects.iter().position(|object| object.id == id) else {
            return false;
        };
        let object = &self.objects[idx];
        let Some(body) = self.engine.bodies.get_mut(object.body) else {
            return false;
        };
        match poison {
            Poison::NotFinite => body.set_linvel(to_vector(&Vector3::repeat(f64::NAN)), true),
            Poison::Velocity(velocity) => {
                body.set_linvel(to_vector(&Vector3::from(velocity)), true)
            }
            Poison::Decoy(pose) => _ = self.decoys.insert(idx, pose.to_isometry()),
            Poison::Teleport(position) => {
                body.set_translation(to_vector(&Vector3::from(position)), true)
            }
        }
        true
    }

    fn take(&mut self, command: &Command) {
        let n_joints = self.robot.model.joints.len();
        for (idx, position) in command.positions.iter().enumerate().take(n_joints) {
            let of_base = self
                .robot
                .layout
                .base
                .is_some_and(|base| base.contains(&idx));
            if !of_base && !self.robot.layout.gripper.contains(idx) {
                self.robot.aim(idx, *position);
            }
        }
        if let Some(base) = self.robot.layout.base
            && base.iter().all(|idx| {
                command
                    .positions
                    .get(*idx)
                    .is_some_and(|value| value.is_finite())
            })
        {
            let truly = self.truly(base.map(|idx| command.positions[idx]));
            for (idx, value) in base.into_iter().zip(truly) {
                self.robot.aim(idx, value);
            }
        }
        for idx in 0..n_joints {
            if let Some(target) = self
                .robot
                .layout
                .gripper
                .target(idx, command.gripper_opening_m)
            {
                self.robot.aim(idx, target);
            }
        }
        self.robot.aim_followers();
        self.robot.limit_grip(command.grip_force_n);
        self.switch_vacuum(command.gripper_opening_m, command.grip_force_n);
        self.robot.push(&command.efforts);
    }

    /// Converts a true base pose to the believed one. Headings continue beyond a full turn.
    pub(super) fn believed(&self, base: [f64; 3]) -> [f64; 3] {
        moved(&self.believed_from_true, base)
    }

    /// Converts a believed base pose to the true one.
    fn truly(&self, base: [f64; 3]) -> [f64; 3] {
        moved(&self.believed_from_true.inverse(), base)
    }

    /// Returns the true base pose: x, y, heading.
    pub(super) fn base_true(&self) -> [f64; 3] {
        match self.robot.layout.base {
            Some(base) => {
                let positions = self.robot.state().0;
                base.map(|idx| positions[idx])
            }
            None => {
                let pose = Pose::from_isometry(&self.robot.kinematics.links(&[])[0]);
                [pose.position[0], pose.position[1], pose.yaw()]
            }
        }
    }

    pub(super) fn find_fault(&self) -> Option<Fault> {
        if let Some(words) = &self.panicked {
            return Some(Fault::Engine(words.clone()));
        }
        // Static bodies may reach far below the floor, as foundations do.
        let objects = self.objects.iter().enumerate();
        let objects = objects.map(|(idx, object)| {
            (
                object.id.as_str(),
                object.body,
                !object.fixed && !self.has_left(idx),
            )
        });
        let links = self.robot.model.links.iter().zip(&self.robot.bodies);
        let links = links.map(|(link, body)| (link.name.as_str(), *body, true));
        let quarantined = self.engine.quarantine().bodies();
        for (id, handle, moves) in objects.chain(links) {
            let Some(body) = self.engine.bodies.get(handle) else {
                continue;
            };
            let finite = body.position().is_finite()
                && body.linvel().is_finite()
                && body.angvel().is_finite();
            if !finite || quarantined.contains(&handle) {
                return Some(Fault::NotFinite(id.to_owned()));
            }
            let position = from_vector(body.translation());
            let outside =
                position.xy().norm() > fault::WORLD_RADIUS_M || position.z < -fault::WORLD_DEPTH_M;
            if moves && (outside || position.z > fault::WORLD_RADIUS_M) {
                return Some(Fault::LeftWorld {
                    id: id.to_owned(),
                    position: position.into(),
                });
            }
        }
        self.robot
            .invalid_joint()
            .map(|joint| Fault::Joint(joint.to_owned()))
    }

    /// Returns the pose at which sensors see an object: the true one, unless it has a decoy.
    pub(super) fn shown(&self, idx: usize) -> Isometry3<f64> {
        self.decoys
            .get(&idx)
            .copied()
            .unwrap_or_else(|| self.pose_of(&self.objects[idx]))
    }

    /// Returns the true pose of an object.
    pub(super) fn pose_of(&self, object: &Object) -> Isometry3<f64> {
        self.engine
            .bodies
            .get(object.body)
            .map_or(object.placed, |body| from_pose(body.position()))
    }
}

/// The words of a panic.
fn words_of(panic: &(dyn std::any::Any + Send)) -> String {
    let words = panic.downcast_ref::<String>().map(String::as_str);
    words
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no reason was given")
        .to_owned()
}

fn moved(by: &Isometry3<f64>, [x, y, heading]: [f64; 3]) -> [f64; 3] {
    let point = by * nalgebra::Point3::new(x, y, 0.0);
    [point.x, point.y, heading + Pose::from_isometry(by).yaw()]
}
