//! The robot in the engine and its joint controllers: motors with limits, coupled fingers.

use std::sync::Arc;

use parry3d::bounding_volume::BoundingSphere;
use rapier3d::prelude::{MultibodyJointHandle, PhysicsWorld, RigidBody, RigidBodyHandle};

use crate::assemble::{insert_joints, insert_links, links_on_floor};
use crate::effective_mass::{CARRIED_SHARE, LIGHT_KG, least_effective_mass_kg};
use crate::free_motion::Equations;
use crate::motor::Motor;
use crate::motor_law::{Law, State};
use crate::other_engine::EngineState;
use crate::ownership::{Hand, Ownership};
use crate::playback::Setpoint;
use crate::{Kinematics, WorldError};
use actcheck_data::{JointState, RobotProfile, RobotStart};
use actcheck_geometry::Ball;
use actcheck_robot::Layout;
use actcheck_robot::Robot;
use actcheck_robot::Twist;
use actcheck_robot::{Joint, RobotModel};

/// The robot, its bodies in the engine, and its joint controllers.
pub struct SimulatedRobot {
    /// Its profile.
    pub profile: Arc<RobotProfile>,
    /// Its links and joints.
    pub model: Arc<RobotModel>,
    /// Its geometry.
    pub kinematics: Kinematics,
    /// Body of each link.
    pub bodies: Vec<RigidBodyHandle>,
    /// Its joints by role.
    pub layout: Layout,
    /// Links of the fingertips, left and right.
    pub finger_links: [usize; 2],
    /// All links of the fingers, left and right: see [`Named::fingers`](actcheck_robot::Named).
    pub fingers: [Vec<usize>; 2],
    pub(super) motors: Vec<Motor>,
    /// Links that do not collide with the floor.
    pub(super) off_floor: Vec<bool>,
    /// The bounding ball of each link's shapes, in its frame; `None` for links without shapes.
    pub(super) balls: Vec<Option<Ball>>,
    /// The bounding balls of each link's shapes, one by one, each in the frame of its shape, in the
    /// order of its colliders.
    pub(super) balls_of_shapes: Vec<Vec<BoundingSphere>>,
    /// Positions of the joints.
    pub(super) positions: Vec<f64>,
    /// Velocities of the joints.
    pub(super) velocities: Vec<f64>,
    /// The part of the robot that the engine moves.
    pub(super) ownership: Ownership,
    /// The engine's joint that carries the hand, if it moves the hand alone.
    pub(super) carrier: Option<MultibodyJointHandle>,
    /// The hand; `None` if it can't be moved alone.
    pub(super) hand: Option<Hand>,
    /// Whether its arm is light: the engine then never moves the hand alone.
    pub(super) is_light: bool,
    /// Largest mass of the objects at the hand with which the engine moves it alone. Unit:
    /// kilograms.
    pub(super) most_carried_kg: f64,
    /// Whether the objects at its hand have more than this mass. The engine then solves its motors
    /// as those of a light arm: as constraints, they let held objects creep.
    pub(super) is_loaded: bool,
    /// Whether the engine solves its motors, except those of the fingers, as springs.
    pub(super) is_springy: bool,
    /// The force of contacts on the hand in the last step, if the engine moves the hand alone.
    /// Frame: world.
    pub(super) push_on_hand: Twist,
    /// The equations of its free motion in this control tick, once they are known.
    pub(super) equations: Option<Box<Equations>>,
}

fn balls_of_shapes(engine: &PhysicsWorld, body: RigidBodyHandle) -> Vec<BoundingSphere> {
    let handles = engine
        .bodies
        .get(body)
        .map(RigidBody::colliders)
        .unwrap_or_default();
    let colliders = handles
        .iter()
        .filter_map(|handle| engine.colliders.get(*handle));
    colliders
        .map(|collider| collider.shape().compute_local_bounding_sphere())
        .collect()
}

