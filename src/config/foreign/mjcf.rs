//! Converts a robot or an object in MJCF, MuJoCo's format, to URDF: bodies, joints, geoms,
//! inertias, equalities of joints.
//!
//! Sites and cameras become links, so that a profile can name them. Spatial tendons and options are
//! not read.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::foreign::mjcf_compiler::{Attributes, Compiler};
use crate::foreign::mjcf_couplings::{Couplings, elements};
use crate::foreign::mjcf_materials::{Mask, collides};
use crate::foreign::urdf::Materials;
use crate::foreign::urdf_text::{Inertial, UrdfJoint, UrdfText};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, Source};

/// Density of geoms: MuJoCo's default. Unit: kg/m³.
pub(super) const DENSITY: f64 = 1000.0;
/// Mass of a body with neither a mass nor a shape whose volume is known. Unit: kilograms.
const UNKNOWN_KG: f64 = 0.1;
/// Edge of the cube whose inertia such a body gets. Unit: metres.
const UNKNOWN_M: f64 = 0.05;
/// Largest effort of a joint without limits of its actuator. Units: newtons or newton metres.
const EFFORT: f64 = 100.0;
/// Largest velocity of joints, which MJCF does not have. Units: rad/s and m/s.
const VELOCITY: [f64; 2] = [2.0, 0.5];
/// Most bodies whose pairs are compared.
const MOST_BODIES: usize = 1_000;
/// Range of an unlimited sliding joint. Unit: metres.
const SLIDES_M: f64 = 10.0;

/// Converts the text of a robot.
///
/// # Errors
/// Faults of the text: W031 to W036, W055.
pub(crate) fn to_urdf(
    source: &Source,
    path: &Path,
    files: &actcheck_base::Files,
) -> Result<Source, Diagnostics> {
    converted(source, path, files, None).map(|(urdf, _)| urdf)
}

/// Converts the text of an object. Also returns the mass of bodies without `<inertial>`, which URDF
/// can't state.
///
/// # Errors
/// Faults of the text: W031 to W036, W055.
pub(crate) fn object(
    source: &Source,
    path: &Path,
    files: &actcheck_base::Files,
) -> Result<(Source, Materials), Diagnostics> {
    let (urdf, materials) = converted(source, path, files, Some(Materials::default()))?;
    Ok((urdf, materials.unwrap_or_default()))
}

fn converted(
    source: &Source,
    path: &Path,
    files: &actcheck_base::Files,
    materials: Option<Materials>,
) -> Result<(Source, Option<Materials>), Diagnostics> {
    with_robot(source, path, files, |root, mut robot, reader| {
        robot.materials = materials;
        let world = robot.unique("world");
        robot.out.link(&world, None, &[]);
        match xml::child(root, "worldbody") {
            Some(worldbody) => {
                robot.children(worldbody, &world, &Isometry3::identity(), None, reader)
            }
            None => reader.error(
                "W033",
                root,
                "`<mujoco>` has no `<worldbody>`".to_owned(),
                "add the bodies",
            ),
        }
        if robot.materials.is_none() {
            robot.write_passing(root);
        }
        let name = root.attribute("model").unwrap_or("robot").to_owned();
        (
            Source::new(
                format!("{} (as URDF)", source.name),
                robot.out.finish(&name),
            ),
            robot.materials,
        )
    })
}

/// Reads the settings of a text, and calls `read` with its root and a robot without bodies.
pub(super) fn with_robot<T>(
    source: &Source,
    path: &Path,
    files: &actcheck_base::Files,
    read: impl FnOnce(Node, Robot, &mut Reader) -> T,
) -> Result<T, Diagnostics> {
    let text = crate::foreign::mjcf_compiler::with_includes(source, path, files, 0)?;
    let source = &Source::new(source.name.to_string(), text);
    let document = xml::parse_model(source, &source.text)?;
    let root = document.root_element();
    let mut reader = Reader::new(source);
    let compiler = Compiler::read(root, &mut reader);
    let robot = Robot {
        out: UrdfText::default(),
        couplings: Rc::new(Couplings::read(root, &compiler, &mut reader)),
        compiler: Rc::new(compiler),
        names: BTreeMap::new(),
        joint_names: BTreeMap::new(),
        masks: BTreeMap::new(),
        materials: None,
    };
    let found = read(root, robot, &mut reader);
    reader.found.or(found)
}

