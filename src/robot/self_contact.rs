//! Detects postures in which links of the robot are too close to each other, for motion planning.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use crate::Kinematics;
use actcheck_data::Part;
use actcheck_geometry::{BodySolids, Directions, gap, is_closer};

/// Distance that links keep from each other. Unit: metres. The tracking error of a moving arm.
const CLEAR_M: f64 = 0.01;
/// Share of their distance in a valid posture that links keep if that distance is smaller.
const KEPT_SHARE: f64 = 0.9;

/// Robots with at least as many solids remember the directions in which they were apart. Below, it
/// is not worth the memory.
const MANY_SOLIDS: usize = 64;

/// The shapes of a robot's links, and the pairs of links that could collide.
#[derive(Clone)]
pub struct SelfContact {
    links: Vec<Arc<BodySolids>>,
    pairs: Vec<LinkPair>,
    /// For each pair, the directions in which its solids were apart last.
    apart: Vec<Directions>,
}

/// Two links and the distance that they have to keep. Unit: metres.
#[derive(Clone, Copy)]
struct LinkPair {
    links: (usize, usize),
    clear_m: f64,
}

impl LinkPair {
    /// Returns the distance of the links at these link poses, or the distance to keep if they are
    /// farther apart. Unit: metres.
    fn gap(&self, links: &[Arc<BodySolids>], poses: &[Isometry3<f64>]) -> f64 {
        let (first, second) = self.links;
        let of_pair = [links[first].as_ref(), links[second].as_ref()];
        gap(of_pair, [&poses[first], &poses[second]], self.clear_m)
    }

    /// Whether the links are closer than they may be at these link poses.
    fn is_closer(
        &self,
        links: &[Arc<BodySolids>],
        poses: &[Isometry3<f64>],
        apart: &Directions,
    ) -> bool {
        let (first, second) = self.links;
        let of_pair = [links[first].as_ref(), links[second].as_ref()];
        is_closer(
            of_pair,
            [&poses[first], &poses[second]],
            self.clear_m,
            apart,
        )
    }
}

impl SelfContact {
    /// Finds the pairs of links that could collide. Leaves out neighbours, whose shapes overlap at
    /// their joint, pairs of the hand, which the arm does not bring together, and pairs that
    /// overlap in one of the `right` postures, which are known to be valid, such as the one for
    /// driving. Pairs that are close in one of these may come as close in others.
    pub fn new(kinematics: &Kinematics, right: &[Vec<f64>]) -> Self {
        let links: Vec<Arc<BodySolids>> = kinematics.forms().collect();
        let right: Vec<Vec<Isometry3<f64>>> = right
            .iter()
            .map(|posture| kinematics.links(posture))
            .collect();
        let is_solid = |link: &usize| !links[*link].is_empty();
        let mut pairs = Vec::new();
        for second in (0..links.len()).filter(is_solid) {
            let neighbour = kinematics.solid_parent(second);
            let passes = |first: usize| {
                kinematics.pass(first, second) || kinematics.are_of_hand(first, second)
            };
            let others = (0..second)
                .filter(is_solid)
                .filter(|first| neighbour != Some(*first) && !passes(*first));
            for first in others {
                let pair = LinkPair {
                    links: (first, second),
                    clear_m: CLEAR_M,
                };
                let nearest = right
                    .iter()
                    .map(|poses| pair.gap(&links, poses))
                    .fold(CLEAR_M, f64::min);
                let clear_m = if nearest < CLEAR_M {
                    nearest * KEPT_SHARE
                } else {
                    CLEAR_M
                };
                if clear_m > 0.0 {
                    pairs.push(LinkPair { clear_m, ..pair });
                }
            }
        }
        Self::of(links, pairs)
    }

    fn of(links: Vec<Arc<BodySolids>>, pairs: Vec<LinkPair>) -> Self {
        let n_solids: usize = links.iter().map(|link| link.len()).sum();
        let remembered = n_solids >= MANY_SOLIDS;
        let of_pair = |pair: &LinkPair| {
            Directions::new([&links[pair.links.0], &links[pair.links.1]], remembered)
        };
        let apart = pairs.iter().map(of_pair).collect();
        Self {
            links,
            pairs,
            apart,
        }
    }

    /// Returns the pairs that overlap at these link poses.
    pub(crate) fn overlaps(&self, poses: &[Isometry3<f64>]) -> Vec<(usize, usize)> {
        let overlap = |pair: &&LinkPair| pair.gap(&self.links, poses) <= 0.0;
        self.pairs
            .iter()
            .filter(overlap)
            .map(|pair| pair.links)
            .collect()
    }

