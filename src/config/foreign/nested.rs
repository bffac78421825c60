//! The links of an SDF model together with those of the models in it.

use nalgebra::Isometry3;

use crate::foreign::body::{Body, Mass};
use crate::foreign::folder;
use crate::foreign::geometry::Shapes;
use crate::foreign::sdf::pose;
use crate::foreign::xml::{self, Node, Reader};
use actcheck_data::{Part, Pose};

/// Deepest inclusion of models: deeper ones include themselves.
const DEEPEST: usize = 8;
/// Elements of a model that are read, or that do not affect its body.
const KNOWN: [&str; 15] = [
    "link",
    "joint",
    "static",
    "pose",
    "frame",
    "self_collide",
    "allow_auto_disable",
    "enable_wind",
    "plugin",
    "model",
    "include",
    "gripper",
    "name",
    "origin",
    "placement_frame",
];

/// The part that a model has in scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// It moves as one rigid body, unless it is static.
    Object,
    /// It is a part of a world, where nothing moves: its joints stay as in the file.
    Furniture,
}

/// Links, joints and included models. Poses are in the frame of the outermost model.
pub(crate) struct Links<'a> {
    pub(crate) links: Vec<(Node<'a>, Isometry3<f64>)>,
    joints: Vec<Node<'a>>,
    includes: Vec<(Node<'a>, Isometry3<f64>)>,
}

impl<'a> Links<'a> {
    /// Collects those of a model and of the models nested in it.
    pub(crate) fn of(model: Node<'a>, role: Role, reader: &mut Reader) -> Self {
        let mut links = Self { links: Vec::new(), joints: Vec::new(), includes: Vec::new() };
        links.collect(model, &Isometry3::identity(), role, reader);
        links
    }

    fn collect(&mut self, model: Node<'a>, at: &Isometry3<f64>, role: Role, reader: &mut Reader) {
        reader.warn_about_unknown_children(model, &KNOWN);
        for child in model.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "link" => self.links.push((child, *at)),
                "joint" => self.joints.push(child),
                "include" => self.includes.push((child, *at)),
                "model" => {
                    if let Some(nested) = pose(child, reader) {
                        self.collect(child, &(at * nested), role, reader);
                    }
                }
                "gripper" if role == Role::Object => {
                    let message = "`<gripper>` inside a model is not supported".to_owned();
                    reader.error("W035", child, message, "leave it out; robots are read from URDF");
                }
                "plugin" => {
                    reader.warning("W036", child, "the plugin is not run".to_owned(), "the model works without it");
                }
                _ => {}
            }
        }
    }

    /// Checks that the links form one rigid body: those of a model that can move need fixed joints (W035).
    pub(crate) fn check_joints(&self, role: Role, fixed: bool, reader: &mut Reader) {
        for joint in self.joints.iter().filter(|joint| joint.attribute("type") != Some("fixed")) {
            let kind = joint.attribute("type").unwrap_or("unknown");
            let name = joint.attribute("name").unwrap_or("");
            if role == Role::Furniture {
                let message = format!("the joint `{name}` does not move in a world here");
                reader.warning("W036", *joint, message, "it stays as in the file");
            } else {
                let message = format!("the joint `{name}` is of the type {kind}, but objects must be rigid");
                reader.error("W035", *joint, message, "make the joint `fixed`; robots are read from URDF");
            }
        }
        let all: Vec<Node> = self.links.iter().chain(&self.includes).map(|(node, _)| *node).collect();
        if let (Some(loose), false) = (all.get(self.joints.len() + 1), fixed) {
            let written = ["name", "uri"].iter().find_map(|child| xml::child(*loose, child)).map(xml::text);
            let name = loose.attribute("name").or(written).unwrap_or_default();
            let message = format!("no joint connects `{name}` to the other links");
            reader.error("W035", *loose, message, "add a `<joint type=\"fixed\">`, or write `<static>true</static>`");
        }
    }

    /// Adds the bodies of the included models.
    pub(crate) fn read_included(&self, role: Role, body: &mut Body, shapes: &mut Shapes, reader: &mut Reader) {
        for (include, at) in &self.includes {
            if let Some((included, placed)) = read_include(*include, role, shapes, reader) {
                add(included, &(at * placed), body);
            }
        }
    }
}

/// Reads the model that an `<include>` names, and its pose in the frame of the parent. Returns `None` after it has
/// reported a fault.
fn read_include(include: Node, role: Role, shapes: &mut Shapes, reader: &mut Reader) -> Option<(Body, Isometry3<f64>)> {
    reader.warn_about_unknown_children(include, &["uri", "name", "pose", "static", "plugin", "placement_frame"]);
    let uri = reader.required(include, "uri")?;
    if shapes.depth >= DEEPEST {
        let message = format!("models are included more than {DEEPEST} levels deep: one includes itself");
        reader.error("W035", uri, message, "remove the `<include>`");
        return None;
    }
    let model = folder::included(uri, shapes.lookup, role, shapes.depth + 1, std::iter::empty(), reader)?;
    shapes.digest.update(model.digest.as_bytes());
    let own = if xml::child(include, "pose").is_some() { pose(include, reader)? } else { model.pose };
    Some((model.body, own))
}

/// Adds a body at a pose to another one.
fn add(other: Body, at: &Isometry3<f64>, body: &mut Body) {
    let turn = at.rotation.to_rotation_matrix();
    body.parts.extend(
        other
            .parts
            .into_iter()
            .map(|part| Part { pose: Pose::from_isometry(&(at * part.pose.to_isometry())), shape: part.shape }),
    );
    body.masses.extend(other.masses.into_iter().map(|mass| Mass {
        kg: mass.kg,
        com: (at * nalgebra::Point3::from(mass.com)).coords,
        about_com: mass.about_com.map(|moments| turn.matrix() * moments * turn.matrix().transpose()),
    }));
    body.has_unknown_mass |= other.has_unknown_mass;
    body.friction = body.friction.or(other.friction);
    body.restitution = body.restitution.or(other.restitution);
}