impl SimulatedRobot {
    /// Inserts the robot into the engine, in its home posture.
    ///
    /// # Errors
    /// [`WorldError`] if profile and URDF don't match.
    pub fn insert(
        engine: &mut PhysicsWorld,
        robot: &Robot,
        start: &RobotStart,
    ) -> Result<Self, WorldError> {
        let Robot {
            profile,
            model,
            named,
            ..
        } = robot;
        let profile = Arc::clone(profile);
        let (kinematics, _, positions) = robot.at(start);
        let bodies = insert_links(
            engine,
            model,
            &kinematics.links(&positions),
            named,
            &profile,
        );
        let motors = insert_joints(engine, model, &bodies, named, &profile)?;
        let off_floor = links_on_floor(model, named, &profile);
        let balls = model
            .links
            .iter()
            .map(|link| Ball::around(&link.solids))
            .collect();
        let balls_of_shapes = bodies
            .iter()
            .map(|body| balls_of_shapes(engine, *body))
            .collect();
        let hand = Hand::of(model, &named.layout.gripper);
        let mut robot = Self {
            model: Arc::clone(model),
            layout: named.layout.clone(),
            profile,
            kinematics,
            bodies,
            finger_links: named.finger_links,
            fingers: named.fingers.clone(),
            motors,
            off_floor,
            balls,
            balls_of_shapes,
            velocities: vec![0.0; positions.len()],
            positions,
            ownership: Ownership::Whole,
            carrier: None,
            hand,
            is_light: false,
            most_carried_kg: 0.0,
            is_loaded: false,
            is_springy: false,
            push_on_hand: Twist::ZERO,
            equations: None,
        };
        let effective_kg = least_effective_mass_kg(&robot);
        robot.is_light = effective_kg.is_some_and(|mass_kg| mass_kg < LIGHT_KG);
        robot.most_carried_kg = CARRIED_SHARE * effective_kg.unwrap_or(0.0);
        robot.is_springy = robot.is_light || model.has_many_pieces();
        for (motor, position) in robot.motors.iter_mut().zip(&robot.positions) {
            motor.target = *position;
            motor.setpoint = *position;
        }
        robot.finish_owned_joints(engine);
        robot.put_state(engine);
        Ok(robot)
    }

    /// Returns the measured joint positions and velocities.
    pub fn state(&self) -> (Vec<f64>, Vec<f64>) {
        (self.positions.clone(), self.velocities.clone())
    }

    /// Returns the state of all joints, with their limits.
    pub fn joint_states(&self) -> Vec<JointState> {
        let states = self
            .model
            .joints
            .iter()
            .zip(self.positions.iter().zip(&self.velocities));
        states
            .map(|(joint, (position, velocity))| JointState {
                name: joint.name.clone(),
                position: *position,
                velocity: *velocity,
                lower: joint.lower,
                upper: joint.upper,
                max_velocity: joint.velocity,
                max_effort: joint.effort,
            })
            .collect()
    }

    /// Returns the force of each finger's motor by its control law; positive closes; 0 for a
    /// suction cup. Unit: newtons.
    pub fn finger_efforts(&self) -> [f64; 2] {
        let force_of = |(idx, effort_per_n): (usize, f64)| {
            let (motor, position) = (&self.motors[idx], self.positions[idx]);
            let effort = motor.stiffness * (position - motor.setpoint)
                + motor.damping * (self.velocities[idx] - motor.setpoint_velocity);
            effort.clamp(-motor.max_effort, motor.max_effort) / effort_per_n
        };
        self.layout
            .gripper
            .sides()
            .map_or([0.0; 2], |sides| sides.map(force_of))
    }

    /// Returns the effort that each joint's motor gave in the last control tick, within its limit
    /// and without gravity compensation: for holding, pushing and braking. Units: newtons or newton
    /// metres.
    pub fn loads(&self) -> Vec<f64> {
        self.motors.iter().map(|motor| motor.effort).collect()
    }

    /// Returns the effort of each motor in the last control tick as a share of the joint's limit.
    pub fn effort_shares(&self) -> Vec<f64> {
        let motors = self.motors.iter().zip(&self.model.joints);
        motors
            .map(|(motor, joint)| {
                if joint.effort > 0.0 {
                    motor.effort.abs() / joint.effort
                } else {
                    0.0
                }
            })
            .collect()
    }

    /// Starts a control tick: measures its efforts, and finds its equations of motion anew.
    pub fn begin_tick(&mut self) {
        self.equations = None;
        self.motors.iter_mut().for_each(|motor| motor.effort = 0.0);
    }

