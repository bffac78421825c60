//! The gripper: which joints move it, which links are its fingertips, and where an object is
//! between them.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::between::{Between, CENTRED_AT_M, driven};
use super::body::chain;
use super::cup;
use super::frames::{LEAST_CHANGE_M, behind, frames};
use super::hands::groups;
use super::row::{across, amid, beside};
use super::stated::{NoHand, Stated};
use super::weights::{innermost, powered, tips};
use crate::description::{JointKind, RobotModel};
use crate::gripper::Probe;
use crate::{Gripper, GripperFault};
use actcheck_data::RobotProfile;

/// Most pairs of fingers that are measured.
const MOST_PAIRS: usize = 40;
/// Fewest joints that carry a hand of an arm.
const FEWEST_ARM_JOINTS: usize = 4;
/// Weight of fingers that point back to the palm: the joints of some fingers are at their tips.
const BACKWARDS: f64 = 0.2;
/// Openings wider than this are worth no more. Unit: metres.
const WIDE_M: f64 = 0.12;

/// A gripper, as a profile without other roles.
pub(super) struct ProposedHand {
    pub(super) profile: RobotProfile,
    /// The link that carries the fingers.
    pub(super) palm: usize,
    pub(super) notes: BTreeMap<&'static str, String>,
    /// Names of the links that carry other hands.
    pub(super) others: Vec<String>,
    /// How good it is, to compare hands of the same robot; 0 if the profile names its parts.
    pub(super) score: f64,
}

/// Finds the best gripper, and keeps the parts that the profile names. Of several hands, only those
/// with `wanted` in a name of theirs or of their arm count.
///
/// # Errors
/// [`NoHand`] if there is none.
pub(super) fn find(
    partial: &RobotProfile,
    model: &RobotModel,
    wanted: Option<&str>,
) -> Result<ProposedHand, NoHand> {
    let stated = Stated::of(partial, model)?;
    if let (Some(_), Some((palm, _))) = (partial.suction, stated.grasp) {
        return Ok(ProposedHand {
            profile: partial.clone(),
            palm,
            notes: BTreeMap::new(),
            others: Vec::new(),
            score: 0.0,
        });
    }
    if let (Some(links), [_, ..], Some(grasp)) =
        (stated.links, stated.joints.as_slice(), stated.grasp)
    {
        let mut profile = partial.clone();
        if profile.max_opening_m == 0.0 {
            profile.max_opening_m =
                as_opening(Gripper::find(partial, model, links, grasp)?.widest_m());
        }
        return Ok(ProposedHand {
            profile,
            palm: grasp.0,
            notes: BTreeMap::new(),
            others: Vec::new(),
            score: 0.0,
        });
    }
    let groups = stated.groups(model).unwrap_or_else(|| groups(model));
    if groups.is_empty() {
        if let Some(hand) = cup::find(partial, model, wanted) {
            return Ok(hand);
        }
        if let (Some(wanted), Some(other)) = (wanted, cup::find(partial, model, None)) {
            let there = &model.links[other.palm].name;
            return Err(NoHand::Gripper(GripperFault::UnknownHand {
                wanted: wanted.to_owned(),
                cup: there.clone(),
            }));
        }
        return Err(NoHand::Gripper(GripperFault::NoNames));
    }
    let mut rated: Vec<(usize, usize, &BTreeSet<usize>)> = groups
        .iter()
        .map(|(palm, joints)| (rank(model, *palm), *palm, joints))
        .collect();
    if let Some(wanted) = wanted {
        let hands = rated
            .iter()
            .map(|(_, palm, _)| model.links[*palm].name.clone());
        let unknown = NoHand::Gripper(GripperFault::UnknownHandOf {
            wanted: wanted.to_owned(),
            hands: hands.collect(),
        });
        let chosen: Vec<_> = rated
            .iter()
            .copied()
            .filter(|(_, palm, _)| is_called(model, *palm, wanted))
            .collect();
        if chosen.is_empty() {
            return Err(unknown);
        }
        rated = chosen;
    }
    rated.retain(|(_, palm, _)| stated.grasp.is_none_or(|(link, _)| link == *palm));
    rated.sort_by_key(|(rank, palm, _)| (std::cmp::Reverse(*rank), *palm));
    // The meshes are in the model already.
    let light = RobotProfile {
        meshes: BTreeMap::new(),
        ..partial.clone()
    };
    let best = rated
        .iter()
        .find_map(|(_, palm, joints)| measure(&light, model, &stated, *palm, joints));
    let others_than = |own: usize| {
        // A link on the way to this hand is a wrist that is named after it.
        let inner = chain(model, own);
        let is_elsewhere = |palm: &&usize| {
            **palm != own && palm.checked_sub(1).is_none_or(|idx| !inner.contains(&idx))
        };
        let others = groups
            .keys()
            .filter(is_elsewhere)
            .filter(|palm| chain(model, **palm).len() >= FEWEST_ARM_JOINTS);
        others.map(|palm| model.links[*palm].name.clone()).collect()
    };
    let best = best.map(|hand| ProposedHand {
        profile: RobotProfile {
            meshes: partial.meshes.clone(),
            ..hand.profile
        },
        others: others_than(hand.palm),
        ..hand
    });
    best.ok_or_else(|| NoHand::Gripper(why_none(model, &rated)))
}

