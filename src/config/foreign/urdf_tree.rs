//! Reads the tree of a robot in URDF: its links and joints, with every fault at its place.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::foreign::colours;
use crate::foreign::geometry::{PrimitiveShape, check_scale, cone, kind_of, primitive};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, did_you_mean};
use actcheck_data::{
    Mesh, ModelTree, TreeColour, TreeGeometry, TreeInertial, TreeJoint, TreeLink, TreeMimic,
    TreeMotion, TreeSolid,
};

/// Supported joint types.
const TYPES: [&str; 4] = ["fixed", "prismatic", "revolute", "continuous"];

/// Elements that a joint may have once.
const SINGLE: [&str; 8] = [
    "origin",
    "parent",
    "child",
    "axis",
    "limit",
    "dynamics",
    "mimic",
    "safety_controller",
];

/// Help text about the root of a document.
pub(crate) const URDF_ROOT: &str = "a URDF file begins with `<robot name=\"…\">`";

/// A tree, and the faults of shapes that are only seen: they matter if such a shape has to collide.
pub(crate) struct UrdfTree {
    pub(crate) tree: ModelTree,
    /// Whether the links form one tree.
    pub(crate) is_whole: bool,
    pub(crate) faults_of_visuals: BTreeMap<String, Diagnostics>,
}

/// Reads the tree below `<robot>` and reports its faults: missing or duplicate names (W033, W051),
/// joints that can't be simulated (W035), invalid numbers (W034), and links that do not form a tree
/// (W051).
pub(crate) fn read(root: Node, reader: &mut Reader) -> UrdfTree {
    let mut tree = ModelTree {
        name: root.attribute("name").unwrap_or("robot").to_owned(),
        ..ModelTree::default()
    };
    let mut faults_of_visuals = BTreeMap::new();
    warn_about_colours(root, reader);
    let materials = materials(root);
    let mut names = BTreeSet::new();
    for link in xml::children(root, "link") {
        let Some(name) = reader.attribute(link, "name") else {
            continue;
        };
        if !names.insert(name) {
            let message = format!("there are two links `{name}`");
            reader.error("W051", link, message, "give one of them another name");
            continue;
        }
        let mut unheard = Reader::new(reader.source);
        let meshes = &mut tree.inline_meshes;
        let visuals = solids((link, "visual"), (&materials, &mut *meshes), &mut unheard);
        if !unheard.found.is_empty() {
            faults_of_visuals.insert(name.to_owned(), unheard.found);
        }
        tree.links.push(TreeLink {
            name: name.to_owned(),
            inertial: inertial(link, reader),
            solids: solids((link, "collision"), (&materials, meshes), reader),
            visuals,
            place: reader.place(link),
        });
    }
    let is_whole = if tree.links.is_empty() {
        reader.error(
            "W051",
            root,
            "the robot has no links".to_owned(),
            "add `<link name=\"base_link\"/>`",
        );
        false
    } else {
        let is_whole = read_joints(root, &names, &mut tree, reader);
        read_passing(root, &mut tree, reader);
        is_whole
    };
    UrdfTree {
        tree,
        is_whole,
        faults_of_visuals,
    }
}

/// Reads all joints. Returns whether the links form one tree.
fn read_joints(
    root: Node,
    links: &BTreeSet<&str>,
    tree: &mut ModelTree,
    reader: &mut Reader,
) -> bool {
    let mut is_whole = true;
    // Joint and parent link by child link.
    let mut above: BTreeMap<&str, (Node, &str)> = BTreeMap::new();
    let mut names = BTreeSet::new();
    for joint in xml::children(root, "joint") {
        warn_about_repeated(joint, reader);
        let Some(name) = reader.attribute(joint, "name") else {
            continue;
        };
        if !names.insert(name) {
            let message = format!("there are two joints `{name}`");
            reader.error("W051", joint, message, "give one of them another name");
            continue;
        }
        let (parent, child) = (
            end(joint, "parent", links, reader),
            end(joint, "child", links, reader),
        );
        let ends = [parent, child].map(Option::unwrap_or_default);
        tree.joints.push(read_joint(joint, name, ends, reader));
        let (Some(parent), Some(child)) = (parent, child) else {
            is_whole = false;
            continue;
        };
        if above.insert(child, (joint, parent)).is_some() {
            is_whole = false;
            let message = format!("the link `{child}` is the child of two joints");
            reader.error(
                "W051",
                joint,
                message,
                "links form one tree: each link but the root is the child of one joint",
            );
        }
    }
    check_tree(root, links, &above, reader) && is_whole
}

