//! Moments of inertia of a robot's moving links: finds those that no body has, and proposes others.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::foreign::body::is_possible;
use crate::foreign::solid_mass::SolidMass;
use crate::foreign::{root_name, xml};
use actcheck_base::{Diagnostic, Diagnostics, Span};
use actcheck_data::{
    LEAST_LINK_KG, ModelTree, Part, Pose, Shape, TreeGeometry, TreeInertial, TreeLink, TreeMotion,
    bounds,
};

/// Density of a link without a shape: that of water. Unit: kg/m³.
const DENSITY: f64 = 1000.0;
/// Least side of a box whose moments are proposed: sheets have none. Unit: metres.
const LEAST_SIDE_M: f64 = 1e-3;

/// A change of a URDF's text that gives a link moments of inertia that a body can have.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mend {
    /// The replaced bytes; empty if the text is inserted there.
    pub(crate) span: Span,
    /// The new text.
    pub(crate) text: String,
    /// The change as a sentence without a full stop.
    pub(crate) change: String,
}

/// Reports the moments of inertia of moving links that no body has: a principal moment of 0 or less
/// (W034), with which the smallest torque would turn the link infinitely fast, or one that exceeds
/// the sum of the others (W036). Links that are fixed to each other are one body, as in the
/// simulation. Returns the proposed changes: those of a URDF that is a whole robot. `meshes` are the
/// solids by mesh file.
pub(crate) fn check(
    tree: &ModelTree,
    meshes: &BTreeMap<String, Vec<Shape>>,
    is_urdf: bool,
    found: &mut Diagnostics,
) -> Vec<Mend> {
    let mut mends = Vec::new();
    for joint in tree
        .joints
        .iter()
        .filter(|joint| joint.motion != TreeMotion::Fixed)
    {
        let masses = masses_of_body(tree, &joint.child);
        if masses.iter().map(|mass| mass.stated.kg).sum::<f64>() < LEAST_LINK_KG {
            continue;
        }
        let whole = together(&masses);
        if is_possible(&whole) {
            continue;
        }
        let massless = whole.symmetric_eigenvalues().min() <= 0.0;
        let impossible = |mass: &&LinkMass| !is_possible(&mass.stated.about_com);
        for mass in masses.iter().filter(impossible) {
            let proposed = Proposal::new(mass, meshes);
            report(mass, &joint.child, (massless, is_urdf), &proposed, found);
            mends.extend(is_urdf.then(|| proposed.mend(mass)));
        }
    }
    mends
}

/// The mass of one link of a body.
struct LinkMass<'a> {
    link: &'a TreeLink,
    stated: &'a TreeInertial,
    /// Pose of the mass in the frame of the body.
    at: Isometry3<f64>,
}

/// Returns the masses of a link and of all links that are fixed to it.
fn masses_of_body<'a>(tree: &'a ModelTree, moved: &'a str) -> Vec<LinkMass<'a>> {
    let fixed = || {
        tree.joints
            .iter()
            .filter(|joint| joint.motion == TreeMotion::Fixed)
    };
    let mut masses = Vec::new();
    let mut seen = BTreeSet::from([moved]);
    let mut open = vec![(moved, Isometry3::identity())];
    while let Some((name, at)) = open.pop() {
        let link = tree.link(name);
        let stated = link.and_then(|link| Some((link, link.inertial.as_ref()?)));
        masses.extend(
            stated
                .filter(|(_, stated)| stated.kg > 0.0)
                .map(|(link, stated)| LinkMass {
                    link,
                    stated,
                    at: at * stated.pose,
                }),
        );
        for joint in fixed().filter(|joint| joint.parent == name) {
            if seen.insert(&joint.child) {
                open.push((&joint.child, at * joint.origin));
            }
        }
    }
    masses
}

/// The inertia tensor of all masses about their common centre.
fn together(masses: &[LinkMass]) -> Matrix3<f64> {
    let in_body = masses.iter().map(|mass| {
        let own = SolidMass {
            kg: mass.stated.kg,
            com: Vector3::zeros(),
            about_com: mass.stated.about_com,
        };
        own.moved(&mass.at)
    });
    SolidMass::together(&in_body.collect::<Vec<_>>()).about_com
}