/// Whether a name of a hand or of the arm that carries it contains a text; for `left` and `right`,
/// also the abbreviation of one letter. Fingers don't count: each hand has a left one.
pub(super) fn is_called(model: &RobotModel, palm: usize, text: &str) -> bool {
    let text = text.to_lowercase();
    let letter = ["left", "right"]
        .contains(&text.as_str())
        .then(|| &text[..1]);
    let is_so = |name: &str| {
        let name = name.to_lowercase();
        name.contains(&text)
            || letter.is_some_and(|letter| name.split(['_', '-']).any(|word| word == letter))
    };
    let has =
        |joint: &usize| is_so(&model.joints[*joint].name) || is_so(&model.links[*joint + 1].name);
    chain(model, palm).iter().any(has)
}

/// Why none of these groups of joints is a gripper.
fn why_none(model: &RobotModel, groups: &[(usize, usize, &BTreeSet<usize>)]) -> GripperFault {
    let joints: Vec<usize> = groups
        .iter()
        .flat_map(|(_, _, joints)| joints.iter().copied())
        .collect();
    let is_stiff = |joint: &usize| model.joints[*joint].upper - model.joints[*joint].lower < 1e-6;
    if let Some(joint) = joints
        .iter()
        .copied()
        .find(is_stiff)
        .map(|joint| &model.joints[joint])
    {
        let (lower, upper) = (joint.lower, joint.upper);
        return GripperFault::Stiff {
            joint: joint.name.clone(),
            lower,
            upper,
        };
    }
    if joints
        .iter()
        .all(|joint| model.links[joint + 1].solids.is_empty())
    {
        let links = joints
            .iter()
            .map(|joint| model.links[joint + 1].name.clone());
        return GripperFault::NoShapes(links.collect());
    }
    GripperFault::NoOpposition
}

/// Long chains before short ones, then right hands.
fn rank(model: &RobotModel, palm: usize) -> usize {
    let name = model.links[palm].name.to_lowercase();
    let is_right = name.contains("right") || name.starts_with("r_") || name.contains("_r_");
    4 * chain(model, palm).len().min(6) + usize::from(is_right)
}

/// A measured candidate.
struct HandCandidate {
    score: f64,
    named: Vec<usize>,
    links: [usize; 2],
    frame: Isometry3<f64>,
    widest_m: f64,
}