/// Reads the pairs of links of `<disable_collisions>`: elements of SRDF, which some tools write
/// into the URDF.
fn read_passing(root: Node, tree: &mut ModelTree, reader: &mut Reader) {
    for pair in xml::children(root, "disable_collisions") {
        let ends = ["link1", "link2"].map(|key| reader.attribute(pair, key));
        let [Some(first), Some(second)] = ends else {
            continue;
        };
        for name in [first, second] {
            if tree.link(name).is_none() {
                let help = did_you_mean(name, tree.links.iter().map(|link| link.name.as_str()));
                reader.error(
                    "W051",
                    pair,
                    format!("the model has no link `{name}`"),
                    help,
                );
            }
        }
        tree.passing.push([first.to_owned(), second.to_owned()]);
    }
}

/// Reports colours that are not four numbers (W036).
fn warn_about_colours(root: Node, reader: &mut Reader) {
    let colours = root.descendants().filter(|node| {
        let parent = node
            .parent_element()
            .filter(|parent| parent.has_tag_name("material"));
        node.has_tag_name("color") && parent.is_some_and(|material| material.has_attribute("name"))
    });
    for colour in colours {
        let numbers = colour.attribute("rgba").unwrap_or_default();
        let words = numbers.split_whitespace();
        if words.clone().count() == 4 && words.clone().all(|word| word.parse::<f64>().is_ok()) {
            continue;
        }
        let message = format!(
            "`<color>` is ignored: `rgba` must be four numbers, but is `{}`",
            xml::short(numbers)
        );
        reader.warning("W036", colour, message, colours::NO_EFFECT);
    }
}

/// The colours of materials by their names; the first one of each counts. Links may refer to those
/// of other links, as in ROS's `urdfdom`.
fn materials<'a>(root: Node<'a>) -> BTreeMap<&'a str, TreeColour> {
    let mut known = BTreeMap::new();
    for material in root.descendants() {
        if let (true, Some(name), Some(colour)) = (
            material.has_tag_name("material"),
            material.attribute("name"),
            own_colour(material),
        ) {
            known.entry(name).or_insert(colour);
        }
    }
    known
}

/// The colour that a material states itself.
fn own_colour(material: Node) -> Option<TreeColour> {
    let text = xml::child(material, "color")?.attribute("rgba")?;
    colours::rest(&colours::numbers(text)?)
}

/// The colour of a `<visual>`, by its own material or that with its name.
fn colour(visual: Node, materials: &BTreeMap<&str, TreeColour>) -> Option<TreeColour> {
    let material = xml::child(visual, "material")?;
    let named = || materials.get(material.attribute("name")?).copied();
    own_colour(material).or_else(named)
}

/// Reports elements that a joint has already (W036).
fn warn_about_repeated(joint: Node, reader: &mut Reader) {
    let name = joint.attribute("name").unwrap_or_default();
    for key in SINGLE {
        for further in xml::children(joint, key).skip(1) {
            let message =
                format!("the joint `{name}` has more than one `<{key}>`: the first counts");
            reader.warning("W036", further, message, "remove the others");
        }
    }
}

