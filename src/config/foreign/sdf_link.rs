//! Reads the links of models in SDF: their solids, material and mass.

use nalgebra::{Isometry3, Translation3};

use crate::foreign::body::{Body, Role};
use crate::foreign::elements::Children;
use crate::foreign::geometry::{Shapes, check_volume};
use crate::foreign::inclusions::Inclusions;
use crate::foreign::sdf_inertial::{self, CollisionSolid};
use crate::foreign::sdf_pose::pose;
use crate::foreign::sdf_robot_include::SdfFile;
use crate::foreign::sdf_surface::Surface;
use crate::foreign::xml::{self, Bound, Node, Reader};
use crate::foreign::{sdf_robot_link, seen};
use actcheck_data::{ModelTree, Part, Pose, SeenLink, SeenPart, Shape, TreeLink};

/// Thickness of the plate that a plane becomes. Unit: metres.
const PLANE_M: f64 = 0.02;
pub(super) const LINK: Children = Children {
    read: &[
        "pose",
        "inertial",
        "collision",
        "visual",
        "gravity",
        "kinematic",
        "velocity_decay",
        // The reader of models reads `self_collide`; the simulation has no wind.
        "self_collide",
        "enable_wind",
        "must_be_base_link",
    ],
    harmless: &[
        "sensor",
        "light",
        "audio_sink",
        "audio_source",
        "battery",
        "particle_emitter",
        "projector",
    ],
    refused: &[],
};
pub(super) const COLLISION: Children = Children {
    read: &[
        "pose",
        "geometry",
        "surface",
        "max_contacts",
        "laser_retro",
        "density",
        "drake_proximity_properties",
    ],
    harmless: &["auto_inertia_params"],
    refused: &[],
};
const DECAY: Children = Children {
    read: &["linear", "angular"],
    harmless: &[],
    refused: &[],
};

/// Reads a link at a pose, of a model that never moves if `fixed`.
pub(crate) fn read(
    link: Node,
    at: &Isometry3<f64>,
    (role, fixed): (Role, bool),
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> Body {
    LINK.check(link, reader);
    let mut body = Body {
        fixed,
        ..Body::default()
    };
    if !fixed {
        let why = "a link without gravity can't be simulated";
        check_motion(link, "gravity", true, why, reader);
        let why = "a kinematic link can't be simulated";
        check_motion(link, "kinematic", false, why, reader);
        if let Some(decay) = xml::child(link, "velocity_decay") {
            check_drag(decay, reader);
        }
    }
    let mut solids = Vec::new();
    for collision in xml::children(link, "collision")
        .filter(|collision| role == Role::Object || plane(*collision).is_none())
    {
        solids.extend(read_collision(
            collision,
            at,
            (role, fixed),
            &mut body,
            shapes,
            reader,
        ));
    }
    // A static object, too, states a mass.
    if role == Role::Object {
        let mass = sdf_inertial::read(link, at, &solids, reader);
        body.has_unknown_mass =
            mass.is_none() && (xml::child(link, "inertial").is_some() || !solids.is_empty());
        body.masses.extend(mass);
    }
    if shapes.seen.is_some() {
        body.seen = look(link, at, &solids, shapes, reader);
    }
    body.parts = solids
        .into_iter()
        .map(|solid| Part {
            pose: Pose::from_isometry(&solid.at),
            shape: solid.shape,
        })
        .collect();
    body
}

/// Reads the appearance of a link: its visual shapes, or its collision shapes if it has none or one
/// has a fault.
fn look(
    link: Node,
    at: &Isometry3<f64>,
    solids: &[CollisionSolid],
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> SeenLink {
    let mut tree = ModelTree::default();
    let file = SdfFile {
        lookup: shapes.lookup,
        path: shapes.path,
        inclusions: Inclusions::default(),
    };
    let (visuals, faults) = reader.aside(|reader| {
        let meshes = &mut tree.inline_meshes;
        let visuals = xml::children(link, "visual");
        visuals
            .map(|visual| sdf_robot_link::solid(visual, "", &file, meshes, reader))
            .collect::<Option<Vec<_>>>()
    });
    let link = TreeLink {
        visuals: visuals.unwrap_or_default(),
        ..TreeLink::frame(String::new(), reader.place(link))
    };
    let Some(shapes) = &mut shapes.seen else {
        return SeenLink::default();
    };
    shapes.report(faults.into_iter().map(seen::as_warning).collect());
    let mut seen = shapes.of_object(&link, &tree);
    if !seen.parts.is_empty() {
        seen.transform(at);
        return seen;
    }
    let collides = |solid: &CollisionSolid| SeenPart {
        part: Part {
            pose: Pose::from_isometry(&solid.at),
            shape: solid.shape.clone(),
        },
        colour: None,
    };
    SeenLink {
        parts: solids.iter().map(collides).collect(),
        has_look: false,
    }
}

fn check_motion(link: Node, name: &str, usual: bool, why: &str, reader: &mut Reader) {
    if let Some(node) = xml::child(link, name)
        && reader.boolean(node).is_some_and(|value| value != usual)
    {
        let help = "write `<static>true</static>` if the model never moves";
        reader.error("W035", node, why.to_owned(), help);
    }
}

/// Reports air drag (W035), unless it is zero.
pub(super) fn check_drag(decay: Node, reader: &mut Reader) {
    DECAY.check(decay, reader);
    for name in ["linear", "angular"] {
        let node = xml::child(decay, name);
        if let Some(node) = node
            && reader
                .number(node, Bound::Finite)
                .is_some_and(|value| value != 0.0)
        {
            let message = "`<velocity_decay>` can't be simulated: there is no air drag".to_owned();
            reader.error("W035", node, message, "remove it, or write 0");
        }
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

fn read_collision<'a>(
    collision: Node<'a>,
    link: &Isometry3<f64>,
    (role, fixed): (Role, bool),
    body: &mut Body,
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> Option<CollisionSolid<'a>> {
    COLLISION.check(collision, reader);
    let at = pose(collision, reader);
    let (at, shape) = match plane(collision).filter(|_| fixed) {
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
    Surface::of(collision, role, reader).add_to(body, collision, role, reader);
    let (at, shape) = (at?, shape?);
    check_volume(&shape, collision, reader);
    Some(CollisionSolid {
        collision,
        shape,
        at: link * at,
    })
}
