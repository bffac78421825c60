//! The engine's part of a world: steps physics, with the mechanisms that the physics engine lacks,
//! and finds faults.
//!
//! Never: knows the robot's beliefs, or records anything.

use std::panic::{AssertUnwindSafe, catch_unwind};

use actcheck_data::{CONTROL_HZ, CupState, Scene};
use actcheck_robot::Robot;
use rapier3d::prelude::RigidBodyHandle;

use crate::attach::attach;
use crate::bodies::{Bodies, Clock};
use crate::contacts::{self, Touches, is_pushed_hard, push_on_hand};
use crate::departure::Departures;
use crate::furniture::Furniture;
use crate::hollows;
use crate::link_pairs::{LinkPairs, prepare_contacts};
use crate::object::{self, Object};
use crate::other_engine::{OtherEngine, Puppeteer};
use crate::patches::Patches;
use crate::physics::{add_floor, engine};
use crate::playback::Playback;
use crate::proximity::Proximity;
use crate::reach::Reach;
use crate::robot::SimulatedRobot;
use crate::suction::Cup;
use crate::watch::Watch;
use crate::{Fault, WorldError};

/// Steps the bodies of a world.
pub struct Engine {
    bodies: Bodies,
    /// The engine's substeps in each step of the whole robot.
    substeps: usize,
    /// The robot's suction cup; `None` if its gripper has fingers.
    cup: Option<Cup>,
    departures: Departures,
    furniture: Furniture,
    link_pairs: LinkPairs,
    patches: Patches,
    watch: Watch,
    /// Another engine, which steps the bodies instead.
    puppeteer: Option<Puppeteer>,
}

impl Engine {
    /// Inserts the objects of a scene and its robot, which was compiled before.
    ///
    /// # Errors
    /// [`WorldError`] if the robot or the physics settings are unusable.
    pub(super) fn build(scene: &Scene, robot: &Robot) -> Result<Self, WorldError> {
        let mut physics = engine(&scene.physics)?;
        let floor = add_floor(&mut physics);
        let robot = SimulatedRobot::insert(&mut physics, robot, &scene.robot)?;
        let mut objects: Vec<Object> = scene
            .objects
            .iter()
            .enumerate()
            .map(|(idx, object)| object::insert(&mut physics, idx, object))
            .collect();
        let handles: Vec<RigidBodyHandle> = objects.iter().map(|object| object.body).collect();
        for (idx, attachment) in attach(&mut physics, &scene.objects, &handles) {
            objects[idx].attached = Some(attachment);
        }
        let steps_per_second = scene.physics.steps_per_second;
        let clock = Clock {
            n_steps: 0,
            steps_per_tick: (steps_per_second / CONTROL_HZ).max(1),
            steps_per_second,
        };
        let cup = robot.profile.hand.suction.map(Cup::new);
        let mut bodies = Bodies {
            physics,
            objects,
            robot,
            floor,
            left: std::collections::BTreeSet::new(),
            clock,
        };
        let link_pairs = LinkPairs::of(&bodies);
        link_pairs.group_links(&mut bodies);
        Ok(Self {
            bodies,
            substeps: scene.physics.iterations as usize,
            cup,
            departures: Departures::default(),
            furniture: Furniture::default(),
            link_pairs,
            patches: Patches::default(),
            watch: Watch::default(),
            puppeteer: None,
        })
    }

    /// Sets the substeps in each step of the whole robot.
    #[cfg(test)]
    pub(super) fn set_substeps(&mut self, substeps: usize) {
        self.substeps = substeps;
    }

    /// Returns the bodies.
    pub(super) fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    /// Returns the bodies, to command or to disturb them.
    pub(super) fn bodies_mut(&mut self) -> &mut Bodies {
        &mut self.bodies
    }

    /// Returns the fault of the simulation, or `None` if there is none. A fault is permanent.
    pub(super) fn fault(&self) -> Option<&Fault> {
        self.departures.fault()
    }

    /// Returns the pairs of links that collide with each other.
    pub(super) fn link_pairs(&self) -> &LinkPairs {
        &self.link_pairs
    }

