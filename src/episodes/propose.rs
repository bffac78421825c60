//! Drafts a mapping from the names, shapes and contacts of an episode.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::Vector3;

use crate::mapping::id_of;
use crate::{Episode, JointKind, Model};

/// Words in the names of sites and bodies that are between the fingertips, the best one first.
const HANDS: [&str; 6] = ["grip_site", "grip", "pinch", "tcp", "eef", "hand"];

/// Returns the text of a mapping for an episode. A comment at each line says why it was guessed.
pub fn propose(episode: &Episode) -> String {
    let model = &episode.model;
    let robot = robot(model);
    let fingers = fingers(model, &robot);
    let object = object(episode, &fingers);
    let surface = object.and_then(|object| surface(episode, object));
    let environment = episode.about.get("environment").map_or("", String::as_str);
    let mut text = String::new();
    let mut line = |written: String| {
        // Writing to a string can't fail.
        let _ = writeln!(text, "{written}");
    };
    line("# A draft: check each line. Names are patterns, in which `*` is any text.".to_owned());
    line(format!("environments = [{environment:?}]"));
    line(String::new());
    line("[robot]".to_owned());
    line("# The bodies that carry the most joints.".to_owned());
    line(format!(
        "bodies = {}",
        list(robot.iter().map(|body| name(model, *body)))
    ));
    if let Some(base) = robot.first() {
        line(format!("base = {:?}", name(model, *base)));
    }
    match hand(model, &robot) {
        Some((hand, word)) => line(format!(
            "hand = {hand:?}    # the point between the fingertips: its name contains `{word}`"
        )),
        None => line(
            "# hand = \"…\"    # the site or body between the fingertips was not found".to_owned(),
        ),
    }
    for (side, finger) in ["left_finger", "right_finger"].into_iter().zip(&fingers) {
        if finger.is_empty() {
            line(format!(
                "# {side} = \"…\"    # no body of the robot has such a name"
            ));
        } else {
            line(format!(
                "{side} = {}",
                list(finger.iter().map(|body| name(model, *body)))
            ));
        }
    }
    let opening = opening(model, &fingers);
    if opening.is_empty() {
        line("# opening = [\"…\"]    # the joints whose positions add up to the gap between the fingers".to_owned());
    } else {
        line(format!(
            "opening = {}",
            list(opening.iter().map(String::as_str))
        ));
    }
    if let Some(object) = object {
        line(String::new());
        line(format!("[objects.{}]", id(model, object)));
        line("# The fingers touch it longest, or else it moves farthest.".to_owned());
        line(format!("body = {:?}", name(model, object)));
    }
    if let Some(surface) = surface {
        line(String::new());
        line(format!("[objects.{}]", id(model, surface)));
        line("# It carries the object in the first state.".to_owned());
        line(format!("body = {:?}", name(model, surface)));
    }
    line(String::new());
    if episode.marks.is_empty() {
        line("[[actions]]".to_owned());
        line("action = \"Pick\"".to_owned());
        line(
            "from = \"start\"    # or \"grasp\", \"top\", \"release\", a time in seconds"
                .to_owned(),
        );
        line("to = \"end\"".to_owned());
        if let Some(object) = object {
            line(format!("pickObject = {:?}", id(model, object)));
        }
        if let Some(surface) = surface {
            line(format!("objectSurface = {:?}", id(model, surface)));
        }
        let says = episode.states.iter().any(|state| {
            state
                .outcome
                .is_some_and(|outcome| outcome.success.is_some())
        });
        if says {
            line(
                "reported = \"success\"    # the environment's own success is the action's report"
                    .to_owned(),
            );
        }
    } else {
        line(
            "# The recording marks its actions itself: `[[actions]]` would replace them."
                .to_owned(),
        );
    }
    text
}

fn name(model: &Model, body: usize) -> &str {
    &model.bodies[body].name
}

/// A short id for the thing of a body.
fn id(model: &Model, body: usize) -> String {
    let name = name(model, body);
    id_of(name.strip_suffix("_main").unwrap_or(name), body)
}

/// A TOML list of names.
fn list<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let names: Vec<String> = names.map(|name| format!("{name:?}")).collect();
    format!("[{}]", names.join(", "))
}

