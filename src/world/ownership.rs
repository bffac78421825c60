//! The part of the robot that the engine moves.
//!
//! The engine needs a multibody only for links that touch something. Its cost grows with the square
//! of the number of joints. Links outside of it are kinematic bodies, which the robot's own
//! solution places. A hand alone moves in the engine on a carrier: a joint with a large inertia,
//! whose velocities lead it along the path of the arm. In each step the carrier's axes are laid
//! along the motion of the hand, so that three of them are enough. The hand of a light arm never
//! moves alone: such an arm gives way to a held object.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{
    GenericJoint, JointAxesMask, MultibodyDofCoupling, MultibodyJointHandle, PhysicsWorld,
    RigidBodyType,
};

use crate::assemble::insert_joint;
use crate::robot::SimulatedRobot;
use actcheck_geometry::{from_pose, to_pose, to_real};
use actcheck_robot::Gripper;
use actcheck_robot::RobotModel;

/// Inertia of the carrier of a hand: contacts and motors of the fingers change its velocity by less
/// than a millionth. Units: kilograms and kg·m².
const CARRIER_INERTIA: f32 = 1e4;

/// Number of the carrier's coordinates: along two axes and about the first of them.
const CARRIER_AXES: usize = 3;

/// The part of the robot that the engine moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ownership {
    /// No link.
    Nothing,
    /// The hand with its fingers.
    Hand,
    /// All links.
    Whole,
}

/// The hand: the link that carries all fingers, and the links that move with it.
#[derive(Debug, Clone)]
pub(super) struct Hand {
    /// The link that carries all fingers.
    pub(super) link: usize,
    /// Whether each link is part of the hand.
    contains: Vec<bool>,
}

impl Hand {
    /// Returns the hand of a robot. Returns `None` if the fingers are on the root, or follow a
    /// joint outside the hand.
    pub(super) fn of(model: &RobotModel, gripper: &Gripper) -> Option<Self> {
        let parent = |link: &usize| link.checked_sub(1).map(|joint| model.joints[joint].parent);
        let above = |joint: usize| std::iter::successors(Some(model.joints[joint].parent), parent);
        let mut joints = gripper.joints();
        let first = joints.next()?;
        let rest: Vec<Vec<usize>> = joints.map(|joint| above(joint).collect()).collect();
        let link = above(first).find(|link| rest.iter().all(|links| links.contains(link)))?;
        let mut contains = vec![false; model.links.len()];
        contains[link] = true;
        for (idx, joint) in model.joints.iter().enumerate() {
            contains[idx + 1] |= contains[joint.parent];
        }
        let hand = Self { link, contains };
        let mut moved = model
            .joints
            .iter()
            .enumerate()
            .filter(|(idx, _)| hand.moves(*idx));
        let alone =
            moved.all(|(_, joint)| joint.mimic.is_none_or(|(leader, ..)| hand.moves(leader)));
        (link > 0 && alone).then_some(hand)
    }

    /// Returns whether a link is part of the hand.
    pub(super) fn has(&self, link: usize) -> bool {
        self.contains[link]
    }

    /// Returns whether a joint moves links within the hand.
    pub(super) fn moves(&self, joint: usize) -> bool {
        joint + 1 != self.link && self.contains[joint + 1]
    }
}

/// Passes of the solver in each substep for grippers with coupled joints. In a single pass, the
/// motor's force does not arrive at the fingertips: with 15 N commanded, a finger that turns with
/// five couplings presses with 5 N.
const COUPLED_ITERATIONS: usize = 8;

impl SimulatedRobot {
    /// Returns whether the engine moves a joint.
    pub(super) fn engine_moves(&self, joint: usize) -> bool {
        match self.ownership {
            Ownership::Nothing => false,
            Ownership::Hand => self.hand.as_ref().is_some_and(|hand| hand.moves(joint)),
            Ownership::Whole => true,
        }
    }

