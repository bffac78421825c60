//! The robot in the engine and its joint controllers: motors with limits, coupled fingers.

use std::sync::Arc;

use nalgebra::Isometry3;
use rapier3d::prelude::{MultibodyDofCoupling, MultibodyJointHandle, PhysicsWorld, RigidBodyHandle};

use crate::assemble::{home, insert_joints, insert_links, links_on_floor};
use crate::convert::to_real;
use crate::description::{Joint, RobotModel};
use crate::layout::{Layout, Named};
use crate::motor::{Motor, limit_if_near};
use crate::room::Ball;
use crate::{Kinematics, WorldError};
use actcheck_data::{JointState, Pose, RobotProfile, RobotStart};

/// The robot, its bodies in the engine, and its joint controllers.
pub struct Robot {
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
    /// Links of the fingers, left and right.
    pub finger_links: [usize; 2],
    pub(super) motors: Vec<Motor>,
    /// Links that do not collide with the floor.
    pub(super) off_floor: Vec<bool>,
    /// The bounding ball of each link's shapes, in its frame; `None` for links without shapes.
    pub(super) balls: Vec<Option<Ball>>,
}

/// Returns a robot's geometry, layout and home posture, without a simulation.
///
/// # Errors
/// [`WorldError`] if profile and URDF don't match.
pub fn geometry(start: &RobotStart) -> Result<(Kinematics, Layout, Vec<f64>), WorldError> {
    let model = Arc::new(RobotModel::read(&start.profile)?);
    let named = Named::find(&start.profile, &model)?;
    let positions = home(&start.profile, &model, &named, start.base);
    let root = root_of(start, &named.layout);
    let passing = named.passing(&model);
    let kinematics = Kinematics::new(model, root, named.grasp, named.camera).with_passing(passing);
    Ok((kinematics, named.layout, positions))
}

/// Pose of the root link. Frame: world.
fn root_of(start: &RobotStart, layout: &Layout) -> Isometry3<f64> {
    let [x, y, heading] = start.base;
    match layout.base {
        // The root of a mobile robot is above the world's origin, which is the frame of its odometry.
        Some(_) => Isometry3::translation(0.0, 0.0, start.profile.mount_height_m),
        None => Pose::upright([x, y, start.profile.mount_height_m], heading).to_isometry(),
    }
}

/// Passes of the solver in each substep for grippers with coupled joints. In a single pass, the motor's force does not
/// arrive at the fingertips: with 15 N commanded, a finger that turns with five couplings presses with 5 N.
const COUPLED_ITERATIONS: usize = 8;

impl Robot {
    /// Inserts the robot into the engine, in its home posture.
    ///
    /// # Errors
    /// [`WorldError`] if profile and URDF don't match.
    pub fn insert(engine: &mut PhysicsWorld, start: &RobotStart) -> Result<Self, WorldError> {
        let profile = start.profile.clone();
        let model = Arc::new(RobotModel::read(&profile)?);
        let named = Named::find(&profile, &model)?;
        let positions = home(&profile, &model, &named, start.base);
        let root = root_of(start, &named.layout);
        let passing = named.passing(&model);
        let kinematics = Kinematics::new(model.clone(), root, named.grasp, named.camera).with_passing(passing);
        let bodies = insert_links(engine, &model, &kinematics.links(&positions), &named, &profile);
        let motors = insert_joints(engine, &model, &bodies, &named, &profile)?;
        let off_floor = links_on_floor(&model, &named, &profile);
        let balls = model.links.iter().map(|link| Ball::around(&link.solids)).collect();
        let mut robot = Self {
            profile,
            model,
            kinematics,
            bodies,
            layout: named.layout,
            finger_links: named.finger_links,
            motors,
            off_floor,
            balls,
        };
        robot.couple_mimics(engine);
        robot.move_to(engine, &positions);
        Ok(robot)
    }

    /// Returns the measured joint positions and velocities.
    pub fn state(&self, engine: &PhysicsWorld) -> (Vec<f64>, Vec<f64>) {
        let mut positions = Vec::with_capacity(self.motors.len());
        let mut velocities = Vec::with_capacity(self.motors.len());
        for motor in &self.motors {
            let Some((multibody, link)) = engine.multibody_joints.get(motor.joint) else { continue };
            let Some(link) = multibody.link(link) else { continue };
            positions.push(f64::from(link.joint.coords()[motor.axis as usize]));
            velocities.push(f64::from(multibody.joint_velocity(link)[0]));
        }
        (positions, velocities)
    }

