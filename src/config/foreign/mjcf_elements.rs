//! The elements and attributes of MJCF: those that MuJoCo does not know, and those that would change
//! the model and can't be simulated.

use std::collections::BTreeMap;

use crate::foreign::elements::is_usual_gravity;
use crate::foreign::mjcf::Purpose;
use crate::foreign::mjcf_couplings::elements;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::did_you_mean;

/// Each element as PARENT/ELEMENT, with its attributes; `*` for those that have no effect here.
/// `body` means all elements that have the children of a body. (The schema of MuJoCo 3.3.1, as its
/// function `mj_printSchema` prints it.)
const SCHEMA: &str = include_str!("mjcf_schema.txt");

/// Elements with the children of a body.
const LIKE_BODIES: [&str; 4] = ["body", "worldbody", "frame", "replicate"];
/// Largest difference from the simulation's gravity that is not reported. Unit: m/s².
const GRAVITY_TOLERANCE: f64 = 0.05;

/// Reports elements and attributes that are unknown (W036, W035 in bodies), and those that would
/// change the model.
pub(super) fn check(root: Node, purpose: Purpose, reader: &mut Reader) {
    let schema: BTreeMap<&str, Vec<&str>> = SCHEMA
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?, words.collect()))
        })
        .collect();
    for node in root.descendants().filter(Node::is_element) {
        let Some(parent) = node.parent_element() else {
            continue;
        };
        if node.tag_name().namespace().is_none() {
            check_names(node, parent, &schema, reader);
        }
    }
    check_bodies(root, purpose, reader);
    check_equalities(root, purpose, reader);
    check_options(root, purpose, reader);
}

/// Reports an unknown element, or its unknown attributes.
fn check_names(node: Node, parent: Node, schema: &BTreeMap<&str, Vec<&str>>, reader: &mut Reader) {
    let (name, inside) = (node.tag_name().name(), parent.tag_name().name());
    let kind = if LIKE_BODIES.contains(&inside) {
        "body"
    } else {
        inside
    };
    let Some(attributes) = schema.get(format!("{kind}/{name}").as_str()) else {
        let known: Vec<&str> = schema
            .keys()
            .filter_map(|key| key.strip_prefix(kind)?.strip_prefix('/'))
            .collect();
        if known.is_empty() {
            return;
        }
        let message = format!("`<{name}>` in `<{inside}>` is ignored");
        let help = format!("this name is unknown; {}", did_you_mean(name, known));
        if kind == "body" {
            let message = format!("`<{inside}>` has no `<{name}>`");
            reader.error("W035", node, message, help);
        } else {
            reader.warning("W036", node, message, help);
        }
        return;
    };
    if attributes.contains(&"*") {
        return;
    }
    for attribute in node.attributes() {
        let key = attribute.name();
        let is_known = attributes.contains(&key) || matches!(key, "class" | "name" | "user");
        if !is_known && attribute.namespace().is_none() {
            let message = format!("the attribute `{key}` of `<{name}>` is ignored");
            let help = format!(
                "MuJoCo does not know this name; {}",
                did_you_mean(key, attributes.iter().copied())
            );
            reader.warning("W036", node, message, help);
        }
    }
}

/// Reports bodies that gravity moves less, and those that a program moves.
fn check_bodies(root: Node, purpose: Purpose, reader: &mut Reader) {
    let mut is_first = true;
    for body in root.descendants().filter(|node| node.has_tag_name("body")) {
        if body.attribute("mocap") == Some("true") {
            let message = "this body is moved by a program (`mocap`), and does not move here";
            let help = "nothing moves it: leave it out if it is only a target";
            reader.warning("W036", body, message.to_owned(), help);
        }
        let Some(written) = body.attribute("gravcomp") else {
            continue;
        };
        let share = reader.numbers::<1>(body, written, Bound::Finite);
        if !share.is_some_and(|[share]| share != 0.0) {
            continue;
        }
        if purpose != Purpose::Robot {
            let message = "a body that gravity does not pull (`gravcomp`) can't be simulated";
            let help = "the model would be another one without it: remove it if that is meant";
            reader.error("W035", body, message.to_owned(), help);
        } else if std::mem::take(&mut is_first) {
            let message = "`gravcomp` is left out: motors carry the weight of this body";
            let help = "it is left out of all other bodies, too";
            reader.warning("W036", body, message.to_owned(), help);
        }
    }
}

/// Reports couplings of objects, and welded bodies: one that a program moves would only lead the
/// other.
fn check_equalities(root: Node, purpose: Purpose, reader: &mut Reader) {
    let is_mocap = |name: &str| {
        root.descendants().any(|body| {
            body.has_tag_name("body")
                && body.attribute("name") == Some(name)
                && body.attribute("mocap") == Some("true")
        })
    };
    let active =
        elements(root, "equality").filter(|node| node.attribute("active") != Some("false"));
    for equality in active {
        let name = equality.tag_name().name();
        let is_read = ["joint", "tendon", "connect"].contains(&name) && purpose == Purpose::Robot;
        let ends = ["body1", "body2"].into_iter();
        if is_read {
            continue;
        }
        if name == "weld" && ends.filter_map(|end| equality.attribute(end)).any(is_mocap) {
            let message = "`<weld>` to a body that a program moves is left out".to_owned();
            let help = "here joints move the model, and gravity";
            reader.warning("W036", equality, message, help);
        } else {
            let message = format!("`<{name}>` in `<equality>` can't be simulated");
            let help = "the model would be another one without it: remove it if that is meant, \
                        or put the one body into the other";
            reader.error("W035", equality, message, help);
        }
    }
}

/// Reports gravity that differs from that of the simulation: in a world, it is an error (W035).
fn check_options(root: Node, purpose: Purpose, reader: &mut Reader) {
    for option in xml::children(root, "option") {
        let mut differs =
            xml::children(option, "flag").any(|flag| flag.attribute("gravity") == Some("disable"));
        if let Some(written) = option.attribute("gravity") {
            let found = reader.numbers::<3>(option, written, Bound::Finite);
            differs |= found.is_some_and(|found| !is_usual_gravity(found, GRAVITY_TOLERANCE));
        }
        if !differs {
            continue;
        }
        let help = "write `gravity=\"0 0 -9.81\"`, or remove it";
        if purpose == Purpose::World {
            let message = "this gravity can't be simulated".to_owned();
            reader.error("W035", option, message, help);
        } else {
            let message = "this gravity is ignored: that of the simulation is 0 0 -9.81 m/s²";
            reader.warning("W036", option, message.to_owned(), help);
        }
    }
}