fn measure(
    bare: &RobotProfile,
    model: &RobotModel,
    stated: &Stated,
    palm: usize,
    joints: &BTreeSet<usize>,
) -> Option<ProposedHand> {
    let mut best: Option<HandCandidate> = None;
    for (links, drives) in pairs(model, palm, (joints, stated))
        .into_iter()
        .take(MOST_PAIRS)
    {
        for named in drives {
            let all = match stated.grasp {
                Some((_, frame)) => vec![(1.0, frame)],
                None => frames(model, palm, links, &named),
            };
            for (weight, frame) in all {
                let Some(found) = rate(bare, model, palm, links, &named, frame) else {
                    continue;
                };
                let weight = weight * powered(model, &named, joints) * tips(model, links, joints);
                let further = beside(model, (found.links, &found.named), joints, palm);
                let weight = weight
                    * amid(model, &found.named, &further)
                    * across(model, &found.named, &further);
                let is_better = |found: &HandCandidate, best: &Option<HandCandidate>| {
                    best.as_ref()
                        .is_none_or(|best| found.score > best.score + 1e-9)
                };
                let found = HandCandidate {
                    score: found.score * weight,
                    ..found
                };
                // Rays are cast only for candidates that could be the best.
                if !is_better(&found, &best) {
                    continue;
                }
                let between = Between {
                    bare,
                    model,
                    palm,
                    links: found.links,
                    named: &found.named,
                };
                let score = found.score * innermost(&between, found.frame, joints);
                let found = HandCandidate { score, ..found };
                if is_better(&found, &best) {
                    best = Some(found);
                }
            }
        }
    }
    let mut found = best?;
    let mut deeper = false;
    let between = Between {
        bare,
        model,
        palm,
        links: found.links,
        named: &found.named,
    };
    if stated.grasp.is_none() {
        let turned = if found.links.contains(&palm) {
            between.turned(found.frame)
        } else {
            found.frame
        };
        let centred = between.centred(turned);
        let seated = between.seated(centred);
        deeper = seated.is_some();
        found.frame = as_written(&seated.unwrap_or(centred));
    }
    if let Some(gripper) = between.gripper(found.frame) {
        found.widest_m = gripper.widest_m();
    }
    let mut profile = bare.clone();
    let mut notes = BTreeMap::new();
    if stated.joints.is_empty() {
        let named = alike(model, found.links).unwrap_or_else(|| {
            [
                found.named.clone(),
                beside(model, (found.links, &found.named), joints, palm),
            ]
            .concat()
        });
        let own = |idx: &usize| model.own_leaders.get(idx).copied().unwrap_or(*idx);
        profile.finger_joints = named
            .iter()
            .map(|idx| model.joints[own(idx)].name.clone())
            .collect();
        notes.insert(
            "finger_joints",
            "their names, and the links that they move".to_owned(),
        );
    }
    if stated.links.is_none() {
        profile.finger_links = found.links.map(|link| model.links[link].name.clone());
        notes.insert(
            "finger_links",
            "these two face each other and open widest".to_owned(),
        );
    }
    if stated.grasp.is_none() {
        profile.grasp_link = model.links[palm].name.clone();
        profile.grasp_offset_m = rounded(found.frame.translation.vector.into());
        let (roll, pitch, yaw) = found.frame.rotation.euler_angles();
        profile.grasp_turned_rad = rounded([roll, pitch, yaw]);
        let place = match deeper {
            true => "between the fingers, where they don't squeeze a can out",
            false => "between the fingertips, 2.5 cm before their ends",
        };
        notes.insert("grasp_offset_m", place.to_owned());
        notes.insert(
            "grasp_turned_rad",
            "x along the fingers, y from the right to the left one".to_owned(),
        );
    }
    if profile.max_opening_m == 0.0 {
        profile.max_opening_m = as_opening(found.widest_m);
        notes.insert("max_opening_m", "measured at that place".to_owned());
    }
    Some(ProposedHand {
        profile,
        palm,
        notes,
        others: Vec::new(),
        score: found.score,
    })
}

/// Not wider than measured, up to the rounding of limits. Unit: metres.
pub(super) fn as_opening(widest_m: f64) -> f64 {
    (widest_m.min(1.0) * 1000.0 + 0.1).floor() / 1000.0
}

/// The joints of two fingers that slide alike, one of which mimics the other: each has a motor of
/// its own then.
fn alike(model: &RobotModel, links: [usize; 2]) -> Option<Vec<usize>> {
    let [left, right] = links.map(|link| link.checked_sub(1));
    let (left, right) = (left?, right?);
    let slides = |idx: usize| {
        model.joints[idx].kind == JointKind::Prismatic && model.joints[idx].lower >= -1e-3
    };
    let follows = |idx: usize, other: usize| {
        let mimic = model.joints[idx].mimic;
        mimic.is_some_and(|(leader, factor, offset)| {
            leader == other && (factor - 1.0).abs() < 1e-9 && offset == 0.0
        })
    };
    let is_alike = slides(left) && slides(right) && (follows(left, right) || follows(right, left));
    is_alike.then(|| vec![left, right])
}