    /// Gives this part of the robot to the engine, in the robot's state, and takes the others from
    /// it.
    pub(super) fn hand_over(&mut self, engine: &mut PhysicsWorld, ownership: Ownership) {
        if self.ownership == ownership {
            return;
        }
        (self.ownership, self.carrier) = (ownership, None);
        if let Some(body) = self.bodies.get(1) {
            // The link of the hand is a root or follows one, as all others do.
            engine
                .multibody_joints
                .remove_multibody_articulations(*body, false);
        }
        if let Some(hand) = &self.hand {
            engine
                .multibody_joints
                .remove_multibody_articulations(self.bodies[hand.link], false);
        }
        let poses = self.kinematics.links(&self.positions);
        for (idx, (body, pose)) in self.bodies.iter().zip(&poses).enumerate().skip(1) {
            let given = match ownership {
                Ownership::Nothing => false,
                Ownership::Hand => self.hand.as_ref().is_some_and(|hand| hand.has(idx)),
                Ownership::Whole => true,
            };
            let kind = if given {
                RigidBodyType::Dynamic
            } else {
                RigidBodyType::KinematicPositionBased
            };
            if let Some(body) = engine.bodies.get_mut(*body) {
                body.set_body_type(kind, false);
                body.set_position(to_pose(pose), false);
            }
        }
        self.insert_owned_joints(engine);
        self.put_state(engine);
    }

    /// Inserts the joints that the engine moves.
    fn insert_owned_joints(&mut self, engine: &mut PhysicsWorld) {
        if let (Ownership::Hand, Some(hand)) = (self.ownership, &self.hand) {
            let locked = JointAxesMask::LIN_Z | JointAxesMask::ANG_Y | JointAxesMask::ANG_Z;
            let joint = GenericJoint::new(locked);
            self.carrier =
                engine
                    .multibody_joints
                    .insert(self.bodies[0], self.bodies[hand.link], joint, true);
        }
        for idx in 0..self.motors.len() {
            if self.engine_moves(idx)
                && let Some(handle) =
                    insert_joint(engine, &self.model.joints[idx], idx, &self.bodies)
            {
                self.motors[idx].joint = handle;
            }
        }
        self.finish_owned_joints(engine);
    }

    /// Finishes the joints that the engine moves, once all are inserted.
    pub(super) fn finish_owned_joints(&self, engine: &mut PhysicsWorld) {
        let Some(first) = self.first_owned() else {
            return;
        };
        let Some((multibody, _)) = engine.multibody_joints.get_mut(first) else {
            return;
        };
        // This determines whether the root is fixed, and with it the index of each joint's
        // coordinate.
        multibody.forward_kinematics(&engine.bodies, true);
        if self.ownership == Ownership::Hand {
            multibody
                .armature_mut()
                .rows_mut(0, CARRIER_AXES)
                .fill(CARRIER_INERTIA);
            multibody.damping_mut().rows_mut(0, CARRIER_AXES).fill(0.0);
        }
        for motor in self
            .motors
            .iter()
            .enumerate()
            .filter(|(idx, _)| self.engine_moves(*idx))
            .map(|(_, motor)| motor)
        {
            let Some((multibody, link)) = engine.multibody_joints.get_mut(motor.joint) else {
                continue;
            };
            if let Some(dof) = multibody
                .link(link)
                .map(rapier3d::prelude::MultibodyLink::assembly_id)
            {
                multibody.armature_mut()[dof] = to_real(motor.armature);
            }
        }
        self.couple_mimics(engine);
    }

    /// Returns a joint of the engine's multibody, or `None` if there is none.
    fn first_owned(&self) -> Option<MultibodyJointHandle> {
        match self.ownership {
            Ownership::Nothing => None,
            Ownership::Hand => self.carrier,
            Ownership::Whole => self.motors.first().map(|motor| motor.joint),
        }
    }

