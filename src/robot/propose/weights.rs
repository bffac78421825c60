//! How much two links look like the fingertips of a gripper: weights of candidates.

use std::collections::BTreeSet;

use nalgebra::Isometry3;

use super::between::Between;
use crate::Gripper;
use crate::description::RobotModel;
use crate::gripper::Probe;

/// Weight of a link that carries another one of the gripper: a knuckle rather than a fingertip.
const CARRIER: f64 = 0.3;
/// Weight of a joint whose largest effort is 0.
const WITHOUT_MOTOR: f64 = 0.2;
/// Weight of two links whose volumes differ by more than the share [`UNLIKE`].
const UNALIKE: f64 = 0.7;
const UNLIKE: f64 = 0.1;
/// Weight of two links with another link of the gripper between them, and how far this is inside.
/// Unit: metres.
const OUTSIDE: f64 = 0.2;
const LEAST_INSIDE_M: f64 = 0.001;

/// Weight of joints that drive the fingers: springs move joints without an effort, if others have
/// one.
pub(super) fn powered(model: &RobotModel, named: &[usize], joints: &BTreeSet<usize>) -> f64 {
    let has_motor = |joint: &usize| model.joints[*joint].effort > 0.0;
    if !named.iter().all(has_motor) && joints.iter().any(has_motor) {
        WITHOUT_MOTOR
    } else {
        1.0
    }
}

/// How much two links look like fingertips, from 0 to 1: they carry no other link of the gripper,
/// and are alike.
pub(super) fn tips(model: &RobotModel, links: [usize; 2], joints: &BTreeSet<usize>) -> f64 {
    let is_solid = |link: usize| !model.links[link].solids.is_empty();
    let carries = |link: usize| {
        joints
            .iter()
            .any(|joint| model.joints[*joint].parent == link && is_solid(joint + 1))
    };
    let moved = links.map(|link| {
        link.checked_sub(1)
            .is_some_and(|joint| joints.contains(&joint))
    });
    let n_carriers = (0..2)
        .filter(|side| moved[*side] && carries(links[*side]))
        .count();
    let [left, right] = links.map(|link| {
        model.links[link]
            .solids
            .iter()
            .map(|part| part.shape.volume())
            .sum::<f64>()
    });
    let are_alike = (left - right).abs() < UNLIKE * left.max(right);
    CARRIER.powi(i32::try_from(n_carriers).unwrap_or(2)) * if are_alike { 1.0 } else { UNALIKE }
}

/// Weight of two links between which no other link of the gripper moves: of a finger of several
/// bars, an object touches the innermost first.
pub(super) fn innermost(
    between: &Between<'_>,
    frame: Isometry3<f64>,
    joints: &BTreeSet<usize>,
) -> f64 {
    let Between {
        model,
        palm,
        links,
        named,
    } = between;
    let Ok(gripper) = Gripper::find_coarse(named, model, *links, (*palm, frame)) else {
        return 1.0;
    };
    let mut positions = vec![0.0; model.joints.len()];
    gripper.set(&mut positions, gripper.widest_m());
    let gap = |links| Probe::new(model, links, (*palm, frame)).gap(&positions);
    let Some(own) = gap(*links) else { return 1.0 };
    let is_between = |joint: &usize| {
        let link = joint + 1;
        // Of one link, the lowest and the highest point along y.
        let other = Some(link)
            .filter(|link| !links.contains(link))
            .and_then(|link| gap([link, link]));
        other.is_some_and(|other| {
            other.left_m > own.right_m + LEAST_INSIDE_M
                && other.right_m < own.left_m - LEAST_INSIDE_M
        })
    };
    if joints.iter().any(is_between) {
        OUTSIDE
    } else {
        1.0
    }
}