/// The frame with the numbers that a profile has.
fn as_written(frame: &Isometry3<f64>) -> Isometry3<f64> {
    let [x, y, z] = rounded(frame.translation.vector.into());
    let (roll, pitch, yaw) = frame.rotation.euler_angles();
    let [roll, pitch, yaw] = rounded([roll, pitch, yaw]);
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Rounds to the tenth of a millimetre or milliradian.
pub(super) fn rounded(values: [f64; 3]) -> [f64; 3] {
    values.map(|value| (value * 1e4).round() / 1e4 + 0.0)
}

/// Pairs of links that could be fingertips, each with the joints that could drive them.
fn pairs(
    model: &RobotModel,
    palm: usize,
    (joints, stated): (&BTreeSet<usize>, &Stated),
) -> Vec<([usize; 2], Vec<Vec<usize>>)> {
    let drivers = |link: usize| -> Vec<usize> {
        let own = chain(model, link)
            .into_iter()
            .filter(|joint| joints.contains(joint));
        let mut leaders: Vec<usize> = own.map(|joint| leader(model, joint)).collect();
        leaders.dedup();
        leaders
    };
    let ways = |[left, right]: [usize; 2]| -> Vec<Vec<usize>> {
        if !stated.joints.is_empty() {
            return vec![stated.joints.clone()];
        }
        let (of_left, of_right) = (drivers(left), drivers(right));
        if let Some(common) = of_left.iter().find(|joint| of_right.contains(joint)) {
            return vec![vec![*common]];
        }
        match (of_left.as_slice(), of_right.as_slice()) {
            (one, []) | ([], one) => one.iter().map(|joint| vec![*joint]).collect(),
            (firsts, seconds) => firsts
                .iter()
                .flat_map(|first| seconds.iter().map(move |second| vec![*first, *second]))
                .collect(),
        }
    };
    let links = stated
        .links
        .map_or_else(|| facing(model, palm, joints), |links| vec![links]);
    links
        .into_iter()
        .map(|links| (links, ways(links)))
        .collect()
}

/// Pairs of links that the joints move, and each with the palm; the outermost first: fingertips
/// rather than knuckles.
fn facing(model: &RobotModel, palm: usize, joints: &BTreeSet<usize>) -> Vec<[usize; 2]> {
    let is_solid = |link: usize| !model.links[link].solids.is_empty();
    let mut moved: Vec<usize> = joints
        .iter()
        .map(|joint| joint + 1)
        .filter(|link| is_solid(*link))
        .collect();
    moved.sort_by_key(|link| std::cmp::Reverse(chain(model, *link).len()));
    let others = |place: usize| {
        moved[place + 1..]
            .iter()
            .copied()
            .chain(is_solid(palm).then_some(palm))
    };
    moved
        .iter()
        .enumerate()
        .flat_map(|(place, left)| others(place).map(|right| [*left, right]))
        .collect()
}

/// The joint that a joint follows, or itself.
pub(super) fn leader(model: &RobotModel, joint: usize) -> usize {
    let next = |joint: &usize| model.joints[*joint].mimic.map(|(leader, ..)| leader);
    std::iter::successors(Some(joint), next)
        .take(model.joints.len())
        .last()
        .unwrap_or(joint)
}

/// Rates a candidate: how far its fingers open and close, and how far it is from the palm.
fn rate(
    bare: &RobotProfile,
    model: &RobotModel,
    palm: usize,
    links: [usize; 2],
    named: &[usize],
    frame: Isometry3<f64>,
) -> Option<HandCandidate> {
    let profile = driven(bare, model, named);
    let gripper = Gripper::find_coarse(&profile, model, links, (palm, frame)).ok()?;
    // Surfaces at the grasp frame must have been found for both fingers.
    let mut positions = vec![0.0; model.joints.len()];
    gripper.set(&mut positions, gripper.widest_m());
    let probe = Probe::new(model, links, (palm, frame));
    let gap = probe.gap(&positions)?;
    // At the width of a can, where the fingers hold most objects.
    gripper.set(&mut positions, CENTRED_AT_M.min(gripper.widest_m()));
    let flat = probe.flat_share(&positions);
    let widest_m = Some(gripper.widest_m()).filter(|widest_m| *widest_m > LEAST_CHANGE_M)?;
    let closes_m = gripper.travel_m();
    let off_m = gap.middle_m().abs();
    // Fingertips are alike; a fingertip and a knuckle are not.
    let [left, right] = links.map(|link| chain(model, link).len());
    let both = match (links.contains(&palm), left == right) {
        (true, _) => 0.6,
        (false, true) => 1.0,
        (false, false) => 0.4,
    };
    let reach_m = frame.translation.vector.norm().min(0.3);
    let from_palm = frame.translation.vector - behind(model, palm, links).coords;
    let points_back = (frame.rotation * Vector3::x()).dot(&from_palm) < 0.0;
    let both = both * if points_back { BACKWARDS } else { 1.0 };
    let score =
        (0.3 + flat) * both * closes_m.min(WIDE_M) * (0.05 + reach_m) / (1.0 + 10.0 * off_m);
    Some(HandCandidate {
        score,
        named: named.to_vec(),
        links,
        frame,
        widest_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    const INERTIAL: &str = "<inertial><mass value=\"0.1\"/>\
        <inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial>";

    /// A finger that slides by 4 cm along y, with its shape ahead of its joint along x, and the
    /// share by which it follows the joint `finger_pad_left`.
    fn finger(name: &str, [x, y]: [f64; 2], ahead_m: f64, share: f64) -> String {
        let mimic = match name {
            "finger_pad_left" => String::new(),
            _ => format!("<mimic joint=\"finger_pad_left\" multiplier=\"{share}\"/>"),
        };
        let (lower, upper) = if share > 0.0 {
            (0.0, 0.04)
        } else {
            (-0.04, 0.0)
        };
        format!(
            "<link name=\"{name}\">{INERTIAL}<collision><origin xyz=\"{ahead_m} 0 0\"/>\
             <geometry><box size=\"0.1 0.008 0.03\"/></geometry></collision></link>\
             <joint name=\"{name}\" type=\"prismatic\"><parent link=\"palm\"/><child link=\"{name}\"/>\
             <origin xyz=\"{x} {y} 0\"/><axis xyz=\"0 1 0\"/>\
             <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"9\" velocity=\"1\"/>{mimic}</joint>"
        )
    }

    /// The hand that is found on a palm with these fingers.
    fn found(fingers: &[String]) -> RobotProfile {
        found_on("", fingers)
    }

    /// The hand that is found on a palm with these shapes and fingers.
    fn found_on(shapes: &str, fingers: &[String]) -> RobotProfile {
        let path = Path::new("models/robots/fixed_arm.toml");
        let shipped = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid");
        let text = format!(
            "<robot name=\"hand\"><link name=\"palm\">{INERTIAL}{shapes}</link>{}</robot>",
            fingers.concat()
        );
        let profile = RobotProfile {
            arm_joints: Vec::new(),
            finger_joints: Vec::new(),
            finger_links: [String::new(), String::new()],
            grasp_link: String::new(),
            max_opening_m: 0.0,
            ..shipped
        };
        let profile = actcheck_config::robot::with_urdf(profile, Source::new("hand.urdf", text))
            .expect("it is a URDF");
        let model = RobotModel::read(&profile).expect("the hand is valid");
        find(&profile, &model, None)
            .unwrap_or_else(|_| panic!("there is a hand"))
            .profile
    }

    /// Each finger has a pad and a bar outside of it, which opens wider; both slide with the same
    /// motor.
    #[test]
    fn the_innermost_links_are_the_fingertips() {
        let mut found = found(&[
            finger("finger_bar_left", [0.0, 0.04], 0.06, 1.0),
            finger("finger_bar_right", [0.0, -0.04], 0.06, -1.0),
            finger("finger_pad_left", [0.0, 0.006], 0.06, 1.0),
            finger("finger_pad_right", [0.0, -0.006], 0.06, -1.0),
        ]);
        found.finger_links.sort();
        assert_eq!(found.finger_links, ["finger_pad_left", "finger_pad_right"]);
        assert!(
            (found.max_opening_m - 0.084).abs() < 1e-3,
            "{}",
            found.max_opening_m
        );
    }

    /// The joints of the fingers of a Piper are at their tips; those of an AIRBOT Play, too, with
    /// the origin of the palm.
    #[test]
    fn fingers_point_away_from_the_palm_wherever_their_joints_are() {
        let shape = "<collision><origin xyz=\"-0.13 0 0\"/><geometry><box size=\"0.06 0.1 0.06\"/></geometry></collision>";
        for (shapes, joint_m, ahead_m) in [("", 0.03, 0.06), ("", 0.14, -0.05), (shape, 0.0, -0.05)]
        {
            let fingers = [
                finger("finger_pad_left", [joint_m, 0.006], ahead_m, 1.0),
                finger("finger_pad_right", [joint_m, -0.006], ahead_m, -1.0),
            ];
            let found = found_on(shapes, &fingers);
            let [roll, pitch, yaw] = found.grasp_turned_rad;
            let ahead = UnitQuaternion::from_euler_angles(roll, pitch, yaw) * Vector3::x();
            assert!(ahead.x > 0.99, "{ahead}");
            let before_tip_m = joint_m + ahead_m + 0.05 - found.grasp_offset_m[0];
            assert!(
                (0.01..0.046).contains(&before_tip_m),
                "{:?}",
                found.grasp_offset_m
            );
        }
    }
}
