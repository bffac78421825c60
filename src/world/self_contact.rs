//! Detects postures in which links of the robot are too close to each other, for motion planning.

use nalgebra::{Isometry3, Point3};
use parry3d::query::distance;
use rapier3d::math::Pose as EnginePose;
use rapier3d::prelude::SharedShape;

use crate::Kinematics;
use crate::convert::to_pose;
use crate::engine::{Owner, collider};
use crate::room::Ball;

/// Distance that links keep from each other. Unit: metres. The tracking error of a moving arm.
const CLEAR_M: f64 = 0.01;
/// Share of their distance in a valid posture that links keep if that distance is smaller.
const KEPT_SHARE: f64 = 0.9;

/// The shapes of a robot's links, and the pairs of links that could collide.
#[derive(Clone)]
pub struct SelfContact {
    links: Vec<Form>,
    pairs: Vec<Pair>,
}

/// Two links and the distance that they have to keep. Unit: metres.
#[derive(Clone, Copy)]
struct Pair {
    links: (usize, usize),
    clear_m: f64,
}

/// The convex solids of one link, in its frame.
#[derive(Clone)]
struct Form {
    solids: Vec<(EnginePose, SharedShape)>,
    /// Centre of their bounding sphere.
    middle: Point3<f64>,
    radius: f64,
}

impl SelfContact {
    /// Finds the pairs of links that could collide. Leaves out neighbours, whose shapes overlap at their joint, and
    /// pairs that overlap in one of the `right` postures, which are known to be valid, such as the one for driving.
    /// Pairs that are close in one of these may come as close in others.
    pub fn new(kinematics: &Kinematics, right: &[Vec<f64>]) -> Self {
        let links: Vec<Form> = kinematics.solids_of_links().map(Form::new).collect();
        let right: Vec<Vec<Isometry3<f64>>> = right.iter().map(|posture| kinematics.links(posture)).collect();
        let is_solid = |link: &usize| !links[*link].solids.is_empty();
        let mut pairs = Vec::new();
        for second in (0..links.len()).filter(is_solid) {
            let neighbour = kinematics.solid_parent(second);
            for first in (0..second).filter(is_solid).filter(|first| neighbour != Some(*first)) {
                let pair = Pair { links: (first, second), clear_m: CLEAR_M };
                let nearest = right.iter().map(|poses| gap(&links, pair, poses)).fold(CLEAR_M, f64::min);
                let clear_m = if nearest < CLEAR_M { nearest * KEPT_SHARE } else { CLEAR_M };
                if clear_m > 0.0 {
                    pairs.push(Pair { clear_m, ..pair });
                }
            }
        }
        Self { links, pairs }
    }

    /// Whether any two links collide, or nearly so, at these link poses (see [`Kinematics::links`]).
    pub fn touches(&self, poses: &[Isometry3<f64>]) -> bool {
        self.pairs.iter().any(|pair| gap(&self.links, *pair, poses) < pair.clear_m)
    }
}

/// Returns the distance of two links at these link poses, or their clearance if they are farther apart. Unit: metres.
fn gap(links: &[Form], Pair { links: (first, second), clear_m }: Pair, poses: &[Isometry3<f64>]) -> f64 {
    let (a, b) = (&links[first], &links[second]);
    let apart = poses[first] * a.middle - poses[second] * b.middle;
    if apart.norm() > a.radius + b.radius + clear_m {
        return clear_m;
    }
    let (at_a, at_b) = (to_pose(&poses[first]), to_pose(&poses[second]));
    let mut nearest = clear_m;
    for (on_a, solid_a) in &a.solids {
        for (on_b, solid_b) in &b.solids {
            // Convex solids are always supported; an unsupported pair would count as a collision.
            let found = distance(&(at_a * *on_a), solid_a.as_ref(), &(at_b * *on_b), solid_b.as_ref());
            nearest = nearest.min(found.map_or(0.0, |found| f64::from(found.distance)));
        }
    }
    nearest
}

impl Ball {
    /// Returns a ball around solids: that around their bounding box. Returns `None` if there are none.
    pub(super) fn around(solids: &[actcheck_data::Part]) -> Option<Self> {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for solid in solids {
            let (lower, upper) = solid.bounds();
            for axis in 0..3 {
                low[axis] = low[axis].min(lower[axis]);
                high[axis] = high[axis].max(upper[axis]);
            }
        }
        let (low, high) = (Point3::from(low), Point3::from(high));
        let ball = Self { middle: nalgebra::center(&low, &high), radius: (high - low).norm() / 2.0 };
        (!solids.is_empty()).then_some(ball)
    }
}

impl Form {
    fn new(solids: &[actcheck_data::Part]) -> Self {
        let around = Ball::around(solids).unwrap_or(Ball { middle: Point3::origin(), radius: 0.0 });
        let forms = solids.iter().filter_map(|solid| collider(solid, Owner::Floor, 0.0, 0.0));
        Self {
            solids: forms.map(|form| (form.position, form.shape)).collect(),
            middle: around.middle,
            radius: around.radius,
        }
    }
}