    /// Returns the state of all joints, with their limits.
    pub fn joint_states(&self, engine: &PhysicsWorld) -> Vec<JointState> {
        let (positions, velocities) = self.state(engine);
        let states = self.model.joints.iter().zip(positions.into_iter().zip(velocities));
        states
            .map(|(joint, (position, velocity))| JointState {
                name: joint.name.clone(),
                position,
                velocity,
                lower: joint.lower,
                upper: joint.upper,
                max_velocity: joint.velocity,
                max_effort: joint.effort,
            })
            .collect()
    }

    /// Returns the force of each finger's motor by its control law; positive closes. Unit: newtons.
    pub fn finger_efforts(&self, engine: &PhysicsWorld) -> [f64; 2] {
        let (positions, velocities) = self.state(engine);
        self.layout.gripper.sides().map(|(idx, sign, lever_m)| {
            let (motor, position) = (&self.motors[idx], positions[idx]);
            let effort = motor.stiffness * (position - motor.setpoint)
                + motor.damping * (velocities[idx] - motor.setpoint_velocity);
            effort.clamp(-motor.max_effort, motor.max_effort) * sign / lever_m
        })
    }

    /// Returns the effort that each joint's motor gave in the last control tick, within its limit and without gravity
    /// compensation: for holding, pushing and braking. Units: newtons or newton metres.
    pub fn loads(&self) -> Vec<f64> {
        self.motors.iter().map(|motor| motor.effort).collect()
    }

    /// Returns the effort of each motor in the last control tick as a share of the joint's limit.
    pub fn effort_shares(&self) -> Vec<f64> {
        let motors = self.motors.iter().zip(&self.model.joints);
        motors.map(|(motor, joint)| if joint.effort > 0.0 { motor.effort.abs() / joint.effort } else { 0.0 }).collect()
    }

    /// Starts measuring the efforts of a control tick.
    pub fn begin_tick(&mut self) {
        self.motors.iter_mut().for_each(|motor| motor.effort = 0.0);
    }

    /// Measures the efforts of a step that is this share of its control tick.
    pub fn measure(&mut self, engine: &PhysicsWorld, holding: &[f64], share: f64) {
        let parameters = &engine.integration_parameters;
        let (dt, n_substeps) = (f64::from(parameters.dt), parameters.num_solver_iterations as f64);
        let (positions, _) = self.state(engine);
        for (idx, (motor, position)) in self.motors.iter_mut().zip(positions).enumerate() {
            let held = holding.get(idx).copied().unwrap_or(0.0);
            motor.effort += share * motor.effort_of_step(position, held, dt, n_substeps);
        }
    }

    /// Sets a joint's target position, clamped to its limits.
    pub fn aim(&mut self, joint: usize, target: f64) {
        let Joint { lower, upper, .. } = self.model.joints[joint];
        if target.is_finite() {
            self.motors[joint].target = target.clamp(lower, upper);
        }
    }

    /// Sets the targets of mimic joints outside of the gripper to those of their leaders: their motors must not resist
    /// the coupling.
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

