//! Reads a robot in SDF, Gazebo's format: links, joints, collisions and inertias of one
//! model.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix3};

use crate::foreign::sdf::check_version;
use crate::foreign::sdf_joint;
use crate::foreign::sdf_pose::pose;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, Source, did_you_mean};
use actcheck_data::{
    ModelTree, TreeGeometry, TreeInertial, TreeJoint, TreeLink, TreeMimic, TreeMotion, TreeSolid,
};

/// Limits beyond this are none. Units: metres or radians.
const UNLIMITED: f64 = 1e6;
/// Range of an unlimited sliding joint. Unit: metres.
const SLIDES_M: f64 = 10.0;
/// Largest effort and velocity of a joint without them.
const EFFORT: f64 = 100.0;
const VELOCITY: f64 = 2.0;

/// Reads the tree of a text.
///
/// # Errors
/// Faults of the text: W031 to W035, W051, W055.
pub(crate) fn tree(source: &Source) -> Result<ModelTree, Diagnostics> {
    let document = xml::parse_model(source, &source.text)?;
    let mut reader = Reader::new(source);
    let root = document.root_element();
    let tree = convert(root, &mut reader);
    reader.found.or(())?;
    Ok(tree.unwrap_or_default())
}

fn convert(root: Node, reader: &mut Reader) -> Option<ModelTree> {
    check_version(root, reader)?;
    let models = root
        .descendants()
        .filter(|node| node.tag_name().name() == "model");
    let robot = models.max_by_key(|model| xml::children(*model, "joint").count());
    let Some(model) = robot else {
        reader.error(
            "W032",
            root,
            "the file contains no `<model>`".to_owned(),
            "a robot is a `<model>` with joints",
        );
        return None;
    };
    let mut links: BTreeMap<&str, (Node, Isometry3<f64>)> = BTreeMap::new();
    for link in xml::children(model, "link") {
        let name = reader.attribute(link, "name")?;
        links.insert(name, (link, pose(link, reader)?));
    }
    if links.is_empty() {
        reader.error(
            "W051",
            model,
            "the robot has no links".to_owned(),
            "add `<link name=\"base_link\"/>`",
        );
        return None;
    }
    // The frame of a link in URDF is that of its joint.
    let mut frames: BTreeMap<&str, Isometry3<f64>> =
        links.iter().map(|(name, (_, at))| (*name, *at)).collect();
    let mut joints: Vec<(Node, &str, &str)> = Vec::new();
    for joint in xml::children(model, "joint") {
        let (parent, child) = (end(joint, "parent", reader)?, end(joint, "child", reader)?);
        let is_unknown = |name: &&str| *name != "world" && !links.contains_key(name);
        if let Some(name) = [parent, child].into_iter().find(is_unknown) {
            let help = did_you_mean(name, links.keys().copied());
            reader.error("W051", joint, format!("there is no link `{name}`"), help);
            return None;
        }
        if parent == "world" {
            continue;
        }
        if let Some((_, at)) = links.get(child) {
            frames.insert(child, at * pose(joint, reader)?);
        }
        joints.push((joint, parent, child));
    }
    let mut out = ModelTree {
        name: model.attribute("name").unwrap_or("robot").to_owned(),
        ..ModelTree::default()
    };
    for (name, (link, at)) in &links {
        let shift = frames[name].inverse() * at;
        out.links.push(read_link(*link, name, &shift, reader)?);
    }
    for (joint, parent, child) in &joints {
        out.joints.push(read_joint(
            *joint,
            [parent, child],
            [&frames[parent], &frames[child]],
            reader,
        )?);
    }
    tie_roots(&links, &joints, &frames, &mut out);
    Some(out)
}

