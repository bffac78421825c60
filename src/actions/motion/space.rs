//! Obstacles of the arm: perceived furniture and objects, the floor, and the robot itself.

use nalgebra::{Isometry3, Point3};

use crate::hindrance::Surroundings;
use crate::link_points::LinkPoints;
use crate::route::{Block, Pillar};
use actcheck_world::{JointKind, Kinematics, Layout, SelfContact};

/// Spacing of checked points on the arm, and the largest movement of a point between checked
/// postures. Unit: metres.
const CHECK_M: f64 = 0.03;
/// Largest number of postures checked on one straight path.
const MOST_CHECKS: f64 = 400.0;
/// Joints without limits are sampled this far in both directions. Unit: radians.
const HALF_TURN: f64 = std::f64::consts::PI;

/// Clearances of the arm. Unit: metres; negative inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmClearance {
    /// To furniture and to the floor.
    pub furniture_m: f64,
    /// To objects.
    pub things_m: f64,
}

impl ArmClearance {
    /// The smaller clearances of both.
    #[must_use]
    pub fn least(self, other: Self) -> Self {
        Self {
            furniture_m: self.furniture_m.min(other.furniture_m),
            things_m: self.things_m.min(other.things_m),
        }
    }

    /// Whether both clearances are at least these.
    pub fn holds(self, least: Self) -> bool {
        self.furniture_m >= least.furniture_m && self.things_m >= least.things_m
    }
}

/// The free space of an arm among perceived obstacles, with the base and all other joints fixed.
#[derive(Clone)]
pub struct ArmSpace<'a> {
    kinematics: &'a Kinematics,
    arm: &'a [usize],
    /// Points on the links that the arm moves.
    points: Vec<LinkPoints>,
    furniture: &'a [Block],
    things: &'a [Pillar],
    itself: SelfContact,
    /// Whether each link is part of the hand.
    is_hand: Vec<bool>,
    /// How much farther from furniture the arm stays than the hand. Unit: metres.
    arm_farther_m: f64,
    /// Largest movement of a point per unit of each arm joint's movement. Unit: metres, or 1.
    levers: Vec<f64>,
}

impl<'a> ArmSpace<'a> {
    /// The space of a robot's arm. Links that touch in the `right` postures are allowed to touch.
    pub fn new(
        kinematics: &'a Kinematics,
        layout: &'a Layout,
        furniture: &'a [Block],
        things: &'a [Pillar],
        right: &[Vec<f64>],
    ) -> Self {
        let moved = moved_links(kinematics, &layout.arm);
        let points: Vec<(usize, Point3<f64>)> = kinematics
            .surface_points(CHECK_M)
            .into_iter()
            .filter(|(link, _)| moved[*link])
            .collect();
        let levers = layout.arm.iter().map(|joint| {
            let followers = kinematics.followers_of(*joint);
            let of_followers: f64 = followers
                .map(|(own, factor)| factor.abs() * lever(kinematics, own, &points))
                .sum();
            lever(kinematics, *joint, &points) + of_followers
        });
        let levers = levers.collect();
        let itself = SelfContact::new(kinematics, right);
        let is_hand = moved_links(kinematics, layout.arm.last().copied().as_slice());
        let (arm, arm_farther_m) = (layout.arm.as_slice(), 0.0);
        let points = LinkPoints::grouped(&points);
        Self {
            kinematics,
            arm,
            points,
            furniture,
            things,
            itself,
            is_hand,
            arm_farther_m,
            levers,
        }
    }

    /// The same space for an arm that stays this much farther from furniture than its hand. Unit:
    /// metres.
    pub fn farther(self, arm_farther_m: f64) -> Self {
        Self {
            arm_farther_m,
            ..self
        }
    }

    /// The same space with other objects.
    pub fn among(&self, things: &'a [Pillar]) -> Self {
        Self {
            things,
            ..self.clone()
        }
    }

