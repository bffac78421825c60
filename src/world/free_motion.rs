//! Moves the robot through free space, where it touches nothing, without the engine.
//!
//! The engine rebuilds and factorises the robot's mass matrix in each substep, and solves contacts
//! and joints by iteration. Without contacts, the same motors, joint stops and couplings follow
//! from one small system of linear equations, which is solved exactly. Motors act as in the engine:
//! implicit springs with a largest force.

use nalgebra::Isometry3;
use rapier3d::prelude::PhysicsWorld;

use crate::assemble::{STOP_DAMPING, STOP_FREQUENCY_HZ, WIDEST_RANGE};
use crate::motor_law::VelocityConstraint;
use crate::ownership::{Hand, Ownership};
use crate::robot::SimulatedRobot;
use actcheck_robot::Factor;
use actcheck_robot::{Inertias, Twist, inertias};

/// Impulse per error of velocity of a coupling between two joints: nearly rigid. Unit: kilograms or
/// kg·m².
const COUPLING_GAIN: f64 = 1e4;
/// As [`COUPLING_GAIN`], for a joint whose velocity is given.
const GIVEN_GAIN: f64 = 1e6;
/// Most changes of the set of saturated motors in a substep.
const MOST_CHANGES: usize = 8;

/// Most factors that are kept in a control tick.
const MOST_FACTORS: usize = 8;

/// The joint of each drive with its gain, unless it is at a bound, and the factor of the equations
/// with these gains.
type Factored = (Vec<(usize, Option<f64>)>, Factor);

/// The equations of motion in one control tick: those terms that its substeps have in common. They
/// are those at its beginning.
pub(super) struct Equations {
    inertias: Inertias,
    /// Length of a substep. Unit: seconds.
    secs: f64,
    /// Mass matrix with damping, couplings and given velocities, row by row.
    matrix: Vec<f64>,
    /// Inertias of single joints that are past a stop, while all others are free to move.
    apparent: Vec<Option<f64>>,
    /// Momenta that gravity, contacts and given velocities add in a substep of this step.
    added: Vec<f64>,
    /// The factors found so far, since drives often return to the same bounds.
    factors: Vec<Factored>,
    drives: Vec<VelocityConstraint>,
    momenta: Vec<f64>,
}

impl Equations {
    /// Returns the factor of the equations with the drives that are not at a bound.
    fn factor(&mut self) -> &Factor {
        let gain = |drive: &VelocityConstraint| drive.at.is_none().then_some(drive.gain);
        let is_of = |(known, _): &Factored| {
            known.len() == self.drives.len()
                && known
                    .iter()
                    .zip(&self.drives)
                    .all(|(known, drive)| *known == (drive.joint, gain(drive)))
        };
        let at = self.factors.iter().position(is_of).unwrap_or_else(|| {
            let size = self.momenta.len();
            let mut matrix = self.matrix.clone();
            for drive in self.drives.iter().filter(|drive| drive.at.is_none()) {
                matrix[drive.joint * size + drive.joint] += drive.gain;
            }
            let free = self
                .drives
                .iter()
                .map(|drive| (drive.joint, gain(drive)))
                .collect();
            self.factors.truncate(MOST_FACTORS - 1);
            self.factors.insert(0, (free, Factor::new(matrix, size)));
            0
        });
        &self.factors[at].1
    }
}

impl SimulatedRobot {
    /// Moves the joints by a step of the engine's length, with the engine's substeps, without
    /// moving the links. Joints that the engine moves keep their velocities.
    pub(super) fn move_freely(&mut self, engine: &PhysicsWorld) {
        let parameters = &engine.integration_parameters;
        let n_substeps = parameters.num_solver_iterations;
        let secs = f64::from(parameters.dt) / n_substeps as f64;
        let mut step = self
            .equations
            .take()
            .unwrap_or_else(|| self.equations(secs));
        self.begin_step(&mut step);
        for _ in 0..n_substeps {
            self.set_drives(&mut step);
            self.solve(&mut step);
            for (position, velocity) in self.positions.iter_mut().zip(&self.velocities) {
                *position += velocity * step.secs;
            }
        }
        self.equations = Some(step);
    }

