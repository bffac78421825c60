//! The gripper: which joints move it, which links are its fingertips, and where an object is
//! between them.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::between::{Between, CENTRED_AT_M};
use super::body::chain;
use super::cup;
use super::effort::Effort;
use super::frames::{LEAST_CHANGE_M, behind, frames};
use super::hands::groups;
use super::row::{across, amid, beside};
use super::stated::{NoHand, Stated};
use super::weights::{innermost, powered, tips};
use crate::description::{JointKind, RobotModel};
use crate::gripper::Probe;
use crate::layout::frame;
use crate::{Gripper, GripperFault, RobotError};
use actcheck_data::{FINGER_FRICTION, GRIP_FORCE_N, Hand, LinkFrame, StatedFingers, StatedHand};

/// Most pairs of fingers that are measured.
const MOST_PAIRS: usize = 40;
/// Fewest joints that carry a hand of an arm.
const FEWEST_ARM_JOINTS: usize = 4;
/// Weight of fingers that point back to the palm: the joints of some fingers are at their tips.
const BACKWARDS: f64 = 0.2;
/// Scores that differ by less than this are equal.
const EQUAL_SCORE: f64 = 1e-9;
/// Steps of one measured gap, besides one for each solid of both fingers.
const STEPS_OF_GAP: u64 = 4;
/// Gaps that are measured to rate a candidate, at most.
const GAPS_OF_RATING: u64 = 140;
/// Openings wider than this are worth no more. Unit: metres.
const WIDE_M: f64 = 0.12;

/// A gripper that was found.
pub(super) struct ProposedHand {
    pub(super) hand: Hand,
    /// The link that carries the fingers.
    pub(super) palm: usize,
    pub(super) notes: BTreeMap<&'static str, String>,
    /// Names of the links that carry other hands.
    pub(super) others: Vec<String>,
    /// How good it is, to compare hands of the same robot; 0 if the profile names its parts.
    pub(super) score: f64,
    /// The joint of a thumb that is parked opposite the fingers, with its position.
    pub(super) thumb: Option<(String, f64)>,
}

impl ProposedHand {
    /// A hand that was not searched for.
    pub(super) fn known(hand: Hand, palm: usize) -> Self {
        Self {
            hand,
            palm,
            notes: BTreeMap::new(),
            others: Vec::new(),
            score: 0.0,
            thumb: None,
        }
    }
}

