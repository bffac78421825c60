//! Poses in SDF, which may be relative to any frame of their model: a link, joint, nested model or
//! `<frame>`.

use nalgebra::Isometry3;

use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::did_you_mean;

/// Longest chain of frames, each relative to the next: longer ones are circles.
const LONGEST: usize = 64;
/// The elements that have a frame of their own.
const WITH_FRAME: [&str; 5] = ["link", "joint", "frame", "model", "include"];

/// Reads the pose of an element; the identity if it has none. It is in the frame in which SDF reads
/// a pose that names none: that of the parent element or, for a joint, that of its child link.
///
/// Returns `None` after it has reported a fault: W034, W035.
pub(crate) fn pose(node: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
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

/// Returns a frame of the model that contains an element, in the frame of that model. Reports W035,
/// and returns `None`, if there is no such frame.
pub(crate) fn frame(node: Node, name: &str, reader: &mut Reader) -> Option<Isometry3<f64>> {
    named(scope(node), name, node, 0, reader)
}

/// Reads the pose of an element in the frame of its model.
fn in_model(node: Node, depth: usize, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let element = xml::child(node, "pose");
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

fn name_of(node: Node<'_>) -> Option<&str> {
    node.attribute("name")
        .or_else(|| xml::child(node, "name").map(xml::text))
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
    if ["__model__", "world", ""].contains(&name) {
        return Some(Isometry3::identity());
    }
    let frames = || {
        model
            .children()
            .filter(|child| WITH_FRAME.contains(&child.tag_name().name()))
    };
    if let Some(child) = frames().find(|child| name_of(*child) == Some(name)) {
        return in_model(child, depth, reader);
    }
    if let Some((first, rest)) = name.split_once("::")
        && let Some(nested) = frames()
            .find(|child| name_of(*child) == Some(first) && child.tag_name().name() == "model")
    {
        return Some(
            in_model(nested, depth, reader)? * named(nested, rest, at, depth + 1, reader)?,
        );
    }
    let known: Vec<&str> = frames().filter_map(name_of).collect();
    reader.error(
        "W035",
        at,
        format!("there is no frame `{name}`"),
        did_you_mean(name, known),
    );
    None
}

/// The numbers of a `<pose>`.
fn written(element: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let text = xml::text(element);
    if text.is_empty() {
        return Some(Isometry3::identity());
    }
    if element.attribute("rotation_format") == Some("quat_xyzw") {
        let [x, y, z, qx, qy, qz, qw] = reader.numbers(element, text, Bound::Finite)?;
        return xml::turned([x, y, z], [qx, qy, qz, qw]);
    }
    let [x, y, z, roll, pitch, yaw] = reader.numbers(element, text, Bound::Finite)?;
    let unit = if element.attribute("degrees") == Some("true") {
        1f64.to_radians()
    } else {
        1.0
    };
    Some(xml::placed(
        [x, y, z],
        [roll * unit, pitch * unit, yaw * unit],
    ))
}