/// Returns the bodies of the tree below the world that has the most joints with one position.
fn robot(model: &Model) -> Vec<usize> {
    let mut trees: Vec<usize> = Vec::new();
    for (idx, body) in model.bodies.iter().enumerate() {
        trees.push(match body.parent {
            None | Some(0) => idx,
            Some(parent) => trees[parent],
        });
    }
    let mut joints: BTreeMap<usize, usize> = BTreeMap::new();
    for joint in model.joints.iter().filter(|joint| joint.is_scalar()) {
        *joints.entry(trees[joint.body]).or_default() += 1;
    }
    let Some((tree, _)) = joints.into_iter().max_by_key(|(_, count)| *count) else {
        return Vec::new();
    };
    (1..model.bodies.len())
        .filter(|body| trees[*body] == tree)
        .collect()
}

/// Returns the bodies of the left and of the right finger, by their names.
fn fingers(model: &Model, robot: &[usize]) -> [Vec<usize>; 2] {
    let of = |words: [&str; 3]| -> Vec<usize> {
        robot
            .iter()
            .copied()
            .filter(|body| {
                let name = name(model, *body).to_lowercase();
                let is_finger = ["finger", "pad", "tip", "knuckle"]
                    .iter()
                    .any(|word| name.contains(word));
                // A prefix such as `gripper0_right_` is that of the arm.
                let own = name
                    .replace("gripper0_right_", "")
                    .replace("gripper0_left_", "");
                is_finger && words.iter().any(|word| own.contains(word))
            })
            .collect()
    };
    [
        of(["left", "finger1", "joint1"]),
        of(["right", "finger2", "joint2"]),
    ]
}

/// Returns the name of the site or body between the fingertips, with the word that was found in it.
fn hand<'m>(model: &'m Model, robot: &[usize]) -> Option<(&'m str, &'static str)> {
    HANDS.into_iter().find_map(|word| {
        let sites = model
            .sites
            .iter()
            .filter(|site| robot.contains(&site.body))
            .map(|site| site.name.as_str());
        let bodies = robot.iter().map(|body| name(model, *body));
        sites
            .chain(bodies)
            .find(|name| name.to_lowercase().contains(word))
            .map(|name| (name, word))
    })
}

/// Returns the names of the joints that move the fingers along an axis.
fn opening(model: &Model, fingers: &[Vec<usize>; 2]) -> Vec<String> {
    model
        .joints
        .iter()
        .filter(|joint| joint.kind == JointKind::Slide)
        .filter(|joint| fingers.iter().any(|finger| finger.contains(&joint.body)))
        .map(|joint| joint.name.clone())
        .collect()
}

/// Returns the free body that the fingers touch in the most states, or else the one that moves
/// farthest.
fn object(episode: &Episode, fingers: &[Vec<usize>; 2]) -> Option<usize> {
    let free: Vec<usize> = episode
        .model
        .joints
        .iter()
        .filter(|joint| joint.kind == JointKind::Free)
        .map(|joint| joint.body)
        .collect();
    let root = |mut body: usize| {
        while !free.contains(&body) {
            body = episode.model.bodies[body].parent?;
        }
        Some(body)
    };
    let mut touched: BTreeMap<usize, usize> = BTreeMap::new();
    for contact in episode.states.iter().flat_map(|state| &state.contacts) {
        for [one, other] in [contact.bodies, [contact.bodies[1], contact.bodies[0]]] {
            if fingers.iter().any(|finger| finger.contains(&one))
                && let Some(thing) = root(other)
            {
                *touched.entry(thing).or_default() += 1;
            }
        }
    }
    let way = |body: &usize| {
        let at = |state: Option<&crate::State>| {
            state
                .and_then(|state| state.poses.get(*body))
                .map_or(Vector3::zeros(), |pose| Vector3::from(pose.position))
        };
        (at(episode.states.last()) - at(episode.states.first())).norm()
    };
    touched
        .into_iter()
        .max_by_key(|(_, count)| *count)
        .map(|(body, _)| body)
        .or_else(|| {
            free.iter()
                .copied()
                .max_by(|a, b| way(a).total_cmp(&way(b)))
        })
}

/// Returns the body that does not move and carries a body in the first state.
fn surface(episode: &Episode, object: usize) -> Option<usize> {
    let model = &episode.model;
    let is_of_object = |mut body: usize| {
        while body != object {
            match model.bodies[body].parent {
                Some(parent) => body = parent,
                None => return false,
            }
        }
        true
    };
    // Objects of many recordings fall on their places in the first states.
    let states = episode.states.iter().take(30);
    states
        .flat_map(|state| &state.contacts)
        .find_map(|contact| {
            let [one, other] = contact.bodies;
            let carrier = match (is_of_object(one), is_of_object(other)) {
                (true, false) => other,
                (false, true) => one,
                _ => return None,
            };
            (carrier > 0 && !model.bodies[carrier].moves).then_some(carrier)
        })
}