/// Reports one link's moments, with those of a box around its shape. `can_mend`: they are those of a
/// URDF that is a whole robot.
fn report(
    mass: &LinkMass,
    moved: &str,
    (massless, can_mend): (bool, bool),
    proposed: &Proposal,
    found: &mut Diagnostics,
) {
    let name = &mass.link.name;
    let moves = match *name == moved {
        true => "moves".to_owned(),
        false => format!("moves with `{moved}`"),
    };
    let place = mass.stated.moments_place.as_ref();
    let place = place.unwrap_or(&mass.stated.place);
    let element = proposed.element(root_name(&place.source.text));
    let mut help = format!("write those of {}: `{element}`", proposed.origin);
    if can_mend {
        help.push_str("; `actcheck check --mend` writes a mended copy");
    }
    let says = format!(
        "the link `{name}` of {} kg {moves}, but its principal moments of inertia are {} kg·m²",
        mass.stated.kg,
        principal(mass)
    );
    let fault = if massless {
        Diagnostic::error("W034", format!("{says}: all must be above 0"))
    } else {
        let message = format!("{says}: no body has one above the sum of the others");
        Diagnostic::warning("W036", message)
    };
    found.push(fault.at(&place.source, xml::tag(place)).help(help));
}

/// The principal moments of a link as text, the largest first.
fn principal(mass: &LinkMass) -> String {
    let moments = mass.stated.about_com.symmetric_eigenvalues();
    let mut moments: Vec<f64> = moments.iter().copied().collect();
    moments.sort_by(|a, b| b.total_cmp(a));
    let moments: Vec<String> = moments.into_iter().map(short).collect();
    moments.join(", ")
}

/// The moments of a box around a link's collision shapes.
struct Proposal {
    /// About the axes of the `<inertial>`.
    moments: [f64; 3],
    /// The box in words.
    origin: String,
}

impl Proposal {
    fn new(mass: &LinkMass, meshes: &BTreeMap<String, Vec<Shape>>) -> Self {
        let kg = mass.stated.kg;
        let (size, origin) = match size_of(mass, meshes) {
            Some(size) => {
                let [x, y, z] = size.map(|side| short(100.0 * side));
                (
                    size,
                    format!("a box of {x} x {y} x {z} cm around its collision shape"),
                )
            }
            None => {
                let side = (kg / DENSITY).cbrt();
                (
                    [side; 3],
                    format!(
                        "a cube of {} cm, the size of this mass of water",
                        short(100.0 * side)
                    ),
                )
            }
        };
        let [x, y, z] = size.map(|side| side.max(LEAST_SIDE_M).powi(2) * kg / 12.0);
        Self {
            moments: [y + z, x + z, x + y],
            origin,
        }
    }

    /// The moments as a file with this root writes them.
    fn element(&self, root: Option<&str>) -> String {
        let [xx, yy, zz] = self.moments.map(short);
        match root {
            Some("mujoco") => format!("diaginertia=\"{xx} {yy} {zz}\""),
            Some("sdf") => {
                format!("<inertia><ixx>{xx}</ixx><iyy>{yy}</iyy><izz>{zz}</izz></inertia>")
            }
            _ => format!(
                "<inertia ixx=\"{xx}\" ixy=\"0\" ixz=\"0\" iyy=\"{yy}\" iyz=\"0\" izz=\"{zz}\"/>"
            ),
        }
    }

    /// The change of a URDF that gives a link these moments.
    fn mend(&self, mass: &LinkMass) -> Mend {
        let change = format!(
            "`{}` has the moments of inertia of {} instead of {} kg·m²",
            mass.link.name,
            self.origin,
            principal(mass)
        );
        // Missing moments are inserted after `<mass …/>`.
        let span = match &mass.stated.moments_place {
            Some(inertia) => inertia.span.clone(),
            None => mass.stated.place.span.end..mass.stated.place.span.end,
        };
        Mend {
            span,
            text: self.element(Some("robot")),
            change,
        }
    }
}

/// The sides of the box around a link's collision shapes, along the axes of its mass. Unit: metres.
fn size_of(mass: &LinkMass, meshes: &BTreeMap<String, Vec<Shape>>) -> Option<[f64; 3]> {
    let mass_from_link = mass.stated.pose.inverse();
    let mut parts: Vec<Part> = Vec::new();
    for solid in &mass.link.solids {
        let pose = Pose::from_isometry(&(mass_from_link * solid.pose));
        let shapes = shapes_of(&solid.geometry, meshes)?;
        parts.extend(shapes.into_iter().map(|shape| Part { pose, shape }));
    }
    let (low, high) = bounds(&parts);
    let size = high - low;
    (!parts.is_empty() && size.iter().all(|side| side.is_finite())).then(|| size.into())
}

