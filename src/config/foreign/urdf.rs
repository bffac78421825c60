//! Reads objects in URDF: those of its tree, with the properties that only objects have.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use crate::foreign::body::{Body, Role, SdfModel};
use crate::foreign::frames::Frame;
use crate::foreign::geometry::Shapes;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::sdf_surface::{refuse_self_collision, warn_of_usual_friction};
use crate::foreign::tree_object;
use crate::foreign::urdf_extra::{self, Contact, Extras};
use crate::foreign::urdf_tree::{self, URDF_ROOT};
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::{ModelTree, TreeJoint, TreeMotion};

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
    let (mut body, mut frames) = (Body::default(), BTreeMap::new());
    if reader.root(root, "robot", URDF_ROOT).is_some() {
        (body, frames) = read_object(root, &mut shapes, &mut reader);
        if body.parts.is_empty() && !reader.found.has_errors() {
            let message = "the object has no solid shape: none of its links has a `<collision>`";
            let help = "give a link a `<collision>`; a `<visual>` does not collide";
            reader.error("W038", root, message.to_owned(), help);
        }
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
            frames,
            pose: Isometry3::identity(),
            digest,
        }),
        found,
    )
}

fn read_object(
    root: Node,
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> (Body, BTreeMap<String, Frame>) {
    urdf_extra::ROBOT.check(root, reader);
    let extras = Extras::of(root, reader);
    let read = urdf_tree::read(root, reader);
    if !read.is_whole {
        return (Body::default(), BTreeMap::new());
    }
    let mut tree = read.tree;
    let named = |element: &'static str| {
        xml::children(root, element).filter_map(|node| Some((node.attribute("name")?.trim(), node)))
    };
    let links: BTreeMap<&str, Node> = named("link").collect();
    let joints: BTreeMap<&str, Node> = named("joint").collect();
    for joint in &mut tree.joints {
        if let Some(node) = joints.get(joint.name.as_str()) {
            check_joint(joint, *node, reader);
        }
    }
    let contacts = check_links(&mut tree, &links, &extras, reader);
    let mut found = Diagnostics::new();
    let material = |members: &[usize], body: &mut Body, _: &mut Diagnostics| {
        for (link, contact) in members.iter().filter_map(|idx| contacts.get(idx)) {
            for collision in xml::children(*link, "collision") {
                let surface = contact.of_collision(collision, reader);
                surface.add_to(body, collision, Role::Object, reader);
            }
        }
        warn_of_usual_friction(body, xml::span(root), reader);
    };
    let (body, frames) = tree_object::body(&tree, shapes, extras.is_static, material, &mut found);
    reader.found.extend(found);
    refuse_self_collision(&body, extras.collides, reader);
    (body, frames)
}

/// Reports a joint that can't move a part of an object (W035). One with the range 0 to 0 is fixed.
fn check_joint(joint: &mut TreeJoint, node: Node, reader: &mut Reader) {
    match joint.motion {
        TreeMotion::Planar | TreeMotion::Floating => {
            let message = format!(
                "the joint `{}` is of the type {}, which can't be simulated",
                joint.name,
                node.attribute("type").unwrap_or_default()
            );
            let help = "use revolute, continuous, prismatic or fixed";
            reader.error("W035", node, message, help);
        }
        motion if motion.moves() => {
            urdf_extra::JOINT.check(node, reader);
            if joint.lower == 0.0 && joint.upper == 0.0 {
                joint.motion = TreeMotion::Fixed;
            }
        }
        _ => {}
    }
}

/// Reports elements of links that are not read, and masses of 0 (W034). Returns the links with their
/// contact properties, by their index.
fn check_links<'a>(
    tree: &mut ModelTree,
    nodes: &BTreeMap<&str, Node<'a>>,
    extras: &Extras,
    reader: &mut Reader,
) -> BTreeMap<usize, (Node<'a>, Contact)> {
    let mut contacts = BTreeMap::new();
    for (idx, link) in tree.links.iter_mut().enumerate() {
        let Some(node) = nodes.get(link.name.as_str()) else {
            continue;
        };
        urdf_extra::LINK.check(*node, reader);
        for collision in xml::children(*node, "collision") {
            urdf_extra::COLLISION.check(collision, reader);
        }
        for inertial in xml::children(*node, "inertial") {
            urdf_extra::INERTIAL.check(inertial, reader);
        }
        let contact = extras.of_link(*node, reader);
        if let Some(inertial) = &mut link.inertial {
            contact.scale(inertial, *node, reader);
            if inertial.kg == 0.0 && !link.solids.is_empty() {
                let message = format!("the link `{}` collides but has a mass of 0", link.name);
                let help = "state its mass in kilograms; an object that never moves has `<gazebo><static>true</static></gazebo>`";
                reader.error_in("W034", xml::at_tag(&inertial.place), message, help);
            }
        }
        contacts.insert(idx, (*node, contact));
    }
    contacts
}
