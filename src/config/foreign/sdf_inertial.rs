//! Reads the mass of a link in SDF, or computes it from the link's collisions.

use nalgebra::{Isometry3, Matrix3};

use crate::foreign::body::{Mass, is_possible};
use crate::foreign::elements::Children;
use crate::foreign::geometry::{PrimitiveShape, kind_of, sdf_primitive};
use crate::foreign::sdf_pose::pose;
use crate::foreign::solid_mass::SolidMass;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_data::Shape;

/// Density where none is stated, in SDF: that of water. Unit: kg/m³.
const DENSITY: f64 = 1000.0;
pub(super) const INERTIAL: Children = Children {
    read: &["mass", "pose", "inertia", "density", "auto_inertia_params"],
    harmless: &[],
    refused: &["fluid_added_mass"],
};

/// A collision of a link: its element, shape and pose.
pub(crate) struct CollisionSolid<'a> {
    pub(crate) collision: Node<'a>,
    pub(crate) shape: Shape,
    pub(crate) at: Isometry3<f64>,
}

/// Reads the mass of a link from its `<inertial>`, which states it or leaves it to the volumes of
/// the collisions; `None` if it has none.
pub(crate) fn read(
    link: Node,
    at: &Isometry3<f64>,
    solids: &[CollisionSolid],
    reader: &mut Reader,
) -> Option<Mass> {
    let inertial = xml::child(link, "inertial");
    let is_computed = match inertial {
        Some(inertial) => reader.boolean_attribute(inertial, "auto")?,
        None => false,
    };
    if !is_computed {
        warn_of_densities(link, inertial, reader);
    }
    let inertial = inertial?;
    INERTIAL.check(inertial, reader);
    if is_computed {
        computed(inertial, solids, reader)
    } else {
        let mut mass = stated(inertial, at, solids.is_empty(), reader)?;
        if mass.about_com.is_none() && xml::child(inertial, "pose").is_some() {
            mass.about_com = of_solids(solids, mass.kg);
        }
        Some(mass)
    }
}

/// Computes the moments of a link with a stated mass and centre from its solids. Returns `None` if
/// one of them has no volume.
fn of_solids(solids: &[CollisionSolid], kg: f64) -> Option<Matrix3<f64>> {
    let masses = solids
        .iter()
        .map(|solid| Some(SolidMass::of_shape(&solid.shape)?.moved(&solid.at)))
        .collect::<Option<Vec<SolidMass>>>()?;
    let whole = SolidMass::together(&masses);
    (whole.kg > 0.0).then(|| whole.about_com * (kg / whole.kg))
}

/// Warns of densities in a link whose mass is not computed from them.
pub(super) fn warn_of_densities(link: Node, inertial: Option<Node>, reader: &mut Reader) {
    let density = xml::children(link, "collision")
        .chain(inertial)
        .find_map(|node| xml::child(node, "density"));
    if let Some(density) = density {
        let message = "`<density>` has no effect: the mass is not computed from it".to_owned();
        let help = "write `<inertial auto=\"true\">`";
        reader.warning("W036", density, message, help);
    }
}

/// Reads a stated mass. A link without shapes may have none: `is_bare`.
fn stated(
    inertial: Node,
    link: &Isometry3<f64>,
    is_bare: bool,
    reader: &mut Reader,
) -> Option<Mass> {
    let at = link * pose(inertial, reader)?;
    let bound = if is_bare {
        Bound::Mass
    } else {
        Bound::Positive
    };
    let kg = reader.number(xml::child(inertial, "mass")?, bound)?;
    if kg == 0.0 {
        return Some(Mass {
            kg,
            com: at.translation.vector,
            about_com: Some(Matrix3::zeros()),
        });
    }
    let moments = xml::child(inertial, "inertia").and_then(|inertia| {
        warn_of_missing_moments(inertia, reader);
        let moments = moments(inertia, reader)?;
        possible(moments, inertia, reader)
    });
    let turn = at.rotation.to_rotation_matrix();
    let about_com = moments.map(|moments| turn.matrix() * moments * turn.matrix().transpose());
    Some(Mass {
        kg,
        com: at.translation.vector,
        about_com,
    })
}