/// Finds the best gripper, and keeps the parts that the profile names. Of several hands, only those
/// with `wanted` in a name of theirs or of their arm count. Without steps left of the effort, it is
/// the best of those that were measured.
///
/// # Errors
/// [`NoHand`] if there is none.
pub(super) fn find(
    hand: &StatedHand,
    model: &RobotModel,
    wanted: Option<&str>,
    effort: &mut Effort,
) -> Result<ProposedHand, NoHand> {
    let fingers = match hand {
        StatedHand::Fingers(fingers) => fingers,
        StatedHand::Cup { grasp, cup } => {
            let (palm, _) = frame(model, grasp)?;
            return Ok(ProposedHand::known(Hand::of_cup(grasp.clone(), *cup), palm));
        }
    };
    let stated = Stated::of(fingers, model)?;
    let with_opening = with_opening(fingers, &stated, model)?;
    if let (Ok(hand), Some((palm, _))) = (with_opening.complete(), stated.grasp) {
        return Ok(ProposedHand::known(hand, palm));
    }
    let groups = stated.groups(model).unwrap_or_else(|| groups(model));
    if groups.is_empty() {
        if let Some(hand) = cup::find(model, wanted) {
            return Ok(hand);
        }
        if let (Some(wanted), Some(other)) = (wanted, cup::find(model, None)) {
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
    let mut best = None;
    for (place, (_, palm, joints)) in rated.iter().enumerate() {
        let mut part = effort.part(rated.len() - place);
        best = measure((fingers, &stated), model, (*palm, joints), &mut part);
        effort.join(&part);
        if best.is_some() {
            break;
        }
    }
    let best = best.map(|hand| ProposedHand {
        others: others_than(model, &groups, hand.palm),
        ..hand
    });
    best.ok_or_else(|| {
        NoHand::Gripper(match why_none(model, &rated) {
            GripperFault::NoOpposition if effort.is_cut() => GripperFault::CutShort,
            fault => fault,
        })
    })
}

/// The fingers with their opening, which is measured if a profile states all but that.
fn with_opening(
    fingers: &StatedFingers,
    stated: &Stated,
    model: &RobotModel,
) -> Result<StatedFingers, RobotError> {
    let (Some(links), Some(joints), Some(grasp), None) = (
        stated.links,
        &fingers.finger_joints,
        stated.grasp,
        fingers.max_opening_m,
    ) else {
        return Ok(fingers.clone());
    };
    let named = joints.iter().map(|name| model.joint(name));
    let named = named.collect::<Result<Vec<_>, _>>()?;
    let widest_m = Gripper::find(&named, model, links, grasp)?.widest_m();
    Ok(StatedFingers {
        max_opening_m: Some(as_opening(widest_m)),
        ..fingers.clone()
    })
}

/// The names of the links that carry other hands, at the end of arms, than the one on this link.
pub(super) fn others_than(
    model: &RobotModel,
    groups: &BTreeMap<usize, BTreeSet<usize>>,
    own: usize,
) -> Vec<String> {
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
pub(super) fn rank(model: &RobotModel, palm: usize) -> usize {
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
    /// The place of its pair, and that of its joints among those that could drive the pair.
    place: [usize; 2],
}

impl HandCandidate {
    /// Whether it is better than another; of equal ones, the first pair with its first joints is.
    fn is_better(&self, other: &Option<Self>) -> bool {
        other.as_ref().is_none_or(|other| {
            let is_before = self.place < other.place && self.score >= other.score - EQUAL_SCORE;
            self.score > other.score + EQUAL_SCORE || is_before
        })
    }
}

/// The best of all pairs of fingers, joints that could drive them, and frames. Each pair is
/// measured with its first joints before any with its second ones, so that a cut search has seen
/// all fingers.
fn best_candidate(
    model: &RobotModel,
    stated: &Stated,
    (palm, joints): (usize, &BTreeSet<usize>),
    effort: &mut Effort,
) -> Option<HandCandidate> {
    let mut best: Option<HandCandidate> = None;
    let pairs = pairs(model, palm, (joints, stated));
    let n_ways = pairs.iter().map(|(_, drives)| drives.len()).max();
    let places =
        (0..n_ways.unwrap_or(0)).flat_map(|way| (0..pairs.len()).map(move |pair| [pair, way]));
    for [pair, way] in places {
        let (links, Some(named)) = (pairs[pair].0, pairs[pair].1.get(way)) else {
            continue;
        };
        let n_solids: usize = links
            .iter()
            .map(|link| model.links[*link].solids.len())
            .sum();
        let steps_of_gap = STEPS_OF_GAP + n_solids as u64;
        let all = match stated.grasp {
            Some((_, frame)) => vec![(1.0, frame)],
            None => frames(model, palm, (links, named), steps_of_gap, effort),
        };
        for (weight, frame) in all {
            if effort.is_spent() {
                return best;
            }
            effort.spend(GAPS_OF_RATING * steps_of_gap);
            let Some(found) = rate(model, palm, links, named, frame) else {
                continue;
            };
            let weight = weight * powered(model, named, joints) * tips(model, links, joints);
            let further = beside(model, (links, named), joints, palm);
            let weight = weight * amid(model, named, &further) * across(model, named, &further);
            let found = HandCandidate {
                score: found.score * weight,
                place: [pair, way],
                ..found
            };
            // Rays are cast only for candidates that could be the best.
            if !found.is_better(&best) {
                continue;
            }
            let between = Between {
                model,
                palm,
                links,
                named,
            };
            let score = found.score * innermost(&between, found.frame, joints);
            let found = HandCandidate { score, ..found };
            if found.is_better(&best) {
                best = Some(found);
            }
        }
    }
    best
}

fn measure(
    (fingers, stated): (&StatedFingers, &Stated),
    model: &RobotModel,
    (palm, joints): (usize, &BTreeSet<usize>),
    effort: &mut Effort,
) -> Option<ProposedHand> {
    let mut found = best_candidate(model, stated, (palm, joints), effort)?;
    let mut deeper = false;
    let between = Between {
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
    let mut notes = BTreeMap::new();
    let finger_joints = fingers.finger_joints.clone().unwrap_or_else(|| {
        notes.insert(
            "finger_joints",
            "their names, and the links that they move".to_owned(),
        );
        let named = alike(model, found.links).unwrap_or_else(|| {
            [
                found.named.clone(),
                beside(model, (found.links, &found.named), joints, palm),
            ]
            .concat()
        });
        let own = |idx: &usize| model.own_leaders.get(idx).copied().unwrap_or(*idx);
        let names = named.iter().map(|idx| model.joints[own(idx)].name.clone());
        names.collect()
    });
    let finger_links = fingers.finger_links.clone().unwrap_or_else(|| {
        notes.insert(
            "finger_links",
            format!("these two face each other and open widest{}", cut(effort)),
        );
        found.links.map(|link| model.links[link].name.clone())
    });
    let grasp = fingers.grasp.clone().unwrap_or_else(|| {
        let place = match deeper {
            true => "between the fingers, where they don't squeeze a can out",
            false => "between the fingertips, 2.5 cm before their ends",
        };
        notes.insert("grasp_offset_m", place.to_owned());
        notes.insert(
            "grasp_turned_rad",
            "x along the fingers, y from the right to the left one".to_owned(),
        );
        written(model.links[palm].name.clone(), &found.frame)
    });
    let max_opening_m = fingers.max_opening_m.unwrap_or_else(|| {
        notes.insert("max_opening_m", "measured at that place".to_owned());
        as_opening(found.widest_m)
    });
    let hand = Hand {
        grasp,
        finger_joints,
        finger_links,
        max_opening_m,
        finger_friction: fingers.finger_friction.unwrap_or(FINGER_FRICTION),
        grip_force_n: fingers.grip_force_n.unwrap_or(GRIP_FORCE_N),
        suction: None,
    };
    Some(ProposedHand {
        notes,
        score: found.score,
        ..ProposedHand::known(hand, palm)
    })
}

/// A frame on a link, as a profile states it.
pub(super) fn written(link: String, frame: &Isometry3<f64>) -> LinkFrame {
    let (roll, pitch, yaw) = frame.rotation.euler_angles();
    LinkFrame {
        link,
        offset_m: rounded(frame.translation.vector.into()),
        turned_rad: rounded([roll, pitch, yaw]),
    }
}

/// A remark about a search that was cut short.
fn cut(effort: &Effort) -> &'static str {
    match effort.is_cut() {
        true => {
            ", of those measured: the search was cut short, because the hand has many joints and \
                 shapes"
        }
        false => "",
    }
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
        .take(MOST_PAIRS)
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
    model: &RobotModel,
    palm: usize,
    links: [usize; 2],
    named: &[usize],
    frame: Isometry3<f64>,
) -> Option<HandCandidate> {
    let gripper = Gripper::find_coarse(named, model, links, (palm, frame)).ok()?;
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
        place: [0, 0],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    const INERTIAL: &str = "<inertial><mass value=\"0.1\"/>\
        <inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial>";

    /// A hand of which nothing is stated.
    const UNKNOWN: StatedHand = StatedHand::Fingers(StatedFingers {
        grasp: None,
        finger_joints: None,
        finger_links: None,
        max_opening_m: None,
        finger_friction: None,
        grip_force_n: None,
    });

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
    fn found(fingers: &[String]) -> Hand {
        found_on("", fingers)
    }

    /// The hand that is found on a palm with these shapes and fingers.
    fn found_on(shapes: &str, fingers: &[String]) -> Hand {
        find(&UNKNOWN, &hand(shapes, fingers), None, &mut Effort::whole())
            .unwrap_or_else(|_| panic!("there is a hand"))
            .hand
    }

    /// A palm with these shapes and fingers.
    fn hand(shapes: &str, fingers: &[String]) -> RobotModel {
        let path = Path::new("models/robots/fixed_arm.toml");
        let shipped = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid");
        let text = format!(
            "<robot name=\"hand\"><link name=\"palm\">{INERTIAL}{shapes}</link>{}</robot>",
            fingers.concat()
        );
        let core = actcheck_config::robot::with_urdf(shipped.core, Source::new("hand.urdf", text))
            .expect("it is a URDF");
        RobotModel::without_roles(&core).expect("the hand is valid")
    }

    /// A search that is cut short proposes the best of the measured candidates with a remark, and the
    /// same each time; one that measured none says so.
    #[test]
    fn a_search_without_steps_left_proposes_the_best_so_far() {
        let model = hand(
            "",
            &[
                finger("finger_bar_left", [0.0, 0.04], 0.06, 1.0),
                finger("finger_bar_right", [0.0, -0.04], 0.06, -1.0),
                finger("finger_pad_left", [0.0, 0.006], 0.06, 1.0),
                finger("finger_pad_right", [0.0, -0.006], 0.06, -1.0),
            ],
        );
        let with = |steps: u64| find(&UNKNOWN, &model, None, &mut Effort::of(steps));
        let fault = match with(0) {
            Err(NoHand::Gripper(fault)) => fault,
            _ => panic!("nothing was measured"),
        };
        assert_eq!(fault, GripperFault::CutShort);
        let is_cut = |hand: &ProposedHand| hand.notes["finger_links"].contains("cut short");
        let sizes = std::iter::successors(Some(1000), |steps| Some(2 * steps));
        let found: Vec<(u64, ProposedHand)> = sizes
            .take(14)
            .filter_map(|steps| Some((steps, with(steps).ok()?)))
            .collect();
        let (steps, first) = &found[0];
        assert!(is_cut(first), "{steps}");
        assert_eq!(
            with(*steps).ok().map(|hand| hand.hand),
            Some(first.hand.clone())
        );
        let (_, last) = &found[found.len() - 1];
        assert!(!is_cut(last) && last.score >= first.score);
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
            let [roll, pitch, yaw] = found.grasp.turned_rad;
            let ahead = UnitQuaternion::from_euler_angles(roll, pitch, yaw) * Vector3::x();
            assert!(ahead.x > 0.99, "{ahead}");
            let before_tip_m = joint_m + ahead_m + 0.05 - found.grasp.offset_m[0];
            assert!(
                (0.01..0.046).contains(&before_tip_m),
                "{:?}",
                found.grasp.offset_m
            );
        }
    }
}
