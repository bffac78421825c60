//! Detects postures with self-collisions. Physics ignores them, so motion plans must avoid them.

use nalgebra::{Isometry3, Point3};
use parry3d::query::intersection_test;
use rapier3d::math::Pose as EnginePose;
use rapier3d::prelude::SharedShape;

use crate::Kinematics;
use crate::convert::to_pose;
use crate::engine::{Owner, collider};

/// The shapes of a robot's links, and the pairs of links that could collide.
#[derive(Clone)]
pub struct SelfContact {
    links: Vec<Form>,
    pairs: Vec<(usize, usize)>,
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
    pub fn new(kinematics: &Kinematics, right: &[Vec<f64>]) -> Self {
        let links: Vec<Form> = kinematics.solids_of_links().map(Form::new).collect();
        let neighbour = |link: usize| bearer(kinematics, &links, link);
        let is_solid = |link: &usize| !links[*link].solids.is_empty();
        let pairs = (0..links.len()).filter(is_solid).flat_map(|second| {
            (0..second)
                .filter(is_solid)
                .filter(move |first| neighbour(second) != Some(*first))
                .map(move |first| (first, second))
        });
        let mut found = Self { pairs: pairs.collect(), links: links.clone() };
        for posture in right {
            let poses = kinematics.links(posture);
            let meeting: Vec<(usize, usize)> =
                found.pairs.iter().copied().filter(|pair| found.meet(*pair, &poses)).collect();
            found.pairs.retain(|pair| !meeting.contains(pair));
        }
        found
    }

    /// Whether any two links collide at these link poses (see [`Kinematics::links`]).
    pub fn touches(&self, poses: &[Isometry3<f64>]) -> bool {
        self.pairs.iter().any(|pair| self.meet(*pair, poses))
    }

    fn meet(&self, (first, second): (usize, usize), poses: &[Isometry3<f64>]) -> bool {
        let (a, b) = (&self.links[first], &self.links[second]);
        let apart = poses[first] * a.middle - poses[second] * b.middle;
        if apart.norm_squared() > (a.radius + b.radius).powi(2) {
            return false;
        }
        let (at_a, at_b) = (to_pose(&poses[first]), to_pose(&poses[second]));
        a.solids.iter().any(|(on_a, solid_a)| {
            let solids_b = b.solids.iter();
            // Convex solids are always supported; an unsupported pair would count as a collision.
            solids_b.into_iter().any(|(on_b, solid_b)| {
                intersection_test(&(at_a * *on_a), solid_a.as_ref(), &(at_b * *on_b), solid_b.as_ref())
                    .map_or(true, |found| found.intersecting)
            })
        })
    }
}

impl Form {
    fn new(solids: &[actcheck_data::Part]) -> Self {
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
        let forms = solids.iter().filter_map(|solid| collider(solid, Owner::Floor, 0.0, 0.0));
        Self {
            solids: forms.map(|form| (form.position, form.shape)).collect(),
            middle: nalgebra::center(&low, &high),
            radius: (high - low).norm() / 2.0,
        }
    }
}

/// Returns the nearest ancestor link with shapes.
fn bearer(kinematics: &Kinematics, links: &[Form], mut link: usize) -> Option<usize> {
    while link > 0 {
        link = kinematics.joints()[link - 1].parent;
        if !links[link].solids.is_empty() {
            return Some(link);
        }
    }
    None
}
