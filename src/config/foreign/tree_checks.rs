//! Checks of a robot's tree that don't depend on its format.

use std::collections::BTreeMap;

use crate::foreign::words::words_at;
use crate::foreign::xml;
use actcheck_base::{Diagnostic, Diagnostics, SourceSpan, did_you_mean};
use actcheck_data::{ModelTree, TreeJoint, TreeMimic, TreeMotion};

/// Share of its range by which a joint may leave its limits without a warning: they are often
/// rounded.
const BEYOND_SHARE: f64 = 0.05;

/// Reports joints that move the whole robot (W035, W036), moving links without a mass (W034), and
/// couplings to joints that don't exist (W051) or that move a joint beyond its limits (W036).
pub(crate) fn check(tree: &ModelTree, found: &mut Diagnostics) {
    let joints: BTreeMap<&str, &TreeJoint> = tree
        .joints
        .iter()
        .map(|joint| (joint.name.as_str(), joint))
        .collect();
    for joint in &tree.joints {
        check_kind(joint, tree, found);
        check_mass(joint, tree, found);
        if let Some(mimic) = joint.mimic.as_ref().filter(|_| joint.motion.moves()) {
            check_mimic(joint, mimic, &joints, found);
        }
    }
}

fn fault(found: &mut Diagnostics, fault: Diagnostic, at: &SourceSpan, help: &str) {
    found.push(fault.at(&at.source, xml::tag(at)).help(help));
}

/// Reports a planar or floating joint: one at the root moves the whole robot.
fn check_kind(joint: &TreeJoint, tree: &ModelTree, found: &mut Diagnostics) {
    let kind = match joint.motion {
        TreeMotion::Planar => "planar",
        TreeMotion::Floating => "floating",
        _ => return,
    };
    let is_at_root = tree.joints.iter().all(|other| other.child != joint.parent);
    let says = format!("the joint `{}` is of the type {kind}", joint.name);
    if is_at_root {
        let warning = Diagnostic::warning("W036", format!("{says}, and is taken as fixed"));
        let help = "`base = \"planar\"` in the profile moves the whole robot";
        fault(found, warning, &joint.place, help);
    } else {
        let error = Diagnostic::error("W035", format!("{says}, which can't be simulated"));
        let help = "use fixed, prismatic, revolute or continuous";
        fault(found, error, &joint.place, help);
    }
}

/// Reports a movable, colliding link with a mass of 0: it could neither push an object nor be
/// pushed.
fn check_mass(joint: &TreeJoint, tree: &ModelTree, found: &mut Diagnostics) {
    let link = tree
        .link(&joint.child)
        .filter(|link| joint.motion != TreeMotion::Fixed && !link.solids.is_empty());
    let inertial = link.and_then(|link| link.inertial.as_ref());
    if let Some(inertial) = inertial.filter(|inertial| inertial.kg == 0.0) {
        let error = Diagnostic::error(
            "W034",
            format!("the link `{}` moves but has a mass of 0", joint.child),
        );
        let solid = words_at(&inertial.place).solid;
        let help = format!("set its mass in kilograms, or remove each {solid}");
        fault(found, error, &inertial.place, &help);
    }
}

fn check_mimic(
    joint: &TreeJoint,
    mimic: &TreeMimic,
    joints: &BTreeMap<&str, &TreeJoint>,
    found: &mut Diagnostics,
) {
    let leader = mimic.leader.as_str();
    let Some(leads) = joints.get(leader).filter(|leads| leads.motion.moves()) else {
        let known = joints.values().filter(|known| known.motion.moves());
        let help = did_you_mean(leader, known.map(|known| known.name.as_str()));
        let message = format!("the model has no movable joint `{leader}` to mimic");
        fault(
            found,
            Diagnostic::error("W051", message),
            &mimic.place,
            &help,
        );
        return;
    };
    // Limits that the leader makes the joint leave would block both.
    let ends = [leads.lower, leads.upper].map(|end| mimic.factor * end + mimic.offset);
    let (low, high): (f64, f64) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let slack = BEYOND_SHARE * (high - low);
    if !slack.is_finite() || (low >= joint.lower - slack && high <= joint.upper + slack) {
        return;
    }
    let message = format!(
        "`{}` has the limits {} to {}, but `{leader}` moves it from {low:.3} to {high:.3}",
        joint.name, joint.lower, joint.upper
    );
    let words = words_at(&mimic.place);
    let help = format!(
        "its limits are taken as those of its coupling: check {} and the {}",
        words.limits, words.factor
    );
    fault(
        found,
        Diagnostic::warning("W036", message),
        &mimic.place,
        &help,
    );
}
