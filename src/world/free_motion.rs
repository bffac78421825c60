//! Moves the robot through free space, where it touches nothing, without the engine.
//!
//! The engine rebuilds and factorises the robot's mass matrix in each substep, and solves contacts and joints by
//! iteration. Without contacts, the same motors, joint stops and couplings follow from one small system of linear
//! equations, which is solved exactly. Motors act as in the engine: implicit springs with a largest force.

use nalgebra::Isometry3;
use rapier3d::prelude::PhysicsWorld;

use crate::assemble::{STOP_DAMPING, STOP_FREQUENCY_HZ, WIDEST_RANGE};
use crate::convert::to_real;
use crate::factor::Factor;
use crate::inertia::{Inertias, inertias};
use crate::robot::Robot;

/// Impulse per error of velocity of a coupling between two joints: nearly rigid. Unit: kilograms or kg·m².
const COUPLING_GAIN: f64 = 1e4;
/// Most changes of the set of saturated motors in a substep.
const MOST_CHANGES: usize = 8;

/// A soft constraint on the velocity of one joint: its impulse is `gain · (wanted − velocity)`, within bounds.
#[derive(Debug, Clone, Copy)]
struct Drive {
    joint: usize,
    gain: f64,
    wanted: f64,
    /// Smallest and largest impulse.
    bounds: [f64; 2],
    /// The bound that it has reached, if any.
    at: Option<usize>,
}

impl Drive {
    /// Updates whether the drive has reached a bound at this velocity. Returns whether that has changed.
    fn update(&mut self, velocity: f64) -> bool {
        let impulse = self.gain * (self.wanted - velocity);
        let at = if impulse < self.bounds[0] {
            Some(0)
        } else if impulse > self.bounds[1] {
            Some(1)
        } else {
            None
        };
        std::mem::replace(&mut self.at, at) != at
    }
}

/// The law of a joint's motor in this step, as the engine has it.
#[derive(Debug, Clone, Copy)]
struct Law {
    target: f64,
    velocity: f64,
    stiffness: f64,
    damping: f64,
    most: f64,
}

impl Law {
    /// Returns the motor's drive for a substep of `secs`.
    fn drive(self, joint: usize, position: f64, limits: [f64; 2], secs: f64) -> Drive {
        let resistance = secs * self.stiffness + self.damping;
        let pull = if resistance > 0.0 { self.stiffness / resistance } else { 0.0 };
        let [slowest, fastest] = limits.map(|limit| (limit - position) / secs);
        let velocity = self.velocity.max(slowest).min(fastest);
        let most = self.most * secs;
        let wanted = velocity - (position - self.target) * pull;
        Drive { joint, gain: secs * resistance, wanted, bounds: [-most, most], at: None }
    }
}

impl Robot {
    /// Moves the joints by a step of the engine's length, with the engine's substeps. The links stay where they are:
    /// see [`Robot::place_links`].
    pub(super) fn move_freely(&self, engine: &mut PhysicsWorld) {
        let parameters = &engine.integration_parameters;
        let n_substeps = parameters.num_solver_iterations;
        let secs = f64::from(parameters.dt) / n_substeps as f64;
        let (mut positions, mut velocities) = self.state(engine);
        let laws = self.laws(engine);
        if laws.len() != positions.len() {
            return;
        }
        let began = positions.clone();
        let poses: Vec<Isometry3<f64>> = self.kinematics.links(&positions);
        let inertias = inertias(&self.model, &poses, &velocities);
        let mut saturated: Vec<Option<usize>> = Vec::new();
        for _ in 0..n_substeps {
            let mut drives = self.drives(&laws, &positions, &inertias, secs);
            for (drive, at) in drives.iter_mut().zip(&saturated) {
                drive.at = *at;
            }
            velocities = self.solve(&inertias, &mut drives, &positions, &velocities, secs);
            saturated = drives.iter().take(laws.len()).map(|drive| drive.at).collect();
            for (position, velocity) in positions.iter_mut().zip(&velocities) {
                *position += velocity * secs;
            }
        }
        self.set_state(engine, &began, &positions, &velocities);
    }

    /// Returns the motors' laws as they are set in the engine.
    fn laws(&self, engine: &PhysicsWorld) -> Vec<Law> {
        let motors = self.motors.iter().filter_map(|motor| {
            let (multibody, link) = engine.multibody_joints.get(motor.joint)?;
            let of = &multibody.link(link)?.joint.data.motors[motor.axis as usize];
            Some(Law {
                target: f64::from(of.target_pos),
                velocity: f64::from(of.target_vel),
                stiffness: f64::from(of.stiffness),
                damping: f64::from(of.damping),
                most: f64::from(of.max_force),
            })
        });
        motors.collect()
    }

