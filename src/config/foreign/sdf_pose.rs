//! Poses in SDF, which may be relative to any frame of their model: a link, joint, `<frame>`,
//! nested or included model.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::foreign::frames::{Frame, Included, OWN};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::did_you_mean;

/// Longest chain of frames, each relative to the next: longer ones are circles.
const LONGEST: usize = 64;
/// The elements that have a frame of their own.
const WITH_FRAME: [&str; 5] = ["link", "joint", "frame", "model", "include"];

/// Reads the pose of an element; the identity if it has none. It is in the frame in which SDF reads
/// a pose that names none: that of the parent element or, for a joint, that of its child link. Of a
/// model and an `<include>`, this is the pose of the model's own frame, whichever frame of it the
/// file places.
///
/// Returns `None` after it has reported a fault: W034, W035.
pub(crate) fn pose(node: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
    if is_model(node) {
        return in_model(node, 0, reader);
    }
    let Some(element) = xml::child(node, "pose") else {
        return Some(Isometry3::identity());
    };
    if relative_to(element).is_none() {
        return written(element, reader);
    }
    let usual = match usual_frame(node) {
        Some(name) => named(scope(node), name, element, 0, reader)?,
        None => Isometry3::identity(),
    };
    Some(usual.inverse() * in_model(node, 0, reader)?)
}

/// Returns the pose and the frames of a model, for a file that includes it. Returns `None` after it has
/// reported a fault.
pub(crate) fn place(model: Node, reader: &mut Reader) -> Option<Included> {
    Some(Included {
        name: model.attribute("name").unwrap_or_default().to_owned(),
        stated: stated(model, 0, reader)?,
        placement: placement_frame(model, 0, reader)?,
        merged: false,
        frames: frames(model, reader),
    })
}

/// Returns a frame of the model that contains an element, in the frame of that model. If the
/// model lacks the frame, reports W035 and returns `None`.
pub(crate) fn frame(node: Node, name: &str, reader: &mut Reader) -> Option<Isometry3<f64>> {
    named(scope(node), name, node, 0, reader)
}

/// Returns all frames of a model by name, with those of the models in it. Reports those that can't
/// be resolved.
fn frames(model: Node, reader: &mut Reader) -> BTreeMap<String, Frame> {
    let own = Frame {
        pose: Isometry3::identity(),
        link: canonical_link(model, 0, reader),
    };
    let mut all = BTreeMap::from([(OWN.to_owned(), own)]);
    for child in with_frame(model) {
        let (Some(name), Some(pose)) = (name_of(child, reader), in_model(child, 0, reader)) else {
            continue;
        };
        let inside = match child.tag_name().name() {
            "model" => frames(child, reader),
            "include" => included(child, reader)
                .map(|included| included.frames.clone())
                .unwrap_or_default(),
            _ => {
                let link = link_of(model, &name, 0, reader);
                all.entry(name).or_insert(Frame { pose, link });
                continue;
            }
        };
        let prefix = prefix(child, reader);
        for (inner, frame) in inside {
            let own_name = match (inner.as_str(), prefix.as_str()) {
                (OWN, "") => continue,
                (OWN, _) => name.clone(),
                _ => format!("{prefix}{inner}"),
            };
            let link = frame.link.map(|link| format!("{prefix}{link}"));
            let pose = pose * frame.pose;
            all.entry(own_name).or_insert(Frame { pose, link });
        }
    }
    all
}

/// Returns the name of the link that carries a frame of the model that contains an element; `None`
/// if the model lacks the frame, which is not reported.
pub(crate) fn carrier(node: Node, name: &str, reader: &Reader) -> Option<String> {
    link_of(scope(node), name, 0, reader)
}

/// The beginning of the names of things in a nested or included model, as its parent names them.
pub(crate) fn prefix(model: Node, reader: &Reader) -> String {
    if included(model, reader).is_some_and(|included| included.merged) {
        return String::new();
    }
    name_of(model, reader).map_or_else(String::new, |name| format!("{name}::"))
}

/// The pose that an element states, in the frame of its model.
fn stated(node: Node, depth: usize, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let element = xml::child(node, "pose");
    if let (None, Some(included)) = (element, included(node, reader)) {
        return Some(included.stated);
    }
    let frame = match element.and_then(relative_to).or(usual_frame(node)) {
        Some(name) => named(
            scope(node),
            name,
            element.unwrap_or(node),
            depth + 1,
            reader,
        )?,
        None => Isometry3::identity(),
    };
    Some(
        frame
            * element.map_or(Some(Isometry3::identity()), |element| {
                written(element, reader)
            })?,
    )
}

