//! The links of both fingers: those that the joints of a gripper move, by the side of the object on
//! which it is.

use crate::description::RobotModel;
use crate::gripper::gap::Probe;
use crate::gripper::opening::Gripper;

/// Openings at which the place of a link beside the grasp frame is measured, as shares of the
/// widest.
const SHARES: [f64; 3] = [0.0, 0.5, 1.0];
/// A link that is nearer to the middle between the fingers than this is on neither side: the
/// nearest point of a plate of 1 cm in the middle jumps from edge to edge as the plate turns a
/// little. Unit: metres.
const BESIDE_M: f64 = 5e-3;

/// Returns the links of the left and of the right finger: the named fingertips, and all links that
/// a joint of the gripper moves without the other fingertip. Links of couplings and of further
/// fingers are on the side of the grasp frame on which they are nearest to it. A link that moves
/// with both fingertips belongs to neither.
pub(crate) fn links_of_fingers(
    model: &RobotModel,
    gripper: &Gripper,
    probe: &Probe<'_>,
) -> [Vec<usize>; 2] {
    let tips = probe.links();
    // The fingertips of a suction cup are the cup.
    if tips[0] == tips[1] {
        return tips.map(|tip| vec![tip]);
    }
    let mut side_of: Vec<Option<usize>> = vec![None; model.links.len()];
    for side in 0..2 {
        let other = tips[1 - side];
        let own = joints_above(model, tips[side])
            .filter(|joint| gripper.contains(*joint) && !moves(model, *joint, other));
        if let Some(root) = own.last() {
            claim(model, root, side, &mut side_of);
        }
    }
    // Children come after their parents.
    for joint in 0..model.joints.len() {
        let moves_tip = tips.iter().any(|tip| moves(model, joint, *tip));
        if !gripper.contains(joint) || moves_tip || side_of[joint + 1].is_some() {
            continue;
        }
        if let Some(side) = side_beside(model, gripper, probe, joint) {
            claim(model, joint, side, &mut side_of);
        }
    }
    for (side, tip) in tips.into_iter().enumerate() {
        side_of[tip] = Some(side);
    }
    [0, 1].map(|side| {
        (0..side_of.len())
            .filter(|link| side_of[*link] == Some(side))
            .collect()
    })
}

/// The joints between a link and the root, from the link on.
fn joints_above(model: &RobotModel, link: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(link.checked_sub(1), |joint| {
        model.joints[*joint].parent.checked_sub(1)
    })
}

/// Returns whether a joint moves a link.
fn moves(model: &RobotModel, joint: usize, link: usize) -> bool {
    joints_above(model, link).any(|own| own == joint)
}

/// Gives the links that a joint moves to a side, unless they have one.
fn claim(model: &RobotModel, joint: usize, side: usize, side_of: &mut [Option<usize>]) {
    for (link, own) in side_of.iter_mut().enumerate() {
        if own.is_none() && moves(model, joint, link) {
            *own = Some(side);
        }
    }
}

/// The side on which the links that a joint moves are nearest to the grasp frame. Returns `None` if
/// they are in the middle or have no shapes.
fn side_beside(
    model: &RobotModel,
    gripper: &Gripper,
    probe: &Probe<'_>,
    joint: usize,
) -> Option<usize> {
    let moved: Vec<usize> = (0..model.links.len())
        .filter(|link| moves(model, joint, *link))
        .collect();
    let beside = SHARES.iter().filter_map(|share| {
        let opening_m = share * gripper.widest_m();
        let mut positions = vec![0.0; model.joints.len()];
        gripper.set(&mut positions, opening_m);
        let nearest = moved
            .iter()
            .filter_map(|link| probe.nearest(*link, &positions));
        let nearest = nearest.min_by(|a, b| a.norm().total_cmp(&b.norm()))?;
        // Some robots name their fingers as seen from the front.
        let [left, right] = probe
            .links()
            .map(|tip| probe.nearest(tip, &positions).map_or(0.0, |at| at.y));
        Some((nearest.y - gripper.middle_m(opening_m)) * if left < right { -1.0 } else { 1.0 })
    });
    let beside: Vec<f64> = beside.collect();
    let mean = beside.iter().sum::<f64>() / beside.len().max(1) as f64;
    (mean.abs() > BESIDE_M).then_some(usize::from(mean < 0.0))
}
