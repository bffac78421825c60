//! A hand that moves alone in the engine and gives way as its arm does.
//!
//! The engine solves the contacts of the hand with the inertia that the arm has there, motors included: an impulse changes the
//! hand's velocity as it would change that of the whole robot. The equations of the arm then get the same push, and the hand is
//! led to the pose that they find. They are solved exactly, unlike the engine's motors: with four substeps, grasps of light arms end
//! as they end with the whole robot in the engine and sixteen substeps.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use rapier3d::prelude::PhysicsWorld;

use crate::World;
use crate::convert::{from_pose, from_vector, to_real, to_vector};
use crate::drive::Law;
use crate::inertia::Twist;
use crate::kinematics::GRAVITY;
use crate::motor::Motor;
use crate::robot::Robot;

/// Smallest part of an inertia at the hand that the carrier has; the rest is that of the hand itself.
const LEAST_PART: f64 = 0.1;
/// Mobility of a hand that can't move along an axis. Units: 1/kg or 1/(kg·m²).
const LEAST_MOBILITY: f64 = 1e-9;

/// An arm is light if a push on its hand for [`LIGHT_SECS`] meets less than this in some direction. The lightest shipped arm has
/// 1.1 kg there, motors included. Heavier arms hardly give way, and need half of the substeps. Unit: kilograms.
const LIGHT_KG: f64 = 0.8;
/// A substep of the default physics. Unit: seconds.
const LIGHT_SECS: f64 = 1.0 / 960.0;

/// How the hand gives way to impulses at its grasp frame.
struct Yielding {
    /// The place of the grasp frame, with the axes along which an impulse has no effect across. Frame: world.
    frame: Isometry3<f64>,
    /// Inertias of the arm along these axes, and about them, without those of the hand. Units: kilograms and kg·m².
    inertias: [f64; 6],
}

impl World {
    /// Performs one step of physics with a hand alone in the engine that gives way.
    pub(super) fn step_yielding_hand(&mut self, dt: f64, ends_tick: bool) {
        let before = self.robot.state();
        // As if the push of the last step went on; then again, with that of this step.
        self.robot.move_freely(&self.engine);
        self.robot.lead_yielding_hand(&mut self.engine, &before.0, dt);
        if ends_tick {
            self.robot.lead_links(&mut self.engine);
        }
        self.step_engine();
        self.robot.push_on_hand = self.push_on_hand();
        (self.robot.positions, self.robot.velocities) = before;
        self.robot.move_freely(&self.engine);
        self.robot.take_state(&self.engine);
    }
}

impl Robot {
    /// Returns whether a hand that moves alone must give way: its arm, in its present posture, is light, or its links have many
    /// pieces, with which half of the substeps are too few.
    pub(super) fn must_yield(&mut self) -> bool {
        let Some(link) = self.hand.as_ref().map(|hand| hand.link) else { return false };
        if self.model.has_many_pieces() {
            return true;
        }
        for (motor, position) in self.motors.iter_mut().zip(&self.positions) {
            let Motor { stiffness, damping, max_effort, .. } = *motor;
            motor.law = Law { target: *position, velocity: 0.0, stiffness, damping, most: max_effort };
        }
        self.hold_equations(LIGHT_SECS);
        let mobility = self.mobility(link, &Point3::from(self.kinematics.grasp(&self.positions).translation.vector));
        self.equations = None;
        let along = mobility.map(|mobility| mobility.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues());
        along.is_some_and(|mobilities| mobilities.max() > 1.0 / LIGHT_KG)
    }

