//! Reads SDF models, Gazebo's format.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Translation3};

use crate::foreign::body::{Body, Mass, is_possible};
use crate::foreign::geometry::{Shapes, check_volume};
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::nested::{Links, Role};
use crate::foreign::sdf_pose::pose;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::{Part, Pose, Shape};

/// Supported minor versions of SDF 1.
const VERSIONS: std::ops::RangeInclusive<u32> = 3..=12;

/// Thickness of the plate that a plane becomes. Unit: metres.
const PLANE_M: f64 = 0.02;

/// A model read from SDF or URDF.
pub(crate) struct SdfModel {
    pub(crate) body: Body,
    /// Pose of the model's origin in the file.
    pub(crate) pose: Isometry3<f64>,
    /// Whether the file says that it never moves.
    pub(crate) is_static: bool,
    /// Digest of the file and its meshes.
    pub(crate) digest: String,
}

/// Reads the model of an SDF file and its faults, included in `depth` others. The model is `None`
/// if there are errors.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
    role: Role,
    depth: usize,
) -> (Option<SdfModel>, Diagnostics) {
    let text = repaired(&source.text);
    let document = match xml::parse_model(source, &text) {
        Ok(document) => document,
        Err(faults) => return (None, faults),
    };
    let mut reader = Reader::new(source);
    let mut shapes = Shapes {
        depth,
        ..Shapes::new(lookup, path)
    };
    shapes.digest.update(source.text.as_bytes());
    let model = root_model(document.root_element(), &mut reader);
    let read = model.map(|model| {
        let pose = pose(model, &mut reader).unwrap_or_default();
        let body = read_model(model, role, &mut shapes, &mut reader);
        // Of furniture, every body is fixed.
        let is_static = if role == Role::Object {
            body.fixed
        } else {
            is_static(model, &mut reader)
        };
        (body, pose, is_static)
    });
    let found = reader.found;
    let complete = read.filter(|_| !found.has_errors());
    let digest = shapes.digest.finish();
    (
        complete.map(|(body, pose, is_static)| SdfModel {
            body,
            pose,
            is_static,
            digest,
        }),
        found,
    )
}

/// Returns the only model of a document.
fn root_model<'a>(root: Node<'a>, reader: &mut Reader) -> Option<Node<'a>> {
    check_version(root, reader)?;
    let models: Vec<Node> = xml::children(root, "model").collect();
    match models.as_slice() {
        [model] => Some(*model),
        [] => {
            let message = "the file contains no `<model>`".to_owned();
            reader.error(
                "W032",
                root,
                message,
                "a file with a `<world>` belongs in the folder `worlds`",
            );
            None
        }
        [_, second, ..] => {
            let message = format!("the file contains {} models", models.len());
            reader.error(
                "W032",
                *second,
                message,
                "give each model a folder of its own",
            );
            None
        }
    }
}

/// Returns `Some` if the root is SDF of a supported version; otherwise reports W032.
pub(crate) fn check_version(root: Node, reader: &mut Reader) -> Option<()> {
    if root.tag_name().name() != "sdf" {
        let message = format!(
            "the root is `<{}>` instead of `<sdf>`",
            root.tag_name().name()
        );
        reader.error(
            "W032",
            root,
            message,
            "an SDF file begins with `<sdf version=\"1.6\">`",
        );
        return None;
    }
    let version = reader.attribute(root, "version")?;
    let minor = version
        .strip_prefix("1.")
        .and_then(|minor| minor.parse::<u32>().ok());
    if minor.is_some_and(|minor| VERSIONS.contains(&minor)) {
        return Some(());
    }
    let message = format!("SDF {version} is not supported");
    reader.error(
        "W032",
        root,
        message,
        format!(
            "use a version from 1.{} to 1.{}",
            VERSIONS.start(),
            VERSIONS.end()
        ),
    );
    None
}

