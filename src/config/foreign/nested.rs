//! The links of an SDF model together with those of the models in it.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::foreign::assembly::{Assembly, Join, free_name};
use crate::foreign::body::{Body, Mass, MovingBody};
use crate::foreign::folder;
use crate::foreign::geometry::Shapes;
use crate::foreign::sdf_joint;
use crate::foreign::sdf_pose::pose;
use crate::foreign::xml::{self, Node, Reader};
use actcheck_data::{Part, PartJoint, Pose};

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
    /// It moves, unless it is static.
    Object,
    /// It is a part of a world, where nothing moves: its joints stay as in the file.
    Furniture,
}

/// Links, joints and included models. Poses are in the frame of the outermost model.
pub(crate) struct Links<'a> {
    pub(crate) links: Vec<(Node<'a>, Isometry3<f64>)>,
    joints: Vec<(Node<'a>, Isometry3<f64>)>,
    includes: Vec<(Node<'a>, Isometry3<f64>)>,
}

impl<'a> Links<'a> {
    /// Collects those of a model and of the models nested in it.
    pub(crate) fn of(model: Node<'a>, role: Role, reader: &mut Reader) -> Self {
        let mut links = Self {
            links: Vec::new(),
            joints: Vec::new(),
            includes: Vec::new(),
        };
        links.collect(model, &Isometry3::identity(), role, reader);
        links
    }

    fn collect(&mut self, model: Node<'a>, at: &Isometry3<f64>, role: Role, reader: &mut Reader) {
        reader.warn_about_unknown_children(model, &KNOWN);
        for child in model.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "link" => self.links.push((child, *at)),
                "joint" => self.joints.push((child, *at)),
                "include" => self.includes.push((child, *at)),
                "model" => {
                    if let Some(nested) = pose(child, reader) {
                        self.collect(child, &(at * nested), role, reader);
                    }
                }
                "gripper" if role == Role::Object => {
                    let message = "`<gripper>` inside a model is not supported".to_owned();
                    reader.error(
                        "W035",
                        child,
                        message,
                        "leave it out; robots are read from URDF",
                    );
                }
                "plugin" => {
                    reader.warning(
                        "W036",
                        child,
                        "the plugin is not run".to_owned(),
                        "the model works without it",
                    );
                }
                _ => {}
            }
        }
    }

    /// Returns the bodies that the links form. Nothing moves in furniture of a world and in a
    /// static model. After a fault, all links are one body.
    pub(crate) fn assembly(&self, role: Role, fixed: bool, reader: &mut Reader) -> Assembly {
        let mut joins = Vec::new();
        for (joint, at) in &self.joints {
            let is_fixed = joint.attribute("type") == Some("fixed");
            if role == Role::Furniture && !is_fixed {
                let name = joint.attribute("name").unwrap_or("");
                let message = format!("the joint `{name}` does not move in a world here");
                reader.warning("W036", *joint, message, "it stays as in the file");
            }
            if role == Role::Object && !fixed {
                joins.extend(self.join(*joint, is_fixed, at, reader));
            }
        }
        Assembly::of(self.links.len(), &joins, &mut reader.found)
    }

    /// Returns whether a joint that does not move ties the model to the world.
    pub(crate) fn is_anchored(&self) -> bool {
        let to_world = |joint: &Node| xml::child(*joint, "parent").map(xml::text) == Some("world");
        self.joints
            .iter()
            .any(|(joint, _)| to_world(joint) && sdf_joint::is_rigid(*joint))
    }

    /// Reads a joint of a model at a pose. Returns `None` if it does not connect links, after it
    /// has reported a fault.
    fn join(
        &self,
        joint: Node<'a>,
        is_fixed: bool,
        model: &Isometry3<f64>,
        reader: &mut Reader,
    ) -> Option<Join> {
        let (parent, child) = (
            self.end(joint, "parent", reader),
            self.end(joint, "child", reader),
        );
        if is_fixed || sdf_joint::is_rigid(joint) {
            // Included models, and the world, are part of the object itself.
            return Some(Join {
                place: reader.place(joint),
                parent: parent?,
                child: child?,
                joint: None,
            });
        }
        let at = match child {
            Some(child) => self.links[child].1 * pose(self.links[child].0, reader)?,
            None => *model,
        };
        let moves = sdf_joint::read(joint, &at, model, reader)?;
        let (Some(parent), Some(child)) = (parent, child) else {
            let name = joint.attribute("name").unwrap_or("");
            let message = match xml::child(joint, "parent").map(xml::text) {
                Some("world") => {
                    format!("the joint `{name}` moves the whole model against the world")
                }
                _ => format!("the joint `{name}` does not connect two links of this model"),
            };
            reader.error(
                "W035",
                joint,
                message,
                "connect links of the model itself, or make the joint `fixed`",
            );
            return None;
        };
        Some(Join {
            place: reader.place(joint),
            parent,
            child,
            joint: Some(moves),
        })
    }

    /// Returns the link at an end of a joint, by its index.
    fn end(&self, joint: Node, which: &str, reader: &mut Reader) -> Option<usize> {
        let named = xml::text(reader.required(joint, which)?);
        let last = named.rsplit("::").next().unwrap_or(named);
        let is_named = |name: &str| {
            self.links
                .iter()
                .position(|(link, _)| link.attribute("name") == Some(name))
        };
        is_named(named).or_else(|| is_named(last))
    }

    /// Checks that joints connect all links of a model that can move (W035).
    pub(crate) fn check_connected(&self, fixed: bool, reader: &mut Reader) {
        let all: Vec<Node> = self
            .links
            .iter()
            .chain(&self.includes)
            .map(|(node, _)| *node)
            .collect();
        if let (Some(loose), false) = (all.get(self.joints.len() + 1), fixed) {
            let written = ["name", "uri"]
                .iter()
                .find_map(|child| xml::child(*loose, child))
                .map(xml::text);
            let name = loose.attribute("name").or(written).unwrap_or_default();
            let message = format!("no joint connects `{name}` to the other links");
            reader.error(
                "W035",
                *loose,
                message,
                "add a `<joint type=\"fixed\">`, or write `<static>true</static>`",
            );
        }
    }

    /// Adds the bodies of the included models.
    pub(crate) fn read_included(
        &self,
        role: Role,
        body: &mut Body,
        shapes: &mut Shapes,
        reader: &mut Reader,
    ) {
        for (include, at) in &self.includes {
            if let Some((included, placed)) = read_include(*include, role, shapes, reader) {
                add(included, &(at * placed), body);
            }
        }
    }
}