    /// Drops these pairs: such links always overlap.
    pub(crate) fn without(mut self, overlapping: &[(usize, usize)]) -> Self {
        self.pairs.retain(|pair| !overlapping.contains(&pair.links));
        Self::of(self.links, self.pairs)
    }

    /// Whether any two links collide, or nearly so, at these link poses (see
    /// [`Kinematics::links`]).
    pub fn touches(&self, poses: &[Isometry3<f64>]) -> bool {
        self.touching(poses).is_some()
    }

    /// The first two links that collide, or nearly so, at these link poses.
    pub fn touching(&self, poses: &[Isometry3<f64>]) -> Option<(usize, usize)> {
        // Most links are far apart.
        let middles: Vec<Point3<f64>> = self
            .links
            .iter()
            .zip(poses)
            .map(|(link, pose)| pose * link.ball().middle)
            .collect();
        let is_near = |LinkPair {
                           links: (first, second),
                           clear_m,
                       }: &LinkPair| {
            let radius = |link: usize| self.links[link].ball().radius;
            let reach = radius(*first) + radius(*second) + clear_m;
            (middles[*first] - middles[*second]).norm_squared() <= reach * reach
        };
        let mut near = self
            .pairs
            .iter()
            .zip(&self.apart)
            .filter(|(pair, _)| is_near(pair));
        near.find(|(pair, apart)| pair.is_closer(&self.links, poses, apart))
            .map(|(pair, _)| pair.links)
    }
}

/// Two links alone, for measurements at many poses.
pub(crate) struct TwoLinks([BodySolids; 2]);

impl TwoLinks {
    pub(crate) fn new(solids: [&[Part]; 2]) -> Self {
        Self(solids.map(BodySolids::new))
    }

    /// Whether they overlap with the first one at the origin and the second one at a pose.
    pub(crate) fn overlap(&self, pose: Isometry3<f64>) -> bool {
        let [first, second] = &self.0;
        gap([first, second], [&Isometry3::identity(), &pose], CLEAR_M) <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start::tests::lonely;
    use actcheck_geometry::to_pose;
    use parry3d::math::Pose as EnginePose;
    use parry3d::query::distance;
    use parry3d::shape::SharedShape;

    /// Error of distances in 32 bits. Unit: metres.
    const ROUNDING_M: f64 = 1e-4;

    /// Skipping solids by the boxes around their links never changes whether links are too close.
    #[test]
    fn links_touch_exactly_if_two_of_their_solids_do() {
        let (kinematics, _, start) = lonely();
        let itself = SelfContact::new(&kinematics, std::slice::from_ref(&start));
        // Only robots of many solids remember directions.
        let remember = |pair: &LinkPair| {
            Directions::new(
                [&itself.links[pair.links.0], &itself.links[pair.links.1]],
                true,
            )
        };
        let remembered: Vec<Directions> = itself.pairs.iter().map(remember).collect();
        let (mut close, mut apart) = (0, 0);
        for trial in 0..150 {
            let mut posture = start.clone();
            for (idx, joint) in kinematics.joints().iter().enumerate() {
                let share = libm::sin(f64::from(trial) * 3.1 + idx as f64 * 1.9);
                posture[idx] = (posture[idx] + share * 2.0).clamp(joint.lower, joint.upper);
            }
            let poses = kinematics.links(&posture);
            let least = |pair: &LinkPair| {
                let (first, second) = pair.links;
                let of = |link: usize| itself.links[link].shapes().map(move |solid| (link, solid));
                let placed = |(link, (_, pose)): (usize, (&SharedShape, &EnginePose))| {
                    to_pose(&poses[link]) * *pose
                };
                let all = of(first).flat_map(|a| of(second).map(move |b| (a, b)));
                let gaps = all.map(|(a, b)| {
                    let found = distance(&placed(a), a.1.0.as_ref(), &placed(b), b.1.0.as_ref());
                    found.map_or(0.0, |found| f64::from(found.distance))
                });
                gaps.fold(f64::INFINITY, f64::min) - pair.clear_m
            };
            for ((pair, directions), remembered) in
                itself.pairs.iter().zip(&itself.apart).zip(&remembered)
            {
                let spare = least(pair);
                if spare.abs() > ROUNDING_M {
                    for directions in [directions, remembered] {
                        let is_closer = pair.is_closer(&itself.links, &poses, directions);
                        assert_eq!(is_closer, spare < 0.0, "{:?} by {spare}", pair.links);
                    }
                    if spare < 0.0 { close += 1 } else { apart += 1 }
                }
            }
        }
        assert!(close > 100 && apart > 1000, "{close} close, {apart} apart");
        assert!(remembered.iter().any(Directions::is_known));
    }
}