    /// Couples mimic joints to their leaders, as a mechanism does.
    fn couple_mimics(&self, engine: &mut PhysicsWorld) {
        if self
            .model
            .joints
            .iter()
            .enumerate()
            .any(|(idx, _)| self.layout.gripper.follows(idx))
        {
            engine.integration_parameters.num_internal_pgs_iterations = COUPLED_ITERATIONS;
        }
        for (follower, joint) in self
            .model
            .joints
            .iter()
            .enumerate()
            .filter(|(idx, _)| self.engine_moves(*idx))
        {
            let Some((leader, factor, offset)) = joint.mimic else {
                continue;
            };
            let link_of = |idx: usize| {
                engine
                    .multibody_joints
                    .get(self.motors[idx].joint)
                    .map(|(_, link)| link)
            };
            let (Some(link1), Some(link2)) = (link_of(leader), link_of(follower)) else {
                continue;
            };
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
            if let Some((multibody, _)) = engine.multibody_joints.get_mut(self.motors[leader].joint)
            {
                multibody.add_dof_coupling(coupling);
            }
        }
    }

    /// Sets the joints that the engine moves to the robot's state.
    pub(super) fn put_state(&self, engine: &mut PhysicsWorld) {
        let Some(first) = self.first_owned() else {
            return;
        };
        let poses = self.kinematics.links(&self.positions);
        let dofs: Vec<Option<(usize, f64)>> = (0..self.motors.len())
            .map(|idx| {
                let (multibody, link) = engine.multibody_joints.get(self.motors[idx].joint)?;
                let link = multibody.link(link).filter(|_| self.engine_moves(idx))?;
                Some((
                    link.assembly_id(),
                    f64::from(link.joint.coords()[self.motors[idx].axis as usize]),
                ))
            })
            .collect();
        if let (Ownership::Hand, Some(hand)) = (self.ownership, &self.hand) {
            self.turn_carrier(engine, &poses[hand.link], &UnitQuaternion::identity());
        }
        let Some((multibody, _)) = engine.multibody_joints.get_mut(first) else {
            return;
        };
        let mut ways = vec![0.0_f32; multibody.ndofs()];
        for (idx, dof) in dofs.into_iter().enumerate() {
            let Some((dof, before)) = dof else { continue };
            ways[dof] = to_real(self.positions[idx] - before);
            multibody.generalized_velocity_mut()[dof] = to_real(self.velocities[idx]);
        }
        multibody.apply_displacements(&ways);
        multibody.forward_kinematics(&engine.bodies, false);
        multibody.update_rigid_bodies(&mut engine.bodies, true);
        self.place_colliders(engine);
    }

    /// Puts the hand at a pose, with the carrier's axes in this direction.
    fn turn_carrier(
        &self,
        engine: &mut PhysicsWorld,
        at: &Isometry3<f64>,
        axes: &UnitQuaternion<f64>,
    ) {
        let Some((multibody, carrier)) = self
            .carrier
            .and_then(|joint| engine.multibody_joints.get_mut(joint))
        else {
            return;
        };
        let Some(link) = multibody.link_mut(carrier) else {
            return;
        };
        let frame = Isometry3::from_parts(at.translation, *axes);
        link.joint
            .data
            .set_local_frame1(to_pose(&(self.kinematics.root().inverse() * frame)));
        link.joint
            .data
            .set_local_frame2(to_pose(&(at.inverse() * frame)));
        let coords = link.joint.coords();
        let mut back = vec![0.0_f32; multibody.ndofs()];
        back[..CARRIER_AXES].copy_from_slice(&[-coords[0], -coords[1], -coords[3]]);
        multibody.apply_displacements(&back);
    }

    /// Reads the state of the joints that the engine moves.
    pub(super) fn take_state(&mut self, engine: &PhysicsWorld) {
        for idx in 0..self.motors.len() {
            if !self.engine_moves(idx) {
                continue;
            }
            let motor = &self.motors[idx];
            let Some((multibody, link)) = engine.multibody_joints.get(motor.joint) else {
                continue;
            };
            let Some(link) = multibody.link(link) else {
                continue;
            };
            self.positions[idx] = f64::from(link.joint.coords()[motor.axis as usize]);
            self.velocities[idx] = f64::from(multibody.joint_velocity(link)[0]);
        }
    }

