//! Reads the joints of models in SDF: those of objects, and the motions of those of robots.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::foreign::elements::{Children, refuse_unless};
use crate::foreign::sdf_pose::{frame, pose};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_data::PartJoint;

/// Larger limits mean that the joint is unlimited. Units: metres or radians.
const UNLIMITED: f64 = 1e6;
/// The minor version of SDF 1 from which axes are in the frame of their joint, no longer in that of
/// the model.
const OWN_FRAME: u32 = 5;

pub(crate) const JOINT: Children = Children {
    read: &["parent", "child", "pose", "axis", "origin"],
    // The limits and damping in `<physics>` are those of other solvers, with their own defaults;
    // a second axis, gears and screws belong to types of joints that are errors.
    harmless: &[
        "sensor",
        "physics",
        "axis2",
        "gearbox_ratio",
        "gearbox_reference_body",
        "thread_pitch",
        "screw_thread_pitch",
    ],
    // It belongs into `<axis>`.
    refused: &["mimic"],
};
const AXIS: Children = Children {
    read: &[
        "xyz",
        "use_parent_model_frame",
        "limit",
        "dynamics",
        "initial_position",
    ],
    harmless: &[],
    refused: &["mimic"],
};
const DYNAMICS: Children = Children {
    read: &[
        "damping",
        "friction",
        "spring_reference",
        "spring_stiffness",
    ],
    harmless: &[],
    refused: &[],
};
/// The motors of robots have the limits `effort` and `velocity`; the joints of objects have no motors.
const LIMIT: Children = Children {
    read: &[
        "lower",
        "upper",
        "effort",
        "velocity",
        "stiffness",
        "dissipation",
    ],
    harmless: &[],
    refused: &[],
};

/// Returns the type of a joint. Reports W035, and returns `None`, if it can't be simulated.
pub(crate) fn kind<'a>(joint: Node<'a>, reader: &mut Reader) -> Option<&'a str> {
    let name = joint.attribute("name").unwrap_or_default();
    let kind = joint.attribute("type").unwrap_or("unknown");
    if !["revolute", "continuous", "prismatic"].contains(&kind) {
        let message = format!("the joint `{name}` is of the type {kind}, which can't be simulated");
        reader.error(
            "W035",
            joint,
            message,
            "use revolute, continuous, prismatic or fixed",
        );
        return None;
    }
    Some(kind)
}

/// The motion of a joint with one axis.
pub(crate) struct Motion {
    pub(crate) slides: bool,
    /// Frame: that of the joint's model.
    pub(crate) axis: Vector3<f64>,
    /// Its lower and upper limit, as far as it has them. Units: metres or radians.
    pub(crate) range: [Option<f64>; 2],
    pub(crate) damping: f64,
    pub(crate) friction: f64,
}

/// Reads a joint of an object, whose model is at a pose, and whose own pose is relative to the frame
/// `child`. Reports W033 to W035, and returns `None`, if it can't be simulated.
pub(crate) fn read(
    joint: Node,
    child: &Isometry3<f64>,
    model: &Isometry3<f64>,
    reader: &mut Reader,
) -> Option<PartJoint> {
    let kind = kind(joint, reader)?;
    let at = child * pose(joint, reader)?;
    let axis = reader.required(joint, "axis")?;
    AXIS.check(axis, reader);
    let own = model.rotation.inverse() * at.rotation;
    let motion = motion(joint, (kind, axis), own, reader)?;
    let [lower, upper] = motion.range;
    Some(PartJoint {
        slides: motion.slides,
        axis: (model.rotation * motion.axis).into(),
        anchor_m: at.translation.vector.into(),
        range: [
            lower.unwrap_or(f64::NEG_INFINITY),
            upper.unwrap_or(f64::INFINITY),
        ],
        damping: motion.damping,
        friction: motion.friction,
    })
}