fn shapes_of(geometry: &TreeGeometry, meshes: &BTreeMap<String, Vec<Shape>>) -> Option<Vec<Shape>> {
    Some(match geometry {
        TreeGeometry::Mesh { file, scale } => meshes
            .get(file)?
            .iter()
            .map(|shape| shape.scaled(*scale))
            .collect(),
        primitive => vec![primitive.solid()?],
    })
}

/// A number with three significant digits.
fn short(number: f64) -> String {
    let rounded: f64 = format!("{number:.2e}").parse().unwrap_or(number);
    match rounded == 0.0 || (0.001..10_000.0).contains(&rounded.abs()) {
        true => format!("{rounded}"),
        false => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::urdf_tree;
    use crate::foreign::xml::{Reader, parse_model};
    use actcheck_base::Source;

    /// Codes and mends of a robot whose moving link has this content, with a link that is fixed to
    /// it.
    fn checked(moving: &str, fixed: &str) -> (Vec<&'static str>, Vec<Mend>) {
        let text = format!(
            "<robot name=\"r\"><link name=\"base\"/>\
             <joint name=\"j\" type=\"prismatic\"><parent link=\"base\"/><child link=\"a\"/></joint>\
             <joint name=\"k\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
             <link name=\"a\">{moving}</link><link name=\"b\">{fixed}</link></robot>"
        );
        let source = Source::new("r.urdf", text);
        let document = parse_model(&source, &source.text).expect("it is XML");
        let mut reader = Reader::new(&source);
        let tree = urdf_tree::read(document.root_element(), &mut reader).tree;
        let mut found = Diagnostics::new();
        let mends = check(&tree, &BTreeMap::new(), true, &mut found);
        (found.iter().map(|fault| fault.code).collect(), mends)
    }

    fn inertial(kg: f64, [xx, yy, zz]: [f64; 3]) -> String {
        format!(
            "<inertial><mass value=\"{kg}\"/>\
             <inertia ixx=\"{xx}\" ixy=\"0\" ixz=\"0\" iyy=\"{yy}\" iyz=\"0\" izz=\"{zz}\"/></inertial>"
        )
    }

    #[test]
    fn only_impossible_moments_of_a_whole_body_are_reported() {
        let (none, flat, much) = ([1e-3, 0.0, 0.0], [2e-3, 1e-3, 1e-3], [3e-3, 1e-3, 1e-3]);
        let round = [2e-3; 3];
        for (moving, fixed, codes) in [
            (inertial(1.0, flat), String::new(), vec![]),
            (inertial(1.0, none), String::new(), vec!["W034"]),
            (
                inertial(1.0, [1e-3, -1e-3, 1e-3]),
                String::new(),
                vec!["W034"],
            ),
            (inertial(1.0, much), String::new(), vec!["W036"]),
            (
                "<inertial><mass value=\"1\"/></inertial>".to_owned(),
                String::new(),
                vec!["W034"],
            ),
            // The body as a whole is possible.
            (inertial(1.0, none), inertial(1.0, round), vec![]),
            (String::new(), inertial(1.0, none), vec!["W034"]),
            (
                inertial(1.0, none),
                inertial(1.0, none),
                vec!["W034", "W034"],
            ),
            // The simulation gives links as light as this moments of its own.
            (inertial(0.001, none), String::new(), vec![]),
        ] {
            assert_eq!(checked(&moving, &fixed).0, codes, "{moving} {fixed}");
        }
    }

    #[test]
    fn the_proposed_moments_are_those_of_the_box_around_the_shape() {
        // The axes of the `<inertial>` are turned: its x axis is along the link's y axis.
        let turned = "<inertial><origin xyz=\"0 0 1\" rpy=\"0 0 1.5707963267948966\"/><mass value=\"12\"/></inertial>\
            <collision><geometry><box size=\"0.1 0.2 0.3\"/></geometry></collision>";
        let mends = checked(turned, "").1;
        assert_eq!(mends.len(), 1);
        assert_eq!(
            mends[0].text,
            "<inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.13\" iyz=\"0\" izz=\"0.05\"/>"
        );
        assert!(
            mends[0].change.contains("a box of 20 x 10 x 30 cm"),
            "{}",
            mends[0].change
        );
    }
}
