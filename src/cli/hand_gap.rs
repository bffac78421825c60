//! The gap in a proposed profile of a robot whose gripper was not found: the keys to fill in, and
//! the joints and links that were seen.

use std::fmt::Write as _;

use crate::new_robot::numbers;
use actcheck_base::{Diagnostic, Source};
use actcheck_campaign::{FingerJoint, UnknownHand};
use actcheck_config::quoted;

/// Most joints that are listed.
const MOST_JOINTS: usize = 60;
/// The two lines that are to be filled in.
const JOINTS: &str = "finger_joints = []";
const LINKS: &str = "finger_links = []";

/// The part of the profile: each line to fill in after a comment about its meaning.
pub(super) fn text(hand: &UnknownHand) -> String {
    let palm = one_line(&hand.grasp.link);
    let mut text = format!(
        "\n# GAP: {}.\n# Fill in the two empty lists. For a suction cup, replace them by `suction_force_n`, `suction_radius_m` and \
         `grasp_link`.\n",
        one_line(&hand.fault.to_string())
    );
    match hand.joints.as_slice() {
        [] => {
            let _ = writeln!(
                text,
                "# No joint moves anything beyond the end of the arm, `{palm}`: name a file with a gripper in `urdf` first."
            );
        }
        joints => {
            let _ = writeln!(
                text,
                "# Candidates: the movable joints beyond the end of the arm, `{palm}`, with the links that they move."
            );
            for joint in joints.iter().take(MOST_JOINTS) {
                let _ = writeln!(text, "#   {}", candidate(joint));
            }
            if joints.len() > MOST_JOINTS {
                let _ = writeln!(text, "#   … and {} more", joints.len() - MOST_JOINTS);
            }
        }
    }
    let _ = write!(
        text,
        "# finger_joints: those with motors that close the fingers, left then right, or one for both; then those of further \
         fingers.\n{JOINTS}\n\
         # finger_links: the links of the two fingertips that hold an object between them, left then right; one may be \
         fixed.\n{LINKS}\n\
         # grasp_link: a link that the fingers don't move; moved and turned by the next two lines, its frame is between the \
         fingertips,\n# with x along the fingers and y from the right to the left one. Without these lines, the place is \
         found.\n\
         # grasp_link = {}\n# grasp_offset_m = {}\n# grasp_turned_rad = {}\n\
         # max_opening_m: the widest gap between the fingertips, in metres. Without this line, it is measured.\n\
         # max_opening_m = 0.08\n",
        quoted(&palm),
        numbers(&hand.grasp.offset_m),
        numbers(&hand.grasp.turned_rad),
    );
    text
}

/// A joint, its link, and its use in a profile.
fn candidate(joint: &FingerJoint) -> String {
    let name = one_line(&joint.name);
    let link = one_line(&joint.link);
    let [lower, upper] = joint.limits.map(|limit| (limit * 1e3).round() / 1e3);
    let (moves, unit) = match joint.turns {
        true => ("turns", "rad"),
        false => ("slides", "m"),
    };
    let mut line = format!("joint `{name}` {moves} `{link}` from {lower} to {upper} {unit}");
    if joint.is_last {
        line.push_str("; the last link of its finger");
    }
    if !joint.has_shapes {
        line.push_str("; no collision shapes");
    }
    if let Some(leader) = &joint.follows {
        let _ = write!(
            line,
            "; follows `{}`, to be named instead",
            one_line(leader)
        );
    }
    line
}

/// A name of a foreign file as part of a comment: without control characters, which would end it.
fn one_line(text: &str) -> String {
    text.split(char::is_control).collect::<Vec<_>>().join(" ")
}

/// The error about a written profile with a gap.
pub(super) fn fault(hand: &UnknownHand, profile: &Source) -> Diagnostic {
    let message = format!("{}: the profile has a gap for it", hand.fault);
    let line = format!("\n{JOINTS}\n");
    let at = profile.text.find(&line).map_or(0, |before| before + 1);
    Diagnostic::error("W024", message)
        .at(profile, at..at + JOINTS.len())
        .help(
            "fill in `finger_joints` and `finger_links`: the comments above list the candidates; `actcheck check` and \
             `run` report the gap until then",
        )
}