    /// Leads the engine's hand to the pose of the robot's in a step of `secs`.
    pub(super) fn lead_hand(&self, engine: &mut PhysicsWorld, secs: f64) {
        let (Some(hand), Some(carrier)) = (&self.hand, self.carrier) else {
            return;
        };
        let to = self.kinematics.links(&self.positions)[hand.link];
        let Some((multibody, link)) = engine.multibody_joints.get(carrier) else {
            return;
        };
        let Some(from) = multibody
            .link(link)
            .map(|link| from_pose(link.local_to_world()))
        else {
            return;
        };
        let shift = to.translation.vector - from.translation.vector;
        let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
        let axes = axes_along(&turn, &shift);
        self.turn_carrier(engine, &from, &axes);
        let Some((multibody, _)) = engine.multibody_joints.get_mut(carrier) else {
            return;
        };
        let (shift, turn) = (axes.inverse() * shift / secs, axes.inverse() * turn / secs);
        for (velocity, of) in multibody
            .generalized_velocity_mut()
            .iter_mut()
            .zip([shift.x, shift.y, turn.x])
        {
            *velocity = to_real(of);
        }
    }

    /// Lets the engine move the links that it does not own to where the joints are, in its
    /// next step.
    pub(super) fn lead_links(&self, engine: &mut PhysicsWorld) {
        let poses = self.kinematics.links(&self.positions);
        for (body, pose) in self.bodies.iter().zip(&poses).skip(1) {
            let Some(known) = engine.bodies.get(*body).filter(|body| body.is_kinematic()) else {
                continue;
            };
            let pose = to_pose(pose);
            if *known.position() != pose
                && let Some(body) = engine.bodies.get_mut(*body)
            {
                body.set_next_kinematic_position(pose);
            }
        }
    }

    /// Moves all links and their colliders to where the joints are, at once.
    pub(super) fn place_links(&self, engine: &mut PhysicsWorld) {
        if self.ownership != Ownership::Nothing {
            return self.put_state(engine);
        }
        let poses = self.kinematics.links(&self.positions);
        for (body, pose) in self.bodies.iter().zip(&poses).skip(1) {
            let pose = to_pose(pose);
            if engine
                .bodies
                .get(*body)
                .is_some_and(|body| *body.position() != pose)
                && let Some(body) = engine.bodies.get_mut(*body)
            {
                body.set_position(pose, false);
            }
        }
        self.place_colliders(engine);
    }

    /// Moves the colliders of links to where the links are.
    fn place_colliders(&self, engine: &mut PhysicsWorld) {
        for body in self
            .bodies
            .iter()
            .filter_map(|body| engine.bodies.get(*body))
        {
            for handle in body.colliders() {
                let Some(known) = engine.colliders.get(*handle) else {
                    continue;
                };
                let Some(on_body) = known.position_wrt_parent() else {
                    continue;
                };
                let pose = *body.position() * *on_body;
                if *known.position() != pose
                    && let Some(collider) = engine.colliders.get_mut(*handle)
                {
                    collider.set_position(pose);
                }
            }
        }
    }
}