/// Reads the pose of an element in the frame of its model.
fn in_model(node: Node, depth: usize, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let stated = stated(node, depth, reader)?;
    if !is_model(node) {
        return Some(stated);
    }
    let placement = placement_frame(node, depth, reader)?;
    Some(match placement == Isometry3::identity() {
        true => stated,
        false => stated * placement.inverse(),
    })
}

/// The frame of a model that its `<pose>` places, in the frame of the model.
fn placement_frame(model: Node, depth: usize, reader: &mut Reader) -> Option<Isometry3<f64>> {
    if model.tag_name().name() == "model" {
        return match model.attribute("placement_frame").map(str::trim) {
            Some(name) => named(model, name, model, depth + 1, reader),
            None => Some(Isometry3::identity()),
        };
    }
    let element = xml::child(model, "placement_frame").filter(|name| !xml::text(*name).is_empty());
    let (Some(element), Some(included)) = (element, included(model, reader)) else {
        return Some(
            included(model, reader).map_or_else(Isometry3::identity, |included| included.placement),
        );
    };
    let name = xml::text(element);
    let Some(frame) = included.frames.get(name) else {
        let known: Vec<&str> = included.frames.keys().map(String::as_str).collect();
        let help = did_you_mean(name, known);
        let message = format!("the included model has no frame `{name}`");
        reader.error("W035", element, message, help);
        return None;
    };
    let pose = frame.pose;
    reader.required(model, "pose")?;
    Some(pose)
}

/// The name of the frame to which a `<pose>` is relative, if it names one.
fn relative_to(element: Node<'_>) -> Option<&str> {
    element
        .attribute("relative_to")
        .or_else(|| element.attribute("frame"))
        .filter(|name| !name.is_empty())
}

/// The name of the frame to which the pose of an element is relative if it names none; `None` for
/// that of the model.
fn usual_frame(node: Node<'_>) -> Option<&str> {
    match node.tag_name().name() {
        "joint" => xml::child(node, "child").map(xml::text),
        "frame" => node.attribute("attached_to"),
        "link" | "model" | "include" => None,
        _ => node
            .ancestors()
            .find(|above| above.tag_name().name() == "link")?
            .attribute("name"),
    }
}

/// The model, or the world, whose frames an element may name.
fn scope(node: Node) -> Node {
    let is_scope = |above: &Node| ["model", "world"].contains(&above.tag_name().name());
    node.ancestors().skip(1).find(is_scope).unwrap_or(node)
}

fn is_model(node: Node) -> bool {
    ["model", "include"].contains(&node.tag_name().name())
}

fn included<'r>(node: Node, reader: &'r Reader) -> Option<&'r Included> {
    reader
        .included
        .get(&node.range().start)
        .filter(|_| node.tag_name().name() == "include")
}

/// The name of an element, or else that of the model that it includes.
pub(super) fn name_of(node: Node, reader: &Reader) -> Option<String> {
    node.attribute("name")
        .or_else(|| xml::child(node, "name").map(xml::text))
        .map(str::to_owned)
        .or_else(|| included(node, reader).map(|included| included.name.clone()))
}

/// Whether an element has a name; without a copy of it, because all elements may be searched for all
/// names.
fn has_name(node: Node, name: &str, reader: &Reader) -> bool {
    let own = node
        .attribute("name")
        .or_else(|| Some(xml::text(xml::child(node, "name")?)));
    match own {
        Some(own) => own == name,
        None => included(node, reader).is_some_and(|included| included.name == name),
    }
}

fn with_frame<'a>(model: Node<'a>) -> impl Iterator<Item = Node<'a>> {
    model
        .children()
        .filter(|child| WITH_FRAME.contains(&child.tag_name().name()))
}

/// Returns the child of a model that has a name, or whose model has the first part of it, and the
/// rest of the name.
fn find<'a, 'n>(
    model: Node<'a>,
    name: &'n str,
    reader: &Reader,
) -> Option<(Node<'a>, Option<&'n str>)> {
    let is_named = |child: &Node<'a>, name: &str| has_name(*child, name, reader);
    if let Some(child) = with_frame(model).find(|child| is_named(child, name)) {
        return Some((child, None));
    }
    if let Some((first, rest)) = name.split_once("::") {
        let nested = with_frame(model).find(|child| is_model(*child) && is_named(child, first));
        if let Some(nested) = nested {
            return Some((nested, Some(rest)));
        }
    }
    let merged = |child: &Node<'a>| {
        included(*child, reader)
            .is_some_and(|included| included.merged && included.frames.contains_key(name))
    };
    with_frame(model)
        .find(merged)
        .map(|include| (include, Some(name)))
}