    /// Sets effort control for the given joints (by index), and position control for all others. Fingers are always
    /// position-controlled.
    pub fn push(&mut self, efforts: &[(usize, f64)]) {
        for (idx, motor) in self.motors.iter_mut().enumerate() {
            let told = efforts.iter().find(|(joint, effort)| *joint == idx && effort.is_finite());
            let limit = self.model.joints[idx].effort * motor.strength;
            motor.push =
                told.filter(|_| !self.layout.gripper.contains(idx)).map(|(_, effort)| effort.clamp(-limit, limit));
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
        for (idx, lever_m) in self.layout.gripper.motors() {
            self.motors[idx].max_effort = (force * lever_m).clamp(0.0, self.model.joints[idx].effort);
        }
    }

    /// Steps the joint controllers: setpoints approach the targets evenly over the `steps_left` of the tick, within the
    /// velocity limits. Motors follow the setpoints, with gravity compensation for the robot but not for held objects.
    pub fn control(&mut self, engine: &mut PhysicsWorld, holding: &[f64], dt: f64, steps_left: u32) {
        let substep_secs = dt / engine.integration_parameters.num_solver_iterations as f64;
        for (idx, motor) in self.motors.iter_mut().enumerate() {
            let held = holding.get(idx).copied().unwrap_or(0.0);
            let largest = motor.fastest * dt;
            let Some((multibody, link)) = engine.multibody_joints.get_mut(motor.joint) else { continue };
            let Some(link) = multibody.link_mut(link) else { continue };
            let position = f64::from(link.joint.coords()[motor.axis as usize]);
            limit_if_near(&mut link.joint.data, motor.axis, &self.model.joints[idx], position, largest);
            if let Some(effort) = motor.push {
                motor.give(engine, effort + held, self.model.joints[idx].velocity);
                continue;
            }
            let change = ((motor.target - motor.setpoint) / f64::from(steps_left)).clamp(-largest, largest);
            motor.setpoint += change;
            motor.setpoint_velocity = change / dt;
            motor.began = position;
            motor.keep_near(position, motor.fastest, substep_secs);
            let position = motor.setpoint + held / motor.stiffness;
            let data = &mut link.joint.data;
            data.set_motor(
                motor.axis,
                to_real(position),
                to_real(motor.setpoint_velocity),
                to_real(motor.stiffness),
                to_real(motor.damping),
            );
            data.set_motor_max_force(motor.axis, to_real(motor.max_effort));
        }
    }

    /// Returns how far each joint can move in a control tick: at its speed now or at that of its setpoint, and to its
    /// setpoint. Units: metres or radians.
    pub(super) fn spans(&self, positions: &[f64], velocities: &[f64], tick_secs: f64, overshoot: f64) -> Vec<f64> {
        let state = positions.iter().zip(velocities);
        let motors = self.motors.iter().zip(&self.model.joints).zip(state);
        motors
            .map(|((motor, joint), (position, velocity))| {
                let (told, lag) = match motor.push {
                    Some(_) => (joint.velocity, 0.0),
                    None => {
                        let told = (motor.target - motor.setpoint).abs() / tick_secs;
                        (told.min(joint.velocity), (motor.setpoint - position).abs())
                    }
                };
                overshoot * velocity.abs().max(told) * tick_secs + lag
            })
            .collect()
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

    /// Moves all joints to the positions at once, and holds them there.
    fn move_to(&mut self, engine: &mut PhysicsWorld, positions: &[f64]) {
        let Some(first) = self.motors.first().map(|motor| motor.joint) else { return };
        for (motor, position) in self.motors.iter_mut().zip(positions) {
            motor.target = *position;
            motor.setpoint = *position;
        }
        let order: Vec<(MultibodyJointHandle, f64)> =
            self.motors.iter().map(|motor| motor.joint).zip(positions.iter().copied()).collect();
        // This determines whether the root is fixed, and with it the index of each joint's coordinate.
        let Some((multibody, _)) = engine.multibody_joints.get_mut(first) else { return };
        multibody.forward_kinematics(&engine.bodies, true);
        let mut displacements = vec![0.0_f32; multibody.ndofs()];
        for (handle, position) in order {
            let Some((multibody, link)) = engine.multibody_joints.get(handle) else { continue };
            let Some(link) = multibody.link(link) else { continue };
            displacements[link.assembly_id()] = to_real(position);
        }
        if let Some((multibody, _)) = engine.multibody_joints.get_mut(first) {
            multibody.apply_displacements(&displacements);
            multibody.forward_kinematics(&engine.bodies, true);
            multibody.update_rigid_bodies(&mut engine.bodies, true);
        }
        engine.bodies.propagate_modified_body_positions_to_colliders(&mut engine.colliders);
    }

    /// Moves the base at once, with everything attached to it; the other joints keep their positions. Units: metres,
    /// metres, radians.
    pub fn shift_base(&mut self, engine: &mut PhysicsWorld, by: [f64; 3]) {
        let Some(base) = self.layout.base else { return };
        let Some((multibody, _)) = engine.multibody_joints.get(self.motors[base[0]].joint) else { return };
        let mut displacements = vec![0.0_f32; multibody.ndofs()];
        for (idx, shift) in base.into_iter().zip(by) {
            let motor = &mut self.motors[idx];
            motor.target += shift;
            motor.setpoint += shift;
            let link = engine.multibody_joints.get(motor.joint).and_then(|(multibody, link)| multibody.link(link));
            if let Some(link) = link {
                displacements[link.assembly_id()] = to_real(shift);
            }
        }
        if let Some((multibody, _)) = engine.multibody_joints.get_mut(self.motors[base[0]].joint) {
            multibody.apply_displacements(&displacements);
        }
        self.place_links(engine);
    }

    /// Couples mimic joints to their leaders, as a mechanism does.
    fn couple_mimics(&self, engine: &mut PhysicsWorld) {
        if self.model.joints.iter().enumerate().any(|(idx, _)| self.layout.gripper.follows(idx)) {
            engine.integration_parameters.num_internal_pgs_iterations = COUPLED_ITERATIONS;
        }
        for (follower, joint) in self.model.joints.iter().enumerate() {
            let Some((leader, factor, offset)) = joint.mimic else { continue };
            let link_of = |idx: usize| engine.multibody_joints.get(self.motors[idx].joint).map(|(_, link)| link);
            let (Some(link1), Some(link2)) = (link_of(leader), link_of(follower)) else { continue };
            let coupling = MultibodyDofCoupling {
                link1,
                dof1: 0,
                axis1: self.motors[leader].axis as usize,
                link2,
                dof2: 0,
                axis2: self.motors[follower].axis as usize,
                coeff: to_real(factor),
                offset: to_real(offset),
            };
            if let Some((multibody, _)) = engine.multibody_joints.get_mut(self.motors[leader].joint) {
                multibody.add_dof_coupling(coupling);
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;
    use crate::convert::from_pose;
    use crate::layout::check_robot;
    use crate::{World, build, ik};
    use actcheck_base::Files;
    use actcheck_data::{Camera, Choices, Odometry, Physics, Scene, Sensing};

    pub(crate) fn lonely() -> World {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        alone(actcheck_config::robot::read(&Files::Shipped, path).expect("the shipped robot is valid"))
    }

    /// A robot with nothing around it.
    pub(crate) fn alone(profile: RobotProfile) -> World {
        let profile = Arc::new(profile);
        let one = (1.0, 1.0);
        let scene = Scene {
            map: actcheck_data::SceneMap::default(),
            world: "empty".to_owned(),
            objects: Vec::new(),
            robot: RobotStart { profile, base: [-1.0, 0.3, 0.4], knows: Arc::new([]) },
            designators: BTreeMap::new(),
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
            },
            physics: Physics {
                mass_scale: one,
                friction_scale: one,
                size_scale: (1.0, 1.0),
                restitution: (0.0, 0.0),
                steps_per_second: 240,
                iterations: 2,
            },
        };
        build(&scene).expect("the scene is valid")
    }

    /// A random posture within the limits.
    fn posture(world: &World, choices: &mut Choices) -> Vec<f64> {
        let joints = world.kinematics().joints().iter();
        joints.map(|joint| choices.real("q".into(), joint.lower.max(-2.0), joint.upper.min(2.0), 0.0)).collect()
    }

    #[test]
    fn the_engine_and_our_kinematics_agree_on_link_poses() {
        let mut world = lonely();
        let mut choices = Choices::random(3, 0);
        for _ in 0..20 {
            let positions = posture(&world, &mut choices);
            let robot = &mut world.robot;
            let (now, _) = robot.state(&world.engine);
            let change: Vec<f64> = positions.iter().zip(&now).map(|(to, from)| to - from).collect();
            robot.move_to(&mut world.engine, &change);
            let (reached, _) = robot.state(&world.engine);
            let poses = robot.kinematics.links(&reached);
            for (body, pose) in robot.bodies.iter().zip(&poses) {
                let simulated = from_pose(world.engine.bodies[*body].position());
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
            let reach = ik::Reach { target, mobility: mobility.clone() };
            let Some(found) = ik::solve(kinematics, &seed, &reach) else { continue };
            n_solved += 1;
            let miss = kinematics.grasp(&found).translation.vector - target.translation.vector;
            assert!(miss.norm() < 1e-3);
            for (position, joint) in found.iter().zip(kinematics.joints()) {
                assert!((joint.lower..=joint.upper).contains(position), "{} at {position}", joint.name);
            }
            assert!(layout.gripper.joints().all(|idx| found[idx] == seed[idx]));
        }
        assert!(n_solved >= 60, "solved {n_solved} of 100 from random postures");
    }

    /// A constant force on a free joint: acceleration is force over mass, up to the joint's largest speed.
    #[test]
    fn commanded_efforts_accelerate_joints_up_to_their_velocity_limit() {
        let mut world = lonely();
        let base = world.layout().base.expect("it drives")[0];
        let (joint, mass) = (world.kinematics().joints()[base].clone(), world.robot.model.links[base + 1..].iter());
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
        assert!((reached - expected).abs() < 0.05 * expected, "{reached} m/s instead of {expected} m/s");
        assert!((world.observe().loads[base] - force).abs() < 1e-9);
        command.efforts = vec![(base, 1e9)];
        (0..120).for_each(|_| world.step(&command));
        let fastest = world.observe().velocities[base];
        assert!((fastest / joint.velocity - 1.0).abs() < 0.03, "{fastest} m/s instead of {} m/s", joint.velocity);
        let still = world.hold();
        (0..120).for_each(|_| world.step(&still));
        assert!(world.observe().velocities[base].abs() < 1e-2);
    }

    #[test]
    fn a_profile_that_names_a_missing_joint_is_refused_with_help() {
        let mut profile = lonely().robot.profile.as_ref().clone();
        profile.arm_joints[1] = "arm_flx_joint".to_owned();
        let refused = check_robot(&profile).expect_err("the joint is missing").diagnostic();
        assert_eq!((refused.code, refused.help.as_deref()), ("W021", Some("did you mean `arm_flex_joint`?")));
        profile.urdf.text = "<robot".into();
        assert_eq!(check_robot(&profile).expect_err("it is not a URDF").diagnostic().code, "W020");
    }
}