/// Returns axes of which the first is along a rotation vector, and the second in the plane of this
/// and a displacement.
fn axes_along(turn: &Vector3<f64>, shift: &Vector3<f64>) -> UnitQuaternion<f64> {
    let unit = |vector: Vector3<f64>| vector.try_normalize(1e-12);
    let first = unit(*turn)
        .or_else(|| unit(*shift))
        .unwrap_or_else(Vector3::x);
    let across = |vector: Vector3<f64>| unit(vector - first * first.dot(&vector));
    // At least one of two axes is far from the first.
    let any = if first.x.abs() < 0.8 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let second = across(*shift)
        .or_else(|| across(any))
        .unwrap_or_else(Vector3::y);
    let third = first.cross(&second);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_columns(
        &[first, second, third],
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reach::Reach;
    use crate::robot::tests::lonely;
    use crate::simulation::tests::{bodies, step_with};

    #[test]
    fn the_hand_is_the_link_that_carries_both_fingers() {
        let world = lonely();
        let robot = &bodies(&world).robot;
        let hand = robot.hand.as_ref().expect("the shipped robot has a hand");
        let names = |links: &dyn Fn(usize) -> bool| -> Vec<&str> {
            (0..robot.bodies.len())
                .filter(|idx| links(*idx))
                .map(|idx| robot.model.links[idx].name.as_str())
                .collect()
        };
        assert_eq!(robot.model.links[hand.link].name, "wrist_roll_link");
        assert_eq!(
            names(&|link| hand.has(link)),
            ["wrist_roll_link", "finger_right_link", "finger_left_link"],
            "the hand's links"
        );
        assert_eq!(
            names(&|link| link > 0 && hand.moves(link - 1)),
            ["finger_right_link", "finger_left_link"]
        );
    }

    /// The engine takes the whole robot, its hand, nothing and all again, tick by tick, while all
    /// joints move.
    #[test]
    fn a_motion_goes_on_while_the_engine_takes_and_returns_parts_of_the_robot() {
        let (mut changing, mut whole) = (lonely(), lonely());
        let mut command = whole.hold();
        // The arm moves away from the body.
        let base = whole.layout().base.expect("it drives");
        let ways = base
            .map(|joint| (joint, 0.3))
            .into_iter()
            .chain([(whole.layout().arm[0], 0.2), (whole.layout().arm[1], -0.3)]);
        for (joint, way) in ways {
            command.positions[joint] += way;
        }
        command.gripper_opening_m = 0.02;
        let order = [
            Reach::Hand,
            Reach::All,
            Reach::Apart,
            Reach::Hand,
            Reach::Nothing,
            Reach::Hand,
            Reach::All,
        ];
        for tick in 0..140 {
            // Joints that start at once differ by the errors of the engine's substeps, until they
            // arrive.
            let most = if tick < 100 { 1e-2 } else { 1e-3 };
            for (world, reach) in [
                (&mut changing, order[tick / 2 % order.len()]),
                (&mut whole, Reach::All),
            ] {
                step_with(world, &command, reach);
                assert_eq!(world.fault(), None);
            }
            let (one, other) = (changing.observe(), whole.observe());
            for (idx, joint) in whole.kinematics().joints().iter().enumerate() {
                let off = (one.positions[idx] - other.positions[idx]).abs();
                assert!(off < most, "{} is {off} off in tick {tick}", joint.name);
            }
            let poses = bodies(&changing)
                .robot
                .kinematics
                .links(&bodies(&changing).robot.positions);
            for (body, pose) in bodies(&changing).robot.bodies.iter().zip(&poses) {
                let at = from_pose(bodies(&changing).physics.bodies[*body].position());
                assert!(
                    (at.translation.vector - pose.translation.vector).norm() < 1e-4,
                    "tick {tick}"
                );
            }
        }
    }

    #[test]
    fn every_motion_is_along_the_first_two_axes_and_about_the_first() {
        let vectors = [
            Vector3::zeros(),
            Vector3::x(),
            Vector3::new(0.3, -0.2, 0.9),
            Vector3::new(1e-7, 2e-7, 0.0),
        ];
        for turn in vectors {
            for shift in vectors {
                let axes = axes_along(&turn, &shift);
                let (turn_there, shift_there) = (axes.inverse() * turn, axes.inverse() * shift);
                assert!(
                    turn_there.y.abs().max(turn_there.z.abs()) < 1e-12 + 1e-9 * turn.norm(),
                    "{turn_there}"
                );
                assert!(
                    shift_there.z.abs() < 1e-12 + 1e-9 * shift.norm(),
                    "{shift_there}"
                );
            }
        }
    }
}