/// Links without a joint above them are fixed to the first of them, as parts of the same base.
fn tie_roots(
    links: &BTreeMap<&str, (Node, Isometry3<f64>)>,
    joints: &[(Node, &str, &str)],
    frames: &BTreeMap<&str, Isometry3<f64>>,
    out: &mut ModelTree,
) {
    let moved: BTreeSet<&str> = joints.iter().map(|(.., child)| *child).collect();
    // The one with the most joints below it is the robot.
    let mut roots: Vec<&str> = links
        .keys()
        .copied()
        .filter(|name| !moved.contains(name))
        .collect();
    roots.sort_by_key(|root| {
        std::cmp::Reverse(
            joints
                .iter()
                .filter(|(_, parent, _)| parent == root)
                .count(),
        )
    });
    let Some((root, others)) = roots.split_first() else {
        return;
    };
    for other in others {
        let origin = frames[root].inverse() * frames[other];
        let place = out.link(other).map(|link| link.place.clone());
        out.joints.push(TreeJoint::fixed(
            format!("{other}_fixed"),
            [root, other],
            origin,
            place.unwrap_or_default(),
        ));
    }
}

fn end<'a>(joint: Node<'a>, which: &str, reader: &mut Reader) -> Option<&'a str> {
    reader.required(joint, which).map(xml::text)
}

fn read_link(
    link: Node,
    name: &str,
    shift: &Isometry3<f64>,
    reader: &mut Reader,
) -> Option<TreeLink> {
    let mut solids = Vec::new();
    for collision in xml::children(link, "collision") {
        let at = shift * pose(collision, reader)?;
        let geometry = reader.required(collision, "geometry")?;
        solids.push(TreeSolid {
            pose: at,
            geometry: shape(geometry, reader)?,
            matter: None,
            friction: None,
            place: reader.place(collision),
        });
    }
    let inertial = match xml::child(link, "inertial") {
        Some(node) => Some(inertial(node, shift, reader)?),
        None => None,
    };
    Some(TreeLink {
        name: name.to_owned(),
        inertial,
        solids,
        visuals: Vec::new(),
        place: reader.place(link),
    })
}

fn inertial(node: Node, shift: &Isometry3<f64>, reader: &mut Reader) -> Option<TreeInertial> {
    let at = shift * pose(node, reader)?;
    let kg = match xml::child(node, "mass") {
        Some(mass) => reader.number(mass, Bound::Mass)?,
        None => 1.0,
    };
    let mut about_com = Matrix3::identity();
    if let Some(inertia) = xml::child(node, "inertia") {
        for (row, column, name) in [
            (0, 0, "ixx"),
            (0, 1, "ixy"),
            (0, 2, "ixz"),
            (1, 1, "iyy"),
            (1, 2, "iyz"),
            (2, 2, "izz"),
        ] {
            let Some(written) = xml::child(inertia, name) else {
                continue;
            };
            let value = reader.number(written, Bound::Finite)?;
            about_com[(row, column)] = value;
            about_com[(column, row)] = value;
        }
    }
    let inertia = xml::child(node, "inertia");
    Some(TreeInertial {
        pose: at,
        kg,
        about_com,
        place: reader.place(xml::child(node, "mass").unwrap_or(node)),
        moments_place: inertia.map(|inertia| reader.place(inertia)),
    })
}

/// Reads the shape of a `<geometry>`.
fn shape(geometry: Node, reader: &mut Reader) -> Option<TreeGeometry> {
    let Some(kind) = geometry.children().find(Node::is_element) else {
        reader.error(
            "W033",
            geometry,
            "`<geometry>` is empty".to_owned(),
            "add a shape, such as `<box>`",
        );
        return None;
    };
    let mut number = |name: &str| {
        let node = reader.required(kind, name)?;
        reader.number(node, Bound::Length)
    };
    Some(match kind.tag_name().name() {
        "sphere" => TreeGeometry::Sphere {
            radius: number("radius")?,
        },
        "cylinder" => TreeGeometry::Cylinder {
            radius: number("radius")?,
            length: number("length")?,
        },
        "capsule" => TreeGeometry::Capsule {
            radius: number("radius")?,
            length: number("length")?,
        },
        "box" => {
            let size = reader.required(kind, "size")?;
            TreeGeometry::Box {
                size: reader.numbers(size, xml::text(size), Bound::Length)?,
            }
        }
        "ellipsoid" => {
            let radii = reader.required(kind, "radii")?;
            TreeGeometry::Ellipsoid {
                radii: reader.numbers(radii, xml::text(radii), Bound::Length)?,
            }
        }
        "mesh" => {
            let file = reader.required(kind, "uri").map(xml::text)?.to_owned();
            let scale = match xml::child(kind, "scale") {
                Some(scale) => reader.numbers(scale, xml::text(scale), Bound::Finite)?,
                None => [1.0; 3],
            };
            TreeGeometry::Mesh { file, scale }
        }
        other => {
            let message = format!("the shape {other} can't be part of a robot");
            reader.error(
                "W035",
                kind,
                message,
                "use a box, cylinder, capsule, ellipsoid, sphere or mesh",
            );
            return None;
        }
    })
}

