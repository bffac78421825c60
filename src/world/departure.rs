//! Objects that leave the world: those that the robot flings, pushes or drops out of it, and those
//! that a fault of the simulation moves there.
//!
//! It is the robot's doing if a link pressed the object since the first action began, or an object
//! that moved because a link had pressed it, and if all of its motion since then was plausible:
//! never too fast, without jumps, and never deep in another body. Such an object stays where it
//! left, and the run goes on. Everything else that leaves is a fault.

use nalgebra::Vector3;
use rapier3d::prelude::RigidBodyType;

use crate::bodies::Bodies;
use crate::contacts::Touches;
use crate::fault::{self, Fault};
use crate::link_pairs::LinkPairs;
use crate::physics::Owner;
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
struct Motions {
    /// Whether the robot pressed it, or something that moved because of the robot.
    moved: bool,
    /// Whether no push of a robot explains its motion.
    implausible: bool,
    /// Position after the last tick.
    last: Option<Vector3<f64>>,
}

/// The objects that the robot moves, and the fault of a simulation.
#[derive(Debug, Default)]
pub(super) struct Departures {
    /// The known motion of each object; empty before the first record.
    motions: Vec<Motions>,
    fault: Option<Fault>,
    /// The words of a panic in the engine.
    panicked: Option<String>,
}

impl Departures {
    /// Returns the fault of the simulation, or `None` if there is none. A fault is permanent.
    pub(super) fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// Notes that this joint is a fault.
    pub(super) fn fault_of_joint(&mut self, joint: String) {
        self.fault = Some(Fault::Joint(joint));
    }

    /// Notes why another engine can't go on, which is a fault.
    pub(super) fn other_engine_failed(&mut self, why: String) {
        self.fault = Some(Fault::OtherEngine(why));
    }

    /// Notes the words of a panic in the engine, which are a fault.
    pub(super) fn engine_panicked(&mut self, words: String) {
        self.panicked = Some(words);
    }

    /// Records after a tick the objects that the robot moves, and whether they move plausibly.
    pub(super) fn record(&mut self, bodies: &Bodies, touches: &Touches) {
        let mut motions = std::mem::take(&mut self.motions);
        motions.resize(bodies.objects.len(), Motions::default());
        let rests: Vec<bool> = bodies
            .objects
            .iter()
            .map(|object| bodies.rests(object))
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
        for ((object, motion), rests) in bodies.objects.iter().zip(&mut motions).zip(rests) {
            let Some(body) = bodies
                .physics
                .bodies
                .get(object.body)
                .filter(|_| !object.fixed)
            else {
                continue;
            };
            let at = from_vector(body.translation());
            let jump_m = motion.last.map_or(0.0, |last| (at - last).norm());
            let is_fast = !rests && from_vector(body.linvel()).norm() > MOST_M_S;
            motion.implausible |= is_fast || jump_m > MOST_M_S * bodies.tick_secs() + SLACK_M;
            motion.last = Some(at);
        }
        self.motions = motions;
    }

    /// Finds a fault after a step. Objects that the robot moved out of the world are stopped there
    /// instead.
    pub(super) fn check(&mut self, bodies: &mut Bodies, link_pairs: &LinkPairs) {
        self.fault = self.find_fault(bodies);
        while let Some(Fault::LeftWorld { id, position }) = &self.fault {
            let at = Vector3::from(*position);
            let Some(idx) = bodies.index_of(id) else {
                break;
            };
            if !self.is_moved_out(bodies, idx, at) {
                break;
            }
            stop_outside(bodies, link_pairs, idx);
            self.fault = self.find_fault(bodies);
        }
    }

    /// Returns whether the robot moved an object to this place outside of the world.
    fn is_moved_out(&self, bodies: &Bodies, object: usize, at: Vector3<f64>) -> bool {
        // No push moves anything through the floor.
        if at.z < -fault::WORLD_DEPTH_M || at.z > fault::WORLD_RADIUS_M {
            return false;
        }
        let speed = bodies
            .physics
            .bodies
            .get(bodies.objects[object].body)
            .map(|body| from_vector(body.linvel()).norm());
        let jumped =
            |last: Vector3<f64>| (at - last).norm() > MOST_M_S * bodies.tick_secs() + SLACK_M;
        let moves_so = |motion: &Motions| {
            motion.moved
                && !motion.implausible
                && !bodies.has_left(object)
                && !motion.last.is_none_or(jumped)
        };
        self.motions.get(object).is_some_and(moves_so)
            && speed.is_some_and(|speed| speed <= MOST_M_S)
    }

    fn find_fault(&self, bodies: &Bodies) -> Option<Fault> {
        if let Some(words) = &self.panicked {
            return Some(Fault::Engine(words.clone()));
        }
        // Static bodies may reach far below the floor, as foundations do.
        let objects = bodies.objects.iter().enumerate();
        let objects = objects.map(|(idx, object)| {
            (
                object.id.as_str(),
                object.body,
                !object.fixed && !bodies.has_left(idx),
            )
        });
        let links = bodies.robot.model.links.iter().zip(&bodies.robot.bodies);
        let links = links.map(|(link, body)| (link.name.as_str(), *body, true));
        let quarantined = bodies.physics.quarantine().bodies();
        for (id, handle, moves) in objects.chain(links) {
            let Some(body) = bodies.physics.bodies.get(handle) else {
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
        bodies
            .robot
            .invalid_joint()
            .map(|joint| Fault::Joint(joint.to_owned()))
    }
}

/// Lets an object, with the parts of the same whole, stay where it is, out of the reach of
/// everything.
fn stop_outside(bodies: &mut Bodies, link_pairs: &LinkPairs, object: usize) {
    let own = link_pairs.whole_of(object);
    let parts: Vec<usize> = (0..bodies.objects.len())
        .filter(|idx| link_pairs.whole_of(*idx) == own)
        .collect();
    for idx in parts {
        bodies.left.insert(idx);
        let Some(body) = bodies.physics.bodies.get_mut(bodies.objects[idx].body) else {
            continue;
        };
        body.set_linvel(rapier3d::math::Vector::ZERO, false);
        body.set_angvel(rapier3d::math::Vector::ZERO, false);
        body.set_body_type(RigidBodyType::Fixed, false);
        for handle in body.colliders().to_vec() {
            if let Some(collider) = bodies.physics.colliders.get_mut(handle) {
                collider.set_enabled(false);
            }
        }
    }
}