/// Reads the `<origin>` of an element; the identity if it has none.
fn origin(node: Node, reader: &mut Reader) -> Option<Isometry3<f64>> {
    let Some(written) = xml::child(node, "origin") else {
        return Some(Isometry3::identity());
    };
    let mut three = |name: &str| match written.attribute(name) {
        Some(text) => reader.numbers(written, text, Bound::Finite),
        None => Some([0.0; 3]),
    };
    Some(xml::placed(three("xyz")?, three("rpy")?))
}

/// Reads the mass of a link; `None` if it has none, or after a fault. Moments that are missing are
/// 0.
fn inertial(link: Node, reader: &mut Reader) -> Option<TreeInertial> {
    let inertial = xml::child(link, "inertial")?;
    let mass = reader.required(inertial, "mass")?;
    let written = reader.attribute(mass, "value")?;
    let [kg] = reader.numbers(mass, written, Bound::Mass)?;
    let pose = origin(inertial, reader)?;
    let inertia = xml::child(inertial, "inertia");
    let about_com = match inertia {
        None => Matrix3::zeros(),
        Some(inertia) => {
            let mut entry = |name: &str| match inertia.attribute(name) {
                None => Some(0.0),
                Some(written) => reader
                    .numbers::<1>(inertia, written, Bound::Finite)
                    .map(|[number]| number),
            };
            let (xx, xy, xz) = (entry("ixx")?, entry("ixy")?, entry("ixz")?);
            let (yy, yz, zz) = (entry("iyy")?, entry("iyz")?, entry("izz")?);
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        }
    };
    Some(TreeInertial {
        pose,
        kg,
        about_com,
        place: reader.place(mass),
        moments_place: inertia.map(|node| reader.place(node)),
    })
}

/// Reads the shapes of a link in elements of this name. Those that are only placeholders are
/// reported (W036). Shapes without a mesh file get entries in `meshes`. `materials` are the colours
/// that they may refer to.
fn solids(
    (link, element): (Node, &str),
    (materials, meshes): (&BTreeMap<&str, TreeColour>, &mut BTreeMap<String, Mesh>),
    reader: &mut Reader,
) -> Vec<TreeSolid> {
    let mut found = Vec::new();
    for node in xml::children(link, element) {
        if let Some(shape) = placeholder(node) {
            let message = format!(
                "this `<{}>` has no size: it is left out",
                shape.tag_name().name()
            );
            let help = "remove its `<collision>`, or write its size in metres";
            reader.warning("W036", shape, message, help);
            continue;
        }
        let pose = origin(node, reader);
        let geometry = reader.required(node, "geometry");
        let geometry =
            geometry.and_then(|shape| Some((shape, read_geometry(shape, meshes, reader)?)));
        let (Some(pose), Some((shape, geometry))) = (pose, geometry) else {
            continue;
        };
        let shape = xml::first(shape).unwrap_or(shape);
        found.push(TreeSolid {
            pose,
            geometry,
            matter: None,
            friction: None,
            colour: colour(node, materials),
            place: reader.place(shape),
        });
    }
    found
}

/// Returns the shape of a `<collision>` if all its sizes are 0: it is only a placeholder.
fn placeholder(collision: Node) -> Option<Node> {
    let shape = xml::first(xml::child(collision, "geometry")?)?;
    let keys: &[&str] = match shape.tag_name().name() {
        "box" => &["size"],
        "cylinder" | "capsule" | "cone" => &["radius", "length"],
        "sphere" => &["radius"],
        _ => return None,
    };
    let is_zero = |key: &&str| {
        let numbers = shape.attribute(*key).unwrap_or_default();
        !numbers.is_empty()
            && numbers
                .split_whitespace()
                .all(|number| number.parse() == Ok(0.0))
    };
    keys.iter().all(is_zero).then_some(shape)
}

