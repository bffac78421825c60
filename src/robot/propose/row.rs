//! Further fingers in a row with one of the two that face each other, which close together with it.

use std::collections::BTreeSet;

use super::body::chain;
use super::fingers::leader;
use crate::description::{JointKind, RobotModel};

/// Limits of joints that differ by less than this are the same. Units: metres or radians.
const LIMIT_SLACK: f64 = 1e-3;
/// Weight of a finger at the end of a row that closes together.
const AT_THE_END: f64 = 0.7;

/// Weight of two fingers of a row of three or more, which curl side by side rather than against
/// each other.
const IN_A_ROW: f64 = 0.2;
/// Least cosine between the axes of the fingers of a row.
const PARALLEL: f64 = 0.9;

/// Weight of two fingers against each other: not both of a row, as the fingers of a human hand
/// without its thumb.
pub(super) fn across(model: &RobotModel, named: &[usize], further: &[usize]) -> f64 {
    let axis =
        |joint: usize| model.joints[joint].origin.rotation * model.joints[joint].axis.into_inner();
    let curl_alike = |one: usize, other: usize| {
        is_like(model, one, other) && axis(one).dot(&axis(other)) > PARALLEL
    };
    let &[one, other] = named else { return 1.0 };
    let turns = model.joints[one].kind == JointKind::Revolute;
    let has_third = || further.iter().any(|third| curl_alike(one, *third));
    if turns && curl_alike(one, other) && has_third() {
        IN_A_ROW
    } else {
        1.0
    }
}

/// The joints that move further fingers: they are on the same link as one of the named joints, with
/// the same limits, and move neither of the two fingers.
pub(super) fn beside(
    model: &RobotModel,
    (links, named): ([usize; 2], &[usize]),
    joints: &BTreeSet<usize>,
    palm: usize,
) -> Vec<usize> {
    let inner = chain(model, palm);
    let in_use: BTreeSet<usize> = links
        .iter()
        .flat_map(|link| chain(model, *link))
        .map(|joint| leader(model, joint))
        .collect();
    let is_further = |joint: &usize| {
        let other =
            leader(model, *joint) == *joint && !in_use.contains(joint) && !inner.contains(joint);
        other && named.iter().any(|named| is_like(model, *joint, *named))
    };
    joints.iter().copied().filter(is_further).collect()
}

/// Whether two joints are on the same link, with the same limits, and have motors both or neither.
fn is_like(model: &RobotModel, joint: usize, other: usize) -> bool {
    let (a, b) = (&model.joints[joint], &model.joints[other]);
    a.parent == b.parent
        && a.kind == b.kind
        && (a.lower - b.lower).abs() + (a.upper - b.upper).abs() < LIMIT_SLACK
        && (a.effort > 0.0) == (b.effort > 0.0)
}

/// Weight of a finger's place among those that close with it: in their middle, an object does not
/// tip out of the hand.
pub(super) fn amid(model: &RobotModel, named: &[usize], further: &[usize]) -> f64 {
    let knuckle = |joint: usize| model.joints[joint].origin.translation.vector;
    let is_amid = |named: &usize| {
        let ways: Vec<_> = further
            .iter()
            .map(|joint| knuckle(*joint) - knuckle(*named))
            .collect();
        ways.iter()
            .any(|way| ways.iter().any(|other| way.dot(other) < 0.0))
    };
    if further.len() < 2 || named.iter().any(is_amid) {
        1.0
    } else {
        AT_THE_END
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    /// A palm with fingers that turn about these axes, with the same limits.
    fn hand(axes: &[[f64; 3]]) -> RobotModel {
        let path = Path::new("models/robots/fixed_arm.toml");
        let shipped = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid");
        let inertial = "<inertial><mass value=\"0.1\"/>\
                        <inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial>";
        let finger = |(idx, [x, y, z]): (usize, &[f64; 3])| {
            format!(
                "<link name=\"finger_{idx}\">{inertial}</link><joint name=\"finger_{idx}\" type=\"revolute\">\
                 <parent link=\"palm\"/><child link=\"finger_{idx}\"/><axis xyz=\"{x} {y} {z}\"/>\
                 <limit lower=\"0\" upper=\"1.5\" effort=\"1\" velocity=\"1\"/></joint>"
            )
        };
        let fingers: String = axes.iter().enumerate().map(finger).collect();
        let text =
            format!("<robot name=\"hand\"><link name=\"palm\">{inertial}</link>{fingers}</robot>");
        let core = actcheck_config::robot::with_urdf(shipped.core, Source::new("hand.urdf", text))
            .expect("it is a URDF");
        RobotModel::without_roles(&core).expect("the hand is valid")
    }

    #[test]
    fn fingers_of_a_row_are_not_against_each_other() {
        let of = |model: &RobotModel, fingers: [usize; 2]| {
            let named = fingers.map(|idx| {
                model
                    .joint(&format!("finger_{idx}"))
                    .expect("it is a joint")
            });
            let further: Vec<usize> = (0..model.joints.len())
                .filter(|joint| !named.contains(joint))
                .collect();
            across(model, &named, &further)
        };
        // Three fingers and a thumb that turns the other way.
        let human = hand(&[
            [0.0, 0.0, 1.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.1, 1.0],
            [0.0, 0.0, -1.0],
        ]);
        assert!(of(&human, [0, 1]) < 1.0 && of(&human, [0, 2]) < 1.0);
        assert_eq!(of(&human, [0, 3]), 1.0);
        // Three fingers around a palm, and two that turn about parallel axes.
        let round = hand(&[[1.0, 0.0, 0.0], [-0.5, 0.87, 0.0], [-0.5, -0.87, 0.0]]);
        assert_eq!(of(&round, [0, 1]), 1.0);
        assert_eq!(of(&hand(&[[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]), [0, 1]), 1.0);
    }
}