    /// Returns the equations for the present state, with substeps of this length.
    fn equations(&self, secs: f64) -> Box<Equations> {
        let poses: Vec<Isometry3<f64>> = self.kinematics.links(&self.positions);
        let armatures = self.motors.iter().map(|motor| motor.armature);
        let inertias = inertias(&self.model, &poses, &self.velocities).with_rotors(armatures);
        let n_joints = self.motors.len();
        let mut matrix = inertias.mass.clone();
        for (idx, joint) in self.model.joints.iter().enumerate() {
            matrix[idx * n_joints + idx] += secs * joint.damping;
            if self.is_given(idx) {
                matrix[idx * n_joints + idx] += GIVEN_GAIN;
            } else if let Some((leader, factor, _)) = joint.mimic {
                for (row, share) in [(idx, 1.0), (leader, -factor)] {
                    for (column, other) in [(idx, 1.0), (leader, -factor)] {
                        matrix[row * n_joints + column] += share * other * COUPLING_GAIN;
                    }
                }
            }
        }
        Box::new(Equations {
            inertias,
            secs,
            matrix,
            apparent: vec![None; n_joints],
            added: Vec::with_capacity(n_joints),
            factors: Vec::new(),
            drives: Vec::with_capacity(2 * n_joints),
            momenta: Vec::with_capacity(n_joints),
        })
    }

    /// Sets the momenta that gravity, contacts and given velocities add in the substeps of the next
    /// step.
    fn begin_step(&self, step: &mut Equations) {
        let secs = step.secs;
        // At first, no drive of the step is at a bound.
        step.drives.clear();
        step.added.clear();
        step.added
            .extend(step.inertias.bias.iter().map(|bias| -secs * bias));
        if let Some((hand, push)) = self.load() {
            for joint in self.joints_to(hand.link) {
                step.added[joint] += secs * step.inertias.effort_of(joint, push);
            }
        }
        for idx in (0..self.motors.len()).filter(|idx| self.is_given(*idx)) {
            step.added[idx] += GIVEN_GAIN * self.velocities[idx];
        }
    }

    /// Returns the hand and the push of contacts on it, if the engine moves it.
    fn load(&self) -> Option<(&Hand, &Twist)> {
        self.hand
            .as_ref()
            .filter(|_| self.ownership == Ownership::Hand)
            .map(|hand| (hand, &self.push_on_hand))
    }

    /// Returns whether the engine gives the velocity of a joint.
    fn is_given(&self, joint: usize) -> bool {
        self.ownership == Ownership::Hand && self.engine_moves(joint)
    }

