//! The part of the robot that the engine moves.
//!
//! The engine needs a multibody only for links that touch something. Its cost grows with the square of the number of
//! joints. Links outside of it are kinematic bodies, which the robot's own solution places. A hand alone moves in the
//! engine on a carrier: six coordinates with a large inertia, whose velocities lead it along the path of the arm.

use nalgebra::Isometry3;
use rapier3d::prelude::{
    GenericJoint, JointAxesMask, MultibodyDofCoupling, MultibodyJointHandle, PhysicsWorld, RigidBodyType,
};

use crate::assemble::insert_joint;
use crate::convert::{from_pose, to_pose, to_real, to_vector};
use crate::description::RobotModel;
use crate::gripper::Gripper;
use crate::robot::Robot;

/// Inertia of the carrier of a hand: contacts and motors of the fingers change its velocity by less than a millionth.
/// Units: kilograms and kg·m².
const CARRIER_INERTIA: f32 = 1e4;

/// The part of the robot that the engine moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Share {
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
    /// Returns the hand of a robot. Returns `None` if the fingers are on the root, or follow a joint outside the hand.
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
        let mut moved = model.joints.iter().enumerate().filter(|(idx, _)| hand.moves(*idx));
        let alone = moved.all(|(_, joint)| joint.mimic.is_none_or(|(leader, ..)| hand.moves(leader)));
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

impl Robot {
    /// Returns whether the engine moves a joint.
    pub(super) fn shares(&self, joint: usize) -> bool {
        match self.share {
            Share::Nothing => false,
            Share::Hand => self.hand.as_ref().is_some_and(|hand| hand.moves(joint)),
            Share::Whole => true,
        }
    }

    /// Gives this part of the robot to the engine, in the robot's state, and takes the others from it.
    pub(super) fn hand_over(&mut self, engine: &mut PhysicsWorld, share: Share) {
        if self.share == share {
            return;
        }
        (self.share, self.carrier) = (share, None);
        if let Some(body) = self.bodies.get(1) {
            // The link of the hand is a root or follows one, as all others do.
            engine.multibody_joints.remove_multibody_articulations(*body, false);
        }
        if let Some(hand) = &self.hand {
            engine.multibody_joints.remove_multibody_articulations(self.bodies[hand.link], false);
        }
        let poses = self.kinematics.links(&self.positions);
        for (idx, (body, pose)) in self.bodies.iter().zip(&poses).enumerate().skip(1) {
            let given = match share {
                Share::Nothing => false,
                Share::Hand => self.hand.as_ref().is_some_and(|hand| hand.has(idx)),
                Share::Whole => true,
            };
            let kind = if given { RigidBodyType::Dynamic } else { RigidBodyType::KinematicPositionBased };
            if let Some(body) = engine.bodies.get_mut(*body) {
                body.set_body_type(kind, false);
                body.set_position(to_pose(pose), false);
            }
        }
        self.insert_share(engine);
        self.put_state(engine);
    }

    /// Inserts the joints of the engine's share.
    fn insert_share(&mut self, engine: &mut PhysicsWorld) {
        if let (Share::Hand, Some(hand)) = (self.share, &self.hand) {
            let mut free = GenericJoint::new(JointAxesMask::empty());
            free.set_local_frame1(to_pose(&self.kinematics.root().inverse()));
            self.carrier = engine.multibody_joints.insert(self.bodies[0], self.bodies[hand.link], free, true);
        }
        for idx in 0..self.motors.len() {
            if self.shares(idx)
                && let Some(handle) = insert_joint(engine, &self.model.joints[idx], idx, &self.bodies)
            {
                self.motors[idx].joint = handle;
            }
        }
        self.finish_share(engine);
    }

    /// Finishes the engine's share once its joints are inserted.
    pub(super) fn finish_share(&self, engine: &mut PhysicsWorld) {
        let Some(first) = self.first_shared() else { return };
        let Some((multibody, _)) = engine.multibody_joints.get_mut(first) else { return };
        // This determines whether the root is fixed, and with it the index of each joint's coordinate.
        multibody.forward_kinematics(&engine.bodies, true);
        if self.share == Share::Hand {
            multibody.armature_mut().rows_mut(0, 6).fill(CARRIER_INERTIA);
            multibody.damping_mut().rows_mut(0, 6).fill(0.0);
        }
        self.couple_mimics(engine);
    }

    /// Returns a joint of the engine's multibody, or `None` if there is none.
    fn first_shared(&self) -> Option<MultibodyJointHandle> {
        match self.share {
            Share::Nothing => None,
            Share::Hand => self.carrier,
            Share::Whole => self.motors.first().map(|motor| motor.joint),
        }
    }

