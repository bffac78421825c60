//! Changes of a URDF's text before the robot is built from it.

use actcheck_base::Span;

use crate::foreign::xml::{self, Node, Reader};

/// A part of the text of a URDF, and the text that replaces it.
pub(crate) struct Edit {
    /// Empty for a text that is inserted.
    pub(crate) span: Span,
    pub(crate) text: String,
}

impl Edit {
    fn removal(node: Node) -> Self {
        Self {
            span: node.range(),
            text: String::new(),
        }
    }
}

/// Returns the text of a URDF with these changes. One inside of another has no effect: both may
/// remove the same element.
pub(crate) fn with(text: &str, mut edits: Vec<Edit>) -> String {
    // A text is inserted before an element that is removed at the same place.
    edits.sort_by_key(|edit| (edit.span.start, edit.span.end));
    let (mut changed, mut done) = (String::with_capacity(text.len()), 0);
    for edit in edits {
        if edit.span.start >= done {
            changed += &text[done..edit.span.start];
            changed += &edit.text;
            done = edit.span.end;
        }
    }
    changed + &text[done..]
}

/// Returns the changes without which the library for URDFs refuses files that other programs load.
pub(crate) fn repairs(root: Node, reader: &mut Reader) -> Vec<Edit> {
    let mut edits = wrong_colours(root, reader);
    edits.extend(nameless_materials(root));
    edits.extend(placeholders(root, reader));
    for joint in xml::children(root, "joint") {
        edits.extend(repeated(joint, reader));
        edits.extend(unlimited(joint));
    }
    edits
}

/// Returns the removals of colours that are not four numbers. Reports each (W036).
fn wrong_colours(root: Node, reader: &mut Reader) -> Vec<Edit> {
    let colours = root.descendants().filter(|node| {
        let parent = node
            .parent_element()
            .filter(|parent| parent.has_tag_name("material"));
        node.has_tag_name("color") && parent.is_some_and(|material| material.has_attribute("name"))
    });
    let mut edits = Vec::new();
    for colour in colours {
        let numbers = colour.attribute("rgba").unwrap_or_default();
        let words = numbers.split_whitespace();
        if words.clone().count() == 4 && words.clone().all(|word| word.parse::<f64>().is_ok()) {
            continue;
        }
        let message = format!(
            "`<color>` is ignored: `rgba` must be four numbers, but is `{}`",
            xml::short(numbers)
        );
        reader.warning(
            "W036",
            colour,
            message,
            "colours have no effect on the simulation",
        );
        edits.push(Edit::removal(colour));
    }
    edits
}

/// Returns the removals of materials without names. They have no effect on the simulation.
fn nameless_materials(root: Node) -> impl Iterator<Item = Edit> {
    root.descendants()
        .filter(|node| node.has_tag_name("material") && !node.has_attribute("name"))
        .map(Edit::removal)
}

/// Returns the shape of a `<collision>` if all its sizes are 0: it is only a placeholder.
pub(crate) fn placeholder<'n>(collision: Node<'n>) -> Option<Node<'n>> {
    let shape = xml::child(collision, "geometry")?.first_element_child()?;
    let keys: &[&str] = match shape.tag_name().name() {
        "box" => &["size"],
        "cylinder" | "capsule" => &["radius", "length"],
        "sphere" => &["radius"],
        _ => return None,
    };
    let is_zero = |key: &&str| {
        let numbers = shape.attribute(*key).unwrap_or_default();
        !numbers.is_empty()
            && numbers
                .split_whitespace()
                .all(|number| number.parse() == Ok(0.0))
    };
    keys.iter().all(is_zero).then_some(shape)
}

/// Returns the removals of collision shapes without a size. Reports each (W036).
fn placeholders(root: Node, reader: &mut Reader) -> Vec<Edit> {
    let mut edits = Vec::new();
    for collision in xml::children(root, "link").flat_map(|link| xml::children(link, "collision")) {
        if let Some(shape) = placeholder(collision) {
            let message = format!(
                "this `<{}>` has no size: it is left out",
                shape.tag_name().name()
            );
            reader.warning(
                "W036",
                shape,
                message,
                "remove its `<collision>`, or write its size in metres",
            );
            edits.push(Edit::removal(collision));
        }
    }
    edits
}

/// Elements of a joint of which there is one.
const SINGLE: [&str; 8] = [
    "origin",
    "parent",
    "child",
    "axis",
    "limit",
    "dynamics",
    "mimic",
    "safety_controller",
];

/// Returns the removals of elements that a joint has already. Reports each (W036).
fn repeated(joint: Node, reader: &mut Reader) -> Vec<Edit> {
    let name = joint.attribute("name").unwrap_or_default();
    let mut edits = Vec::new();
    for key in SINGLE {
        for further in xml::children(joint, key).skip(1) {
            let message =
                format!("the joint `{name}` has more than one `<{key}>`: the first counts");
            reader.warning("W036", further, message, "remove the others");
            edits.push(Edit::removal(further));
        }
    }
    edits
}

/// Returns the changes of a joint's limits of -1 to 0, which means here that they are unknown.
fn unlimited(joint: Node) -> impl Iterator<Item = Edit> {
    let limits = xml::child(joint, "limit")
        .into_iter()
        .flat_map(|limit| limit.attributes());
    let unlimited = limits.filter(|limit| {
        matches!(limit.name(), "effort" | "velocity") && is_unlimited(limit.value())
    });
    unlimited.map(|limit| Edit {
        span: limit.range_value(),
        text: "0".to_owned(),
    })
}

/// Whether an effort or a velocity is written as -1, which means no limit, as in SDF.
pub(crate) fn is_unlimited(written: &str) -> bool {
    written.trim().parse() == Ok(-1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_inside_of_others_have_no_effect() {
        let edit = |span: Span, text: &str| Edit {
            span,
            text: text.to_owned(),
        };
        let removed = || edit(2..6, "");
        assert_eq!(
            with(
                "ab1234cd",
                vec![edit(3..5, "x"), removed(), removed(), edit(6..6, "+")]
            ),
            "ab+cd"
        );
        assert_eq!(with("ab1234cd", vec![removed(), edit(2..2, "-")]), "ab-cd");
        assert_eq!(
            with("abcd", vec![edit(4..4, "e"), edit(0..1, "A")]),
            "Abcde"
        );
    }
}