    /// Sets the drives of all motors, followed by those of the stops that are passed. Motors in the
    /// engine have no drive here, but their place. Motors that were at a bound in the last substep
    /// are there at first.
    fn set_drives(&self, step: &mut Equations) {
        let limits = |idx: usize| match &self.model.joints[idx] {
            joint if joint.upper - joint.lower < WIDEST_RANGE => [joint.lower, joint.upper],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let (secs, n_joints) = (step.secs, self.motors.len());
        step.drives.truncate(n_joints);
        for (idx, (motor, position)) in self.motors.iter().zip(&self.positions).enumerate() {
            let drive = match self.is_given(idx) {
                true => VelocityConstraint::none(idx),
                false => motor.law.drive(idx, *position, limits(idx), secs),
            };
            match step.drives.get_mut(idx) {
                Some(last) => {
                    *last = VelocityConstraint {
                        at: last.at,
                        ..drive
                    }
                }
                None => step.drives.push(drive),
            }
        }
        let turn = std::f64::consts::TAU * f64::from(STOP_FREQUENCY_HZ);
        let recovery = turn / (secs * turn + 2.0 * f64::from(STOP_DAMPING));
        let rest = 1.0 / (secs * recovery) - 1.0;
        let softness = rest * rest / ((1.0 + rest) * 4.0 * f64::from(STOP_DAMPING * STOP_DAMPING));
        for (idx, position) in self
            .positions
            .iter()
            .enumerate()
            .filter(|(idx, _)| !self.is_given(*idx))
        {
            let [lower, upper] = limits(idx);
            let past = (position - upper).max(0.0) - (lower - position).max(0.0);
            if past != 0.0 {
                let bounds = if past > 0.0 {
                    [f64::NEG_INFINITY, 0.0]
                } else {
                    [0.0, f64::INFINITY]
                };
                let apparent =
                    *step.apparent[idx].get_or_insert_with(|| step.inertias.apparent(idx));
                let gain = apparent / softness;
                step.drives.push(VelocityConstraint {
                    joint: idx,
                    gain,
                    wanted: -past * recovery,
                    bounds,
                    at: None,
                });
            }
        }
    }

    /// Sets the velocities to those after a substep. Finds the drives that are at a bound by trial.
    fn solve(&mut self, step: &mut Equations) {
        step.inertias.momenta(&self.velocities, &mut step.momenta);
        step.momenta
            .iter_mut()
            .zip(&step.added)
            .for_each(|(momentum, added)| *momentum += added);
        for (idx, joint) in self
            .model
            .joints
            .iter()
            .enumerate()
            .filter(|(idx, _)| !self.is_given(*idx))
        {
            if let Some((leader, factor, offset)) = joint.mimic {
                let off = self.positions[idx] - factor * self.positions[leader] - offset;
                for (row, share) in [(idx, 1.0), (leader, -factor)] {
                    step.momenta[row] -= share * COUPLING_GAIN * off / step.secs;
                }
            }
        }
        for _ in 0..MOST_CHANGES {
            self.velocities.copy_from_slice(&step.momenta);
            for drive in &step.drives {
                self.velocities[drive.joint] += match drive.at {
                    Some(bound) => drive.bounds[bound],
                    None => drive.gain * drive.wanted,
                };
            }
            step.factor().solve(&mut self.velocities);
            let mut changed = false;
            for drive in &mut step.drives {
                changed |= drive.update(self.velocities[drive.joint]);
            }
            if !changed {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::Bodies;
    use crate::robot::tests::lonely;
    use crate::simulation::tests::{bodies, bodies_mut, set_substeps};
    use crate::{GRAVITY, Shortcuts, World};
    use actcheck_data::Choices;

    fn dynamics(world: &World) -> (Vec<f64>, Inertias) {
        let (positions, velocities) = bodies(world).robot.state();
        let poses = bodies(world).robot.kinematics.links(&positions);
        let armatures = bodies(world)
            .robot
            .motors
            .iter()
            .map(|motor| motor.armature);
        (
            positions,
            inertias(&bodies(world).robot.model, &poses, &velocities).with_rotors(armatures),
        )
    }

    /// Gives every joint a new target, within the limits, and steps for half a second.
    fn wander(world: &mut World, choices: &mut Choices) {
        let mut command = world.hold();
        for (target, joint) in command
            .positions
            .iter_mut()
            .zip(world.kinematics().joints())
        {
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
        for (bias, holding) in found
            .bias
            .iter()
            .zip(world.kinematics().holding_efforts(&positions))
        {
            assert!((bias - holding).abs() < 1e-9, "{bias} instead of {holding}");
        }
    }

    #[test]
    fn the_mass_matrix_is_that_of_the_engine() {
        let (mut world, mut choices) = (lonely(), Choices::random(4, 0));
        // The engine knows the masses of links once it has stepped.
        bodies_mut(&mut world).physics.step();
        for _ in 0..3 {
            wander(&mut world, &mut choices);
            let (_, found) = dynamics(&world);
            let Bodies { robot, physics, .. } = bodies_mut(&mut world);
            let (multibody, _) = physics
                .multibody_joints
                .get_mut(robot.motors[0].joint)
                .expect("it has joints");
            let theirs = multibody.dof_inverse_inertia(&physics.bodies);
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
        let robot = &bodies(&world).robot;
        let (mut positions, _) = dynamics(&world);
        let mut velocities: Vec<f64> = positions
            .iter()
            .map(|_| choices.real("v".into(), -0.5, 0.5, 0.0))
            .collect();
        let energies = |positions: &[f64], velocities: &[f64]| {
            let poses = robot.kinematics.links(positions);
            let now = inertias(&robot.model, &poses, velocities);
            let mut momenta = Vec::new();
            now.momenta(velocities, &mut momenta);
            let kinetic: f64 = momenta
                .iter()
                .zip(velocities)
                .map(|(p, v)| p * v / 2.0)
                .sum();
            let links = robot.model.links.iter().zip(&poses);
            let heights =
                links.map(|(link, pose)| link.mass * (pose * nalgebra::Point3::from(link.com)).z);
            (kinetic, kinetic + GRAVITY * heights.sum::<f64>())
        };
        let (kinetic, before) = energies(&positions, &velocities);
        let secs = 1e-5;
        for _ in 0..2000 {
            let poses = robot.kinematics.links(&positions);
            let now = inertias(&robot.model, &poses, &velocities);
            let mut changes: Vec<f64> = now.bias.iter().map(|bias| -secs * bias).collect();
            Factor::new(now.mass, changes.len()).solve(&mut changes);
            velocities
                .iter_mut()
                .zip(&changes)
                .for_each(|(velocity, change)| *velocity += change);
            positions
                .iter_mut()
                .zip(&velocities)
                .for_each(|(position, velocity)| *position += velocity * secs);
        }
        let (_, after) = energies(&positions, &velocities);
        assert!(
            (after - before).abs() < 1e-3 * kinetic,
            "{before} J became {after} J, with {kinetic} J of motion"
        );
    }

    #[test]
    fn joints_move_through_free_space_as_in_the_engine() {
        let (mut free, mut engine) = (lonely(), lonely());
        engine.take_shortcuts(Shortcuts::NONE);
        // As many substeps in both: the engine solves motors and couplings only by iteration.
        free.take_shortcuts(Shortcuts {
            few_substeps: false,
            ..Shortcuts::ALL
        });
        for world in [&mut free, &mut engine] {
            set_substeps(world, 4);
        }
        let [mut ones, mut others] = [Choices::random(8, 0), Choices::random(8, 0)];
        for _ in 0..6 {
            wander(&mut free, &mut ones);
            wander(&mut engine, &mut others);
            assert!(!engine.proximity().moved_freely());
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
        set_substeps(&mut world, 4);
        let lift = world.layout().arm[0];
        command.positions[lift] = 0.4;
        (0..30).for_each(|_| world.step(&command));
        assert!(world.proximity().moved_freely());
        let before = world.observe();
        world.take_shortcuts(Shortcuts::NONE);
        // As many as free motion took.
        set_substeps(&mut world, 2);
        world.step(&command);
        let after = world.observe();
        assert!(
            (after.velocities[lift] - before.velocities[lift]).abs() < 2e-3,
            "its speed continues"
        );
        let expected = before.positions[lift] + before.velocities[lift] * world.tick_secs();
        assert!(
            (after.positions[lift] - expected).abs() < 1e-4,
            "its motion continues"
        );
        wander(&mut world, &mut choices);
        assert_eq!(world.fault(), None);
    }
    /// Half of the substeps make a joint faster that is as fast as it can be, by the error of the
    /// substeps.
    #[test]
    fn twice_the_substeps_change_the_speed_of_a_joint_little() {
        let mut world = lonely();
        set_substeps(&mut world, 4);
        let mut command = world.hold();
        let lift = world.layout().arm[0];
        command.positions[lift] = 0.4;
        (0..30).for_each(|_| world.step(&command));
        assert!(world.proximity().moved_freely());
        let before = world.observe();
        world.take_shortcuts(Shortcuts::NONE);
        world.step(&command);
        let after = world.observe();
        assert!((after.velocities[lift] / before.velocities[lift] - 1.0).abs() < 0.05);
        let expected = before.positions[lift] + before.velocities[lift] * world.tick_secs();
        assert!(
            (after.positions[lift] - expected).abs() < 1e-4,
            "its motion continues"
        );
    }
}