/// A name that no other has.
pub(super) fn unique(names: &mut BTreeMap<String, u32>, name: &str) -> String {
    let count = names.entry(name.to_owned()).or_insert(0);
    *count += 1;
    if *count == 1 {
        name.to_owned()
    } else {
        format!("{name}_{count}")
    }
}

pub(super) struct Robot {
    pub(super) out: UrdfText,
    pub(super) compiler: Rc<Compiler>,
    couplings: Rc<Couplings>,
    /// Names of links in use, each with the number of its copies.
    names: BTreeMap<String, u32>,
    /// The same for joints: a joint often has the name of its body.
    joint_names: BTreeMap<String, u32>,
    /// The masks of each body's colliding geoms.
    masks: BTreeMap<String, BTreeSet<Mask>>,
    /// Of an object; `None` for a robot.
    pub(super) materials: Option<Materials>,
}

impl Robot {
    /// A name that no other link has.
    pub(super) fn unique(&mut self, name: &str) -> String {
        unique(&mut self.names, name)
    }

    /// Another one of the same file, without bodies, for an object.
    pub(super) fn alone(&self) -> Self {
        Self {
            out: UrdfText::default(),
            compiler: Rc::clone(&self.compiler),
            couplings: Rc::clone(&self.couplings),
            names: BTreeMap::new(),
            joint_names: BTreeMap::new(),
            masks: BTreeMap::new(),
            materials: Some(Materials::default()),
        }
    }

    /// Writes the pairs of bodies that pass through each other: those that `<exclude>` names, and
    /// those whose geoms never collide with each other.
    fn write_passing(&mut self, root: Node) {
        let mut passing = BTreeSet::new();
        let excludes = elements(root, "contact").filter(|contact| contact.has_tag_name("exclude"));
        for exclude in excludes {
            if let (Some(first), Some(second)) =
                (exclude.attribute("body1"), exclude.attribute("body2"))
            {
                passing.insert([first.min(second), first.max(second)]);
            }
        }
        let solid: Vec<(&String, &BTreeSet<Mask>)> = self
            .masks
            .iter()
            .filter(|(_, masks)| !masks.is_empty())
            .collect();
        // More links are refused when the text is read.
        let solid = if solid.len() > MOST_BODIES {
            Vec::new()
        } else {
            solid
        };
        for (idx, (first, of_first)) in solid.iter().enumerate() {
            for (second, of_second) in &solid[idx + 1..] {
                if !of_first
                    .iter()
                    .any(|mask| of_second.iter().any(|other| mask.meets(*other)))
                {
                    passing.insert([first.as_str(), second.as_str()]);
                }
            }
        }
        for pair in passing
            .into_iter()
            .filter(|pair| pair.iter().all(|body| self.names.contains_key(*body)))
        {
            self.out.passing(pair);
        }
    }

