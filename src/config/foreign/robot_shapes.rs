//! Collision shapes of grippers whose links have only shapes to be seen.

use crate::foreign::robot_text::Edit;
use crate::foreign::xml::{self, Node, Reader};

/// Words in the names of a gripper's links and of the joints that move them.
const WORDS: [&str; 6] = ["finger", "grip", "jaw", "knuckle", "hand", "claw"];

/// A change of the collision shapes of a gripper's link.
pub(crate) struct Change<'n> {
    /// The shape to be seen that becomes a collision shape; `None` for a collision shape that is
    /// removed.
    pub(crate) seen: Option<Node<'n>>,
    pub(crate) edit: Edit,
}

/// Gives the links of a gripper the shapes to be seen, if none of its moving links has a collision
/// shape. That of the hand is replaced too, because it may include the fingers and fill the gap
/// between them. Reports each such link (W036).
pub(crate) fn of_gripper<'n>(root: Node<'n>, reader: &mut Reader) -> Vec<Change<'n>> {
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
        let Some(name) = named(link, "name").filter(|name| links.contains(name)) else {
            continue;
        };
        let seen: Vec<Node> = xml::children(link, "visual").collect();
        if seen.is_empty() {
            continue;
        }
        let (message, help) = match collides(&name) {
            true => (
                format!(
                    "the fingers on the link `{name}` have no `<collision>`: its `<visual>` is used like theirs"
                ),
                "give the fingers a `<collision>`, and the hand one that does not include them",
            ),
            false => (
                format!(
                    "the link `{name}` of the gripper has no `<collision>`: its `<visual>` is used instead"
                ),
                "give it a `<collision>` if it has to have another shape",
            ),
        };
        reader.warning("W036", link, message, help);
        for collision in xml::children(link, "collision") {
            found.push(Change {
                seen: None,
                edit: Edit {
                    span: collision.range(),
                    text: String::new(),
                },
            });
        }
        for shape in seen {
            let part = |name: &str| {
                let node = xml::child(shape, name);
                node.map(|node| &root.document().input_text()[node.range()])
                    .unwrap_or_default()
                    .to_owned()
            };
            let text = format!(
                "<collision>{}{}</collision>",
                part("origin"),
                part("geometry")
            );
            let end = shape.range().end;
            found.push(Change {
                seen: Some(shape),
                edit: Edit {
                    span: end..end,
                    text,
                },
            });
        }
    }
    found
}
