//! Reads the links of robots in SDF: their masses and shapes.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3};

use crate::foreign::body::Role;
use crate::foreign::colours;
use crate::foreign::elements::{Children, refuse_switch};
use crate::foreign::geometry::{PrimitiveShape, Shapes, check_scale, cone, kind_of, sdf_primitive};
use crate::foreign::sdf_inertial::{self, CollisionSolid, INERTIAL};
use crate::foreign::sdf_link::{COLLISION, LINK, check_drag};
use crate::foreign::sdf_pose::pose;
use crate::foreign::sdf_robot_include::SdfFile;
use crate::foreign::sdf_robot_model::LinkAt;
use crate::foreign::sdf_surface::Surface;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_data::{Mesh, Shape, TreeColour, TreeGeometry, TreeInertial, TreeLink, TreeSolid};

/// Mass of a link without one, in SDF; its moments are 1 kg·m². Unit: kilograms.
const USUAL_KG: f64 = 1.0;
const MESH: Children = Children {
    read: &["uri", "scale"],
    harmless: &["convex_decomposition"],
    refused: &["submesh"],
};

/// Reads a link, at the origin. Shapes without a mesh file get entries in `meshes`.
pub(crate) fn read(
    link: Node,
    name: &str,
    file: &SdfFile,
    meshes: &mut BTreeMap<String, Mesh>,
    reader: &mut Reader,
) -> LinkAt {
    LINK.check(link, reader);
    check_motion(link, reader);
    let mut solids = Vec::new();
    for collision in xml::children(link, "collision") {
        COLLISION.check(collision, reader);
        // Wheels have frictions that depend on the direction; a robot here does not drive by them.
        let surface = Surface::of(collision, Role::Furniture, reader);
        if surface
            .restitution
            .is_some_and(|restitution| restitution > 0.0)
        {
            let message = "a robot's link that bounces can't be simulated".to_owned();
            let node = xml::child(collision, "surface").unwrap_or(collision);
            reader.error("W035", node, message, "remove its `<bounce>`");
        }
        let solid = solid(collision, name, file, meshes, reader);
        solids.extend(solid.map(|solid| {
            (
                collision,
                TreeSolid {
                    friction: surface.friction,
                    ..solid
                },
            )
        }));
    }
    let (visuals, faults) = reader.aside(|reader| {
        let visuals = xml::children(link, "visual");
        let visuals = visuals.filter_map(|visual| solid(visual, name, file, meshes, reader));
        visuals.collect::<Vec<_>>()
    });
    let collides = xml::child(link, "self_collide").and_then(|node| reader.boolean(node));
    let inertial = inertial(link, &solids, file, reader);
    let (lacks_mass, lacks_moments) = unstated(link);
    LinkAt {
        at: Isometry3::identity(),
        link: TreeLink {
            name: name.to_owned(),
            inertial,
            solids: solids.into_iter().map(|(_, solid)| solid).collect(),
            visuals,
            place: reader.place(link),
        },
        model: String::new(),
        collides,
        faults_of_visuals: Some(faults).filter(|faults| !faults.is_empty()),
        lacks_mass,
        lacks_moments,
    }
}

/// Reports motions by other forces than a robot's motors (W035).
fn check_motion(link: Node, reader: &mut Reader) {
    let why = "a kinematic link can't be simulated";
    refuse_switch(link, "kinematic", false, why, reader);
    if let Some(decay) = xml::child(link, "velocity_decay") {
        check_drag(decay, reader);
    }
    if let Some(gravity) = xml::child(link, "gravity")
        && reader.boolean(gravity) == Some(false)
    {
        let message = "`<gravity>` of a robot's link is ignored".to_owned();
        let help = "the model works without it: motors carry the weight of their robot";
        reader.warning("W036", gravity, message, help);
    }
}

/// The colour of a `<visual>`: its material's in diffuse or, without one, ambient light. Reports one
/// that is not made of numbers (W036).
fn colour(visual: Node, reader: &mut Reader) -> Option<TreeColour> {
    let material = xml::child(visual, "material")?;
    let light = ["diffuse", "ambient"]
        .into_iter()
        .find_map(|name| xml::child(material, name))?;
    let colour = colours::numbers(xml::text(light)).and_then(|numbers| colours::whole(&numbers));
    if colour.is_none() {
        let message = format!(
            "`<{}>` is ignored: it must be three or four numbers, but is `{}`",
            light.tag_name().name(),
            xml::short(xml::text(light))
        );
        reader.warning("W036", light, message, colours::NO_EFFECT);
    }
    colour
}

/// Reads a shape; `None` if it has none, or after a fault.
pub(super) fn solid(
    node: Node,
    link: &str,
    file: &SdfFile,
    meshes: &mut BTreeMap<String, Mesh>,
    reader: &mut Reader,
) -> Option<TreeSolid> {
    let pose = pose(node, reader);
    let geometry = reader.required(node, "geometry")?;
    let kind = kind_of(geometry, reader)?;
    if kind.tag_name().name() == "empty" {
        return None;
    }
    let geometry = if kind.tag_name().name() == "mesh" {
        mesh(kind, file, reader)?
    } else {
        match sdf_primitive(kind, reader)? {
            PrimitiveShape::Geometry(geometry) => geometry,
            PrimitiveShape::Cone { radius, length } => {
                let name = node.attribute("name").unwrap_or_default();
                let name = format!("{link} {name} ({})", meshes.len());
                meshes.insert(name.clone(), cone(radius, length)?);
                TreeGeometry::Mesh {
                    file: name,
                    scale: [1.0; 3],
                }
            }
        }
    };
    Some(TreeSolid {
        pose: pose?,
        geometry,
        matter: None,
        friction: None,
        colour: colour(node, reader),
        place: reader.place(kind),
    })
}

