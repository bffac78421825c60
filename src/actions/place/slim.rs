//! A way of the arm to a posture that makes the robot slim, with an upright load all the way.
//!
//! A tree of postures grows from the present one towards samples and towards slim postures. Each
//! posture is turned so that the load is upright (Berenson et al. 2009, "Manipulation planning on
//! constraint manifolds").

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::motion::Samples;
use actcheck_world::{Kinematics, SelfContact, ik};

/// Length of a branch: the largest movement of a joint. Units: metres or radians.
const BRANCH: f64 = 0.12;
/// A joint that moves more than this many branches between neighbours jumps to another solution.
const JUMP: f64 = 3.0;
/// Every so many samples, the tree grows towards a slim posture instead.
const GOAL_EVERY: u32 = 4;
/// Largest number of samples.
const MOST_SAMPLES: u32 = 1_200;
/// Largest number of slim postures towards which the tree grows.
const MOST_GOALS: usize = 24;
/// Joints without limits are sampled this far in both directions. Unit: radians.
const HALF_TURN: f64 = std::f64::consts::PI;

/// The arm with a load in its hand.
pub(super) struct Load<'a> {
    pub kinematics: &'a Kinematics,
    pub arm: &'a [usize],
    /// The present posture.
    pub start: &'a [f64],
    pub itself: &'a SelfContact,
    /// Whether the load is clear of the robot in a posture.
    pub is_clear: &'a dyn Fn(&[f64]) -> bool,
    /// Whether the robot is slim in a posture.
    pub is_slim: &'a dyn Fn(&[f64]) -> bool,
}

impl Load<'_> {
    /// The way to one of the slim postures with the hand at one of these poses, without its first
    /// posture. `None` if there is none, or the samples run out.
    pub fn way(&self, hands: &[Isometry3<f64>]) -> Option<Vec<Vec<f64>>> {
        let goals = self.goals(hands);
        let mut samples = Samples::new(0.0, MOST_SAMPLES);
        let mut tree = vec![(self.start.to_vec(), 0)];
        let mut count = 0;
        while let Some(sample) = samples.next(self.arm.len()).filter(|_| !goals.is_empty()) {
            count += 1;
            let goal = &goals[(count / GOAL_EVERY) as usize % goals.len()];
            let aims_at_goal = count % GOAL_EVERY == 0;
            let target = if aims_at_goal {
                goal.clone()
            } else {
                self.sampled(&sample)
            };
            let mut at = nearest(&tree, &target, self.arm)?;
            // Towards a goal, the tree grows as far as it can.
            while let Some(posture) = self.step(&tree[at].0, &target) {
                tree.push((posture, at));
                at = tree.len() - 1;
                if !aims_at_goal {
                    break;
                }
                if farthest(&tree[at].0, &target, self.arm) < BRANCH {
                    tree.push((target, at));
                    return Some(self.shortened(&inwards(&tree, tree.len() - 1)));
                }
            }
        }
        None
    }

    /// Slim postures with an upright load, found from samples and from the present posture.
    fn goals(&self, hands: &[Isometry3<f64>]) -> Vec<Vec<f64>> {
        let mut samples = Samples::new(0.5, u32::try_from(hands.len()).unwrap_or(u32::MAX));
        let mut goals = Vec::new();
        for hand in hands {
            let sampled = samples
                .next(self.arm.len())
                .map(|sample| self.sampled(&sample));
            for seed in sampled.iter().map(Vec::as_slice).chain([self.start]) {
                if let Some(posture) = self.reached(seed, *hand)
                    && (self.is_slim)(&posture)
                    && self.is_free(&posture)
                {
                    goals.push(posture);
                }
            }
            if goals.len() >= MOST_GOALS {
                break;
            }
        }
        goals
    }

    /// The next posture of a branch. `None` if something is in the way.
    fn step(&self, from: &[f64], to: &[f64]) -> Option<Vec<f64>> {
        let share = (BRANCH / farthest(from, to, self.arm).max(1e-9)).min(1.0);
        let between: Vec<f64> = from
            .iter()
            .zip(to)
            .map(|(a, b)| a + (b - a) * share)
            .collect();
        let posture = self.reached(&between, self.righted(&between))?;
        let is_near = farthest(from, &posture, self.arm) < JUMP * BRANCH;
        // A branch that turning upright brings back does not grow.
        let grows = farthest(&posture, to, self.arm) < farthest(from, to, self.arm) - BRANCH * 0.1;
        (is_near && grows && self.is_free(&posture)).then_some(posture)
    }

    /// The hand's pose in a posture, turned so that the load is upright.
    fn righted(&self, posture: &[f64]) -> Isometry3<f64> {
        let upright = self.kinematics.grasp(self.start).rotation;
        let mut hand = self.kinematics.grasp(posture);
        let turn = hand.rotation * upright.inverse();
        // The turn about the vertical that is nearest to it.
        let angle = 2.0 * libm::atan2(turn.k, turn.w);
        hand.rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle) * upright;
        hand
    }

    fn reached(&self, seed: &[f64], target: Isometry3<f64>) -> Option<Vec<f64>> {
        let mut mobility = vec![0.0; seed.len()];
        self.arm.iter().for_each(|joint| mobility[*joint] = 1.0);
        ik::solve(self.kinematics, seed, &ik::IkRequest { target, mobility })
    }

    fn is_free(&self, posture: &[f64]) -> bool {
        !self.itself.touches(&self.kinematics.links(posture)) && (self.is_clear)(posture)
    }

    /// The arm at a point of the unit cube, within the limits of its joints.
    fn sampled(&self, point: &[f64]) -> Vec<f64> {
        let mut posture = self.start.to_vec();
        for (idx, share) in self.arm.iter().zip(point) {
            let joint = &self.kinematics.joints()[*idx];
            let (lower, upper) = (joint.lower.max(-HALF_TURN), joint.upper.min(HALF_TURN));
            posture[*idx] = lower + (upper - lower) * share;
        }
        posture
    }

    /// The way without its first posture, and without corners that branches can cut.
    fn shortened(&self, way: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut kept = Vec::new();
        let mut at = 0;
        while at + 1 < way.len() {
            let cut = (at + 2..way.len())
                .rev()
                .step_by(4)
                .find_map(|end| Some((end, self.branches(&way[at], &way[end])?)));
            let (end, branches) = cut.unwrap_or_else(|| (at + 1, vec![way[at + 1].clone()]));
            kept.extend(branches);
            at = end;
        }
        kept
    }

    /// Branches straight from one posture to another, ending there. `None` if something is in the
    /// way.
    fn branches(&self, from: &[f64], to: &[f64]) -> Option<Vec<Vec<f64>>> {
        let mut way: Vec<Vec<f64>> = Vec::new();
        let mut now = from.to_vec();
        while farthest(&now, to, self.arm) >= BRANCH {
            now = self.step(&now, to)?;
            way.push(now.clone());
        }
        way.push(to.to_vec());
        Some(way)
    }
}

