//! Fingers beside the two whose gap is the opening: these close in the direction that brings them
//! to the grasp frame.

use crate::description::RobotModel;
use crate::gripper::gap::Probe;

/// Shares of a joint's way at which its links' distances from the grasp frame are compared, from
/// its lower limit.
const SHARES: [f64; 4] = [0.0, 0.25, 0.75, 1.0];

/// A joint with a motor that moves a further finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Further {
    pub(super) joint: usize,
    /// Whether it opens in its negative direction.
    pub(super) falls: bool,
    /// The side of the grasp frame from which it presses: 0 for the left finger's, 1 for the right
    /// finger's.
    pub(super) side: usize,
}

impl Further {
    /// Finds how a joint closes.
    pub(super) fn find(joint: usize, model: &RobotModel, probe: &Probe<'_>) -> Self {
        let parent = |idx: &usize| model.joints[*idx].parent.checked_sub(1);
        let is_moved = |link: &usize| {
            std::iter::successors(link.checked_sub(1), parent).any(|own| own == joint)
        };
        let moved: Vec<usize> = (0..model.links.len()).filter(is_moved).collect();
        let (lower, upper) = (model.joints[joint].lower, model.joints[joint].upper);
        let nearest = |share: f64| {
            let mut positions = vec![0.0; model.joints.len()];
            positions[joint] = lower + share * (upper - lower);
            let found = moved
                .iter()
                .filter_map(|link| probe.nearest(*link, &positions));
            found.min_by(|a, b| a.norm().total_cmp(&b.norm()))
        };
        let [near_lower, low, high, near_upper] =
            SHARES.map(|share| nearest(share).map_or(0.0, |at| at.norm()));
        let is_left = SHARES
            .iter()
            .filter_map(|share| nearest(*share))
            .map(|at| at.y)
            .sum::<f64>()
            >= 0.0;
        Self {
            joint,
            falls: near_lower + low > high + near_upper,
            side: usize::from(!is_left),
        }
    }
}
