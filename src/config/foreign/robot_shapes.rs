//! Collision shapes of grippers whose links have only shapes to be seen.

use std::collections::BTreeMap;

use crate::foreign::words::{Words, words_at};
use crate::foreign::xml;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::{ModelTree, TreeMotion};

/// Words in the names of a gripper's links and of the joints that move them.
const WORDS: [&str; 6] = ["finger", "grip", "jaw", "knuckle", "hand", "claw"];

/// Gives the links of a gripper the shapes to be seen, if none of its moving links has a collision
/// shape. That of the hand is replaced too, because it may include the fingers and fill the gap
/// between them. Reports each such link (W036), and the faults of these shapes.
pub(crate) fn complete_gripper(
    tree: &mut ModelTree,
    faults_of_visuals: &mut BTreeMap<String, Diagnostics>,
    found: &mut Diagnostics,
) {
    let has_word = |name: &str| WORDS.iter().any(|word| name.to_lowercase().contains(word));
    let (mut moved, mut links) = (Vec::new(), Vec::new());
    for joint in &tree.joints {
        let moves = joint.motion != TreeMotion::Fixed;
        if moves && (has_word(&joint.name) || has_word(&joint.child)) {
            links.extend(Some(joint.parent.clone()).filter(|parent| has_word(parent)));
            moved.push(joint.child.clone());
        }
    }
    let collides = |name: &String| tree.link(name).is_some_and(|link| !link.solids.is_empty());
    if moved.iter().any(collides) {
        return;
    }
    links.extend(moved);
    for link in &mut tree.links {
        let has_seen = !link.visuals.is_empty() || faults_of_visuals.contains_key(&link.name);
        if !has_seen || !links.contains(&link.name) {
            continue;
        }
        let name = &link.name;
        let Words { solid, visual, .. } = words_at(&link.place);
        let (message, help) = if link.solids.is_empty() {
            (
                format!(
                    "the link `{name}` of the gripper has no {solid}: each {visual} is used instead"
                ),
                format!("give it a {solid} if it has to have another shape"),
            )
        } else {
            (
                format!(
                    "the fingers on the link `{name}` have no {solid}: each {visual} of the link is used like theirs"
                ),
                format!("give the fingers a {solid}, and the hand one that does not include them"),
            )
        };
        found.push(
            Diagnostic::warning("W036", message)
                .at(&link.place.source, xml::tag(&link.place))
                .help(help),
        );
        if let Some(faults) = faults_of_visuals.remove(name) {
            found.extend(faults);
        }
        link.solids.clone_from(&link.visuals);
    }
}