    /// Leads the engine's hand towards the pose of the robot's in a step of `secs` that begins with the joints at `positions`,
    /// and lets it give way to contacts.
    fn lead_yielding_hand(&mut self, engine: &mut PhysicsWorld, positions: &[f64], secs: f64) {
        let Some(carrier) = self.carrier else { return };
        let Some(link) = self.hand.as_ref().map(|hand| hand.link) else { return };
        let Some(Yielding { frame, inertias }) = self.yielding(link, positions) else { return };
        let poses = self.kinematics.links(&self.positions);
        let Some((multibody, id)) = engine.multibody_joints.get(carrier) else { return };
        let Some(from) = multibody.link(id).map(|link| from_pose(link.local_to_world())) else { return };
        self.turn_carrier(engine, &from, &frame);
        let Some((multibody, _)) = engine.multibody_joints.get_mut(carrier) else { return };
        let (to, at) = (poses[link], Point3::from(frame.translation.vector));
        let shift = to * from.inverse_transform_point(&at) - at;
        let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
        let [shift, turn] = [shift, turn].map(|way| frame.rotation.inverse() * way / secs);
        for (velocity, of) in multibody.generalized_velocity_mut().iter_mut().zip(shift.iter().chain(&turn)) {
            *velocity = to_real(*of);
        }
        for (armature, of) in multibody.armature_mut().iter_mut().zip(inertias) {
            *armature = to_real(of);
        }
        self.balance_hand(engine, link, &poses);
    }