    /// Lets the robot's links pass through each other, or collide again.
    pub(super) fn let_links_pass(&mut self, pass: bool) {
        self.link_pairs.let_pass(pass);
    }

    /// Returns all contacts and the seal of a suction cup, by ordered pair of owners.
    pub(super) fn touches(&self) -> Touches {
        if let Some(puppeteer) = &self.puppeteer {
            return puppeteer.touches().clone();
        }
        let seal = self.cup.as_ref().and_then(|cup| cup.touch(&self.bodies));
        contacts::touches(&self.bodies, seal)
    }

    /// Returns the gap between the fingers; for a suction cup, 0 while its vacuum is on, otherwise
    /// its diameter. Unit: metres.
    pub(super) fn opening_m(&self, positions: &[f64]) -> f64 {
        self.cup.as_ref().map_or_else(
            || self.bodies.robot.layout.gripper.opening_m(positions),
            Cup::opening_m,
        )
    }

    /// Returns the force of each finger's motor; for a suction cup, the force of its vacuum, in the
    /// place of both fingers. Unit: newtons.
    pub(super) fn grip_forces_n(&self) -> [f64; 2] {
        self.cup.as_ref().map_or_else(
            || self.bodies.robot.finger_efforts(),
            |cup| [cup.suction_n(); 2],
        )
    }

    /// Returns the state of the suction cup. Returns `None` if the gripper has fingers.
    pub(super) fn cup_state(&self) -> Option<CupState> {
        self.cup.as_ref().map(Cup::state)
    }

    /// Returns the object that a suction cup holds, by its index.
    pub(super) fn sealed(&self) -> Option<usize> {
        self.cup.as_ref().and_then(Cup::sealed)
    }

    /// Switches the vacuum of a suction cup on or off, by the commanded opening and force.
    pub(super) fn switch_vacuum(&mut self, opening_m: f64, force_n: f64) {
        if let Some(cup) = &mut self.cup {
            cup.switch(&mut self.bodies.physics, opening_m, force_n);
        }
    }

    /// Lets another engine step the bodies from now on.
    pub(super) fn move_by(&mut self, engine: Box<dyn OtherEngine>, start: &Playback) {
        match Puppeteer::begin(engine, &mut self.bodies, start) {
            Ok(puppeteer) => self.puppeteer = Some(puppeteer),
            Err(why) => self.departures.other_engine_failed(why),
        }
    }

    /// Performs the steps of a control tick, unless there is a fault. Returns whether the tick
    /// ended without one.
    pub(super) fn tick(&mut self, proximity: &mut Proximity) -> bool {
        if self.fault().is_some() {
            return false;
        }
        if let Some(puppeteer) = &mut self.puppeteer {
            if let Err(why) = puppeteer.tick(&mut self.bodies) {
                self.departures.other_engine_failed(why);
            }
            return self.fault().is_none();
        }
        if let Some(cup) = &mut self.cup {
            cup.seal_surface(&mut self.bodies);
        }
        let robot = &self.bodies.robot;
        let poses = robot.kinematics.links(&robot.positions);
        let holding = robot.kinematics.holding_efforts_at(&poses);
        // Furniture that slides, and a seal, are joints that only the whole engine solves.
        let is_tied = self.furniture.slides() || self.sealed().is_some();
        let reach = proximity.update(&mut self.bodies, &self.link_pairs, is_tied, poses);
        hollows::close_hollows(&mut self.bodies, proximity.shortcuts(), reach);
        self.step_all(proximity, reach, &holding)
    }