fn read_geometry(
    geometry: Node,
    meshes: &mut BTreeMap<String, Mesh>,
    reader: &mut Reader,
) -> Option<TreeGeometry> {
    let kind = kind_of(geometry, reader)?;
    if kind.tag_name().name() == "mesh" {
        return mesh(kind, reader);
    }
    let written = |name: &str, reader: &mut Reader| Some((kind, reader.attribute(kind, name)?));
    match primitive(kind, reader, written)? {
        PrimitiveShape::Geometry(geometry) => Some(geometry),
        PrimitiveShape::Cone { radius, length } => {
            let name = format!("cone {}", meshes.len());
            meshes.insert(name.clone(), cone(radius, length)?);
            Some(TreeGeometry::Mesh {
                file: name,
                scale: [1.0; 3],
            })
        }
    }
}

fn mesh(kind: Node, reader: &mut Reader) -> Option<TreeGeometry> {
    let file = reader.attribute(kind, "filename")?.to_owned();
    let scale = match kind.attribute("scale") {
        Some(scale) => reader.numbers(kind, scale, Bound::Finite)?,
        None => [1.0; 3],
    };
    check_scale(scale, &reader.place(kind), &mut reader.found)?;
    Some(TreeGeometry::Mesh { file, scale })
}

/// Reads a joint. One with a fault, which has been reported, is of an unknown kind.
fn read_joint(joint: Node, name: &str, ends: [&str; 2], reader: &mut Reader) -> TreeJoint {
    let known = origin(joint, reader);
    let fixed = TreeJoint::fixed(
        name.to_owned(),
        ends,
        known.unwrap_or_default(),
        reader.place(joint),
    );
    moving(joint, fixed.clone(), reader).unwrap_or(TreeJoint {
        motion: TreeMotion::Unknown,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        ..fixed
    })
}

/// Reads the motion of a joint; `None` after a fault.
fn moving(joint: Node, fixed: TreeJoint, reader: &mut Reader) -> Option<TreeJoint> {
    let kind = reader.attribute(joint, "type")?;
    let motion = match kind {
        "fixed" => {
            if let Some(mimic) = xml::child(joint, "mimic") {
                let message = format!("the joint `{}` is fixed: it follows no other", fixed.name);
                let help = "remove the `<mimic>`, or make the joint `revolute` or `prismatic`";
                reader.warning("W036", mimic, message, help);
            }
            return Some(fixed);
        }
        "planar" => TreeMotion::Planar,
        "floating" => TreeMotion::Floating,
        "prismatic" => TreeMotion::Prismatic,
        "revolute" => TreeMotion::Revolute,
        "continuous" => TreeMotion::Continuous,
        _ => {
            let message = format!(
                "the joint `{}` is of the type {kind}, which can't be simulated",
                fixed.name
            );
            reader.error("W035", joint, message, did_you_mean(kind, TYPES));
            return None;
        }
    };
    if !motion.moves() {
        return Some(TreeJoint { motion, ..fixed });
    }
    let mut read = TreeJoint {
        motion,
        axis: axis(joint, &fixed.name, reader),
        mimic: mimic(joint, reader),
        ..fixed
    };
    if let Some(dynamics) = xml::child(joint, "dynamics") {
        let mut number = |key: &str| match dynamics.attribute(key) {
            Some(written) => reader
                .numbers::<1>(dynamics, written, Bound::Finite)
                .map_or(0.0, |[number]| number),
            None => 0.0,
        };
        (read.damping, read.friction) = (number("damping"), number("friction"));
    }
    if motion == TreeMotion::Continuous {
        (read.lower, read.upper) = (f64::NEG_INFINITY, f64::INFINITY);
        if let Some(limit) = xml::child(joint, "limit") {
            (read.effort, read.velocity) = efforts(limit, reader);
        }
        return Some(read);
    }
    let limit = reader.required(joint, "limit")?;
    (read.effort, read.velocity) = efforts(limit, reader);
    if motion == TreeMotion::Revolute
        && ["lower", "upper"]
            .into_iter()
            .all(|key| limit.attribute(key).is_some_and(is_infinite))
    {
        (read.lower, read.upper) = (f64::NEG_INFINITY, f64::INFINITY);
        read.motion = TreeMotion::Continuous;
        return Some(read);
    }
    let mut end = |key: &str| match limit.attribute(key) {
        Some(written) => reader
            .numbers::<1>(limit, written, Bound::Finite)
            .map(|[number]| number),
        None => Some(0.0),
    };
    let (lower, upper) = (end("lower"), end("upper"));
    (read.lower, read.upper) = (lower?, upper?);
    if read.lower > read.upper {
        let message = format!(
            "the joint `{}` has a lower limit of {} above its upper limit of {}",
            read.name, read.lower, read.upper
        );
        reader.error("W034", limit, message, "`lower` must not exceed `upper`");
        return None;
    }
    Some(read)
}