    /// Measures the efforts of a step that is this share of its control tick.
    pub fn measure(&mut self, engine: &PhysicsWorld, holding: &[f64], share: f64) {
        let parameters = &engine.integration_parameters;
        let (dt, n_substeps) = (
            f64::from(parameters.dt),
            parameters.num_solver_iterations as f64,
        );
        for (idx, (motor, position)) in self.motors.iter_mut().zip(&self.positions).enumerate() {
            let held = holding.get(idx).copied().unwrap_or(0.0);
            motor.effort += share * motor.effort_of_step(*position, held, dt, n_substeps);
        }
    }

    /// Sets a joint's target position, clamped to its limits. Limits that are not in order, which
    /// are a fault, leave it.
    pub fn aim(&mut self, joint: usize, target: f64) {
        let Joint { lower, upper, .. } = self.model.joints[joint];
        if target.is_finite() && lower <= upper {
            self.motors[joint].target = target.clamp(lower, upper);
        }
    }

    /// Sets the targets of mimic joints outside of the gripper to those of their leaders: their
    /// motors must not resist the coupling.
    pub fn aim_followers(&mut self) {
        for idx in 0..self.motors.len() {
            if let Some((leader, factor, offset)) = self.model.joints[idx].mimic
                && !self.layout.gripper.contains(idx)
            {
                self.aim(idx, factor * self.motors[leader].target + offset);
            }
        }
    }

    /// Returns a joint's target position.
    pub fn target(&self, joint: usize) -> f64 {
        self.motors[joint].target
    }

    /// Sets effort control for the given joints (by index), and position control for all others.
    /// Fingers are always position-controlled.
    pub fn push(&mut self, efforts: &[(usize, f64)]) {
        for (idx, motor) in self.motors.iter_mut().enumerate() {
            let told = efforts
                .iter()
                .find(|(joint, effort)| *joint == idx && effort.is_finite());
            let limit = self.model.joints[idx].effort * motor.strength;
            motor.push = told
                .filter(|_| !self.layout.gripper.contains(idx))
                .map(|(_, effort)| effort.clamp(-limit, limit));
        }
    }

    /// Lets a joint's motor give a multiple of its largest effort, as a faulty one does.
    pub fn overdrive(&mut self, joint: usize, strength: f64) {
        if let Some(motor) = self.motors.get_mut(joint) {
            motor.strength = strength;
        }
    }

    /// Limits the force of both fingers. Unit: newtons.
    pub fn limit_grip(&mut self, force: f64) {
        for (idx, effort_per_n) in self.layout.gripper.motors() {
            if force.is_finite() {
                self.motors[idx].max_effort =
                    (force * effort_per_n).clamp(0.0, self.model.joints[idx].effort);
            }
        }
    }

    /// Returns the name of a joint whose state, target or limits are not finite or contradict each
    /// other. `None` if there is none.
    pub fn invalid_joint(&self) -> Option<&str> {
        let states = self.positions.iter().zip(&self.velocities);
        let mut joints = self.motors.iter().zip(&self.model.joints).zip(states);
        let is_valid = |motor: &Motor, joint: &Joint, position: f64, velocity: f64| {
            position.is_finite()
                && velocity.is_finite()
                && motor.is_valid()
                && joint.lower <= joint.upper
        };
        let found = joints.find(|((motor, joint), (position, velocity))| {
            !is_valid(motor, joint, **position, **velocity)
        });
        found.map(|((_, joint), _)| joint.name.as_str())
    }

    /// Moves the setpoints by a whole control tick, and returns them, for another engine.
    pub fn next_setpoints(&mut self, tick_secs: f64) -> Vec<Setpoint> {
        for motor in &mut self.motors {
            if motor.push.is_none() {
                let largest = motor.fastest * tick_secs;
                let change = (motor.target - motor.setpoint).clamp(-largest, largest);
                motor.setpoint += change;
                motor.setpoint_velocity = change / tick_secs;
            }
        }
        self.motors.iter().map(Motor::setpoint).collect()
    }

    /// Takes the state that another engine gives it, and moves its links there.
    pub fn follow(&mut self, engine: &mut PhysicsWorld, state: &EngineState) {
        self.positions.clone_from(&state.positions);
        self.velocities.clone_from(&state.velocities);
        for (motor, load) in self.motors.iter_mut().zip(&state.loads) {
            motor.effort = *load;
        }
        self.place_links(engine);
    }

