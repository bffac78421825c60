//! Makes an object of a model's tree: its bodies, and the joints that move them.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3};

use crate::foreign::assembly::{Assembly, Join};
use crate::foreign::body::{Body, Mass, SdfModel, is_possible};
use crate::foreign::frames::{Frame, OWN};
use crate::foreign::geometry::{Shapes, report_volume};
use crate::foreign::xml;
use actcheck_base::{Diagnostic, Diagnostics, SourceSpan};
use actcheck_data::{
    ModelTree, Part, PartJoint, Pose, Shape, TreeGeometry, TreeJoint, TreeLink, TreeMotion,
    TreeSolid,
};

/// Longest chain of links; a longer one is a cycle.
const LONGEST_CHAIN: usize = 256;
/// Friction coefficient of geoms without one: MuJoCo's default.
const FRICTION: f64 = 1.0;

/// Makes an object of the tree of an MJCF file, and reports its faults. The object is `None` if
/// there are errors. A body without shapes is one that is only seen.
pub(crate) fn read(tree: &ModelTree, shapes: &mut Shapes) -> (Option<SdfModel>, Diagnostics) {
    let mut found = Diagnostics::new();
    let material = |members: &[usize], body: &mut Body, found: &mut Diagnostics| {
        let solids = members.iter().flat_map(|link| &tree.links[*link].solids);
        body.friction = friction(&solids.collect::<Vec<_>>(), found);
    };
    let (body, frames) = body(tree, shapes, false, material, &mut found);
    if found.has_errors() {
        return (None, found);
    }
    let digest = shapes.digest.clone().finish();
    let model = SdfModel {
        body,
        frames,
        pose: Isometry3::identity(),
        is_static: false,
        digest,
    };
    (Some(model), found)
}

/// Makes the body of a tree, with those that joints move, and reports its faults. `is_static`: it
/// never moves. `material` gives a body its material; its links are named by their indices. Also
/// returns the frames of the links, each with the body that carries it.
pub(crate) fn body(
    tree: &ModelTree,
    shapes: &mut Shapes,
    is_static: bool,
    mut material: impl FnMut(&[usize], &mut Body, &mut Diagnostics),
    found: &mut Diagnostics,
) -> (Body, BTreeMap<String, Frame>) {
    let index: BTreeMap<&str, usize> = tree
        .links
        .iter()
        .enumerate()
        .map(|(idx, link)| (link.name.as_str(), idx))
        .collect();
    let above: BTreeMap<&str, &TreeJoint> = tree
        .joints
        .iter()
        .rev()
        .map(|joint| (joint.child.as_str(), joint))
        .collect();
    let places: Vec<Option<Isometry3<f64>>> = tree
        .links
        .iter()
        .map(|link| place(link, &above, found))
        .collect();
    let mut joins = Vec::new();
    for joint in &tree.joints {
        let ends = [&joint.parent, &joint.child].map(|name| index.get(name.as_str()).copied());
        let [Some(parent), Some(child)] = ends else {
            continue;
        };
        let moves = match (joint.motion, &places[child]) {
            (TreeMotion::Fixed, _) => None,
            (_, Some(at)) => match part_joint(joint, at) {
                Some(moves) => Some(moves),
                None => continue,
            },
            (_, None) => continue,
        };
        joins.push(Join {
            place: joint.place.clone(),
            parent,
            child,
            joint: moves,
        });
    }
    let assembly = Assembly::of(tree.links.len(), &joins, found);
    let mut bodies = assembly.empty_bodies(is_static);
    let mut meshes = BTreeMap::new();
    for (idx, (link, at)) in tree.links.iter().zip(&places).enumerate() {
        if let Some(at) = at {
            let body = &mut bodies[assembly.body_of(idx)];
            read_link((link, at), tree, body, &mut meshes, shapes, found);
        }
    }
    for (idx, body) in bodies.iter_mut().enumerate() {
        let own = (0..tree.links.len()).filter(|link| assembly.body_of(*link) == idx);
        material(&own.collect::<Vec<_>>(), body, found);
    }
    let names: Vec<&str> = tree.links.iter().map(|link| link.name.as_str()).collect();
    let (whole, parts) = assembly.attach(bodies, &names, found);
    let mut frames = BTreeMap::new();
    for (idx, (name, at)) in names.iter().zip(&places).enumerate() {
        let body = assembly.body_of(idx);
        let carrier = match parts[body] {
            Some(part) => Some(whole.moving[part].name.clone()),
            None if body == 0 => Some(OWN.to_owned()),
            None => None,
        };
        if let (Some(pose), Some(link)) = (at, carrier) {
            let (pose, link) = (*pose, Some(link));
            frames.insert((*name).to_owned(), Frame { pose, link });
        }
    }
    (whole, frames)
}

