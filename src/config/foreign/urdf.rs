//! Reads objects in URDF.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::foreign::assembly::{Assembly, Join};
use crate::foreign::body::{Body, Mass, Role, SdfModel};
use crate::foreign::geometry::{Shapes, check_volume};
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::sdf_inertial::possible;
use crate::foreign::sdf_surface::{refuse_self_collision, warn_of_usual_friction};
use crate::foreign::urdf_extra::{self, Extras};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::{Part, PartJoint, Pose};

/// Longest chain of links; a longer one is a cycle.
const LONGEST_CHAIN: usize = 256;

/// Reads the object of a URDF file and its faults. The object is `None` if there are errors.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
) -> (Option<SdfModel>, Diagnostics) {
    let text = repaired(&source.text);
    let document = match xml::parse_model(source, &text) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let mut reader = Reader::new(source);
    let mut shapes = Shapes::new(lookup, path);
    shapes.digest.update(source.text.as_bytes());
    let root = document.root_element();
    let mut body = Body::default();
    if root.tag_name().name() == "robot" {
        body = read_robot(root, &mut shapes, &mut reader);
        if body.parts.is_empty() && !reader.found.has_errors() {
            let message = "the object has no solid shape: none of its links has a `<collision>`";
            let help = "give a link a `<collision>`; a `<visual>` does not collide";
            reader.error("W038", root, message.to_owned(), help);
        }
    } else {
        let message = format!(
            "the root is `<{}>` instead of `<robot>`",
            root.tag_name().name()
        );
        reader.error(
            "W032",
            root,
            message,
            "a URDF file begins with `<robot name=\"…\">`",
        );
    }
    let found = reader.found;
    if found.has_errors() {
        return (None, found);
    }
    let digest = shapes.digest.finish();
    (
        Some(SdfModel {
            is_static: body.fixed,
            body,
            pose: Isometry3::identity(),
            digest,
        }),
        found,
    )
}

fn read_robot(root: Node, shapes: &mut Shapes, reader: &mut Reader) -> Body {
    urdf_extra::ROBOT.check(root, reader);
    let extras = Extras::of(root, reader);
    let joints: Vec<Node> = xml::children(root, "joint").collect();
    let links: Vec<Node> = xml::children(root, "link").collect();
    let places: Vec<Option<Isometry3<f64>>> = links
        .iter()
        .map(|link| place(*link, &joints, reader))
        .collect();
    let mut joins = Vec::new();
    for joint in joints {
        let end = |which| {
            let name = xml::child(joint, which).and_then(|end| end.attribute("link"));
            links.iter().position(|link| link.attribute("name") == name)
        };
        let (Some(parent), Some(child)) = (end("parent"), end("child")) else {
            continue;
        };
        let moves = match (joint.attribute("type"), &places[child]) {
            (Some("fixed"), _) => None,
            (_, Some(at)) => match read_joint(joint, at, reader) {
                Some(moves) => Some(moves),
                None => continue,
            },
            (_, None) => continue,
        };
        joins.push(Join {
            place: reader.place(joint),
            parent,
            child,
            joint: moves,
        });
    }
    let assembly = Assembly::of(links.len(), &joins, &mut reader.found);
    let mut bodies = assembly.empty_bodies(extras.is_static);
    for (idx, (link, at)) in links.iter().zip(&places).enumerate() {
        if let Some(at) = at {
            read_link(
                (*link, at, &extras),
                &mut bodies[assembly.body_of(idx)],
                shapes,
                reader,
            );
        }
    }
    let names: Vec<&str> = links
        .iter()
        .map(|link| link.attribute("name").unwrap_or_default())
        .collect();
    for body in &bodies {
        warn_of_usual_friction(body, xml::span(root), reader);
    }
    let body = assembly.attach(bodies, &names, &mut reader.found);
    refuse_self_collision(&body, extras.collides, reader);
    body
}