    /// Couples mimic joints to their leaders, as a mechanism does.
    fn couple_mimics(&self, engine: &mut PhysicsWorld) {
        for (follower, joint) in self.model.joints.iter().enumerate().filter(|(idx, _)| self.shares(*idx)) {
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

    /// Sets the joints of the engine's share to the robot's state.
    pub(super) fn put_state(&self, engine: &mut PhysicsWorld) {
        let Some(first) = self.first_shared() else { return };
        let poses = self.kinematics.links(&self.positions);
        let dofs: Vec<Option<(usize, f64)>> = (0..self.motors.len())
            .map(|idx| {
                let (multibody, link) = engine.multibody_joints.get(self.motors[idx].joint)?;
                let link = multibody.link(link).filter(|_| self.shares(idx))?;
                Some((link.assembly_id(), f64::from(link.joint.coords()[self.motors[idx].axis as usize])))
            })
            .collect();
        let Some((multibody, carrier)) = engine.multibody_joints.get_mut(first) else { return };
        let mut ways = vec![0.0_f32; multibody.ndofs()];
        for (idx, dof) in dofs.into_iter().enumerate() {
            let Some((dof, before)) = dof else { continue };
            ways[dof] = to_real(self.positions[idx] - before);
            multibody.generalized_velocity_mut()[dof] = to_real(self.velocities[idx]);
        }
        if let (Share::Hand, Some(hand)) = (self.share, &self.hand) {
            let before = multibody.link(carrier).map_or_else(Isometry3::identity, |link| from_pose(link.local_to_world()));
            ways[..6].copy_from_slice(&way_to(&before, &poses[hand.link]));
        }
        multibody.apply_displacements(&ways);
        multibody.forward_kinematics(&engine.bodies, false);
        multibody.update_rigid_bodies(&mut engine.bodies, true);
        self.place_colliders(engine);
    }

    /// Reads the state of the joints that the engine moves.
    pub(super) fn take_state(&mut self, engine: &PhysicsWorld) {
        for idx in 0..self.motors.len() {
            if !self.shares(idx) {
                continue;
            }
            let motor = &self.motors[idx];
            let Some((multibody, link)) = engine.multibody_joints.get(motor.joint) else { continue };
            let Some(link) = multibody.link(link) else { continue };
            self.positions[idx] = f64::from(link.joint.coords()[motor.axis as usize]);
            self.velocities[idx] = f64::from(multibody.joint_velocity(link)[0]);
        }
    }

    /// Leads the engine's hand to the pose of the robot's in a step of `secs`.
    pub(super) fn lead_hand(&self, engine: &mut PhysicsWorld, secs: f64) {
        let (Some(hand), Some(carrier)) = (&self.hand, self.carrier) else { return };
        let to = self.kinematics.links(&self.positions)[hand.link];
        let Some((multibody, link)) = engine.multibody_joints.get_mut(carrier) else { return };
        let Some(from) = multibody.link(link).map(|link| from_pose(link.local_to_world())) else { return };
        let way = way_to(&from, &to);
        for (velocity, way) in multibody.generalized_velocity_mut().iter_mut().zip(way) {
            *velocity = way / to_real(secs);
        }
    }

    /// Lets the engine move the links that are not in its share to where the joints are, in its next step.
    pub(super) fn lead_links(&self, engine: &mut PhysicsWorld) {
        let poses = self.kinematics.links(&self.positions);
        for (body, pose) in self.bodies.iter().zip(&poses).skip(1) {
            let Some(known) = engine.bodies.get(*body).filter(|body| body.is_kinematic()) else { continue };
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
        if self.share != Share::Nothing {
            return self.put_state(engine);
        }
        let poses = self.kinematics.links(&self.positions);
        for (body, pose) in self.bodies.iter().zip(&poses).skip(1) {
            let pose = to_pose(pose);
            if engine.bodies.get(*body).is_some_and(|body| *body.position() != pose)
                && let Some(body) = engine.bodies.get_mut(*body)
            {
                body.set_position(pose, false);
            }
        }
        self.place_colliders(engine);
    }

    /// Moves the colliders of links to where the links are.
    fn place_colliders(&self, engine: &mut PhysicsWorld) {
        for body in self.bodies.iter().filter_map(|body| engine.bodies.get(*body)) {
            for handle in body.colliders() {
                let Some(known) = engine.colliders.get(*handle) else { continue };
                let Some(on_body) = known.position_wrt_parent() else { continue };
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

/// Returns the displacement and the rotation vector from one pose to another. Frame: world.
fn way_to(from: &Isometry3<f64>, to: &Isometry3<f64>) -> [f32; 6] {
    let shift = to_vector(&(to.translation.vector - from.translation.vector)).to_array();
    let turn = to_vector(&(to.rotation * from.rotation.inverse()).scaled_axis()).to_array();
    [shift[0], shift[1], shift[2], turn[0], turn[1], turn[2]]
}
