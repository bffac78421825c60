//! Decides whether the robot can touch anything in the next control tick.
//!
//! A free tick needs no contacts. For each link of the robot, the last measured distance from everything else is kept,
//! with the pose of the link at that time. The way that it has moved since, and the longest way in the next tick, are
//! subtracted; the distance is measured again only when too little is left. All of this depends on the state of the
//! simulation alone.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::query::distance;
use rapier3d::prelude::Collider;

use crate::World;
use crate::clearance::gap;
use crate::description::JointKind;
use crate::kinematics::axis_in_world;

/// Distances are measured up to this. Unit: metres.
const RANGE_M: f64 = 0.25;
/// Distance that remains after a free tick: that at which the engine prepares contacts, and the errors of its 32-bit
/// distances. Unit: metres.
const LEFT_M: f64 = 4e-3;
/// As [`LEFT_M`], between two links of the robot. Unit: metres.
const LEFT_OF_LINKS_M: f64 = 1e-3;
/// Factor on the present and the commanded speeds of joints, because joints overshoot.
const OVERSHOOT: f64 = 1.25;

/// The distances of the robot's links from everything.
#[derive(Default)]
pub(super) struct Room {
    /// Distances of links from the floor and all objects, by the link's index.
    links: Vec<Option<Measured>>,
    /// Distances between the pairs of links that can collide, in their order.
    pairs: Vec<Option<Measured>>,
    /// Whether the last tick was free.
    pub(super) free: bool,
    /// Whether all ticks are left to the engine.
    pub(super) engine_only: bool,
}

/// A distance, and where the link was when it was measured: in the world, or in the frame of the other link.
#[derive(Debug, Clone, Copy)]
struct Measured {
    gap_m: f64,
    pose: Isometry3<f64>,
}

impl Measured {
    /// Returns a lower bound of the distance with the link at another pose. Unit: metres.
    fn left(&self, pose: &Isometry3<f64>, ball: &Ball) -> f64 {
        let shift = (pose * ball.middle - self.pose * ball.middle).norm();
        // At least the angle, for all angles up to half a turn.
        let turn = (self.pose.rotation.inverse() * pose.rotation).imag().norm() * std::f64::consts::PI;
        self.gap_m - shift - turn * ball.radius
    }
}

/// The bounding ball of a link's shapes, in the link's frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    pub(super) middle: Point3<f64>,
    pub(super) radius: f64,
}

/// The robot at the beginning of a tick.
struct Moment {
    poses: Vec<Isometry3<f64>>,
    /// How far each joint can move in the tick. Units: metres or radians.
    spans: Vec<f64>,
}

impl World {
    /// Leaves all ticks to the engine, also those in which the robot touches nothing: for comparisons.
    pub fn leave_to_engine(&mut self) {
        self.room.engine_only = true;
    }

    /// Returns whether the robot moved through free space in the last tick, without the engine.
    pub fn moved_freely(&self) -> bool {
        self.room.free
    }

    /// Returns whether the robot touches nothing in the next tick and everything else is at rest, so that the robot
    /// moves as in free space.
    pub(super) fn find_room(&mut self) -> bool {
        let mut room = std::mem::take(&mut self.room);
        room.free = !room.engine_only && self.is_free(&mut room);
        self.room = room;
        self.room.free
    }

    fn is_free(&self, room: &mut Room) -> bool {
        let rests = |object: &crate::simulation::Object| {
            self.engine.bodies.get(object.body).is_none_or(|body| body.is_fixed() || body.is_sleeping())
        };
        let n_pairs = self.link_pairs.iter().count();
        if !self.sliding.is_empty() || !self.objects.iter().all(rests) {
            room.links.clear();
            room.pairs.clear();
            return false;
        }
        room.links.resize(self.robot.bodies.len(), None);
        room.pairs.resize(n_pairs, None);
        let (positions, velocities) = self.robot.state(&self.engine);
        let spans = self.robot.spans(&positions, &velocities, self.tick_secs(), OVERSHOOT);
        let now = Moment { poses: self.robot.kinematics.links(&positions), spans };
        self.has_room_for_links(&mut room.links, &now) && self.has_room_between_links(&mut room.pairs, &now)
    }

