//! Changes of a URDF's text before the robot is built from it.

use actcheck_base::Span;

use crate::foreign::xml::{self, Node, Reader};

/// A part of the text of a URDF, and the text that replaces it.
pub(crate) struct Edit {
    /// Empty for a text that is inserted.
    pub(crate) span: Span,
    pub(crate) text: String,
}

/// Returns the text of a URDF with these changes, none of which overlap.
pub(crate) fn with(text: &str, mut edits: Vec<Edit>) -> String {
    // From the last place to the first, so that the others stay valid.
    edits.sort_by_key(|edit| std::cmp::Reverse(edit.span.start));
    let mut text = text.to_owned();
    for edit in edits {
        text.replace_range(edit.span, &edit.text);
    }
    text
}

/// Returns the removals of colours that are not four numbers, which the library for URDFs refuses. Reports each (W036).
pub(crate) fn wrong_colours(root: Node, reader: &mut Reader) -> Vec<Edit> {
    let colours = root.descendants().filter(|node| {
        let is_of_material = node.parent_element().is_some_and(|parent| parent.tag_name().name() == "material");
        node.is_element() && node.tag_name().name() == "color" && is_of_material
    });
    let mut edits = Vec::new();
    for colour in colours {
        let numbers = colour.attribute("rgba").unwrap_or_default();
        let words = numbers.split_whitespace();
        if words.clone().count() == 4 && words.clone().all(|word| word.parse::<f64>().is_ok()) {
            continue;
        }
        let message = format!("`<color>` is ignored: `rgba` must be four numbers, but is `{}`", xml::short(numbers));
        reader.warning("W036", colour, message, "colours have no effect on the simulation");
        edits.push(Edit { span: colour.range(), text: String::new() });
    }
    edits
}