    /// Writes the bodies, sites and cameras in a body. `shift` is the body's frame in the frame of
    /// its link.
    fn children(
        &mut self,
        node: Node,
        link: &str,
        shift: &Isometry3<f64>,
        class: Option<&str>,
        reader: &mut Reader,
    ) {
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "body" => self.body(child, link, shift, class, reader),
                "frame" => {
                    let pose =
                        self.compiler
                            .pose(&self.compiler.attributes(child, class), child, reader);
                    let class = child.attribute("childclass").or(class);
                    self.children(child, link, &(shift * pose), class, reader);
                }
                "site" | "camera" => {
                    let Some(name) = child.attribute("name") else {
                        continue;
                    };
                    let pose =
                        self.compiler
                            .pose(&self.compiler.attributes(child, class), child, reader);
                    let turned = if child.tag_name().name() == "camera" {
                        lens()
                    } else {
                        Isometry3::identity()
                    };
                    let name = self.unique(name);
                    self.out.frame(&name, link, shift * pose * turned);
                }
                "attach" | "replicate" => {
                    let message = format!(
                        "the bodies that `<{}>` adds are not read",
                        child.tag_name().name()
                    );
                    let help = "let MuJoCo write one file with all of them: \
                                `mujoco.MjSpec.from_file(FILE)`, then `compile()` and `to_xml()`";
                    reader.error("W035", child, message, help);
                }
                _ => {}
            }
        }
    }

    pub(super) fn body(
        &mut self,
        body: Node,
        parent: &str,
        shift: &Isometry3<f64>,
        class: Option<&str>,
        reader: &mut Reader,
    ) {
        let compiler = Rc::clone(&self.compiler);
        let class = body.attribute("childclass").or(class);
        let name = self.unique(body.attribute("name").unwrap_or("body"));
        let attributes = compiler.attributes(body, class);
        let mut at = shift * compiler.pose(&attributes, body, reader);
        // A body that moves freely is the whole robot or object.
        let is_free = |joint: &Node| compiler.attributes(*joint, class).get("type") == Some("free");
        let joints: Vec<Node> = xml::children(body, "joint")
            .filter(|joint| !is_free(joint))
            .collect();
        let mut from = parent.to_owned();
        // Position of the body's origin in the frame of its link.
        let mut own = Isometry3::identity();
        for (idx, joint) in joints.iter().enumerate() {
            let attributes = compiler.attributes(*joint, class);
            let anchor = attributes
                .get("pos")
                .and_then(|text| reader.numbers(*joint, text, Bound::Finite));
            let anchor = Translation3::from(Vector3::from(anchor.unwrap_or([0.0; 3])));
            let link = if idx + 1 == joints.len() {
                name.clone()
            } else {
                self.unique(&format!("{name}_{}", idx + 1))
            };
            if idx + 1 < joints.len() {
                self.out.link(&link, None, &[]);
            }
            if self
                .joint(*joint, &attributes, (&from, &link), at * anchor, reader)
                .is_some()
            {
                (from, own) = (
                    link,
                    Isometry3::from_parts(anchor, UnitQuaternion::identity()).inverse(),
                );
                at = own;
            }
        }
        if joints.is_empty() {
            let free = xml::child(body, "freejoint").is_some()
                || xml::children(body, "joint").any(|joint| is_free(&joint));
            let (kind, ending) = if free && self.materials.is_none() {
                ("floating", "free")
            } else {
                ("fixed", "fixed")
            };
            let own = unique(&mut self.joint_names, &format!("{name}_{ending}"));
            self.out.joint(&UrdfJoint {
                kind,
                ..UrdfJoint::fixed(&own, parent, &name, at)
            });
        }
        let solids = self.solids(body, &own, class, reader);
        if self.materials.is_none() {
            let geoms = xml::children(body, "geom").map(|geom| compiler.attributes(geom, class));
            self.masks.insert(
                name.clone(),
                geoms.filter(collides).map(|geom| Mask::of(&geom)).collect(),
            );
        }
        let inertial = match &mut self.materials {
            Some(materials) if xml::child(body, "inertial").is_none() => {
                materials.add(&name, body, &compiler, class);
                None
            }
            _ => Some(self.inertial(body, &own, class, &solids, reader)),
        };
        let solids: Vec<(Isometry3<f64>, String)> = solids
            .into_iter()
            .map(|(pose, shape, _)| (pose, shape))
            .collect();
        self.out.link(&name, inertial.as_ref(), &solids);
        self.children(body, &name, &own, class, reader);
    }

    /// Writes a joint. Returns `None` after it has reported a fault.
    fn joint(
        &mut self,
        joint: Node,
        attributes: &Attributes<'_>,
        (parent, child): (&str, &str),
        origin: Isometry3<f64>,
        reader: &mut Reader,
    ) -> Option<()> {
        let (kind, slides) = match attributes.get("type").unwrap_or("hinge") {
            "hinge" => ("revolute", false),
            "slide" => ("prismatic", true),
            other => {
                let message = format!("a joint of the type {other} can't be simulated");
                reader.error(
                    "W035",
                    joint,
                    message,
                    "use `hinge` or `slide`; the joint of the whole model may be `free`",
                );
                return None;
            }
        };
        let name = joint
            .attribute("name")
            .map_or_else(|| format!("{child}_joint"), str::to_owned);
        let axis = attributes
            .get("axis")
            .map_or(Some([0.0, 0.0, 1.0]), |text| {
                reader.numbers(joint, text, Bound::Finite)
            })?;
        let range = match attributes.get("range") {
            Some(text) => Some(reader.numbers::<2>(joint, text, Bound::Finite)?),
            None => None,
        };
        if let Some([lower, upper]) = range.filter(|[lower, upper]| lower > upper) {
            let message = format!(
                "the joint `{name}` has a lower limit of {lower} above its upper limit of {upper}"
            );
            reader.error(
                "W034",
                joint,
                message,
                "write the smaller number of `range` first",
            );
            return None;
        }
        let limited = match attributes.get("limited") {
            Some("true") => true,
            Some("false") => false,
            _ => range.is_some(),
        };
        let unit = if slides { 1.0 } else { self.compiler.angle };
        let range = range
            .filter(|_| limited)
            .map(|range| range.map(|end| end * unit));
        let (kind, range) = match (range.or(self.couplings.ranges.get(&name).copied()), slides) {
            (Some(range), _) => (kind, range),
            (None, true) => (kind, [-SLIDES_M, SLIDES_M]),
            (None, false) => ("continuous", [0.0; 2]),
        };
        let start = self.couplings.start(&name);
        let origin = match Unit::try_new(Vector3::from(axis), 1e-9).filter(|_| start != 0.0) {
            Some(axis) if slides => origin * Translation3::from(axis.scale(-start)),
            Some(axis) => origin * UnitQuaternion::from_axis_angle(&axis, -start),
            None => origin,
        };
        let damping = attributes
            .get("damping")
            .and_then(|text| text.split_whitespace().next()?.parse().ok());
        let friction = attributes
            .get("frictionloss")
            .and_then(|text| text.parse().ok());
        let own_effort = attributes
            .get("actuatorfrcrange")
            .and_then(|text| reader.numbers::<2>(joint, text, Bound::Finite));
        let effort = own_effort
            .map(|[lower, upper]| f64::max(-lower, upper))
            .or_else(|| self.couplings.efforts.get(&name).copied());
        let unstated = if self.couplings.is_passive(&name) {
            0.0
        } else {
            EFFORT
        };
        let unique = unique(&mut self.joint_names, &name);
        self.out.joint(&UrdfJoint {
            name: &unique,
            kind,
            parent,
            child,
            origin,
            axis: Vector3::from(axis),
            range,
            effort: effort.filter(|effort| *effort > 0.0).unwrap_or(unstated),
            velocity: VELOCITY[usize::from(slides)],
            damping: damping.unwrap_or(0.0),
            // Robots overcome it with their motors.
            friction: friction.filter(|_| self.materials.is_some()).unwrap_or(0.0),
            mimic: self.couplings.mimics.get(&name).cloned(),
        });
        Some(())
    }

    /// The inertia of a body: stated, or that of its geoms as points with the inertia of small
    /// cubes.
    fn inertial(
        &self,
        body: Node,
        own: &Isometry3<f64>,
        class: Option<&str>,
        solids: &[(Isometry3<f64>, String, Option<f64>)],
        reader: &mut Reader,
    ) -> Inertial {
        let stated = xml::child(body, "inertial").and_then(|node| {
            let attributes = self.compiler.attributes(node, class);
            let pose = own * self.compiler.pose(&attributes, node, reader);
            let [kg] = reader.numbers::<1>(node, attributes.get("mass")?, Bound::Mass)?;
            let about_com =
                match (attributes.get("fullinertia"), attributes.get("diaginertia")) {
                    (Some(text), _) => {
                        let [xx, yy, zz, xy, xz, yz] = reader.numbers(node, text, Bound::Finite)?;
                        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
                    }
                    (None, Some(text)) => Matrix3::from_diagonal(&Vector3::from(
                        reader.numbers::<3>(node, text, Bound::Finite)?,
                    )),
                    (None, None) => cube(kg),
                };
            Some(Inertial {
                pose,
                kg,
                about_com,
            })
        });
        if let Some(stated) = stated {
            return stated;
        }
        let parts: Vec<(Vector3<f64>, f64)> = solids
            .iter()
            .filter_map(|(pose, _, kg)| Some((pose.translation.vector, kg.filter(|kg| *kg > 0.0)?)))
            .collect();
        let kg: f64 = parts.iter().map(|(_, kg)| kg).sum();
        if kg <= 0.0 {
            return Inertial {
                pose: *own,
                kg: UNKNOWN_KG,
                about_com: cube(UNKNOWN_KG),
            };
        }
        let com = parts.iter().map(|(at, kg)| at * *kg).sum::<Vector3<f64>>() / kg;
        let of_point = |(at, kg): &(Vector3<f64>, f64)| {
            let d = at - com;
            (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * *kg + cube(*kg)
        };
        Inertial {
            pose: Isometry3::translation(com.x, com.y, com.z),
            kg,
            about_com: parts.iter().map(of_point).sum(),
        }
    }
}

