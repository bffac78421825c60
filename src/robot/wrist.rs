//! Links of a wrist that pass through each other.
//!
//! Their convex shapes are larger than the links, and the wrist's two axes meet: the shapes overlap
//! at positions that the limits of the joints allow, where the real links are apart.

use std::collections::BTreeSet;

use crate::description::{Joint, JointKind, RobotModel};
use crate::kinematics::motion;
use crate::self_contact::TwoLinks;

/// Axes closer to each other than this belong to one wrist. Unit: metres.
const COMPACT_M: f64 = 0.05;
/// Number of positions of each joint that are tried.
const N_POSITIONS: u32 = 6;
/// Share of them in which the shapes of links that pass through each other overlap.
const OFTEN: f64 = 0.1;

/// Returns the pairs of links with one link between them that pass through each other, with the
/// smaller index first.
pub(crate) fn passing(model: &RobotModel) -> BTreeSet<(usize, usize)> {
    let mut found = BTreeSet::new();
    let is_solid = |link: usize| !model.links[link].solids.is_empty();
    for (idx, outer) in model.joints.iter().enumerate() {
        let Some(inner) = outer
            .parent
            .checked_sub(1)
            .map(|inner| &model.joints[inner])
        else {
            continue;
        };
        let turn = [inner, outer]
            .iter()
            .all(|joint| joint.kind == JointKind::Revolute && joint.mimic.is_none());
        let (first, between, second) = (inner.parent, outer.parent, idx + 1);
        let are_solid = [first, between, second].into_iter().all(is_solid);
        let is_compact = outer.origin.translation.vector.norm() < COMPACT_M;
        if turn && is_compact && are_solid && overlap_often(model, (first, inner), (second, outer))
        {
            found.insert((first, second));
        }
    }
    found
}

fn overlap_often(
    model: &RobotModel,
    (first, inner): (usize, &Joint),
    (second, outer): (usize, &Joint),
) -> bool {
    let links = TwoLinks::new([first, second].map(|link| model.links[link].solids.as_slice()));
    let mut n_overlaps = 0;
    for inner_at in positions(inner) {
        for outer_at in positions(outer) {
            let pose =
                inner.origin * motion(inner, inner_at) * outer.origin * motion(outer, outer_at);
            n_overlaps += u32::from(links.overlap(pose));
        }
    }
    f64::from(n_overlaps) > OFTEN * f64::from(N_POSITIONS * N_POSITIONS)
}

/// Positions over the whole range of a joint.
fn positions(joint: &Joint) -> impl Iterator<Item = f64> {
    let (lower, upper) = (
        joint.lower.max(-std::f64::consts::PI),
        joint.upper.min(std::f64::consts::PI),
    );
    (0..N_POSITIONS)
        .map(move |step| lower + (upper - lower) * (f64::from(step) + 0.5) / f64::from(N_POSITIONS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    /// The shapes of the shipped robots' wrists never overlap; with a thick forearm and hand on a
    /// short wrist they do.
    #[test]
    fn only_links_whose_shapes_overlap_pass_through_each_other() {
        let read = |name: &str| {
            let path = format!("models/robots/{name}.toml");
            actcheck_config::robot::read(&Files::Shipped, Path::new(&path))
                .expect("the shipped robot is valid")
                .complete()
                .expect("it states all roles")
        };
        for name in ["mobile_manipulator", "fixed_arm"] {
            let model = RobotModel::read(read(name).roles()).expect("it is valid");
            assert_eq!(passing(&model), BTreeSet::new(), "{name}");
        }
        let mut profile = read("fixed_arm");
        let text = profile.core.urdf.text.replace(
            "xyz=\"0 0 0.08\" rpy=\"0 0 0\"/>\n    <axis",
            "xyz=\"0 0 0.01\"/>\n    <axis",
        );
        assert_ne!(text, *profile.core.urdf.text);
        let name = std::sync::Arc::clone(&profile.core.urdf.name);
        let text = text.replace(
            "radius=\"0.045\" length=\"0.18\"",
            "radius=\"0.1\" length=\"0.2\"",
        );
        profile.core = actcheck_config::robot::with_urdf(profile.core, Source::new(name, text))
            .expect("it is a URDF");
        let model = RobotModel::read(profile.roles()).expect("it is valid");
        let names =
            |pair: &(usize, usize)| [pair.0, pair.1].map(|link| model.links[link].name.clone());
        let found: Vec<[String; 2]> = passing(&model).iter().map(names).collect();
        assert_eq!(found, [["forearm_roll_link", "wrist_roll_link"]]);
    }
}