    /// Steps the joint controllers: setpoints approach the targets evenly over the `steps_left` of
    /// the tick, within the velocity limits. Motors follow the setpoints, with gravity compensation
    /// for the robot but not for held objects.
    pub fn control(
        &mut self,
        engine: &mut PhysicsWorld,
        holding: &[f64],
        dt: f64,
        steps_left: u32,
    ) {
        let substep_secs = dt / engine.integration_parameters.num_solver_iterations as f64;
        for (idx, motor) in self.motors.iter_mut().enumerate() {
            let held = holding.get(idx).copied().unwrap_or(0.0);
            let largest = motor.fastest * dt;
            let position = self.positions[idx];
            if let Some(effort) = motor.push {
                motor.give(
                    position,
                    self.velocities[idx],
                    effort + held,
                    self.model.joints[idx].velocity,
                );
                continue;
            }
            let change =
                ((motor.target - motor.setpoint) / f64::from(steps_left)).clamp(-largest, largest);
            motor.setpoint += change;
            motor.setpoint_velocity = change / dt;
            motor.began = position;
            motor.keep_near(position, motor.fastest, substep_secs);
            motor.law = Law {
                target: motor.setpoint + held / motor.stiffness,
                velocity: motor.setpoint_velocity,
                stiffness: motor.stiffness,
                damping: motor.damping,
                most: motor.max_effort,
            };
        }
        let states = self.positions.iter().zip(&self.velocities);
        let states = states.map(|(position, velocity)| State {
            position: *position,
            velocity: *velocity,
        });
        for (idx, (motor, at)) in self
            .motors
            .iter()
            .zip(states)
            .enumerate()
            .filter(|(idx, _)| self.engine_moves(*idx))
        {
            let is_spring =
                (self.is_springy || self.is_loaded) && !self.layout.gripper.contains(idx);
            let spring_secs = is_spring.then_some(substep_secs);
            motor.tell(
                engine,
                &self.model.joints[idx],
                at,
                motor.fastest * dt,
                spring_secs,
            );
        }
    }

    /// Returns whether a link is a finger, whose surface is a pad.
    pub(super) fn is_pad(&self, link: usize) -> bool {
        let moves_further = |joint: usize| self.layout.gripper.moves_further_finger(joint);
        self.finger_links.contains(&link) || link.checked_sub(1).is_some_and(moves_further)
    }

    /// Returns the joints between the root and a link.
    pub(super) fn joints_to(&self, link: usize) -> impl Iterator<Item = usize> {
        let parent = |joint: &usize| self.model.joints[*joint].parent.checked_sub(1);
        std::iter::successors(link.checked_sub(1), parent)
    }

    /// Returns whether a joint moves a link.
    pub(super) fn moves(&self, joint: usize, link: usize) -> bool {
        self.joints_to(link).any(|moving| moving == joint)
    }