/// The largest movement of a joint between two postures.
fn farthest(from: &[f64], to: &[f64], arm: &[usize]) -> f64 {
    arm.iter()
        .map(|joint| (to[*joint] - from[*joint]).abs())
        .fold(0.0, f64::max)
}

fn nearest(tree: &[(Vec<f64>, usize)], target: &[f64], arm: &[usize]) -> Option<usize> {
    let span = |node: &[f64]| {
        arm.iter()
            .map(|joint| (target[*joint] - node[*joint]).powi(2))
            .sum::<f64>()
    };
    let spans = tree.iter().map(|(node, _)| span(node)).enumerate();
    spans
        .min_by(|one, other| one.1.total_cmp(&other.1))
        .map(|(node, _)| node)
}

/// Postures from the root to a node.
fn inwards(tree: &[(Vec<f64>, usize)], mut node: usize) -> Vec<Vec<f64>> {
    let mut postures = vec![tree[node].0.clone()];
    while node > 0 {
        node = tree[node].1;
        postures.push(tree[node].0.clone());
    }
    postures.reverse();
    postures
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use nalgebra::Translation3;

    use super::*;
    use actcheck_base::Files;
    use actcheck_data::RobotStart;
    use actcheck_world::geometry;

    /// The load is upright if the hand has only turned about the vertical.
    fn lean(kinematics: &Kinematics, start: &[f64], posture: &[f64]) -> f64 {
        let turn = kinematics.grasp(posture).rotation * kinematics.grasp(start).rotation.inverse();
        (turn * Vector3::z()).angle(&Vector3::z())
    }

    #[test]
    fn the_hand_comes_close_without_tilting_its_load() {
        let path = Path::new("models/robots/fixed_arm.toml");
        let profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        let start = RobotStart {
            profile: Arc::new(profile),
            base: [0.0; 3],
            root_height_m: 0.0,
            knows: Arc::new([]),
        };
        let (kinematics, layout, mut start) = geometry(&start).expect("the shipped robot is valid");
        for (idx, value) in layout
            .arm
            .iter()
            .zip([-0.9, 0.7, 0.0, 1.59, 0.0, 0.85, 0.0])
        {
            start[*idx] = value;
        }
        let itself = SelfContact::new(&kinematics, &[start.clone()]);
        let distance = |posture: &[f64]| kinematics.grasp(posture).translation.vector.xy().norm();
        let slim_m = distance(&start) - 0.15;
        let load = Load {
            kinematics: &kinematics,
            arm: &layout.arm,
            start: &start,
            itself: &itself,
            is_clear: &|_| true,
            is_slim: &|posture| distance(posture) < slim_m,
        };
        let hand = kinematics.grasp(&start);
        let hands: Vec<Isometry3<f64>> = (0..8)
            .map(|turn| {
                let turned =
                    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), f64::from(turn) * 0.7)
                        * hand.rotation;
                let near = hand.translation.vector.xy().normalize() * (slim_m - 0.02);
                Isometry3::from_parts(
                    Translation3::new(near.x, near.y, hand.translation.z + 0.05),
                    turned,
                )
            })
            .collect();
        let way = load.way(&hands).expect("the arm can come closer");
        assert_eq!(
            load.way(&hands).as_ref(),
            Some(&way),
            "the same task gives the same way"
        );
        assert!(way.last().is_some_and(|end| distance(end) < slim_m));
        let postures = std::iter::once(&start).chain(&way);
        for (before, after) in postures.zip(&way) {
            assert!(lean(&kinematics, &start, after) < 0.01);
            assert!(farthest(before, after, &layout.arm) <= JUMP * BRANCH + 1e-9);
            assert!(!itself.touches(&kinematics.links(after)));
        }
        let nowhere = Load {
            is_slim: &|_| false,
            ..load
        };
        assert_eq!(nowhere.way(&hands), None);
    }
}
