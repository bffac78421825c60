//! Reads objects in URDF as one rigid body.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3};

use crate::foreign::body::{Body, Mass};
use crate::foreign::geometry::{Shapes, check_volume};
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::sdf::{SdfModel, possible};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::{Part, Pose};

/// Longest chain of links; a longer one is a cycle.
const LONGEST_CHAIN: usize = 256;

/// Reads the object of a URDF file and its faults. The object is `None` if there are errors.
pub(crate) fn read(source: &Source, path: &Path, lookup: &Lookup) -> (Option<SdfModel>, Diagnostics) {
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
        read_robot(root, &mut body, &mut shapes, &mut reader);
    } else {
        let message = format!("the root is `<{}>` instead of `<robot>`", root.tag_name().name());
        reader.error("W032", root, message, "a URDF file begins with `<robot name=\"…\">`");
    }
    let found = reader.found;
    if found.has_errors() {
        return (None, found);
    }
    let digest = shapes.digest.finish();
    (Some(SdfModel { body, pose: Isometry3::identity(), is_static: false, digest }), found)
}

fn read_robot(root: Node, body: &mut Body, shapes: &mut Shapes, reader: &mut Reader) {
    reader.warn_about_unknown_children(root, &["link", "joint", "material"]);
    let joints: Vec<Node> = xml::children(root, "joint").collect();
    for joint in joints.iter().filter(|joint| joint.attribute("type") != Some("fixed")) {
        let (name, kind) = (joint.attribute("name").unwrap_or(""), joint.attribute("type").unwrap_or("unknown"));
        let message = format!("the joint `{name}` is of the type {kind}, but objects must be rigid");
        reader.error("W035", *joint, message, "make the joint `fixed`; robots are read through `[robot] profile`");
    }
    for link in xml::children(root, "link") {
        let Some(at) = place(link, &joints, reader) else { continue };
        read_link(link, &at, body, shapes, reader);
    }
    if body.parts.is_empty() && !reader.found.has_errors() {
        let message = "the object has no solid shape: none of its links has a `<collision>`".to_owned();
        reader.error("W038", root, message, "give a link a `<collision>`; a `<visual>` does not collide");
    }
}

/// Returns the pose of a link relative to the root, through its chain of fixed joints.
fn place(link: Node, joints: &[Node], reader: &mut Reader) -> Option<Isometry3<f64>> {
    let named =
        |joint: &Node, end: &str| xml::child(*joint, end).and_then(|node| node.attribute("link")).map(str::to_owned);
    let mut at = Isometry3::identity();
    let mut name = link.attribute("name").unwrap_or_default().to_owned();
    for _ in 0..LONGEST_CHAIN {
        let Some(joint) = joints.iter().find(|joint| named(joint, "child").as_ref() == Some(&name)) else {
            return Some(at);
        };
        at = origin(*joint, reader)? * at;
        name = named(joint, "parent").unwrap_or_default();
    }
    reader.error("W035", link, "the link's joints form a cycle".to_owned(), "links form one tree");
    None
}

/// Reads the `<origin>` of an element; the identity if it has none.
pub(crate) fn origin(node: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let Some(written) = xml::child(node, "origin") else { return Some(Isometry3::identity()) };
    let mut three = |name: &str| match written.attribute(name) {
        Some(text) => reader.numbers(written, text, Bound::Finite),
        None => Some([0.0; 3]),
    };
    Some(xml::placed(three("xyz")?, three("rpy")?))
}

fn read_link(link: Node, at: &Isometry3<f64>, body: &mut Body, shapes: &mut Shapes, reader: &mut Reader) {
    reader.warn_about_unknown_children(link, &["inertial", "collision", "visual"]);
    let before = body.parts.len();
    for collision in xml::children(link, "collision") {
        let placed = origin(collision, reader);
        let shape = reader.required(collision, "geometry").and_then(|geometry| shapes.urdf(geometry, reader));
        let (Some(placed), Some(shape)) = (placed, shape) else { continue };
        check_volume(&shape, collision, reader);
        body.parts.push(Part { pose: Pose::from_isometry(&(at * placed)), shape });
    }
    match xml::child(link, "inertial").and_then(|inertial| read_inertial(inertial, at, reader)) {
        Some(mass) => body.masses.push(mass),
        None => body.has_unknown_mass |= body.parts.len() > before,
    }
}

fn read_inertial(inertial: Node, link: &Isometry3<f64>, reader: &mut Reader) -> Option<Mass> {
    let at = link * origin(inertial, reader)?;
    let mass = reader.required(inertial, "mass")?;
    let written = reader.attribute(mass, "value")?;
    let [kg] = reader.numbers::<1>(mass, written, Bound::Positive)?;
    let moments = xml::child(inertial, "inertia").and_then(|inertia| {
        let mut entry = |name: &str| {
            let written = reader.attribute(inertia, name)?;
            reader.numbers::<1>(inertia, written, Bound::Finite).map(|[number]| number)
        };
        let (xx, xy, xz) = (entry("ixx")?, entry("ixy")?, entry("ixz")?);
        let (yy, yz, zz) = (entry("iyy")?, entry("iyz")?, entry("izz")?);
        possible(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz), inertia, reader)
    });
    let turn = at.rotation.to_rotation_matrix();
    let about_com = moments.map(|moments| turn.matrix() * moments * turn.matrix().transpose());
    Some(Mass { kg, com: at.translation.vector, about_com })
}
