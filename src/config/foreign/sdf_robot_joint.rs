//! Reads the joints of robots in SDF.

use std::f64::consts::TAU;

use nalgebra::UnitQuaternion;

use crate::foreign::elements::Children;
use crate::foreign::sdf_joint;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_data::{TreeJoint, TreeMimic, TreeMotion};

/// Range of a sliding joint without a limit at one end or at both. Unit: metres.
const SLIDES_M: f64 = 10.0;
/// Range of a turning joint with a limit at one end only. Unit: radians.
const TURNS_RAD: f64 = 10.0 * TAU;

const AXIS: Children = Children {
    read: &[
        "xyz",
        "use_parent_model_frame",
        "limit",
        "dynamics",
        "initial_position",
        "mimic",
    ],
    harmless: &[],
    refused: &[],
};
const MIMIC: Children = Children {
    read: &["multiplier", "offset", "reference"],
    harmless: &[],
    refused: &[],
};

/// Reads the motion of a joint; `fixed` is one with its name and place. `own`: the orientation of
/// the joint in its model. Its axis is in the frame of this model. Returns `None` after it has
/// reported a fault.
pub(crate) fn read(
    joint: Node,
    fixed: TreeJoint,
    own: UnitQuaternion<f64>,
    reader: &mut Reader,
) -> Option<TreeJoint> {
    sdf_joint::JOINT.check(joint, reader);
    reader.attribute(joint, "type")?;
    let axis = xml::child(joint, "axis");
    let mimic_node = axis.and_then(|axis| xml::child(axis, "mimic"));
    if joint.attribute("type") == Some("fixed") {
        if let Some(mimic) = mimic_node {
            let message = format!("the joint `{}` is fixed: it follows no other", fixed.name);
            let help = "remove the `<mimic>`, or make the joint `revolute` or `prismatic`";
            reader.warning("W036", mimic, message, help);
        }
        return Some(fixed);
    }
    if sdf_joint::is_rigid(joint) && mimic_node.is_none() {
        return Some(fixed);
    }
    let kind = sdf_joint::kind(joint, reader)?;
    let axis = reader.required(joint, "axis")?;
    AXIS.check(axis, reader);
    let read = sdf_joint::motion(joint, (kind, axis), own, reader)?;
    let limits = xml::child(axis, "limit");
    let [effort, velocity] =
        ["effort", "velocity"].map(|name| sdf_joint::limit(limits, name, reader));
    // Negative values mean that there is none; 0 means here that it is unknown.
    let [effort, velocity] =
        [effort?, velocity?].map(|most| most.map_or(0.0, |most| most.max(0.0)));
    let (motion, [lower, upper]) = match (read.slides, read.range) {
        (true, range) => (
            TreeMotion::Prismatic,
            bounded(joint, range, SLIDES_M, reader),
        ),
        (false, [None, None]) => (TreeMotion::Continuous, [f64::NEG_INFINITY, f64::INFINITY]),
        (false, range) => (
            TreeMotion::Revolute,
            bounded(joint, range, TURNS_RAD, reader),
        ),
    };
    Some(TreeJoint {
        motion,
        axis: read.axis,
        lower,
        upper,
        effort,
        velocity,
        damping: read.damping,
        friction: read.friction,
        mimic: mimic(axis, reader)?,
        ..fixed
    })
}

/// Returns limits with both ends. Warns of a missing one (W036).
fn bounded(joint: Node, range: [Option<f64>; 2], most: f64, reader: &mut Reader) -> [f64; 2] {
    let found = match range {
        [Some(lower), Some(upper)] => return [lower, upper],
        [Some(lower), None] => [lower, lower.max(0.0) + most],
        [None, Some(upper)] => [upper.min(0.0) - most, upper],
        [None, None] => [-most, most],
    };
    let name = joint.attribute("name").unwrap_or_default();
    let message = format!(
        "the joint `{name}` has an end without a limit: it moves from {:.3} to {:.3}",
        found[0], found[1]
    );
    reader.warning("W036", joint, message, "write both limits");
    found
}

/// Reads the joint that a joint follows, in SDF 1.11 and later: `Some(None)` if it follows none,
/// `None` after a fault.
#[expect(
    clippy::option_option,
    reason = "a fault and a missing coupling differ"
)]
fn mimic(axis: Node, reader: &mut Reader) -> Option<Option<TreeMimic>> {
    let Some(mimic) = xml::child(axis, "mimic") else {
        return Some(None);
    };
    MIMIC.check(mimic, reader);
    let leader = reader.attribute(mimic, "joint")?.to_owned();
    if mimic.attribute("axis").is_some_and(|axis| axis != "axis") {
        let message = "a coupling to the second axis of a joint can't be simulated".to_owned();
        reader.error("W035", mimic, message, "name a joint with a single axis");
        return None;
    }
    let mut number = |name: &str, otherwise: f64| match xml::child(mimic, name) {
        Some(node) => reader.number(node, Bound::Finite),
        None => Some(otherwise),
    };
    let (factor, offset) = (number("multiplier", 1.0)?, number("offset", 0.0)?);
    let offset = offset - factor * number("reference", 0.0)?;
    Some(Some(TreeMimic {
        leader,
        factor,
        offset,
        place: reader.place(mimic),
    }))
}

/// Whether a plugin makes a joint follow another, as that of `roboticsgroup_gazebo_plugins` does.
pub(crate) fn is_coupling(plugin: Node) -> bool {
    ["joint", "mimicJoint"]
        .iter()
        .all(|name| xml::child(plugin, name).is_some())
}