/// Reads the motion about or along the `<axis>` of a joint of a kind. `own`: the orientation of the
/// joint in its model. Reports W034 and W035, and returns `None`, if it can't be simulated.
pub(crate) fn motion(
    joint: Node,
    (kind, axis): (&str, Node),
    own: UnitQuaternion<f64>,
    reader: &mut Reader,
) -> Option<Motion> {
    let name = joint.attribute("name").unwrap_or_default();
    let why = "a joint begins at 0";
    refuse_unless(axis, "initial_position", 0.0, why, reader);
    let direction = direction(joint, axis, own, reader)?;
    let Some(direction) = direction.try_normalize(1e-9) else {
        let message = format!("the axis of the joint `{name}` must not be zero");
        let help = "write, for example, `<xyz>0 0 1</xyz>`";
        reader.error("W034", axis, message, help);
        return None;
    };
    let limits = xml::child(axis, "limit");
    if let Some(limits) = limits {
        LIMIT.check(limits, reader);
    }
    let range = match kind {
        "continuous" => [None; 2],
        _ => [
            limit(limits, "lower", reader)?,
            limit(limits, "upper", reader)?,
        ],
    };
    if let [Some(lower), Some(upper)] = range
        && lower > upper
    {
        let message = format!(
            "the joint `{name}` has a lower limit of {lower} above its upper limit of {upper}"
        );
        reader.error("W034", axis, message, "exchange the limits");
        return None;
    }
    let [damping, friction] = resistance(axis, reader)?;
    Some(Motion {
        slides: kind == "prismatic",
        axis: direction,
        range,
        damping,
        friction,
    })
}

/// Reads a limit: `Some(None)` if the joint has none, `None` after a fault.
#[expect(clippy::option_option, reason = "a fault and a missing limit differ")]
pub(super) fn limit(limits: Option<Node>, name: &str, reader: &mut Reader) -> Option<Option<f64>> {
    let Some(node) = limits.and_then(|limits| xml::child(limits, name)) else {
        return Some(None);
    };
    if xml::text(node).parse::<f64>().is_ok_and(f64::is_infinite) {
        return Some(None);
    }
    let value = reader.number(node, Bound::Finite)?;
    Some(Some(value).filter(|value| value.abs() <= UNLIMITED))
}

/// Reads damping and dry friction. Reports a spring (W035).
fn resistance(axis: Node, reader: &mut Reader) -> Option<[f64; 2]> {
    let Some(dynamics) = xml::child(axis, "dynamics") else {
        return Some([0.0; 2]);
    };
    DYNAMICS.check(dynamics, reader);
    let why = "joints have no springs";
    refuse_unless(dynamics, "spring_stiffness", 0.0, why, reader);
    let [damping, friction] =
        ["damping", "friction"].map(|name| match xml::child(dynamics, name) {
            Some(node) => reader.number(node, Bound::NotNegative),
            None => Some(0.0),
        });
    Some([damping?, friction?])
}

/// Returns the direction of a joint's axis in the frame of its model. `own`: the orientation of the
/// joint in that frame. Returns `None` after it has reported a fault.
pub(crate) fn direction(
    joint: Node,
    axis: Node,
    own: UnitQuaternion<f64>,
    reader: &mut Reader,
) -> Option<Vector3<f64>> {
    let written = xml::child(axis, "xyz");
    let direction = match written {
        Some(xyz) => Vector3::from(reader.numbers::<3>(xyz, xml::text(xyz), Bound::Finite)?),
        None => Vector3::z(),
    };
    let named = written
        .and_then(|xyz| xyz.attribute("expressed_in"))
        .filter(|name| !name.is_empty());
    let rotation = match (xml::child(axis, "use_parent_model_frame"), named) {
        (Some(node), _) if reader.boolean(node)? => UnitQuaternion::identity(),
        (None, Some(name)) => frame(joint, name, reader)?.rotation,
        (None, None) if is_old(joint) => UnitQuaternion::identity(),
        _ => own,
    };
    Some(rotation * direction)
}

/// Whether a joint does not move: it is fixed, or its range is a single position.
pub(crate) fn is_rigid(joint: Node) -> bool {
    let limit = xml::child(joint, "axis").and_then(|axis| xml::child(axis, "limit"));
    let end =
        |name| limit.and_then(|limit| xml::text(xml::child(limit, name)?).parse::<f64>().ok());
    let has_no_range = matches!((end("lower"), end("upper")), (Some(lower), Some(upper)) if lower == 0.0 && upper == 0.0);
    joint.attribute("type") == Some("fixed") || has_no_range
}

/// Whether a document has an early version of SDF.
fn is_old(joint: Node) -> bool {
    let version = joint.document().root_element().attribute("version");
    let minor = version.and_then(|version| version.strip_prefix("1.")?.parse::<u32>().ok());
    minor.is_some_and(|minor| minor < OWN_FRAME)
}