    /// Performs the steps of a tick in which the robot can touch this. Returns whether they ended
    /// without a fault.
    pub(super) fn step_all(
        &mut self,
        proximity: &mut Proximity,
        mut reach: Reach,
        holding: &[f64],
    ) -> bool {
        let Clock {
            steps_per_tick,
            steps_per_second,
            ..
        } = self.bodies.clock;
        let dt = 1.0 / f64::from(steps_per_second);
        self.bodies.robot.begin_tick();
        prepare_contacts(&mut self.bodies);
        self.patches.rub(&mut self.bodies, reach);
        for step in 0..steps_per_tick {
            if reach == Reach::Hand && is_pushed_hard(&self.bodies) {
                proximity.need_whole();
                reach = Reach::All;
            }
            let Bodies { physics, robot, .. } = &mut self.bodies;
            // The engine and the equations of free motion fail on numbers that are not finite.
            if let Some(joint) = robot.invalid_joint() {
                self.departures.fault_of_joint(joint.to_owned());
                return false;
            }
            proximity.set_substeps(physics, self.substeps, reach);
            robot.hand_over(physics, reach.ownership());
            robot.control(physics, holding, dt, steps_per_tick - step);
            let ends_tick = step + 1 == steps_per_tick;
            self.step_robot(reach, dt, ends_tick);
            let share = 1.0 / f64::from(steps_per_tick);
            let Bodies { physics, robot, .. } = &mut self.bodies;
            robot.measure(physics, holding, share);
            if let Some(cup) = &mut self.cup {
                cup.measure_seal(physics, share, step == 0);
            }
            self.bodies.clock.n_steps += 1;
            // Without the engine, no body moves before the end of the tick.
            if ends_tick || reach != Reach::Nothing {
                self.departures.check(&mut self.bodies, &self.link_pairs);
            }
            if self.fault().is_some() {
                return false;
            }
        }
        if let Some(cup) = &mut self.cup {
            cup.judge_seal(&mut self.bodies.physics);
        }
        true
    }

    /// Performs one step of physics; links that the engine does not move follow at the end of the
    /// tick.
    fn step_robot(&mut self, reach: Reach, dt: f64, ends_tick: bool) {
        let Bodies { physics, robot, .. } = &mut self.bodies;
        if reach != Reach::All {
            robot.move_freely(physics);
        }
        match reach {
            Reach::Nothing if ends_tick => robot.place_links(physics),
            Reach::Nothing => {}
            Reach::Apart | Reach::Hand => {
                robot.lead_hand(physics, dt);
                if ends_tick {
                    robot.lead_links(physics);
                }
                self.step_physics();
            }
            Reach::All => self.step_physics(),
        }
        let Bodies { physics, robot, .. } = &mut self.bodies;
        robot.take_state(physics);
        self.bodies.robot.push_on_hand = push_on_hand(&self.bodies);
    }

    fn step_physics(&mut self) {
        let began_secs = self.watch.now_secs();
        let (physics, link_pairs) = (&mut self.bodies.physics, &self.link_pairs);
        // After a panic, the world has a fault and takes no further step.
        let step = catch_unwind(AssertUnwindSafe(|| {
            physics.step_with_events(link_pairs, &())
        }));
        if let Err(panic) = step {
            self.departures.engine_panicked(words_of(panic.as_ref()));
        }
        self.watch.stepped(began_secs);
    }

    /// Takes the contacts after a tick into account: objects that the robot moves may leave the
    /// world, and furniture that it pushes slides.
    pub(super) fn end_tick(&mut self, touches: &Touches) {
        if self.puppeteer.is_some() {
            return;
        }
        self.departures.record(&self.bodies, touches);
        self.furniture.move_pushed(&mut self.bodies, touches);
    }

    /// Measures the wall time from now on, with a clock in seconds.
    pub(super) fn start_watch(&mut self, clock_secs: fn() -> f64) {
        self.watch = Watch::new(clock_secs);
    }

    /// Returns the watch.
    pub(super) fn watch(&self) -> &Watch {
        &self.watch
    }

    /// Returns the wall time of the engine's steps since [`World::watch`](crate::World::watch); 0
    /// without it. Unit: seconds.
    pub fn engine_secs(&self) -> f64 {
        self.watch.engine_secs()
    }

    /// Returns the wall time of camera images since [`World::watch`](crate::World::watch); 0
    /// without it. Unit: seconds.
    pub fn camera_secs(&self) -> f64 {
        self.watch.camera_secs()
    }

    /// Returns whether the engine swept fast shapes in the last tick, so that they pass through
    /// nothing fixed.
    pub fn swept(&self) -> bool {
        self.bodies.physics.integration_parameters.max_ccd_substeps > 0
    }

    /// Returns whether all tubes of an object are closed, and there is one: for comparisons.
    pub fn is_closed(&self, id: &str) -> bool {
        hollows::are_closed(&self.bodies, id)
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