/// Returns a frame of a model, in the frame of the model. `at`: the element that names it.
fn named(
    model: Node,
    name: &str,
    at: Node,
    depth: usize,
    reader: &mut Reader,
) -> Option<Isometry3<f64>> {
    if depth > LONGEST {
        let message = format!("the frame `{name}` is relative to itself");
        reader.error(
            "W035",
            at,
            message,
            "make it relative to another frame, or write the pose in that of the parent",
        );
        return None;
    }
    if [OWN, "world", ""].contains(&name) {
        return Some(Isometry3::identity());
    }
    match find(model, name, reader) {
        Some((child, None)) => return in_model(child, depth, reader),
        Some((nested, Some(rest))) if nested.tag_name().name() == "model" => {
            return Some(
                in_model(nested, depth, reader)? * named(nested, rest, at, depth + 1, reader)?,
            );
        }
        Some((include, Some(rest))) => match included(include, reader) {
            Some(included) => {
                if let Some(inner) = included.frames.get(rest) {
                    let inner = inner.pose;
                    return Some(in_model(include, depth, reader)? * inner);
                }
            }
            // Its fault is reported already.
            None => return None,
        },
        None => {}
    }
    let known: Vec<String> = with_frame(model)
        .filter_map(|child| name_of(child, reader))
        .collect();
    let help = did_you_mean(name, known.iter().map(String::as_str));
    let message = format!("the {} has no frame `{name}`", model.tag_name().name());
    reader.error("W035", at, message, help);
    None
}

/// Returns the name of the link that carries a frame of a model.
fn link_of(model: Node, name: &str, depth: usize, reader: &Reader) -> Option<String> {
    if depth > LONGEST {
        return None;
    }
    if [OWN, ""].contains(&name) {
        return canonical_link(model, depth + 1, reader);
    }
    let (child, rest) = find(model, name, reader)?;
    match (child.tag_name().name(), rest) {
        ("link", _) => Some(name.to_owned()),
        ("joint", _) => link_of(
            model,
            xml::child(child, "child").map(xml::text)?,
            depth + 1,
            reader,
        ),
        ("frame", _) => link_of(
            model,
            child.attribute("attached_to").unwrap_or_default(),
            depth + 1,
            reader,
        ),
        (_, rest) => link_in(child, rest.unwrap_or(OWN), depth, reader),
    }
}

/// Returns the name of the link that carries a frame of a nested or included model, as the model
/// around it names this link.
fn link_in(model: Node, frame: &str, depth: usize, reader: &Reader) -> Option<String> {
    let link = match included(model, reader) {
        Some(included) => included.frames.get(frame)?.link.clone()?,
        None if model.tag_name().name() == "model" => link_of(model, frame, depth + 1, reader)?,
        None => return None,
    };
    Some(format!("{}{link}", prefix(model, reader)))
}

/// Returns the name of a model's canonical link: the one that it names, or its first.
fn canonical_link(model: Node, depth: usize, reader: &Reader) -> Option<String> {
    if let Some(name) = model
        .attribute("canonical_link")
        .filter(|name| !name.is_empty())
    {
        return link_of(model, name, depth + 1, reader);
    }
    let own = xml::child(model, "link").and_then(|link| link.attribute("name"));
    // Not by their names: a nested model may have that of this one, or none.
    own.map(str::to_owned).or_else(|| {
        with_frame(model)
            .filter(|child| is_model(*child))
            .find_map(|child| link_in(child, OWN, depth, reader))
    })
}

/// The numbers of a `<pose>`.
fn written(element: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let text = xml::text(element);
    if text.is_empty() {
        return Some(Isometry3::identity());
    }
    if element.attribute("rotation_format") == Some("quat_xyzw") {
        let [x, y, z, qx, qy, qz, qw] = reader.numbers(element, text, Bound::Finite)?;
        let turned = xml::turned([x, y, z], [qx, qy, qz, qw]);
        if turned.is_none() {
            let message = "the quaternion of a `<pose>` must not be zero".to_owned();
            let help = "write `0 0 0 1` for a pose without rotation";
            reader.error("W034", element, message, help);
        }
        return turned;
    }
    let [x, y, z, roll, pitch, yaw] = reader.numbers(element, text, Bound::Finite)?;
    let unit = if reader.boolean_attribute(element, "degrees")? {
        1f64.to_radians()
    } else {
        1.0
    };
    Some(xml::placed(
        [x, y, z],
        [roll * unit, pitch * unit, yaw * unit],
    ))
}