    fn has_room_for_links(&self, known: &mut [Option<Measured>], now: &Moment) -> bool {
        (0..known.len()).all(|link| {
            let Some(ball) = self.robot.balls[link] else { return true };
            let pose = now.poses[link];
            let ahead = self.robot.joints_to(link).map(|joint| self.way(joint, link, &ball, now)).sum::<f64>();
            if known[link].is_none_or(|known| known.left(&pose, &ball) - ahead < LEFT_M) {
                known[link] = Some(Measured { gap_m: self.gap_of_link(link), pose });
            }
            known[link].is_some_and(|known| known.left(&pose, &ball) - ahead >= LEFT_M)
        })
    }

    fn has_room_between_links(&self, known: &mut [Option<Measured>], now: &Moment) -> bool {
        if self.link_pairs.pass {
            return true;
        }
        self.link_pairs.iter().zip(known).all(|((first, second), known)| {
            let (Some(one), Some(other)) = (self.robot.balls[first], self.robot.balls[second]) else { return true };
            let pose = now.poses[first].inverse() * now.poses[second];
            let mut ahead = 0.0;
            for joint in self.robot.joints_to(first).filter(|joint| !self.robot.moves(*joint, second)) {
                ahead += self.way(joint, first, &one, now);
            }
            for joint in self.robot.joints_to(second).filter(|joint| !self.robot.moves(*joint, first)) {
                ahead += self.way(joint, second, &other, now);
            }
            if known.is_none_or(|known| known.left(&pose, &other) - ahead < LEFT_OF_LINKS_M) {
                *known = Some(Measured { gap_m: self.gap_of_links(first, second), pose });
            }
            known.is_some_and(|known| known.left(&pose, &other) - ahead >= LEFT_OF_LINKS_M)
        })
    }

    /// Returns how far one joint can move any point of a link in the tick. Unit: metres.
    fn way(&self, joint: usize, link: usize, ball: &Ball, now: &Moment) -> f64 {
        let (axis, point) = axis_in_world(&self.robot.model.joints[joint], &now.poses);
        match self.robot.model.joints[joint].kind {
            JointKind::Prismatic => now.spans[joint],
            JointKind::Revolute => {
                let arm: Vector3<f64> = (now.poses[link] * ball.middle).coords - point;
                now.spans[joint] * (arm.cross(&axis).norm() + ball.radius)
            }
        }
    }

    /// Measures the distance of a link from the floor and all objects. Unit: metres.
    fn gap_of_link(&self, link: usize) -> f64 {
        let mut nearest = RANGE_M;
        for solid in self.colliders_of(self.robot.bodies[link]) {
            let its_box = solid.compute_aabb();
            if !self.robot.off_floor[link] {
                // The distance from the top of so large a slab would be inexact.
                nearest = nearest.min(f64::from(its_box.mins.z));
            }
            for object in &self.objects {
                for other in self.colliders_of(object.body) {
                    nearest = nearest.min(apart(solid, &its_box, other, nearest));
                }
            }
        }
        nearest
    }

    fn gap_of_links(&self, first: usize, second: usize) -> f64 {
        let mut nearest = RANGE_M;
        for solid in self.colliders_of(self.robot.bodies[first]) {
            let its_box = solid.compute_aabb();
            for other in self.colliders_of(self.robot.bodies[second]) {
                nearest = nearest.min(apart(solid, &its_box, other, nearest));
            }
        }
        nearest
    }
}

/// Returns the distance of two colliders, or `most` if it is larger. Unit: metres.
fn apart(one: &Collider, its_box: &Aabb, other: &Collider, most: f64) -> f64 {
    if gap(its_box, &other.compute_aabb()) >= most {
        return most;
    }
    let found = distance(one.position(), one.shape(), other.position(), other.shape());
    found.map_or(0.0, |found| f64::from(found.distance)).min(most)
}