/// Reads a model's links, with those of nested and included models, as one body and those that
/// joints move.
pub(crate) fn read_model(
    model: Node,
    role: Role,
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> Body {
    let fixed = role == Role::Furniture || is_static(model, reader);
    let links = Links::of(model, role, reader);
    let assembly = links.assembly(role, fixed, reader);
    let fixed = fixed || links.is_anchored();
    links.check_connected(fixed, reader);
    let mut bodies = assembly.empty_bodies(fixed);
    for (idx, (link, at)) in links.links.iter().enumerate() {
        read_link(
            *link,
            at,
            role,
            &mut bodies[assembly.body_of(idx)],
            shapes,
            reader,
        );
    }
    let names: Vec<&str> = links
        .links
        .iter()
        .map(|(link, _)| link.attribute("name").unwrap_or_default())
        .collect();
    let mut body = assembly.attach(bodies, &names, &mut reader.found);
    links.read_included(role, &mut body, shapes, reader);
    if body.parts.is_empty() && role == Role::Object && !reader.found.has_errors() {
        let message =
            "the model has no solid shape: none of its links has a `<collision>`".to_owned();
        reader.error(
            "W038",
            model,
            message,
            "give a link a `<collision>`; a `<visual>` does not collide",
        );
    }
    body
}

/// Whether an element says that its model never moves.
pub(crate) fn is_static(model: Node, reader: &mut Reader) -> bool {
    xml::child(model, "static").is_some_and(|node| reader.boolean(node).unwrap_or(false))
}

fn read_link(
    link: Node,
    model: &Isometry3<f64>,
    role: Role,
    body: &mut Body,
    shapes: &mut Shapes,
    reader: &mut Reader,
) {
    const KNOWN: [&str; 10] = [
        "pose",
        "inertial",
        "collision",
        "visual",
        "gravity",
        "kinematic",
        "velocity_decay",
        "self_collide",
        "enable_wind",
        "must_be_base_link",
    ];
    reader.warn_about_unknown_children(link, &KNOWN);
    let Some(at) = pose(link, reader).map(|pose| model * pose) else {
        return;
    };
    for (name, usual, message) in [
        ("gravity", true, "a link without gravity can't be simulated"),
        ("kinematic", false, "a kinematic link can't be simulated"),
    ] {
        if let Some(node) = xml::child(link, name)
            && reader.boolean(node).is_some_and(|value| value != usual)
            && !body.fixed
        {
            reader.error(
                "W035",
                node,
                message.to_owned(),
                "write `<static>true</static>` if the model never moves",
            );
        }
    }
    if let (Some(decay), Role::Object) = (xml::child(link, "velocity_decay"), role) {
        let message = "`<velocity_decay>` is ignored: the simulation has no air drag".to_owned();
        reader.warning("W036", decay, message, "the model works without it");
    }
    let before = body.parts.len();
    for collision in xml::children(link, "collision")
        .filter(|collision| role == Role::Object || plane(*collision).is_none())
    {
        read_collision(collision, &at, body, shapes, reader);
    }
    match xml::child(link, "inertial").filter(|_| role == Role::Object) {
        Some(inertial) => {
            if let Some(mass) = read_inertial(inertial, &at, reader) {
                body.masses.push(mass);
            } else {
                body.has_unknown_mass = true;
            }
        }
        None => body.has_unknown_mass |= body.parts.len() > before,
    }
}

/// Returns the plane that a `<collision>` is.
fn plane(collision: Node<'_>) -> Option<Node<'_>> {
    xml::child(collision, "geometry").and_then(|geometry| xml::child(geometry, "plane"))
}

/// Reads a plane of a model that never moves, as a plate.
fn read_plane(plane: Node, reader: &mut Reader) -> Option<Shape> {
    let [x, y] = match xml::child(plane, "size") {
        Some(size) => reader.numbers(size, xml::text(size), Bound::Positive)?,
        None => [1.0; 2],
    };
    if let Some(normal) = xml::child(plane, "normal") {
        let [x, y, z] = reader.numbers(normal, xml::text(normal), Bound::Finite)?;
        if x != 0.0 || y != 0.0 || z <= 0.0 {
            let message = "a plane that is not level can't be simulated".to_owned();
            reader.error(
                "W035",
                normal,
                message,
                "turn the `<pose>` of the collision instead",
            );
            return None;
        }
    }
    Some(Shape::Box {
        size: [x, y, PLANE_M],
    })
}

fn read_collision(
    collision: Node,
    link: &Isometry3<f64>,
    body: &mut Body,
    shapes: &mut Shapes,
    reader: &mut Reader,
) {
    reader.warn_about_unknown_children(
        collision,
        &["pose", "geometry", "surface", "max_contacts", "laser_retro"],
    );
    let at = pose(collision, reader);
    let (at, shape) = match plane(collision).filter(|_| body.fixed) {
        Some(plane) => (
            at.map(|at| at * Translation3::new(0.0, 0.0, -PLANE_M / 2.0)),
            read_plane(plane, reader),
        ),
        None => (
            at,
            reader
                .required(collision, "geometry")
                .and_then(|geometry| shapes.sdf(geometry, reader)),
        ),
    };
    if let Some(surface) = xml::child(collision, "surface") {
        read_surface(surface, body, reader);
    }
    let (Some(at), Some(shape)) = (at, shape) else {
        return;
    };
    check_volume(&shape, collision, reader);
    body.parts.push(Part {
        pose: Pose::from_isometry(&(link * at)),
        shape,
    });
}

fn read_surface(surface: Node, body: &mut Body, reader: &mut Reader) {
    reader.warn_about_unknown_children(surface, &["friction", "bounce"]);
    if let Some(friction) = xml::child(surface, "friction") {
        reader.warn_about_unknown_children(friction, &["ode"]);
    }
    if let Some(ode) =
        xml::child(surface, "friction").and_then(|friction| xml::child(friction, "ode"))
    {
        reader.warn_about_unknown_children(ode, &["mu", "mu2"]);
        let mut coefficient =
            |name| xml::child(ode, name).and_then(|node| reader.number(node, Bound::NotNegative));
        let (along, across) = (coefficient("mu"), coefficient("mu2"));
        if let (Some(along), Some(across)) = (along, across)
            && along != across
        {
            let message = format!(
                "friction can't depend on the direction: {along} is used and {across} is ignored"
            );
            reader.warning(
                "W036",
                ode,
                message,
                "give `<mu>` and `<mu2>` the same value",
            );
        }
        set("friction", &mut body.friction, along, ode, reader);
    }
    if let Some(bounce) = xml::child(surface, "bounce") {
        reader.warn_about_unknown_children(bounce, &["restitution_coefficient"]);
        let coefficient = xml::child(bounce, "restitution_coefficient");
        let value = coefficient.and_then(|node| reader.number(node, Bound::NotNegative));
        set(
            "restitution",
            &mut body.restitution,
            value.map(|value| value.min(1.0)),
            bounce,
            reader,
        );
    }
}

/// Sets a material parameter of the body. The first value is used; others are ignored with a
/// warning.
fn set(what: &str, place: &mut Option<f64>, value: Option<f64>, node: Node, reader: &mut Reader) {
    match (*place, value) {
        (None, Some(_)) => *place = value,
        (Some(known), Some(other)) if known != other => {
            let message =
                format!("a body has only one {what}: {known} is used and {other} is ignored");
            reader.warning(
                "W036",
                node,
                message,
                "give all its collisions the same value, or split it into two models",
            );
        }
        _ => {}
    }
}

/// Reads the mass of a link; `None` if it has none.
fn read_inertial(inertial: Node, link: &Isometry3<f64>, reader: &mut Reader) -> Option<Mass> {
    reader.warn_about_unknown_children(inertial, &["mass", "pose", "inertia"]);
    let at = link * pose(inertial, reader)?;
    let kg = reader.number(xml::child(inertial, "mass")?, Bound::Positive)?;
    let moments = xml::child(inertial, "inertia").and_then(|inertia| read_inertia(inertia, reader));
    let turn = at.rotation.to_rotation_matrix();
    let about_com = moments.map(|moments| turn.matrix() * moments * turn.matrix().transpose());
    Some(Mass {
        kg,
        com: at.translation.vector,
        about_com,
    })
}

fn read_inertia(inertia: Node, reader: &mut Reader) -> Option<Matrix3<f64>> {
    let mut entry = |name: &str, default| match xml::child(inertia, name) {
        Some(node) => reader.number(node, Bound::Finite),
        None => Some(default),
    };
    let (xx, yy, zz) = (entry("ixx", 1.0)?, entry("iyy", 1.0)?, entry("izz", 1.0)?);
    let (xy, xz, yz) = (entry("ixy", 0.0)?, entry("ixz", 0.0)?, entry("iyz", 0.0)?);
    let moments = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    possible(moments, inertia, reader)
}

/// Returns the moments of inertia if they are possible. Otherwise warns (W036) and returns `None`:
/// they are then computed from the shapes.
pub(crate) fn possible(
    moments: Matrix3<f64>,
    inertia: Node,
    reader: &mut Reader,
) -> Option<Matrix3<f64>> {
    if is_possible(&moments) {
        return Some(moments);
    }
    let message =
        "these moments of inertia are impossible: they are computed from the shapes instead"
            .to_owned();
    reader.warning(
        "W036",
        inertia,
        message,
        "each principal moment must be above 0 and at most the sum of the other two",
    );
    None
}