/// Reads the model that an `<include>` names, and its pose in the frame of the parent. Returns
/// `None` after it has reported a fault.
fn read_include(
    include: Node,
    role: Role,
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> Option<(Body, Isometry3<f64>)> {
    reader.warn_about_unknown_children(
        include,
        &["uri", "name", "pose", "static", "plugin", "placement_frame"],
    );
    let uri = reader.required(include, "uri")?;
    if shapes.depth >= DEEPEST {
        let message =
            format!("models are included more than {DEEPEST} levels deep: one includes itself");
        reader.error("W035", uri, message, "remove the `<include>`");
        return None;
    }
    let model = folder::included(
        uri,
        shapes.lookup,
        role,
        shapes.depth + 1,
        std::iter::empty(),
        reader,
    )?;
    shapes.digest.update(model.digest.as_bytes());
    let own = if xml::child(include, "pose").is_some() {
        pose(include, reader)?
    } else {
        model.pose
    };
    Some((model.body, own))
}

/// Adds a body at a pose to another one.
fn add(other: Body, at: &Isometry3<f64>, body: &mut Body) {
    let turn = at.rotation.to_rotation_matrix();
    body.parts.extend(other.parts.into_iter().map(|part| Part {
        pose: Pose::from_isometry(&(at * part.pose.to_isometry())),
        shape: part.shape,
    }));
    body.masses.extend(other.masses.into_iter().map(|mass| {
        Mass {
            kg: mass.kg,
            com: (at * Point3::from(mass.com)).coords,
            about_com: mass
                .about_com
                .map(|moments| turn.matrix() * moments * turn.matrix().transpose()),
        }
    }));
    let joint = |joint: PartJoint| PartJoint {
        axis: (at.rotation * Vector3::from(joint.axis)).into(),
        anchor_m: (at * Point3::from(joint.anchor_m)).coords.into(),
        ..joint
    };
    let first = body.moving.len();
    for moved in other.moving {
        let mut part = Body::default();
        add(moved.body, at, &mut part);
        let (on, joint) = (moved.on.map(|on| on + first), joint(moved.joint));
        let name = free_name(&moved.name, &body.moving);
        body.moving.push(MovingBody {
            name,
            body: part,
            on,
            joint,
        });
    }
    body.has_unknown_mass |= other.has_unknown_mass;
    body.friction = body.friction.or(other.friction);
    body.restitution = body.restitution.or(other.restitution);
}