/// The inertia of a cube of this mass.
fn cube(kg: f64) -> Matrix3<f64> {
    Matrix3::identity() * (kg * UNKNOWN_M * UNKNOWN_M / 6.0)
}

/// Our camera frame in MuJoCo's, in which the view is along -z and y is up.
fn lens() -> Isometry3<f64> {
    let axes = Matrix3::from_columns(&[-Vector3::z(), -Vector3::x(), Vector3::y()]);
    let turned = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::identity(), turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Files;

    fn converted(bodies: &str, more: &str) -> Result<String, Diagnostics> {
        let text = format!(
            "<mujoco><compiler angle=\"radian\"/><worldbody>{bodies}</worldbody>{more}</mujoco>"
        );
        let path = Path::new("robot.xml");
        let found = to_urdf(&Source::new("robot.xml", text), path, &Files::Shipped);
        found.map(|urdf| urdf.text.to_string())
    }

    const BALL: &str = "<geom size=\"0.1\"/>";

    /// MuJoCo leaves out the contacts of pairs that the file excludes, and of geoms whose masks
    /// don't meet.
    #[test]
    fn bodies_that_never_collide_are_named() {
        let bodies = format!(
            "<body name=\"a\">{BALL}<body name=\"b\">{BALL}</body></body><body name=\"c\">{BALL}</body>\
             <body name=\"d\"><geom size=\"0.1\" contype=\"2\" conaffinity=\"4\"/></body>"
        );
        let urdf = converted(
            &bodies,
            "<contact><exclude body1=\"c\" body2=\"a\"/></contact>",
        )
        .expect("it is valid");
        let pairs: Vec<&str> = urdf
            .lines()
            .filter(|line| line.contains("disable_collisions"))
            .map(str::trim)
            .collect();
        let pair = |a: &str, b: &str| format!("<disable_collisions link1=\"{a}\" link2=\"{b}\"/>");
        assert_eq!(
            pairs,
            [
                pair("a", "c"),
                pair("a", "d"),
                pair("b", "d"),
                pair("c", "d")
            ]
        );
    }

    /// Names of bodies and joints don't exclude each other; only a whole robot may move freely;
    /// `ref` is the position at which the body is where the file puts it.
    #[test]
    fn joints_keep_their_names_and_positions() {
        let bodies = format!(
            "<body name=\"base\"><freejoint/>{BALL}<body name=\"jaw\" pos=\"0 0 1\">\
             <joint name=\"jaw\" axis=\"1 0 0\" ref=\"0.5\" range=\"0 1\"/>{BALL}</body></body>"
        );
        let urdf = converted(&bodies, "").expect("it is valid");
        assert!(
            urdf.contains("<joint name=\"base_free\" type=\"floating\">"),
            "{urdf}"
        );
        let jaw = urdf
            .lines()
            .find(|line| line.contains("<joint name=\"jaw\" type=\"revolute\">"))
            .expect("it has a jaw");
        let turned = jaw
            .split("rpy=\"")
            .nth(1)
            .and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
        assert!(
            turned.is_some_and(|roll_rad| (roll_rad + 0.5).abs() < 1e-9),
            "{jaw}"
        );
    }

    /// A part that would be missing without a word.
    #[test]
    fn bodies_that_are_attached_are_refused() {
        let said = converted(
            "<body name=\"a\"><attach model=\"hand\" body=\"palm\" prefix=\"h_\"/></body>",
            "",
        );
        let said = said.expect_err("a hand is missing").to_string();
        assert!(
            said.contains("W035") && said.contains("the bodies that `<attach>` adds are not read"),
            "{said}"
        );
    }
}