/// The friction of a body: the largest of its shapes, as one number.
fn friction(solids: &[&TreeSolid], found: &mut Diagnostics) -> Option<f64> {
    let solids = || solids.iter().copied();
    if solids().all(|solid| solid.friction.is_none()) {
        return None;
    }
    let of = |solid: &TreeSolid| solid.friction.unwrap_or(FRICTION);
    let most = solids().map(of).fold(0.0, f64::max);
    if let Some(other) = solids().find(|solid| of(solid) < most) {
        let message = format!(
            "this geom has the friction {}, but its body has one friction here: the largest, {most}",
            of(other)
        );
        warn(
            found,
            message,
            &other.place,
            "give all geoms the same `friction`",
        );
    }
    Some(most)
}

fn warn(found: &mut Diagnostics, message: String, at: &SourceSpan, help: &str) {
    found.push(
        Diagnostic::warning("W036", message)
            .at(&at.source, xml::tag(at))
            .help(help),
    );
}

/// Returns the pose of a link relative to the root, through its chain of joints.
/// `above` are the joints by their children.
fn place(
    link: &TreeLink,
    above: &BTreeMap<&str, &TreeJoint>,
    found: &mut Diagnostics,
) -> Option<Isometry3<f64>> {
    let mut at = Isometry3::identity();
    let mut name = link.name.as_str();
    for _ in 0..LONGEST_CHAIN {
        let Some(joint) = above.get(name) else {
            return Some(at);
        };
        at = joint.origin * at;
        name = &joint.parent;
    }
    let error = Diagnostic::error("W035", "the link's joints form a cycle")
        .at(&link.place.source, xml::tag(&link.place));
    found.push(error.help("links form one tree"));
    None
}

/// Returns the motion of a part by a joint; `None` if its kind can't be simulated, which has been
/// reported.
fn part_joint(joint: &TreeJoint, at: &Isometry3<f64>) -> Option<PartJoint> {
    let slides = match joint.motion {
        TreeMotion::Prismatic => true,
        TreeMotion::Revolute | TreeMotion::Continuous => false,
        _ => return None,
    };
    let axis = (at.rotation * joint.axis).try_normalize(1e-9)?;
    Some(PartJoint {
        slides,
        axis: axis.into(),
        anchor_m: at.translation.vector.into(),
        range: [joint.lower, joint.upper],
        damping: joint.damping.max(0.0),
        friction: joint.friction.max(0.0),
    })
}

fn read_link(
    (link, at): (&TreeLink, &Isometry3<f64>),
    tree: &ModelTree,
    body: &mut Body,
    meshes: &mut BTreeMap<String, Vec<Shape>>,
    shapes: &mut Shapes,
    found: &mut Diagnostics,
) {
    if let Some(shapes) = &mut shapes.seen {
        let mut seen = shapes.of_object(link, tree);
        seen.transform(at);
        body.seen.add(seen);
    }
    for solid in &link.solids {
        shapes.load(solid, tree, meshes, found);
    }
    for solid in &link.solids {
        let Some(shape) = shape(&solid.geometry, meshes) else {
            continue;
        };
        report_volume(&shape, &solid.place, found);
        body.parts.push(Part {
            pose: Pose::from_isometry(&(at * solid.pose)),
            shape,
        });
    }
    let Some(stated) = link.inertial.as_ref().filter(|stated| stated.kg > 0.0) else {
        body.has_unknown_mass |= !link.solids.is_empty();
        return;
    };
    let pose = at * stated.pose;
    let turned = pose.rotation.to_rotation_matrix();
    let about_com = turned.matrix() * stated.about_com * turned.matrix().transpose();
    let possible = is_possible(&about_com);
    // A file that states no moments gets no warning about them.
    let is_unstated = stated.moments_place.is_none() && stated.about_com == Matrix3::zeros();
    if !possible && !is_unstated {
        let message =
            "these moments of inertia are impossible: they are computed from the shapes instead";
        let place = stated.moments_place.as_ref().unwrap_or(&stated.place);
        let help = "each principal moment must be above 0 and at most the sum of the other two";
        warn(found, message.to_owned(), place, help);
    }
    body.masses.push(Mass {
        kg: stated.kg,
        com: pose.translation.vector,
        about_com: possible.then_some(about_com),
    });
}

/// Returns the shape of a geometry; `None` if its mesh has a fault, which has been reported.
fn shape(geometry: &TreeGeometry, meshes: &BTreeMap<String, Vec<Shape>>) -> Option<Shape> {
    match geometry {
        TreeGeometry::Mesh { file, scale } => Some(meshes.get(file)?.first()?.scaled(*scale)),
        primitive => primitive.solid(),
    }
}