fn mesh(kind: Node, file: &SdfFile, reader: &mut Reader) -> Option<TreeGeometry> {
    MESH.check(kind, reader);
    let uri = reader.required(kind, "uri").map(xml::text)?;
    let scale = match xml::child(kind, "scale") {
        Some(scale) => reader.numbers(scale, xml::text(scale), Bound::Finite)?,
        None => [1.0; 3],
    };
    check_scale(scale, &reader.place(kind), &mut reader.found)?;
    Some(TreeGeometry::Mesh {
        file: file.mesh(uri),
        scale,
    })
}

/// Reads the mass of a link, or computes it from the volumes of its collisions. Returns `None`
/// after a fault.
fn inertial(
    link: Node,
    solids: &[(Node, TreeSolid)],
    file: &SdfFile,
    reader: &mut Reader,
) -> Option<TreeInertial> {
    let inertial = xml::child(link, "inertial");
    let is_computed = match inertial {
        Some(inertial) => reader.boolean_attribute(inertial, "auto")?,
        None => false,
    };
    if is_computed {
        return computed(inertial?, solids, file, reader);
    }
    sdf_inertial::warn_of_densities(link, inertial, reader);
    match inertial {
        Some(inertial) => stated(inertial, reader),
        None => Some(TreeInertial {
            pose: Isometry3::identity(),
            kg: USUAL_KG,
            about_com: Matrix3::identity(),
            place: reader.place(link),
            moments_place: None,
        }),
    }
}

/// Whether a link states no mass, and whether not all of its moments.
fn unstated(link: Node) -> (bool, bool) {
    let Some(inertial) = xml::child(link, "inertial") else {
        return (true, true);
    };
    if inertial
        .attribute("auto")
        .map(str::trim)
        .and_then(xml::truth)
        == Some(true)
    {
        return (false, false);
    }
    let mass = xml::child(inertial, "mass");
    let is_massless = mass.is_some_and(|mass| xml::text(mass).parse() == Ok(0.0));
    let inertia = xml::child(inertial, "inertia");
    let has = |name| inertia.is_some_and(|inertia| xml::child(inertia, name).is_some());
    let has_moments = ["ixx", "iyy", "izz"].into_iter().all(has);
    (mass.is_none(), !has_moments && !is_massless)
}

fn stated(inertial: Node, reader: &mut Reader) -> Option<TreeInertial> {
    INERTIAL.check(inertial, reader);
    let pose = pose(inertial, reader)?;
    let mass = xml::child(inertial, "mass");
    let kg = match mass {
        Some(mass) => reader.number(mass, Bound::Mass)?,
        None => USUAL_KG,
    };
    let inertia = xml::child(inertial, "inertia");
    let about_com = match inertia {
        Some(inertia) => sdf_inertial::moments(inertia, reader)?,
        None => Matrix3::identity(),
    };
    Some(TreeInertial {
        pose,
        kg,
        about_com,
        place: reader.place(mass.unwrap_or(inertial)),
        moments_place: inertia.map(|inertia| reader.place(inertia)),
    })
}

fn computed(
    inertial: Node,
    solids: &[(Node, TreeSolid)],
    file: &SdfFile,
    reader: &mut Reader,
) -> Option<TreeInertial> {
    INERTIAL.check(inertial, reader);
    let mut shapes = Shapes::new(file.lookup, file.path);
    let mut found = Vec::new();
    for (collision, solid) in solids {
        let shape = match (&solid.geometry, xml::child(*collision, "geometry")) {
            (TreeGeometry::Mesh { .. }, Some(geometry)) => shapes.sdf(geometry, reader)?,
            // The inertia of an ellipsoid follows from its element.
            (geometry, _) => geometry.solid().unwrap_or(Shape::Box { size: [1.0; 3] }),
        };
        found.push(CollisionSolid {
            collision: *collision,
            shape,
            at: solid.pose,
        });
    }
    let mass = sdf_inertial::computed(inertial, &found, reader)?;
    Some(TreeInertial {
        pose: mass.com.into(),
        kg: mass.kg,
        about_com: mass.about_com?,
        place: reader.place(inertial),
        moments_place: None,
    })
}

/// Renames the meshes of a link that have no file.
pub(crate) fn rename_meshes(
    link: &mut TreeLink,
    meshes: &BTreeMap<String, Mesh>,
    changed: impl Fn(&str) -> String,
) {
    for solid in link.solids.iter_mut().chain(&mut link.visuals) {
        if let TreeGeometry::Mesh { file, .. } = &mut solid.geometry
            && meshes.contains_key(file)
        {
            *file = changed(file);
        }
    }
}
