//! Reads the joints of objects in SDF.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::foreign::elements::{Children, refuse_unless};
use crate::foreign::sdf_pose::{frame, pose};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_data::PartJoint;

/// Limits beyond this are none. Units: metres or radians.
pub(super) const UNLIMITED: f64 = 1e6;
/// The minor version of SDF 1 from which axes are in the frame of their joint, no longer in that of
/// the model.
const OWN_FRAME: u32 = 5;

pub(crate) const JOINT: Children = Children {
    read: &["parent", "child", "pose", "axis", "axis2", "origin"],
    // The limits and damping in `<physics>` are those of other solvers, with their own defaults.
    harmless: &[
        "sensor",
        "physics",
        "gearbox_ratio",
        "gearbox_reference_body",
        "thread_pitch",
        "screw_thread_pitch",
    ],
    refused: &[],
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
pub(super) const DYNAMICS: Children = Children {
    read: &[
        "damping",
        "friction",
        "spring_reference",
        "spring_stiffness",
    ],
    harmless: &[],
    refused: &[],
};
/// There is no motor whose effort and speed could have limits.
pub(super) const LIMIT: Children = Children {
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

/// Reads a joint of a model at a pose, whose own pose is relative to the frame `child`. Reports W033 to W035, and
/// returns `None`, if it can't be simulated.
pub(crate) fn read(
    joint: Node,
    child: &Isometry3<f64>,
    model: &Isometry3<f64>,
    reader: &mut Reader,
) -> Option<PartJoint> {
    let name = joint.attribute("name").unwrap_or_default();
    let kind = kind(joint, reader)?;
    let at = child * pose(joint, reader)?;
    let axis = reader.required(joint, "axis")?;
    AXIS.check(axis, reader);
    let why = "a joint begins at 0";
    refuse_unless(axis, "initial_position", 0.0, why, reader);
    let own = model.rotation.inverse() * at.rotation;
    let direction = direction(joint, axis, own, reader)?;
    let Some(direction) = (model.rotation * direction).try_normalize(1e-9) else {
        let message = format!("the axis of the joint `{name}` must not be zero");
        reader.error(
            "W034",
            axis,
            message,
            "write, for example, `<xyz>0 0 1</xyz>`",
        );
        return None;
    };
    let limits = xml::child(axis, "limit").filter(|_| kind != "continuous");
    if let Some(limits) = limits {
        LIMIT.check(limits, reader);
    }
    let mut limit =
        |name: &str, otherwise: f64| match limits.and_then(|limits| xml::child(limits, name)) {
            Some(node) => reader.number(node, Bound::Finite).map(|value| {
                if value.abs() > UNLIMITED {
                    otherwise
                } else {
                    value
                }
            }),
            None => Some(otherwise),
        };
    let range = [
        limit("lower", f64::NEG_INFINITY)?,
        limit("upper", f64::INFINITY)?,
    ];
    if range[0] > range[1] {
        let message = format!(
            "the joint `{name}` has a lower limit of {} above its upper limit of {}",
            range[0], range[1]
        );
        reader.error("W034", axis, message, "exchange the limits");
        return None;
    }
    let dynamics = xml::child(axis, "dynamics");
    let mut resistance = |name: &str| match dynamics.and_then(|dynamics| xml::child(dynamics, name))
    {
        Some(node) => reader.number(node, Bound::NotNegative),
        None => Some(0.0),
    };
    let (damping, friction) = (resistance("damping")?, resistance("friction")?);
    if let Some(dynamics) = dynamics {
        DYNAMICS.check(dynamics, reader);
        let why = "joints have no springs";
        refuse_unless(dynamics, "spring_stiffness", 0.0, why, reader);
    }
    let anchor_m = at.translation.vector.into();
    Some(PartJoint {
        slides: kind == "prismatic",
        axis: direction.into(),
        anchor_m,
        range,
        damping,
        friction,
    })
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
