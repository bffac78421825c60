//! The hands of a robot: joints with a gripper's name, and short chains that branch off at the end
//! of an arm.

use std::collections::{BTreeMap, BTreeSet};

use super::body::chain;
use super::fingers::leader;
use crate::description::{Joint, RobotModel};

/// Words in the names of a gripper's joints and links.
const WORDS: [&str; 12] = [
    "finger", "fngr", "grip", "jaw", "knuckle", "hand", "thumb", "claw", "driver", "distal",
    "proximal", "pad",
];
/// Fewest joints before a link whose branches may be fingers without such names, and most joints of
/// such a finger.
const FEWEST_BEFORE_BRANCHES: usize = 3;
const LONGEST_FINGER: usize = 4;

/// Joints with a gripper's name, by the link that carries them.
pub(super) fn groups(model: &RobotModel) -> BTreeMap<usize, BTreeSet<usize>> {
    let has_word = |name: &str| WORDS.iter().any(|word| name.to_lowercase().contains(word));
    let has_either =
        |idx: usize| has_word(&model.joints[idx].name) || has_word(&model.links[idx + 1].name);
    // A link with such a name that carries others is a palm, unless its joint has such a name too.
    let carries = |idx: usize| {
        (0..model.joints.len()).any(|other| {
            other != idx && has_either(other) && chain(model, other + 1).contains(&idx)
        })
    };
    // A joint of a mechanism does not belong to the arm.
    let is_coupled = |idx: usize| {
        let follows = |joint: &Joint| joint.mimic.is_some_and(|(leader, ..)| leader == idx);
        model.joints[idx].mimic.is_some() || model.joints.iter().any(follows)
    };
    let is_named = |idx: usize| {
        has_word(&model.joints[idx].name) || has_either(idx) && (is_coupled(idx) || !carries(idx))
    };
    // A mechanism that a gripper's motor moves belongs to the gripper, whatever its name.
    let with_name: BTreeSet<usize> = (0..model.joints.len())
        .filter(|idx| is_named(*idx))
        .collect();
    let leads_named: BTreeSet<usize> = with_name
        .iter()
        .filter(|idx| is_coupled(**idx))
        .map(|idx| leader(model, *idx))
        .collect();
    let named = |idx: usize| with_name.contains(&idx) || leads_named.contains(&leader(model, idx));
    let mut groups: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for idx in (0..model.joints.len()).filter(|idx| named(*idx)) {
        let path = chain(model, idx + 1);
        let top = path
            .iter()
            .copied()
            .find(|joint| named(*joint))
            .unwrap_or(idx);
        groups
            .entry(model.joints[top].parent)
            .or_default()
            .insert(idx);
    }
    let mut hands: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for (mut palm, mut joints) in groups {
        while let Some(wrist) = wrist(model, &joints).filter(|wrist| !is_coupled(*wrist)) {
            joints.remove(&wrist);
            palm = wrist + 1;
        }
        hands.entry(palm).or_default().extend(joints);
    }
    let known: BTreeSet<usize> = hands.values().flatten().copied().collect();
    let nameless =
        (1..model.links.len()).filter_map(|palm| Some((palm, short_branches(model, palm)?)));
    hands.extend(
        nameless
            .filter(|(_, joints)| joints.is_disjoint(&known))
            .collect::<Vec<_>>(),
    );
    hands
}

/// The joints beyond a link at the end of an arm on which several short chains branch off, as
/// fingers do, whatever their names. Returns `None` if the link has others.
fn short_branches(model: &RobotModel, palm: usize) -> Option<BTreeSet<usize>> {
    let n_inner = chain(model, palm).len();
    if n_inner < FEWEST_BEFORE_BRANCHES {
        return None;
    }
    let chains = (0..model.joints.len()).map(|joint| chain(model, joint + 1));
    let beyond: Vec<Vec<usize>> = chains
        .filter(|path| {
            path.get(n_inner)
                .is_some_and(|first| model.joints[*first].parent == palm)
        })
        .collect();
    let branches: BTreeSet<usize> = beyond.iter().map(|path| path[n_inner]).collect();
    let are_short = beyond
        .iter()
        .all(|path| path.len() - n_inner <= LONGEST_FINGER);
    (branches.len() >= 2 && are_short).then(|| {
        beyond
            .iter()
            .filter_map(|path| path.last().copied())
            .collect()
    })
}

/// The joint of a group that carries all others, if these are on several branches: a wrist that is
/// named after the gripper on it, rather than a finger.
fn wrist(model: &RobotModel, joints: &BTreeSet<usize>) -> Option<usize> {
    joints.iter().copied().find(|wrist| {
        let others: Vec<usize> = joints
            .iter()
            .copied()
            .filter(|joint| joint != wrist)
            .collect();
        let is_beyond = |joint: usize, from: usize| chain(model, joint + 1).contains(&from);
        let branch_off = |joint: &usize| {
            others
                .iter()
                .any(|other| !is_beyond(*other, *joint) && !is_beyond(*joint, *other))
        };
        others.iter().all(|joint| is_beyond(*joint, *wrist)) && others.iter().any(branch_off)
    })
}
