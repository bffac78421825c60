//! The links and joints of a robot's URDF: checks that they form one tree, and reads each joint's
//! type and limits.

use std::collections::{BTreeMap, BTreeSet};

use crate::foreign::robot_text::is_unlimited;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::did_you_mean;

/// Supported joint types.
const KINDS: [&str; 4] = ["fixed", "prismatic", "revolute", "continuous"];

/// The kind of motion of a URDF joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Motion {
    Fixed,
    Slides,
    Turns,
    /// The joint has a fault, which has been reported.
    Unknown,
}

/// The properties of a joint that profiles are checked against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TreeJoint {
    pub(crate) motion: Motion,
    /// Unit: metres or radians; infinite if the joint is continuous.
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

/// The links and joints of a URDF by name.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    pub(crate) joints: BTreeMap<String, TreeJoint>,
    pub(crate) links: BTreeSet<String>,
}

/// Reads the tree below `<robot>` and reports its faults: missing or duplicate names (W033, W051),
/// joints that can't be simulated (W035), invalid numbers (W034), and links that do not form a tree
/// (W051).
pub(crate) fn read(root: Node, reader: &mut Reader) -> Tree {
    let mut tree = Tree::default();
    for link in xml::children(root, "link") {
        let Some(name) = reader.attribute(link, "name") else {
            continue;
        };
        if !tree.links.insert(name.to_owned()) {
            let message = format!("there are two links `{name}`");
            reader.error("W051", link, message, "give one of them another name");
        }
        read_mass(link, reader);
    }
    if tree.links.is_empty() {
        reader.error(
            "W051",
            root,
            "the robot has no links".to_owned(),
            "add `<link name=\"base_link\"/>`",
        );
        return tree;
    }
    // Joint and parent link by child link.
    let mut above: BTreeMap<&str, (Node, &str)> = BTreeMap::new();
    for joint in xml::children(root, "joint") {
        let Some(name) = reader.attribute(joint, "name") else {
            continue;
        };
        let unknown = TreeJoint {
            motion: Motion::Unknown,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        };
        let read = read_joint(root, joint, name, reader).unwrap_or(unknown);
        if tree.joints.insert(name.to_owned(), read).is_some() {
            reader.error(
                "W051",
                joint,
                format!("there are two joints `{name}`"),
                "give one of them another name",
            );
        }
        let (parent, child) = (
            end(joint, "parent", &tree, reader),
            end(joint, "child", &tree, reader),
        );
        let (Some(parent), Some(child)) = (parent, child) else {
            continue;
        };
        if above.insert(child, (joint, parent)).is_some() {
            let message = format!("the link `{child}` is the child of two joints");
            reader.error(
                "W051",
                joint,
                message,
                "links form one tree: each link but the root is the child of one joint",
            );
        }
        weigh(root, joint, child, reader);
    }
    check_mimics(root, &tree, reader);
    check_tree(root, &tree, &above, reader);
    tree
}

/// Reports a negative or absurd mass.
fn read_mass(link: Node, reader: &mut Reader) {
    let Some(inertial) = xml::child(link, "inertial") else {
        return;
    };
    if let Some(mass) = reader.required(inertial, "mass")
        && let Some(written) = reader.attribute(mass, "value")
    {
        reader.numbers::<1>(mass, written, Bound::Mass);
    }
}

/// Reports a movable, colliding link with a mass of 0: it could neither push an object nor be
/// pushed.
fn weigh(root: Node, joint: Node, child: &str, reader: &mut Reader) {
    let link = xml::children(root, "link").find(|link| link.attribute("name") == Some(child));
    let moves = joint.attribute("type") != Some("fixed");
    let Some(link) = link.filter(|link| moves && xml::child(*link, "collision").is_some()) else {
        return;
    };
    let mass = xml::child(link, "inertial").and_then(|inertial| xml::child(inertial, "mass"));
    let weight: Option<f64> = mass.and_then(|mass| mass.attribute("value")?.trim().parse().ok());
    if let (Some(mass), Some(0.0)) = (mass, weight) {
        let message = format!("the link `{child}` moves but has a mass of 0");
        reader.error(
            "W034",
            mass,
            message,
            "set its mass in kilograms, or remove its `<collision>`",
        );
    }
}

fn read_joint(root: Node, joint: Node, name: &str, reader: &mut Reader) -> Option<TreeJoint> {
    let kind = reader.attribute(joint, "type")?;
    let motion = match kind {
        "fixed" => Motion::Fixed,
        "prismatic" => Motion::Slides,
        "revolute" | "continuous" => Motion::Turns,
        "planar" | "floating" if is_at_root(root, joint) => {
            let message =
                format!("the joint `{name}` is of the type {kind}, and is taken as fixed");
            reader.warning(
                "W036",
                joint,
                message,
                "`base = \"planar\"` in the profile moves the whole robot",
            );
            Motion::Fixed
        }
        _ => {
            let message =
                format!("the joint `{name}` is of the type {kind}, which can't be simulated");
            reader.error("W035", joint, message, did_you_mean(kind, KINDS));
            return None;
        }
    };
    if motion == Motion::Fixed {
        return Some(TreeJoint {
            motion,
            lower: 0.0,
            upper: 0.0,
        });
    }
    if let Some(axis) = xml::child(joint, "axis")
        && let Some(written) = reader.attribute(axis, "xyz")
        && reader.numbers(axis, written, Bound::Finite) == Some([0.0; 3])
    {
        let message = format!("the axis of the joint `{name}` must not be zero");
        reader.error(
            "W034",
            axis,
            message,
            "write `<axis xyz=\"0 0 1\"/>`, or another direction",
        );
    }
    if kind == "continuous" {
        return Some(TreeJoint {
            motion,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        });
    }
    let limit = reader.required(joint, "limit")?;
    let mut number = |key: &str, bound: Bound| {
        // `lower` and `upper` default to 0; `effort` and `velocity` are required.
        let written = match (limit.attribute(key), key) {
            (None, "lower" | "upper") => "0",
            _ => reader.attribute(limit, key)?,
        };
        if bound == Bound::NotNegative && is_unlimited(written) {
            return None;
        }
        reader
            .numbers::<1>(limit, written, bound)
            .map(|[number]| number)
    };
    let (lower, upper) = (
        number("lower", Bound::Finite),
        number("upper", Bound::Finite),
    );
    number("effort", Bound::NotNegative);
    number("velocity", Bound::NotNegative);
    let (lower, upper) = (lower?, upper?);
    if lower > upper {
        let message = format!(
            "the joint `{name}` has a lower limit of {lower} above its upper limit of {upper}"
        );
        reader.error("W034", limit, message, "`lower` must not exceed `upper`");
        return None;
    }
    Some(TreeJoint {
        motion,
        lower,
        upper,
    })
}

