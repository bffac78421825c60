//! Objects that leave the world: those that the robot flings, pushes or drops out of it, and those
//! that a fault of the simulation moves there.
//!
//! It is the robot's doing if a link pressed the object since the first action began, or an object
//! that moved because a link had pressed it, and if all of its motion since then was plausible:
//! never too fast, without jumps, and never deep in another body. Such an object stays where it
//! left, and the run goes on. Everything else that leaves is a fault.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rapier3d::prelude::RigidBodyType;

use crate::contacts::Touch;
use crate::engine::Owner;
use crate::{Fault, World, fault};
use actcheck_geometry::from_vector;

/// No object that a robot moves is faster. Unit: m/s. A blow by a link at 4 m/s, faster than most
/// arms, gives a light ball 8 m/s, and a fall from 1.5 m adds 3.4 m/s.
const MOST_M_S: f64 = 12.0;
/// Objects are never deeper in others, unless physics fails. Unit: metres. Contacts of a grasp are
/// some tenths of a millimetre deep, blows a few millimetres.
const MOST_DEPTH_M: f64 = 0.02;
/// Slack of the way in a tick. Unit: metres. Origins of objects that turn are off their centres of
/// mass.
const SLACK_M: f64 = 0.02;

/// The known motion of an object.
#[derive(Debug, Clone, Default)]
pub(super) struct Motions {
    /// Whether the robot pressed it, or something that moved because of the robot.
    moved: bool,
    /// Whether no push of a robot explains its motion.
    implausible: bool,
    /// Position after the last tick.
    last: Option<Vector3<f64>>,
    /// Whether it has left the world.
    pub(super) left: bool,
}

impl World {
    /// Records after a tick the objects that the robot moves, and whether they move plausibly.
    pub(super) fn record_motions(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        let mut motions = std::mem::take(&mut self.motions);
        motions.resize(self.objects.len(), Motions::default());
        let rests: Vec<bool> = self
            .objects
            .iter()
            .map(|object| self.rests(object))
            .collect();
        for ((first, second), touch) in touches {
            let (Owner::Object(idx), other) = (first, second) else {
                continue;
            };
            let both: Vec<usize> = match other {
                Owner::Link(_) => vec![*idx],
                Owner::Object(other) if motions[*idx].moved && !rests[*idx] => vec![*other],
                Owner::Object(other) if motions[*other].moved && !rests[*other] => vec![*idx],
                _ => continue,
            };
            for idx in both {
                motions[idx].moved = true;
                motions[idx].implausible |= touch.depth_m > MOST_DEPTH_M;
            }
        }
        for ((object, motion), rests) in self.objects.iter().zip(&mut motions).zip(rests) {
            let Some(body) = self
                .engine
                .bodies
                .get(object.body)
                .filter(|_| !object.fixed)
            else {
                continue;
            };
            let at = from_vector(body.translation());
            let jump_m = motion.last.map_or(0.0, |last| (at - last).norm());
            let is_fast = !rests && from_vector(body.linvel()).norm() > MOST_M_S;
            motion.implausible |= is_fast || jump_m > MOST_M_S * self.tick_secs() + SLACK_M;
            motion.last = Some(at);
        }
        self.motions = motions;
    }

    /// Finds a fault after a step. Objects that the robot moved out of the world are stopped there
    /// instead.
    pub(super) fn check_faults(&mut self) {
        self.fault = self.find_fault();
        while let Some(Fault::LeftWorld { id, position }) = &self.fault {
            let at = Vector3::from(*position);
            let Some(idx) = self.objects.iter().position(|object| object.id == *id) else {
                break;
            };
            if !self.is_moved_out(idx, at) {
                break;
            }
            self.stop_outside(idx);
            self.fault = self.find_fault();
        }
    }

    /// Returns whether an object has left the world.
    pub(super) fn has_left(&self, object: usize) -> bool {
        self.motions.get(object).is_some_and(|motion| motion.left)
    }

    /// Returns whether the robot moved an object to this place outside of the world.
    fn is_moved_out(&self, object: usize, at: Vector3<f64>) -> bool {
        // No push moves anything through the floor.
        if at.z < -fault::WORLD_DEPTH_M || at.z > fault::WORLD_RADIUS_M {
            return false;
        }
        let speed = self
            .engine
            .bodies
            .get(self.objects[object].body)
            .map(|body| from_vector(body.linvel()).norm());
        let jumped =
            |last: Vector3<f64>| (at - last).norm() > MOST_M_S * self.tick_secs() + SLACK_M;
        self.motions.get(object).is_some_and(|motion| {
            motion.moved && !motion.implausible && !motion.left && !motion.last.is_none_or(jumped)
        }) && speed.is_some_and(|speed| speed <= MOST_M_S)
    }

    /// Lets an object, with the parts of the same whole, stay where it is, out of the reach of
    /// everything.
    fn stop_outside(&mut self, object: usize) {
        let whole = |idx: usize| self.link_pairs.wholes.get(&idx).copied().unwrap_or(idx);
        let own = whole(object);
        let parts: Vec<usize> = (0..self.objects.len())
            .filter(|idx| whole(*idx) == own)
            .collect();
        for idx in parts {
            self.motions[idx].left = true;
            let Some(body) = self.engine.bodies.get_mut(self.objects[idx].body) else {
                continue;
            };
            body.set_linvel(rapier3d::math::Vector::ZERO, false);
            body.set_angvel(rapier3d::math::Vector::ZERO, false);
            body.set_body_type(RigidBodyType::Fixed, false);
            for handle in body.colliders().to_vec() {
                if let Some(collider) = self.engine.colliders.get_mut(handle) {
                    collider.set_enabled(false);
                }
            }
        }
    }
}
