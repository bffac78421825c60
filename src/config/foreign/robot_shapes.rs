//! Collision shapes of grippers whose links have only shapes to be seen.

use crate::foreign::xml::{self, Node, Reader};

/// Words in the names of a gripper's links and of the joints that move them.
const WORDS: [&str; 6] = ["finger", "grip", "jaw", "knuckle", "hand", "claw"];

/// A collision shape to be inserted into the text of a URDF.
pub(crate) struct Added {
    /// Byte offset in the text.
    at: usize,
    text: String,
}

/// A shape to be seen that a link of the gripper collides with.
pub(crate) struct Visual<'n> {
    pub(crate) shape: Node<'n>,
    pub(crate) added: Added,
}

/// Returns the shapes to be seen of the gripper's links, if none of its moving links has a collision shape. Reports each
/// such link (W036).
pub(crate) fn of_gripper<'n>(root: Node<'n>, reader: &mut Reader) -> Vec<Visual<'n>> {
    let has_word = |name: &str| WORDS.iter().any(|word| name.to_lowercase().contains(word));
    let named = |node: Node, key: &str| node.attribute(key).map(str::to_owned);
    let (mut moved, mut links) = (Vec::new(), Vec::new());
    for joint in xml::children(root, "joint") {
        let child = xml::child(joint, "child").and_then(|child| named(child, "link"));
        let moves = !matches!(joint.attribute("type"), None | Some("fixed"));
        if let (true, Some(name), Some(child)) = (moves, joint.attribute("name"), child)
            && (has_word(name) || has_word(&child))
        {
            let parent = xml::child(joint, "parent").and_then(|parent| named(parent, "link"));
            links.extend(parent.filter(|parent| has_word(parent)));
            moved.push(child);
        }
    }
    let collides = |name: &String| {
        let link = xml::children(root, "link").find(|link| link.attribute("name") == Some(name));
        link.is_some_and(|link| xml::child(link, "collision").is_some())
    };
    if moved.iter().any(collides) {
        return Vec::new();
    }
    links.extend(moved);
    let mut found = Vec::new();
    for link in xml::children(root, "link") {
        let Some(name) = named(link, "name").filter(|name| links.contains(name) && !collides(name)) else { continue };
        let seen: Vec<Node> = xml::children(link, "visual").collect();
        if seen.is_empty() {
            continue;
        }
        let message = format!("the link `{name}` of the gripper has no `<collision>`: its `<visual>` is used instead");
        reader.warning("W036", link, message, "give it a `<collision>` if it has to have another shape");
        for shape in seen {
            let part = |name: &str| {
                let node = xml::child(shape, name);
                node.map(|node| &root.document().input_text()[node.range()]).unwrap_or_default().to_owned()
            };
            let text = format!("<collision>{}{}</collision>", part("origin"), part("geometry"));
            found.push(Visual { shape, added: Added { at: shape.range().end, text } });
        }
    }
    found
}

/// Returns the text of a URDF with these shapes.
pub(crate) fn with(text: &str, mut added: Vec<Added>) -> String {
    added.sort_by_key(|shape| std::cmp::Reverse(shape.at));
    let mut text = text.to_owned();
    for shape in added {
        text.insert_str(shape.at, &shape.text);
    }
    text
}