/// Reads a joint that moves a link, whose pose is known. Returns `None` after it has reported a
/// fault.
fn read_joint(joint: Node, at: &Isometry3<f64>, reader: &mut Reader) -> Option<PartJoint> {
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
    urdf_extra::JOINT.check(joint, reader);
    let mut numbers = |element: &str, attribute: &str, otherwise: f64| {
        let written =
            xml::child(joint, element).and_then(|node| Some((node, node.attribute(attribute)?)));
        match written {
            Some((node, text)) => reader
                .numbers::<1>(node, text, Bound::Finite)
                .map(|[number]| number),
            None => Some(otherwise),
        }
    };
    let range = match kind {
        "continuous" => [f64::NEG_INFINITY, f64::INFINITY],
        _ => [
            numbers("limit", "lower", 0.0)?,
            numbers("limit", "upper", 0.0)?,
        ],
    };
    let (damping, friction) = (
        numbers("dynamics", "damping", 0.0)?.max(0.0),
        numbers("dynamics", "friction", 0.0)?.max(0.0),
    );
    let axis = match xml::child(joint, "axis").and_then(|axis| Some((axis, axis.attribute("xyz")?)))
    {
        Some((axis, text)) => Vector3::from(reader.numbers::<3>(axis, text, Bound::Finite)?),
        None => Vector3::x(),
    };
    let Some(axis) = (at.rotation * axis).try_normalize(1e-9) else {
        let message = format!("the axis of the joint `{name}` must not be zero");
        reader.error(
            "W034",
            joint,
            message,
            "write, for example, `<axis xyz=\"0 0 1\"/>`",
        );
        return None;
    };
    if range[0] > range[1] {
        let message = format!(
            "the joint `{name}` has a lower limit of {} above its upper limit of {}",
            range[0], range[1]
        );
        reader.error("W034", joint, message, "exchange the limits");
        return None;
    }
    let anchor_m = at.translation.vector.into();
    Some(PartJoint {
        slides: kind == "prismatic",
        axis: axis.into(),
        anchor_m,
        range,
        damping,
        friction,
    })
}

/// Returns the pose of a link relative to the root, through its chain of fixed joints.
fn place(link: Node, joints: &[Node], reader: &mut Reader) -> Option<Isometry3<f64>> {
    let named = |joint: &Node, end: &str| {
        xml::child(*joint, end)
            .and_then(|node| node.attribute("link"))
            .map(str::to_owned)
    };
    let mut at = Isometry3::identity();
    let mut name = link.attribute("name").unwrap_or_default().to_owned();
    for _ in 0..LONGEST_CHAIN {
        let Some(joint) = joints
            .iter()
            .find(|joint| named(joint, "child").as_ref() == Some(&name))
        else {
            return Some(at);
        };
        at = origin(*joint, reader)? * at;
        name = named(joint, "parent").unwrap_or_default();
    }
    reader.error(
        "W035",
        link,
        "the link's joints form a cycle".to_owned(),
        "links form one tree",
    );
    None
}

/// Reads the `<origin>` of an element; the identity if it has none.
pub(crate) fn origin(node: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let Some(written) = xml::child(node, "origin") else {
        return Some(Isometry3::identity());
    };
    let mut three = |name: &str| match written.attribute(name) {
        Some(text) => reader.numbers(written, text, Bound::Finite),
        None => Some([0.0; 3]),
    };
    Some(xml::placed(three("xyz")?, three("rpy")?))
}

fn read_link(
    (link, at, extras): (Node, &Isometry3<f64>, &Extras),
    body: &mut Body,
    shapes: &mut Shapes,
    reader: &mut Reader,
) {
    urdf_extra::LINK.check(link, reader);
    let before = body.parts.len();
    let contact = extras.of_link(link, reader);
    for collision in xml::children(link, "collision") {
        urdf_extra::COLLISION.check(collision, reader);
        let surface = contact.of_collision(collision, reader);
        surface.add_to(body, collision, Role::Object, reader);
        let placed = origin(collision, reader);
        let shape = reader
            .required(collision, "geometry")
            .and_then(|geometry| shapes.urdf(geometry, reader));
        let (Some(placed), Some(shape)) = (placed, shape) else {
            continue;
        };
        check_volume(&shape, collision, reader);
        body.parts.push(Part {
            pose: Pose::from_isometry(&(at * placed)),
            shape,
        });
    }
    if let Some(mass) =
        xml::child(link, "inertial").and_then(|inertial| read_inertial(inertial, at, reader))
    {
        body.masses.push(contact.with_inertia(mass, link, reader));
        return;
    }
    body.has_unknown_mass |= body.parts.len() > before;
}

fn read_inertial(inertial: Node, link: &Isometry3<f64>, reader: &mut Reader) -> Option<Mass> {
    urdf_extra::INERTIAL.check(inertial, reader);
    let at = link * origin(inertial, reader)?;
    let mass = reader.required(inertial, "mass")?;
    let written = reader.attribute(mass, "value")?;
    let [kg] = reader.numbers::<1>(mass, written, Bound::Positive)?;
    let moments = xml::child(inertial, "inertia").and_then(|inertia| {
        let mut entry = |name: &str| {
            let written = reader.attribute(inertia, name)?;
            reader
                .numbers::<1>(inertia, written, Bound::Finite)
                .map(|[number]| number)
        };
        let (xx, xy, xz) = (entry("ixx")?, entry("ixy")?, entry("ixz")?);
        let (yy, yz, zz) = (entry("iyy")?, entry("iyz")?, entry("izz")?);
        possible(
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            inertia,
            reader,
        )
    });
    let turn = at.rotation.to_rotation_matrix();
    let about_com = moments.map(|moments| turn.matrix() * moments * turn.matrix().transpose());
    Some(Mass {
        kg,
        com: at.translation.vector,
        about_com,
    })
}