fn is_infinite(written: &str) -> bool {
    written.trim().parse::<f64>().is_ok_and(f64::is_infinite)
}

/// Reads the largest effort and velocity: 0 if they are unknown. A limit of -1 means none, as in
/// SDF, and so does an infinite one.
fn efforts(limit: Node, reader: &mut Reader) -> (f64, f64) {
    let mut number = |key: &str| match limit.attribute(key).map(str::trim) {
        Some(written) if written.parse() != Ok(-1.0) && !is_infinite(written) => reader
            .numbers::<1>(limit, written, Bound::NotNegative)
            .map_or(0.0, |[number]| number),
        _ => 0.0,
    };
    (number("effort"), number("velocity"))
}

fn axis(joint: Node, name: &str, reader: &mut Reader) -> Vector3<f64> {
    let written = xml::child(joint, "axis").and_then(|axis| {
        let written = reader.attribute(axis, "xyz")?;
        Some((axis, reader.numbers::<3>(axis, written, Bound::Finite)?))
    });
    let Some((node, direction)) = written else {
        return Vector3::x();
    };
    if direction == [0.0; 3] {
        reader.error(
            "W034",
            node,
            format!("the axis of the joint `{name}` must not be zero"),
            "write `<axis xyz=\"0 0 1\"/>`, or another direction",
        );
        return Vector3::x();
    }
    Vector3::from(direction)
}

fn mimic(joint: Node, reader: &mut Reader) -> Option<TreeMimic> {
    let mimic = xml::child(joint, "mimic")?;
    let leader = reader.attribute(mimic, "joint")?.to_owned();
    let mut number = |key: &str, otherwise: f64| match mimic.attribute(key) {
        Some(written) => reader
            .numbers::<1>(mimic, written, Bound::Finite)
            .map_or(otherwise, |[number]| number),
        None => otherwise,
    };
    Some(TreeMimic {
        leader,
        factor: number("multiplier", 1.0),
        offset: number("offset", 0.0),
        place: reader.place(mimic),
    })
}

/// Returns the link at one end of a joint.
fn end<'n>(
    joint: Node<'n>,
    which: &str,
    links: &BTreeSet<&str>,
    reader: &mut Reader,
) -> Option<&'n str> {
    let end = reader.required(joint, which)?;
    let link = reader.attribute(end, "link")?;
    if !links.contains(link) {
        let help = did_you_mean(link, links.iter().copied());
        reader.error("W051", end, format!("the model has no link `{link}`"), help);
        return None;
    }
    Some(link)
}

/// Checks that there are one root and no cycles. Returns whether that is so.
fn check_tree(
    root: Node,
    links: &BTreeSet<&str>,
    above: &BTreeMap<&str, (Node, &str)>,
    reader: &mut Reader,
) -> bool {
    // Faulty joints make connected links look disconnected.
    let is_faulty = reader.found.has_errors();
    let mut circles: BTreeSet<&str> = BTreeSet::new();
    for start in links {
        let mut seen = BTreeSet::new();
        let mut link: &str = start;
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
    let roots: Vec<&str> = links
        .iter()
        .copied()
        .filter(|link| !above.contains_key(link))
        .collect();
    if roots.len() > 1 && !is_faulty {
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
    circles.is_empty() && roots.len() == 1
}