    /// The robot and the obstacles, for messages.
    pub fn surroundings(&self) -> Surroundings<'_> {
        Surroundings {
            kinematics: self.kinematics,
            points: &self.points,
            is_hand: &self.is_hand,
            furniture: self.furniture,
            things: self.things,
            arm_farther: false,
        }
    }

    /// The posture at a point of the unit cube: arm joints within their limits, all others as in
    /// `like`.
    pub(super) fn posture(&self, point: &[f64], like: &[f64]) -> Vec<f64> {
        let mut positions = like.to_vec();
        for (idx, share) in self.arm.iter().zip(point) {
            let joint = &self.kinematics.joints()[*idx];
            let (lower, upper) = (joint.lower.max(-HALF_TURN), joint.upper.min(HALF_TURN));
            positions[*idx] = lower + (upper - lower) * share;
        }
        self.kinematics.follow(&mut positions);
        positions
    }

    /// Copies the arm's joint positions from one posture to another.
    pub(super) fn copy_arm(&self, from: &[f64], to: &mut [f64]) {
        self.arm.iter().for_each(|idx| to[*idx] = from[*idx]);
        self.kinematics.follow(to);
    }

    /// Number of arm joints.
    pub(super) fn n_joints(&self) -> usize {
        self.arm.len()
    }

    /// Upper bound of the distance that any point of the arm moves on the straight path between two
    /// postures. Unit: metres.
    pub fn span(&self, from: &[f64], to: &[f64]) -> f64 {
        self.arm
            .iter()
            .zip(&self.levers)
            .map(|(idx, lever)| (to[*idx] - from[*idx]).abs() * lever)
            .sum()
    }

    /// The clearances of a posture, and whether it is free of self-collisions.
    pub fn clearance(&self, positions: &[f64]) -> (ArmClearance, bool) {
        let links = self.kinematics.links(positions);
        (self.clearance_of(&links), !self.itself.touches(&links))
    }

    /// The first two links of the robot that come too close to each other in a posture.
    pub fn touching(&self, positions: &[f64]) -> Option<(usize, usize)> {
        self.itself.touching(&self.kinematics.links(positions))
    }

    /// The clearances at these link poses.
    fn clearance_of(&self, links: &[Isometry3<f64>]) -> ArmClearance {
        let mut clearance = ArmClearance {
            furniture_m: f64::INFINITY,
            things_m: f64::INFINITY,
        };
        for points in &self.points {
            let pose = &links[points.link];
            let farther_m = self.farther_m(points);
            clearance.furniture_m = points.nearest(pose, clearance.furniture_m, |point| point.z);
            for block in self.furniture {
                clearance.furniture_m = points.nearest(pose, clearance.furniture_m, |point| {
                    block.distance(point) - farther_m
                });
            }
            for pillar in self.things {
                clearance.things_m =
                    points.nearest(pose, clearance.things_m, |point| pillar.distance(point));
            }
        }
        clearance
    }

    /// Whether all clearances at these link poses are at least these: less work than
    /// [`ArmSpace::clearance_of`].
    fn has_room(
        &self,
        links: &[Isometry3<f64>],
        ArmClearance {
            furniture_m,
            things_m,
        }: ArmClearance,
    ) -> bool {
        self.points.iter().all(|points| {
            let pose = &links[points.link];
            let farther_m = self.farther_m(points);
            let is_near = |block: &Block| {
                points.is_nearer(pose, furniture_m, |at| block.distance(at) - farther_m)
            };
            !points.is_nearer(pose, furniture_m, |at| at.z)
                && !self.furniture.iter().any(is_near)
                && !self
                    .things
                    .iter()
                    .any(|pillar| points.is_nearer(pose, things_m, |at| pillar.distance(at)))
        })
    }

    /// How much farther these points have to be from furniture. Unit: metres.
    fn farther_m(&self, points: &LinkPoints) -> f64 {
        if self.is_hand[points.link] {
            0.0
        } else {
            self.arm_farther_m
        }
    }

    /// Whether a posture is free of collisions and keeps these clearances.
    pub fn is_free(&self, positions: &[f64], least: ArmClearance) -> bool {
        let links = self.kinematics.links(positions);
        self.has_room(&links, least) && !self.itself.touches(&links)
    }

    /// Whether the straight path between two postures is free, not counting its first end.
    pub fn is_way_free(&self, from: &[f64], to: &[f64], least: ArmClearance) -> bool {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few hundred at most"
        )]
        let n_steps = (self.span(from, to) / CHECK_M)
            .ceil()
            .clamp(1.0, MOST_CHECKS) as usize;
        // Start at the far end, where most blocked paths are blocked.
        (1..=n_steps)
            .rev()
            .all(|step| self.is_free(&between(from, to, step as f64 / n_steps as f64), least))
    }
}

/// The posture at a fraction of the straight path.
pub(super) fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter()
        .zip(to)
        .map(|(a, b)| a + (b - a) * share)
        .collect()
}

/// Whether each link is moved by these joints.
pub fn moved_links(kinematics: &Kinematics, joints: &[usize]) -> Vec<bool> {
    let mut moved = vec![false];
    for (idx, joint) in kinematics.joints().iter().enumerate() {
        moved.push(joints.contains(&idx) || moved[joint.parent]);
    }
    moved
}

/// Largest possible distance between a joint and the points behind it, with all links in line. A
/// prismatic joint moves the points by its own displacement.
fn lever(kinematics: &Kinematics, joint: usize, points: &[(usize, Point3<f64>)]) -> f64 {
    let joints = kinematics.joints();
    if joints[joint].kind == JointKind::Prismatic {
        return 1.0;
    }
    let length = |point: &(usize, Point3<f64>)| {
        let (mut link, mut length) = (point.0, point.1.coords.norm());
        while link > 0 && link != joint + 1 {
            let inner = &joints[link - 1];
            let slides = if inner.kind == JointKind::Prismatic {
                inner.upper.abs().min(1.0)
            } else {
                0.0
            };
            length += inner.origin.translation.vector.norm() + slides;
            link = inner.parent;
        }
        if link == joint + 1 { length } else { 0.0 }
    };
    points.iter().map(length).fold(0.0, f64::max)
}