/// Warns of moments of inertia that a link does not state (W036): SDF has defaults for them.
fn warn_of_missing_moments(inertia: Node, reader: &mut Reader) {
    let missing = ["ixx", "iyy", "izz"].map(|name| (name, xml::child(inertia, name)));
    let missing: Vec<String> = missing
        .iter()
        .filter(|(_, written)| written.is_none())
        .map(|(name, _)| format!("`<{name}>`"))
        .collect();
    if !missing.is_empty() {
        let message = format!(
            "`<inertia>` has no {}: 1 kg·m² is used, the default of SDF",
            missing.join(", ")
        );
        let help = "state all moments of inertia, or remove `<inertia>`";
        reader.warning("W036", inertia, message, help);
    }
}

/// Reads moments of inertia; those that are missing have the defaults of SDF. Returns `None` after a
/// fault.
pub(super) fn moments(inertia: Node, reader: &mut Reader) -> Option<Matrix3<f64>> {
    let mut entry = |name: &str, default| match xml::child(inertia, name) {
        Some(node) => reader.number(node, Bound::Finite),
        None => Some(default),
    };
    let (xx, yy, zz) = (entry("ixx", 1.0)?, entry("iyy", 1.0)?, entry("izz", 1.0)?);
    let (xy, xz, yz) = (entry("ixy", 0.0)?, entry("ixz", 0.0)?, entry("iyz", 0.0)?);
    Some(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
}

/// Returns the moments of inertia if they are possible. Otherwise warns (W036) and returns `None`:
/// they are then computed from the shapes.
fn possible(moments: Matrix3<f64>, inertia: Node, reader: &mut Reader) -> Option<Matrix3<f64>> {
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

/// Computes mass, centre and moments of a link from the volumes and densities of its collisions. A
/// stated mass scales them, as in libsdformat.
pub(super) fn computed(
    inertial: Node,
    solids: &[CollisionSolid],
    reader: &mut Reader,
) -> Option<Mass> {
    let usual = match xml::child(inertial, "density") {
        Some(density) => reader.number(density, Bound::Positive)?,
        None => DENSITY,
    };
    let mut masses = Vec::new();
    for solid in solids {
        let density = match xml::child(solid.collision, "density") {
            Some(density) => reader.number(density, Bound::Positive)?,
            None => usual,
        };
        let Some(unit) = of_geometry(solid, reader) else {
            let message = "the mass of a shape without a volume can't be computed".to_owned();
            let help = "state the `<mass>` of the link, without `auto`";
            reader.error("W035", solid.collision, message, help);
            return None;
        };
        masses.push(unit.times(density).moved(&solid.at));
    }
    let whole = SolidMass::together(&masses);
    if whole.kg <= 0.0 {
        let message = "the mass of a link without a `<collision>` can't be computed".to_owned();
        reader.error(
            "W033",
            inertial,
            message,
            "add a `<collision>`, or state the `<mass>`",
        );
        return None;
    }
    let kg = match xml::child(inertial, "mass") {
        Some(mass) => reader.number(mass, Bound::Positive)?,
        None => whole.kg,
    };
    Some(Mass {
        kg,
        com: whole.com,
        about_com: Some(whole.about_com * (kg / whole.kg)),
    })
}

/// Returns the exact solid of a collision, with a density of 1; those that are simulated as meshes
/// have less volume.
fn of_geometry(solid: &CollisionSolid, reader: &mut Reader) -> Option<SolidMass> {
    let kind = kind_of(xml::child(solid.collision, "geometry")?, reader)?;
    if kind.tag_name().name() == "mesh" {
        return SolidMass::of_shape(&solid.shape);
    }
    Some(match sdf_primitive(kind, reader)? {
        PrimitiveShape::Geometry(geometry) => SolidMass::of_primitive(&geometry),
        PrimitiveShape::Cone { radius, length } => SolidMass::of_cone(radius, length),
    })
}