fn read_joint(
    joint: Node,
    ends: [&str; 2],
    [from, to]: [&Isometry3<f64>; 2],
    reader: &mut Reader,
) -> Option<TreeJoint> {
    let name = reader.attribute(joint, "name")?;
    let origin = from.inverse() * to;
    let fixed = TreeJoint::fixed(name.to_owned(), ends, origin, reader.place(joint));
    let motion = match reader.attribute(joint, "type")? {
        "fixed" => return Some(fixed),
        "revolute" => TreeMotion::Revolute,
        "continuous" => TreeMotion::Continuous,
        "prismatic" => TreeMotion::Prismatic,
        other => {
            let message =
                format!("the joint `{name}` is of the type {other}, which can't be simulated");
            reader.error(
                "W035",
                joint,
                message,
                "use revolute, continuous, prismatic or fixed",
            );
            return None;
        }
    };
    let axis = reader.required(joint, "axis")?;
    let direction = to.rotation.inverse() * sdf_joint::direction(joint, axis, to.rotation, reader)?;
    let limits = xml::child(axis, "limit");
    let mut limit =
        |name: &str, otherwise: f64| match limits.and_then(|limits| xml::child(limits, name)) {
            Some(node) => reader.number(node, Bound::Finite),
            None => Some(otherwise),
        };
    let range = [limit("lower", -1e16)?, limit("upper", 1e16)?];
    let (effort, velocity) = (limit("effort", EFFORT)?, limit("velocity", VELOCITY)?);
    let damping = xml::child(axis, "dynamics").and_then(|dynamics| xml::child(dynamics, "damping"));
    let damping = match damping {
        Some(node) => reader.number(node, Bound::NotNegative)?,
        None => 0.0,
    };
    let is_open = range.iter().any(|end| end.abs() > UNLIMITED);
    let (motion, [lower, upper]) = match (is_open, motion) {
        (true, TreeMotion::Prismatic) => (motion, [-SLIDES_M, SLIDES_M]),
        (true, _) | (_, TreeMotion::Continuous) => {
            (TreeMotion::Continuous, [f64::NEG_INFINITY, f64::INFINITY])
        }
        (false, _) => (motion, range),
    };
    // Negative values mean that there is none.
    let stated = |value: f64, otherwise: f64| if value > 0.0 { value } else { otherwise };
    Some(TreeJoint {
        motion,
        axis: direction,
        lower,
        upper,
        effort: stated(effort, EFFORT),
        velocity: stated(velocity, VELOCITY),
        damping,
        mimic: mimic(axis, reader),
        ..fixed
    })
}

/// The joint that a joint follows, in SDF 1.11 and later.
fn mimic(axis: Node, reader: &mut Reader) -> Option<TreeMimic> {
    let mimic = xml::child(axis, "mimic")?;
    let leader = mimic.attribute("joint")?.to_owned();
    let mut number = |name: &str, otherwise: f64| match xml::child(mimic, name) {
        Some(node) => reader.number(node, Bound::Finite).unwrap_or(otherwise),
        None => otherwise,
    };
    let (factor, offset) = (number("multiplier", 1.0), number("offset", 0.0));
    let offset = offset - factor * number("reference", 0.0);
    Some(TreeMimic {
        leader,
        factor,
        offset,
        place: reader.place(mimic),
    })
}