    /// Returns the drives of all motors, followed by those of the stops that are passed.
    fn drives(&self, laws: &[Law], positions: &[f64], inertias: &Inertias, secs: f64) -> Vec<Drive> {
        let limits = |idx: usize| match &self.model.joints[idx] {
            joint if joint.upper - joint.lower < WIDEST_RANGE => [joint.lower, joint.upper],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let of_motors = laws.iter().zip(positions).enumerate();
        let mut drives: Vec<Drive> =
            of_motors.map(|(idx, (law, position))| law.drive(idx, *position, limits(idx), secs)).collect();
        let turn = std::f64::consts::TAU * f64::from(STOP_FREQUENCY_HZ);
        let recovery = turn / (secs * turn + 2.0 * f64::from(STOP_DAMPING));
        let rest = 1.0 / (secs * recovery) - 1.0;
        let softness = rest * rest / ((1.0 + rest) * 4.0 * f64::from(STOP_DAMPING * STOP_DAMPING));
        for (idx, position) in positions.iter().enumerate() {
            let [lower, upper] = limits(idx);
            let past = (position - upper).max(0.0) - (lower - position).max(0.0);
            if past != 0.0 {
                let bounds = if past > 0.0 { [f64::NEG_INFINITY, 0.0] } else { [0.0, f64::INFINITY] };
                let gain = inertias.apparent(idx) / softness;
                drives.push(Drive { joint: idx, gain, wanted: -past * recovery, bounds, at: None });
            }
        }
        drives
    }

    /// Returns the velocities after a substep. Finds the drives that are at a bound by trial.
    fn solve(
        &self,
        inertias: &Inertias,
        drives: &mut [Drive],
        positions: &[f64],
        velocities: &[f64],
        secs: f64,
    ) -> Vec<f64> {
        let joints = &self.model.joints;
        let mut momenta = inertias.times(velocities);
        let mut matrix = inertias.mass.clone();
        let n_joints = joints.len();
        for (idx, joint) in joints.iter().enumerate() {
            momenta[idx] -= secs * inertias.bias[idx];
            matrix[idx * n_joints + idx] += secs * joint.damping;
            if let Some((leader, factor, offset)) = joint.mimic {
                let wanted = -(positions[idx] - factor * positions[leader] - offset) / secs;
                for (row, share) in [(idx, 1.0), (leader, -factor)] {
                    momenta[row] += share * COUPLING_GAIN * wanted;
                    for (column, other) in [(idx, 1.0), (leader, -factor)] {
                        matrix[row * n_joints + column] += share * other * COUPLING_GAIN;
                    }
                }
            }
        }
        let mut found = velocities.to_vec();
        for _ in 0..MOST_CHANGES {
            let mut matrix = matrix.clone();
            found.copy_from_slice(&momenta);
            for drive in drives.iter() {
                match drive.at {
                    Some(bound) => found[drive.joint] += drive.bounds[bound],
                    None => {
                        found[drive.joint] += drive.gain * drive.wanted;
                        matrix[drive.joint * n_joints + drive.joint] += drive.gain;
                    }
                }
            }
            Factor::new(matrix, n_joints).solve(&mut found);
            let mut changed = false;
            for drive in drives.iter_mut() {
                changed |= drive.update(found[drive.joint]);
            }
            if !changed {
                break;
            }
        }
        found
    }

    /// Moves the engine's joints from their positions to others, with new velocities.
    fn set_state(&self, engine: &mut PhysicsWorld, began: &[f64], positions: &[f64], velocities: &[f64]) {
        let Some(first) = self.motors.first().map(|motor| motor.joint) else { return };
        let of = |motor: &crate::motor::Motor| {
            let (multibody, link) = engine.multibody_joints.get(motor.joint)?;
            Some(multibody.link(link)?.assembly_id())
        };
        let dofs: Vec<Option<usize>> = self.motors.iter().map(of).collect();
        let Some((multibody, _)) = engine.multibody_joints.get_mut(first) else { return };
        let mut ways = vec![0.0_f32; multibody.ndofs()];
        for (idx, dof) in dofs.into_iter().enumerate() {
            let Some(dof) = dof else { continue };
            ways[dof] = to_real(positions[idx] - began[idx]);
            multibody.generalized_velocity_mut()[dof] = to_real(velocities[idx]);
        }
        multibody.apply_displacements(&ways);
    }

    /// Moves links and their colliders to where the joints are.
    pub(super) fn place_links(&self, engine: &mut PhysicsWorld) {
        let Some(first) = self.motors.first().map(|motor| motor.joint) else { return };
        let Some((multibody, _)) = engine.multibody_joints.get_mut(first) else { return };
        multibody.forward_kinematics(&engine.bodies, false);
        multibody.update_rigid_bodies(&mut engine.bodies, true);
        for body in self.bodies.iter().filter_map(|body| engine.bodies.get(*body)) {
            for handle in body.colliders() {
                if let Some(collider) = engine.colliders.get_mut(*handle)
                    && let Some(on_body) = collider.position_wrt_parent().copied()
                {
                    collider.set_position(*body.position() * on_body);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::tests::lonely;
    use crate::{GRAVITY, World};
    use actcheck_data::Choices;

    fn dynamics(world: &World) -> (Vec<f64>, Inertias) {
        let (positions, velocities) = world.robot.state(&world.engine);
        let poses = world.robot.kinematics.links(&positions);
        (positions, inertias(&world.robot.model, &poses, &velocities))
    }

    /// Gives every joint a new target, within the limits, and steps for half a second.
    fn wander(world: &mut World, choices: &mut Choices) {
        let mut command = world.hold();
        for (target, joint) in command.positions.iter_mut().zip(world.kinematics().joints()) {
            let way = choices.real("way".into(), -0.4, 0.4, 0.0);
            *target = (*target + way).clamp(joint.lower, joint.upper);
        }
        command.gripper_opening_m = choices.real("gap".into(), 0.01, 0.12, 0.05);
        (0..30).for_each(|_| world.step(&command));
    }

    #[test]
    fn at_rest_the_joints_carry_the_weight_of_their_links() {
        let world = lonely();
        let (positions, found) = dynamics(&world);
        for (bias, holding) in found.bias.iter().zip(world.kinematics().holding_efforts(&positions)) {
            assert!((bias - holding).abs() < 1e-9, "{bias} instead of {holding}");
        }
    }

    #[test]
    fn the_mass_matrix_is_that_of_the_engine() {
        let (mut world, mut choices) = (lonely(), Choices::random(4, 0));
        // The engine knows the masses of links once it has stepped.
        world.engine.step();
        for _ in 0..3 {
            wander(&mut world, &mut choices);
            let (_, found) = dynamics(&world);
            let robot = &world.robot;
            let (multibody, _) = world.engine.multibody_joints.get_mut(robot.motors[0].joint).expect("it has joints");
            let theirs = multibody.dof_inverse_inertia(&world.engine.bodies);
            for joint in 0..robot.motors.len() {
                let product = found.apparent(joint) * f64::from(theirs[joint]);
                assert!((product - 1.0).abs() < 5e-3, "joint {joint}: {product}");
            }
        }
    }

    #[test]
    fn free_joints_keep_their_energy() {
        let (mut world, mut choices) = (lonely(), Choices::random(6, 0));
        wander(&mut world, &mut choices);
        let robot = &world.robot;
        let (mut positions, _) = dynamics(&world);
        let mut velocities: Vec<f64> = positions.iter().map(|_| choices.real("v".into(), -0.5, 0.5, 0.0)).collect();
        let energies = |positions: &[f64], velocities: &[f64]| {
            let poses = robot.kinematics.links(positions);
            let now = inertias(&robot.model, &poses, velocities);
            let kinetic: f64 = now.times(velocities).iter().zip(velocities).map(|(p, v)| p * v / 2.0).sum();
            let links = robot.model.links.iter().zip(&poses);
            let heights = links.map(|(link, pose)| link.mass * (pose * nalgebra::Point3::from(link.com)).z);
            (kinetic, kinetic + GRAVITY * heights.sum::<f64>())
        };
        let (kinetic, before) = energies(&positions, &velocities);
        let secs = 1e-5;
        for _ in 0..2000 {
            let poses = robot.kinematics.links(&positions);
            let now = inertias(&robot.model, &poses, &velocities);
            let mut changes: Vec<f64> = now.bias.iter().map(|bias| -secs * bias).collect();
            Factor::new(now.mass, changes.len()).solve(&mut changes);
            velocities.iter_mut().zip(&changes).for_each(|(velocity, change)| *velocity += change);
            positions.iter_mut().zip(&velocities).for_each(|(position, velocity)| *position += velocity * secs);
        }
        let (_, after) = energies(&positions, &velocities);
        assert!((after - before).abs() < 1e-3 * kinetic, "{before} J became {after} J, with {kinetic} J of motion");
    }

    #[test]
    fn joints_move_through_free_space_as_in_the_engine() {
        let (mut free, mut engine) = (lonely(), lonely());
        engine.leave_to_engine();
        let [mut ones, mut others] = [Choices::random(8, 0), Choices::random(8, 0)];
        for _ in 0..6 {
            wander(&mut free, &mut ones);
            wander(&mut engine, &mut others);
            assert!(!engine.moved_freely());
            let (one, other) = (free.observe(), engine.observe());
            for (idx, joint) in free.kinematics().joints().iter().enumerate() {
                let off = (one.positions[idx] - other.positions[idx]).abs();
                assert!(off < 1e-3, "{} is {off} off", joint.name);
            }
        }
    }

    #[test]
    fn the_engine_continues_where_free_motion_ended() {
        let (mut world, mut choices) = (lonely(), Choices::random(9, 0));
        let mut command = world.hold();
        let lift = world.layout().arm[0];
        command.positions[lift] = 0.4;
        (0..30).for_each(|_| world.step(&command));
        assert!(world.moved_freely());
        let before = world.observe();
        world.leave_to_engine();
        world.step(&command);
        let after = world.observe();
        assert!((after.velocities[lift] - before.velocities[lift]).abs() < 2e-3, "its speed continues");
        let expected = before.positions[lift] + before.velocities[lift] * world.tick_secs();
        assert!((after.positions[lift] - expected).abs() < 1e-4, "its motion continues");
        wander(&mut world, &mut choices);
        assert_eq!(world.fault(), None);
    }
}