    /// Returns how the hand with this link gives way, with the joints at these positions.
    fn yielding(&mut self, link: usize, positions: &[f64]) -> Option<Yielding> {
        let point = Point3::from(self.kinematics.grasp(positions).translation.vector);
        let mobility = self.mobility(link, &point)?;
        let along = SymmetricEigen::new(mobility.fixed_view::<3, 3>(0, 0).into_owned());
        let mut axes = along.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.column_mut(2).neg_mut();
        }
        let (mass, inertia) = self.mass_of_hand(&point, positions);
        let inertia = axes.transpose() * inertia * axes;
        let about = axes.transpose() * mobility.fixed_view::<3, 3>(3, 3) * axes;
        let of_arm = |mobility: f64, of_hand: f64| {
            let both = 1.0 / mobility.max(LEAST_MOBILITY);
            (both - of_hand).max(LEAST_PART * both)
        };
        let inertias = std::array::from_fn(|idx| match idx {
            0..3 => of_arm(along.eigenvalues[idx], mass),
            _ => of_arm(about[(idx - 3, idx - 3)], inertia[(idx - 3, idx - 3)]),
        });
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Some(Yielding { frame: Isometry3::from_parts(point.into(), rotation), inertias })
    }

    /// Returns the change of a link's velocity for each unit of an impulse on it at a point: linear parts, then angular ones.
    /// Frame: world.
    fn mobility(&mut self, link: usize, point: &Point3<f64>) -> Option<Matrix6<f64>> {
        let joints: Vec<usize> = self.joints_to(link).collect();
        let equations = self.equations.as_mut()?;
        let mut mobility = Matrix6::zeros();
        for column in 0..6 {
            let axis = Vector3::ith(column % 3, 1.0);
            let impulse = match column {
                0..3 => Twist::by_force(&axis, point),
                _ => Twist { turn: axis, shift: Vector3::zeros() },
            };
            let change = equations.answer(&joints, &impulse);
            let of_point = change.shift + change.turn.cross(&point.coords);
            mobility.fixed_view_mut::<3, 1>(0, column).copy_from(&of_point);
            mobility.fixed_view_mut::<3, 1>(3, column).copy_from(&change.turn);
        }
        Some(mobility)
    }

    /// Returns the mass of the hand, and its inertia about a point. Frame: world.
    fn mass_of_hand(&self, point: &Point3<f64>, positions: &[f64]) -> (f64, Matrix3<f64>) {
        let poses = self.kinematics.links(positions);
        let (mut mass, mut inertia) = (0.0, Matrix3::zeros());
        for (idx, (link, pose)) in self.model.links.iter().zip(&poses).enumerate() {
            if self.hand.as_ref().is_some_and(|hand| hand.has(idx)) {
                let way = pose * Point3::from(link.com) - point;
                let turned = pose.rotation.to_rotation_matrix();
                let spread = Matrix3::identity() * way.norm_squared() - way * way.transpose();
                mass += link.mass;
                inertia += turned * link.inertia * turned.transpose() + spread * link.mass;
            }
        }
        (mass, inertia)
    }

    /// Balances the forces on the hand, whose first link this is, that the arm's equations contain: its weight and the push of the
    /// last step. Only a change of this push then changes the way of the hand.
    fn balance_hand(&self, engine: &mut PhysicsWorld, first: usize, poses: &[Isometry3<f64>]) {
        let Some(body) = engine.bodies.get_mut(self.bodies[first]) else { return };
        body.reset_forces(false);
        body.reset_torques(false);
        let Twist { turn, shift } = self.push_on_hand;
        let middle = from_vector(body.center_of_mass());
        body.add_force(to_vector(&-shift), false);
        body.add_torque(to_vector(&(middle.cross(&shift) - turn)), false);
        for (idx, (link, pose)) in self.model.links.iter().zip(poses).enumerate() {
            if self.hand.as_ref().is_some_and(|hand| hand.has(idx)) {
                let weight = Vector3::z() * (link.mass * GRAVITY);
                let at = pose * Point3::from(link.com);
                body.add_force_at_point(to_vector(&weight), to_vector(&at.coords), false);
            }
        }
    }

    /// Takes away the forces that carry the hand.
    pub(super) fn drop_weight(&self, engine: &mut PhysicsWorld) {
        let hand = self.hand.as_ref().filter(|_| self.yields && self.carrier.is_some());
        if let Some(body) = hand.and_then(|hand| engine.bodies.get_mut(self.bodies[hand.link])) {
            body.reset_forces(false);
            body.reset_torques(false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::tests::{hand, turning};
    use crate::robot::tests::alone;

    /// A hand on a vertical slide gives way along the slide alone: its mass there is that of the links with the resistance of the
    /// motor.
    #[test]
    fn a_hand_on_a_slide_yields_along_the_slide_alone() {
        let mut world = alone(hand(&turning(0.0, 0.6), &turning(-0.6, 0.0), &["left", "right"]));
        let robot = &mut world.robot;
        robot.move_freely(&world.engine);
        let link = robot.hand.as_ref().expect("it has a hand").link;
        let mobility = robot.mobility(link, &Point3::new(0.3, -0.2, 0.9)).expect("its equations are known");
        let parameters = &world.engine.integration_parameters;
        let secs = f64::from(parameters.dt) / parameters.num_solver_iterations as f64;
        let resistance = secs * (secs * robot.motors[0].stiffness + robot.motors[0].damping);
        // The palm and two fingers.
        let expected = 1.0 / (0.3 + resistance);
        assert!((mobility[(2, 2)] / expected - 1.0).abs() < 1e-9, "{} instead of {expected}", mobility[(2, 2)]);
        let others = mobility.abs().sum() - mobility[(2, 2)];
        assert!(others < 1e-9, "{mobility}");
    }

    #[test]
    fn the_axes_of_yielding_are_those_along_which_an_impulse_acts_alone() {
        let mut world = crate::robot::tests::lonely();
        let robot = &mut world.robot;
        robot.move_freely(&world.engine);
        let (link, positions) = (robot.hand.as_ref().expect("it has a hand").link, robot.positions.clone());
        let Yielding { frame, inertias } = robot.yielding(link, &positions).expect("its equations are known");
        let point = Point3::from(frame.translation.vector);
        let mobility = robot.mobility(link, &point).expect("its equations are known");
        let (mass, _) = robot.mass_of_hand(&point, &positions);
        for (idx, inertia) in inertias[..3].iter().enumerate() {
            let axis = frame.rotation * Vector3::ith(idx, 1.0);
            let change = mobility.fixed_view::<3, 3>(0, 0) * axis;
            assert!((change - axis * axis.dot(&change)).norm() < 1e-9 * change.norm(), "axis {idx}: {change}");
            let both = 1.0 / axis.dot(&change);
            assert!((inertia - (both - mass).max(LEAST_PART * both)).abs() < 1e-6 * both, "axis {idx}: {inertia} kg");
        }
        assert!(inertias.iter().all(|inertia| *inertia > 0.0), "{inertias:?}");
    }
}