/// Whether a joint's parent is the root link.
fn is_at_root(root: Node, joint: Node) -> bool {
    let named = |joint: Node, which| {
        xml::child(joint, which).and_then(|end| end.attribute("link").map(str::to_owned))
    };
    let parent = named(joint, "parent");
    parent.is_some() && xml::children(root, "joint").all(|other| named(other, "child") != parent)
}

/// Returns the link at one end of a joint.
fn end<'n>(joint: Node<'n>, which: &str, tree: &Tree, reader: &mut Reader) -> Option<&'n str> {
    let end = reader.required(joint, which)?;
    let link = reader.attribute(end, "link")?;
    if !tree.links.contains(link) {
        let help = did_you_mean(link, tree.links.iter().map(String::as_str));
        reader.error("W051", end, format!("there is no link `{link}`"), help);
        return None;
    }
    Some(link)
}

fn check_mimics(root: Node, tree: &Tree, reader: &mut Reader) {
    for joint in xml::children(root, "joint") {
        let Some(mimic) =
            xml::child(joint, "mimic").filter(|_| joint.attribute("type") != Some("fixed"))
        else {
            continue;
        };
        let Some(leader) = reader.attribute(mimic, "joint") else {
            continue;
        };
        let moves = tree
            .joints
            .get(leader)
            .is_some_and(|joint| joint.motion != Motion::Fixed);
        if !moves {
            let known = tree
                .joints
                .iter()
                .filter(|(_, joint)| joint.motion != Motion::Fixed);
            let help = did_you_mean(leader, known.map(|(name, _)| name.as_str()));
            reader.error(
                "W051",
                mimic,
                format!("there is no movable joint `{leader}` to mimic"),
                help,
            );
            continue;
        }
        let own = joint
            .attribute("name")
            .and_then(|name| Some((name, tree.joints.get(name)?)));
        if let (Some((name, own)), Some(leader_joint)) = (own, tree.joints.get(leader)) {
            check_coupling(mimic, (name, own), (leader, leader_joint), reader);
        }
    }
}

/// Share of its range by which a joint may leave its limits without a warning: they are often
/// rounded.
const BEYOND_SHARE: f64 = 0.05;

/// Warns about limits of a joint that its leader makes it leave: as stated, they would block both.
fn check_coupling(
    mimic: Node,
    (name, own): (&str, &TreeJoint),
    (leader, leads): (&str, &TreeJoint),
    reader: &mut Reader,
) {
    let number = |key: &str, otherwise: f64| {
        mimic
            .attribute(key)
            .map_or(Some(otherwise), |written| written.trim().parse().ok())
    };
    let (Some(factor), Some(offset)) = (number("multiplier", 1.0), number("offset", 0.0)) else {
        return;
    };
    let ends = [leads.lower, leads.upper].map(|end| factor * end + offset);
    let (low, high): (f64, f64) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let slack = BEYOND_SHARE * (high - low);
    if !slack.is_finite() || (low >= own.lower - slack && high <= own.upper + slack) {
        return;
    }
    let message = format!(
        "`{name}` has the limits {} to {}, but `{leader}` moves it from {low:.3} to {high:.3}",
        own.lower, own.upper
    );
    let help = "its limits are taken as those of its coupling: check `<limit>` and the multiplier";
    reader.warning("W036", mimic, message, help);
}

/// Checks that there are one root and no cycles.
fn check_tree(root: Node, tree: &Tree, above: &BTreeMap<&str, (Node, &str)>, reader: &mut Reader) {
    let mut circles: BTreeSet<&str> = BTreeSet::new();
    for start in tree.links.iter().map(String::as_str) {
        let mut seen = BTreeSet::new();
        let mut link = start;
        while let Some((joint, parent)) = above.get(link) {
            if !seen.insert(link) {
                if circles.is_disjoint(&seen) {
                    let message =
                        format!("the link `{link}` is its own ancestor through `{parent}`");
                    reader.error(
                        "W051",
                        *joint,
                        message,
                        "links form one tree: remove one of the joints",
                    );
                }
                circles.extend(&seen);
                break;
            }
            link = parent;
        }
    }
    let roots: Vec<&str> = tree
        .links
        .iter()
        .map(String::as_str)
        .filter(|link| !above.contains_key(link))
        .collect();
    // Faulty joints make connected links look disconnected.
    if roots.len() > 1 && !reader.found.has_errors() {
        let message = format!(
            "the links form {} trees, with the roots `{}`",
            roots.len(),
            roots.join("`, `")
        );
        reader.error(
            "W051",
            root,
            message,
            "links form one tree: join them with joints of the type `fixed`",
        );
    }
}