    /// Moves the base at once, with everything attached to it; the other joints keep their
    /// positions. Units: metres, metres, radians.
    pub fn shift_base(&mut self, engine: &mut PhysicsWorld, by: [f64; 3]) {
        let Some(base) = self.layout.base else { return };
        for (idx, shift) in base.into_iter().zip(by) {
            let motor = &mut self.motors[idx];
            motor.target += shift;
            motor.setpoint += shift;
            self.positions[idx] += shift;
        }
        self.place_links(engine);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;
    use crate::bodies::Bodies;
    use crate::gripper_tests::checked;
    use crate::simulation::tests::{bodies, bodies_mut, tick};
    use crate::{World, build, ik};
    use actcheck_base::Files;
    use actcheck_data::{Camera, Choices, DecorRanges, Odometry, Physics, Scene, Sensing};
    use actcheck_geometry::from_pose;

    pub(crate) fn lonely() -> World {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        alone(
            actcheck_config::robot::read(&Files::Shipped, path)
                .expect("the shipped robot is valid")
                .complete()
                .expect("it states all roles"),
        )
    }

    /// A robot with nothing around it.
    pub(crate) fn alone(profile: RobotProfile) -> World {
        let profile = Arc::new(profile);
        let one = (1.0, 1.0);
        let scene = Scene {
            map: actcheck_data::SceneMap::default(),
            world: "empty".to_owned(),
            objects: Vec::new(),
            robot: RobotStart {
                profile,
                base: [-1.0, 0.3, 0.4],
                root_height_m: 0.0,
                knows: Arc::new([]),
            },
            designators: BTreeMap::new(),
            steps: Vec::new(),
            sensing: Sensing {
                position_noise_m: 0.0,
                height_noise_m: 0.0,
                yaw_noise_rad: 0.0,
                size_noise_m: 0.0,
                localisation_noise_m: 0.0,
                heading_noise_rad: 0.0,
                gripper_noise_m: 0.0,
                odometry: Odometry::IDEAL,
                camera: Camera::IDEAL,
                decor: DecorRanges::PLAIN,
            },
            physics: Physics {
                mass_scale: one,
                friction_scale: one,
                size_scale: (1.0, 1.0),
                restitution: (0.0, 0.0),
                steps_per_second: 240,
                iterations: 2,
                shortcuts: true,
            },
        };
        build(&scene).expect("the scene is valid")
    }

    /// A random posture within the limits.
    fn posture(world: &World, choices: &mut Choices) -> Vec<f64> {
        let joints = world.kinematics().joints().iter();
        joints
            .map(|joint| choices.real("q".into(), joint.lower.max(-2.0), joint.upper.min(2.0), 0.0))
            .collect()
    }

    #[test]
    fn the_engine_and_our_kinematics_agree_on_link_poses() {
        let mut world = lonely();
        let mut choices = Choices::random(3, 0);
        for _ in 0..20 {
            let positions = posture(&world, &mut choices);
            let Bodies { robot, physics, .. } = bodies_mut(&mut world);
            robot.positions = positions;
            robot.put_state(physics);
            robot.take_state(physics);
            let poses = robot.kinematics.links(&robot.positions);
            for (body, pose) in robot.bodies.iter().zip(&poses) {
                let simulated = from_pose(physics.bodies[*body].position());
                assert!((simulated.translation.vector - pose.translation.vector).norm() < 1e-5);
                assert!(simulated.rotation.angle_to(&pose.rotation) < 2e-3);
            }
        }
    }

    #[test]
    fn inverse_kinematics_solutions_reach_their_target_within_the_limits() {
        let world = lonely();
        let mut choices = Choices::random(5, 0);
        let (kinematics, layout) = (world.kinematics(), world.layout());
        let mut mobility = vec![0.0; kinematics.joints().len()];
        for idx in layout.arm.iter().chain(layout.base.iter().flatten()) {
            mobility[*idx] = 1.0;
        }
        let mut n_solved = 0;
        for _ in 0..100 {
            let target = kinematics.grasp(&posture(&world, &mut choices));
            let seed = posture(&world, &mut choices);
            let reach = ik::IkRequest {
                target,
                mobility: mobility.clone(),
            };
            let Some(found) = ik::solve(kinematics, &seed, &reach) else {
                continue;
            };
            n_solved += 1;
            let miss = kinematics.grasp(&found).translation.vector - target.translation.vector;
            assert!(miss.norm() < 1e-3);
            for (position, joint) in found.iter().zip(kinematics.joints()) {
                assert!(
                    (joint.lower..=joint.upper).contains(position),
                    "{} at {position}",
                    joint.name
                );
            }
            assert!(layout.gripper.joints().all(|idx| found[idx] == seed[idx]));
        }
        assert!(
            n_solved >= 60,
            "solved {n_solved} of 100 from random postures"
        );
    }

    /// A constant force on a free joint: acceleration is force over mass, up to the joint's largest
    /// speed.
    #[test]
    fn commanded_efforts_accelerate_joints_up_to_their_velocity_limit() {
        let mut world = lonely();
        let base = world.layout().base.expect("it drives")[0];
        let (joint, mass) = (
            world.kinematics().joints()[base].clone(),
            bodies(&world).robot.model.links[base + 1..].iter(),
        );
        let mass: f64 = mass.map(|link| link.mass).sum();
        let force = 0.25 * mass;
        assert!(force < joint.effort);
        let mut command = world.hold();
        command.efforts = vec![(base, force)];
        for _ in 0..30 {
            world.step(&command);
        }
        let reached = world.observe().velocities[base];
        let expected = force / mass * 30.0 * world.tick_secs();
        assert!(
            (reached - expected).abs() < 0.05 * expected,
            "{reached} m/s instead of {expected} m/s"
        );
        assert!((world.observe().loads[base] - force).abs() < 1e-9);
        command.efforts = vec![(base, 1e9)];
        (0..120).for_each(|_| world.step(&command));
        let fastest = world.observe().velocities[base];
        assert!(
            (fastest / joint.velocity - 1.0).abs() < 0.03,
            "{fastest} m/s instead of {} m/s",
            joint.velocity
        );
        let still = world.hold();
        (0..120).for_each(|_| world.step(&still));
        assert!(world.observe().velocities[base].abs() < 1e-2);
    }

    /// Published models have joints whose viscous friction is as strong as their motors.
    #[test]
    fn joints_with_strong_friction_keep_up_with_their_targets() {
        let with_friction = |damping: f64| {
            let mut profile = bodies(&lonely()).robot.profile.as_ref().clone();
            let limit = r#"effort="50" velocity="1.5"/>"#;
            let (before, after) = profile
                .core
                .urdf
                .text
                .split_once(limit)
                .expect("the shipped robot has such a joint");
            let after = after.replacen(r#"damping="0.5""#, &format!("damping=\"{damping}\""), 1);
            let text = format!("{before}{limit}{after}");
            let urdf = actcheck_base::Source::new("slow.urdf", text);
            profile.core =
                actcheck_config::robot::with_urdf(profile.core, urdf).expect("it is a URDF");
            alone(profile)
        };
        let find = |world: &World| {
            let joints = world.kinematics().joints();
            let joint = joints
                .iter()
                .position(|joint| joint.name == "wrist_flex_joint")
                .expect("it is shipped");
            (joint, joints[joint].velocity)
        };
        for (damping, fastest) in [(0.5, 1.5), (20.0, 1.5), (100.0, 0.75 * 50.0 / 100.0)] {
            let mut world = with_friction(damping);
            let (joint, velocity) = find(&world);
            assert!(
                (velocity - fastest).abs() < 1e-9,
                "{velocity} rad/s with {damping} N·m·s"
            );
            let mut command = world.hold();
            for _ in 0..40 {
                command.positions[joint] += 0.9 * fastest * world.tick_secs();
                world.step(&command);
            }
            let lag = (world.observe().positions[joint] - command.positions[joint]).abs();
            assert!(lag < 0.05, "{lag} rad behind with {damping} N·m·s");
        }
    }

    /// A panic about `min > max` ended the run of a robot whose state was not a number.
    #[test]
    fn a_joint_whose_state_or_limits_are_not_numbers_is_a_fault() {
        type Spoil = fn(&mut SimulatedRobot, usize);
        let spoils: [Spoil; 5] = [
            |robot, joint| robot.velocities[joint] = f64::NAN,
            |robot, joint| robot.positions[joint] = f64::INFINITY,
            |robot, joint| robot.motors[joint].target = f64::NAN,
            |robot, joint| robot.motors[joint].max_effort = f64::NAN,
            |robot, joint| Arc::make_mut(&mut robot.model).joints[joint].lower = 9.0,
        ];
        for (idx, spoil) in spoils.into_iter().enumerate() {
            let mut world = lonely();
            let joint = world.layout().arm[1];
            let command = world.hold();
            world.step(&command);
            spoil(&mut bodies_mut(&mut world).robot, joint);
            tick(&mut world);
            let name = world.kinematics().joints()[joint].name.clone();
            assert_eq!(world.fault(), Some(&crate::Fault::Joint(name)), "{idx}");
            world.step(&command);
        }
    }

    #[test]
    fn a_profile_that_names_a_missing_joint_is_refused_with_help() {
        let mut profile = bodies(&lonely()).robot.profile.as_ref().clone();
        profile.arm_joints[1] = "arm_flx_joint".to_owned();
        let refused = checked(&profile)
            .expect_err("the joint is missing")
            .diagnostic();
        assert_eq!(
            (refused.code, refused.help.as_deref()),
            ("W021", Some("did you mean `arm_flex_joint`?"))
        );
        profile.core.tree = Arc::default();
        assert_eq!(
            checked(&profile)
                .expect_err("it has no links")
                .diagnostic()
                .code,
            "W020"
        );
    }
}
