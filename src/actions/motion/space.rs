//! What the arm keeps clear of: furniture and things as they are seen, the floor, and the robot itself.

use nalgebra::{Isometry3, Point3};

use crate::actions::route::{Block, Pillar};
use crate::world::{JointKind, Kinematics, Layout, SelfContact};

/// Distance between checked points of the arm, and the farthest that one goes between checked postures. Unit: metres.
const CHECK_M: f64 = 0.03;
/// Most postures that are checked on one straight way.
const MOST_CHECKS: f64 = 400.0;
/// Joints without limits are sampled this far to both sides. Unit: radians.
const HALF_TURN: f64 = std::f64::consts::PI;

/// Distances that the arm keeps. Unit: metres; negative inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// To furniture and to the floor.
    pub furniture_m: f64,
    /// To things.
    pub things_m: f64,
}

impl Room {
    /// What both have.
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        Self { furniture_m: self.furniture_m.min(other.furniture_m), things_m: self.things_m.min(other.things_m) }
    }

    /// Whether there is at least as much room.
    fn holds(self, least: Self) -> bool {
        self.furniture_m >= least.furniture_m && self.things_m >= least.things_m
    }
}

/// The postures of an arm among what is seen, the base and all other joints being where they are.
#[derive(Clone)]
pub struct ArmSpace<'a> {
    kinematics: &'a Kinematics,
    arm: &'a [usize],
    /// Points of what the arm moves: link, and place on it.
    points: Vec<(usize, Point3<f64>)>,
    furniture: &'a [Block],
    things: &'a [Pillar],
    itself: SelfContact,
    /// How far a point can go at most for each unit that a joint of the arm goes. Unit: metres, or 1.
    levers: Vec<f64>,
}

impl<'a> ArmSpace<'a> {
    /// The space of a robot's arm; `right` are postures in which links that meet are meant to.
    pub fn new(
        kinematics: &'a Kinematics,
        layout: &'a Layout,
        furniture: &'a [Block],
        things: &'a [Pillar],
        right: &[Vec<f64>],
    ) -> Self {
        let moved = moved_links(kinematics, &layout.arm);
        let points: Vec<(usize, Point3<f64>)> =
            kinematics.surface_points(CHECK_M).into_iter().filter(|(link, _)| moved[*link]).collect();
        let levers = layout.arm.iter().map(|joint| lever(kinematics, *joint, &points)).collect();
        let itself = SelfContact::new(kinematics, right);
        Self { kinematics, arm: &layout.arm, points, furniture, things, itself, levers }
    }

    /// The same among other things.
    pub fn among(&self, things: &'a [Pillar]) -> Self {
        Self { things, ..self.clone() }
    }

    /// The posture at a point of the unit cube: joints of the arm within their limits, all others as in `like`.
    pub(super) fn posture(&self, point: &[f64], like: &[f64]) -> Vec<f64> {
        let mut positions = like.to_vec();
        for (idx, share) in self.arm.iter().zip(point) {
            let joint = &self.kinematics.joints()[*idx];
            let (lower, upper) = (joint.lower.max(-HALF_TURN), joint.upper.min(HALF_TURN));
            positions[*idx] = lower + (upper - lower) * share;
        }
        positions
    }

    /// Gives a posture the arm of another.
    pub(super) fn copy_arm(&self, from: &[f64], to: &mut [f64]) {
        self.arm.iter().for_each(|idx| to[*idx] = from[*idx]);
    }

    /// How many joints the arm has.
    pub(super) fn n_joints(&self) -> usize {
        self.arm.len()
    }

    /// No point of the arm goes further than this on the straight way between two postures. Unit: metres.
    pub fn span(&self, from: &[f64], to: &[f64]) -> f64 {
        self.arm.iter().zip(&self.levers).map(|(idx, lever)| (to[*idx] - from[*idx]).abs() * lever).sum()
    }

    /// The room around a posture, and whether the robot keeps clear of itself.
    pub fn room(&self, positions: &[f64]) -> (Room, bool) {
        let links = self.kinematics.links(positions);
        (self.room_of(&links), !self.itself.touches(&links))
    }

    fn room_of(&self, links: &[Isometry3<f64>]) -> Room {
        let mut room = Room { furniture_m: f64::INFINITY, things_m: f64::INFINITY };
        for (link, point) in &self.points {
            let point = links[*link] * point;
            room.furniture_m = self
                .furniture
                .iter()
                .fold(room.furniture_m.min(point.z), |least, block| least.min(block.distance(&point)));
            room.things_m = self.things.iter().fold(room.things_m, |least, pillar| least.min(pillar.distance(&point)));
        }
        room
    }

    /// Whether a posture keeps clear of everything.
    pub fn is_free(&self, positions: &[f64], least: Room) -> bool {
        let (room, clear_of_itself) = self.room(positions);
        clear_of_itself && room.holds(least)
    }

    /// Whether the straight way between two postures does, its first end apart.
    pub fn is_way_free(&self, from: &[f64], to: &[f64], least: Room) -> bool {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred at most")]
        let n_steps = (self.span(from, to) / CHECK_M).ceil().clamp(1.0, MOST_CHECKS) as usize;
        // From the far end, where most ways are not free.
        (1..=n_steps).rev().all(|step| self.is_free(&between(from, to, step as f64 / n_steps as f64), least))
    }
}

/// The posture at a share of the straight way.
pub(super) fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect()
}

/// Which links a joint of the arm moves.
fn moved_links(kinematics: &Kinematics, arm: &[usize]) -> Vec<bool> {
    let mut moved = vec![false];
    for (idx, joint) in kinematics.joints().iter().enumerate() {
        moved.push(arm.contains(&idx) || moved[joint.parent]);
    }
    moved
}

/// How far the farthest point behind a joint can be from it: with all links in line. A joint that slides moves them by as
/// much as it goes.
fn lever(kinematics: &Kinematics, joint: usize, points: &[(usize, Point3<f64>)]) -> f64 {
    let joints = kinematics.joints();
    if joints[joint].kind == JointKind::Prismatic {
        return 1.0;
    }
    let length = |point: &(usize, Point3<f64>)| {
        let (mut link, mut length) = (point.0, point.1.coords.norm());
        while link > 0 && link != joint + 1 {
            let inner = &joints[link - 1];
            let slides = if inner.kind == JointKind::Prismatic { inner.upper.abs().min(1.0) } else { 0.0 };
            length += inner.origin.translation.vector.norm() + slides;
            link = inner.parent;
        }
        if link == joint + 1 { length } else { 0.0 }
    };
    points.iter().map(length).fold(0.0, f64::max)
}
