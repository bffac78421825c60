//! RRT-Connect in the arm's joint space, and shortening of its paths.
//!
//! Two trees of postures grow from both ends towards samples and towards each other (Kuffner and
//! LaValle 2000, "RRT-Connect: an efficient approach to single-query path planning").

use crate::motion::space::between;
use crate::motion::{ArmClearance, ArmSpace, Samples};

/// Length of a branch. Unit: metres, as [`ArmSpace::span`] counts.
const BRANCH_M: f64 = 0.4;

/// The postures of a free path without its first, ending with `to`: a single posture if the
/// straight path is free, otherwise the path that the trees found. Returns `None` if there is no
/// path or the samples run out.
pub fn way(
    space: &ArmSpace<'_>,
    from: &[f64],
    to: &[f64],
    least: ArmClearance,
    samples: &mut Samples,
) -> Option<Vec<Vec<f64>>> {
    if !space.is_free(to, least) {
        return None;
    }
    if space.is_way_free(from, to, least) {
        return Some(vec![to.to_vec()]);
    }
    let found = connect(space, from, to, least, samples)?;
    let halves = found
        .windows(2)
        .flat_map(|pair| [pair[0].clone(), between(&pair[0], &pair[1], 0.5)]);
    let finer: Vec<Vec<f64>> = halves.chain([to.to_vec()]).collect();
    Some(shortened(space, &shortened(space, &finer, least), least).split_off(1))
}

/// Postures grown from one end; each but the root has a parent.
struct Tree {
    nodes: Vec<(Vec<f64>, usize)>,
}

impl Tree {
    /// Grows one branch towards a posture, or to it if it is near. Returns the new node, or `None`
    /// if something is in the way.
    fn extend(
        &mut self,
        space: &ArmSpace<'_>,
        towards: &[f64],
        least: ArmClearance,
    ) -> Option<usize> {
        let spans = self.nodes.iter().map(|(node, _)| space.span(node, towards));
        let (nearest, span) = spans.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let end = between(
            &self.nodes[nearest].0,
            towards,
            (BRANCH_M / span.max(1e-9)).min(1.0),
        );
        if !space.is_way_free(&self.nodes[nearest].0, &end, least) {
            return None;
        }
        self.nodes.push((end, nearest));
        Some(self.nodes.len() - 1)
    }

    /// Grows branches until one reaches a posture. Returns `None` if something is in the way.
    fn reach(
        &mut self,
        space: &ArmSpace<'_>,
        target: &[f64],
        least: ArmClearance,
    ) -> Option<usize> {
        loop {
            let end = self.extend(space, target, least)?;
            if space.span(&self.nodes[end].0, target) < 1e-9 {
                return Some(end);
            }
        }
    }

    /// Postures from a node to the root.
    fn inwards(&self, mut node: usize) -> Vec<Vec<f64>> {
        let mut postures = vec![self.nodes[node].0.clone()];
        while node > 0 {
            node = self.nodes[node].1;
            postures.push(self.nodes[node].0.clone());
        }
        postures
    }
}

/// A path including both ends.
fn connect(
    space: &ArmSpace<'_>,
    from: &[f64],
    to: &[f64],
    least: ArmClearance,
    samples: &mut Samples,
) -> Option<Vec<Vec<f64>>> {
    // All other joints, such as the fingers, move before the arm.
    let mut start = to.to_vec();
    space.copy_arm(from, &mut start);
    let mut trees = [start, to.to_vec()].map(|root| Tree {
        nodes: vec![(root, 0)],
    });
    let mut from_start = true;
    while let Some(sample) = samples.next(space.n_joints()) {
        let target = space.posture(&sample, to);
        let [first, second] = &mut trees;
        let (grown, other) = if from_start {
            (first, second)
        } else {
            (second, first)
        };
        if let Some(end) = grown.extend(space, &target, least) {
            let meeting = grown.nodes[end].0.clone();
            if let Some(met) = other.reach(space, &meeting, least) {
                let (mut there, back) = (grown.inwards(end), other.inwards(met));
                there.reverse();
                there.extend(back.into_iter().skip(1));
                if !from_start {
                    there.reverse();
                }
                return Some(there);
            }
        }
        from_start = !from_start;
    }
    None
}

/// The path with corners removed: from each posture to the farthest one that a free straight path
/// reaches.
fn shortened(space: &ArmSpace<'_>, way: &[Vec<f64>], least: ArmClearance) -> Vec<Vec<f64>> {
    let mut kept: Vec<Vec<f64>> = way.first().cloned().into_iter().collect();
    let mut at = 0;
    while at + 1 < way.len() {
        let farthest = (at + 2..way.len())
            .rev()
            .find(|next| space.is_way_free(&way[at], &way[*next], least));
        at = farthest.unwrap_or(at + 1);
        kept.push(way[at].clone());
    }
    kept
}
