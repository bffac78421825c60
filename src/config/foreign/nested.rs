//! The links of an SDF model together with those of the models in it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Point3, Vector3};

use crate::foreign::assembly::{Assembly, Join};
use crate::foreign::body::{Body, Role};
use crate::foreign::elements::Children;
use crate::foreign::folder::{self, Including};
use crate::foreign::frames::{Frame, Included, OWN};
use crate::foreign::geometry::Shapes;
use crate::foreign::inclusions::check_size;
use crate::foreign::sdf::is_static;
use crate::foreign::sdf_ends::{JointEnd, WrittenPart, last_name};
use crate::foreign::sdf_pose::{self, pose, prefix};
use crate::foreign::sdf_surface::{
    Surface, prefixed, refuse_self_collision, warn_of_usual_friction,
};
use crate::foreign::xml::{self, Node, Reader};
use crate::foreign::{sdf_joint, sdf_link};
use actcheck_base::Span;
use actcheck_data::PartJoint;

/// Of the elements that are read, `allow_auto_disable`, `name` and `origin` have no effect.
pub(super) const MODEL: Children = Children {
    read: &[
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
    ],
    harmless: &[],
    refused: &[],
};
const INCLUDE: Children = Children {
    read: &[
        "uri",
        "name",
        "pose",
        "static",
        "placement_frame",
        "plugin",
        "experimental_params",
    ],
    harmless: &[],
    refused: &[],
};

/// A link with its solids and its mass. Frame: that of the outermost model.
pub(crate) struct Link {
    /// With the names of the models in the outermost one that contain it.
    pub(crate) name: String,
    pub(crate) pose: Isometry3<f64>,
    pub(crate) body: Body,
    /// The link, or the `<include>` of its model.
    at: Span,
}

/// A joint between two links, by their indices, or between a link and the world.
struct Joint {
    name: String,
    /// The joint, or the `<include>` of its model.
    at: Span,
    parent: Option<usize>,
    child: Option<usize>,
    /// `None` if it is fixed.
    moves: Option<PartJoint>,
    /// Whether it ties its child to the world.
    to_world: bool,
}

/// A model as its files state it, with nested and included ones.
pub(crate) struct Tree {
    /// The model in the text.
    at: Span,
    pub(crate) links: Vec<Link>,
    joints: Vec<Joint>,
    /// Whether the file says that the model never moves, or it is part of such a model.
    fixed: bool,
    /// Whether a joint has a fault that is reported already.
    has_faulty_joint: bool,
    /// A switch by which links collide with each other.
    collides: Option<Span>,
}

/// A model that another one includes.
pub(crate) struct SubModel {
    pub(crate) tree: Tree,
    pub(crate) place: Included,
    pub(crate) is_static: bool,
    /// Digest of the file and its meshes.
    pub(crate) digest: String,
}

/// The elements of a model and of the models nested in it, and the models that they include.
#[derive(Default)]
struct Elements<'a> {
    links: Vec<WrittenPart<'a>>,
    joints: Vec<WrittenPart<'a>>,
    includes: Vec<WrittenPart<'a>>,
    /// A switch by which links of a model that can move collide with each other.
    collides: Option<Span>,
    models: BTreeMap<usize, SubModel>,
}

impl Tree {
    /// Reads a model. `fixed`: it is part of a model that never moves.
    pub(crate) fn read(
        model: Node,
        role: Role,
        fixed: bool,
        shapes: &mut Shapes,
        reader: &mut Reader,
    ) -> Self {
        let fixed = role == Role::Furniture || fixed || is_static(model, reader);
        let mut elements = Elements::default();
        elements.include_all(model, (role, fixed), shapes, reader);
        elements.collect(model, &Isometry3::identity(), "", (role, fixed), reader);
        let mut tree = Self {
            at: xml::span(model),
            links: Vec::new(),
            joints: Vec::new(),
            fixed,
            has_faulty_joint: false,
            collides: elements.collides.take(),
        };
        let stays = fixed || elements.stay();
        for link in &elements.links {
            tree.read_link(link, (role, stays), shapes, reader);
        }
        tree.add_included(&mut elements, shapes, reader);
        for joint in &elements.joints {
            match fixed {
                true => warn_of_motion(joint.node, role, reader),
                false => match tree.read_joint(joint, reader) {
                    Some(joint) => tree.joints.push(joint),
                    None => tree.has_faulty_joint = true,
                },
            }
        }
        tree
    }

    /// Converts a body of another format, with those that joints move, to links. Returns their
    /// frames, too. `fixed`: it is part of a model that never moves.
    pub(crate) fn of_body(mut base: Body, fixed: bool) -> (Self, BTreeMap<String, Frame>) {
        let mut tree = Self {
            at: 0..0,
            links: Vec::new(),
            joints: Vec::new(),
            fixed: fixed || base.fixed,
            has_faulty_joint: false,
            collides: None,
        };
        let moving = std::mem::take(&mut base.moving);
        tree.push_body(OWN.to_owned(), base);
        for part in moving {
            tree.joints.push(Joint {
                name: part.name.clone(),
                at: 0..0,
                parent: Some(part.on.map_or(0, |idx| idx + 1)),
                child: Some(tree.links.len()),
                moves: Some(part.joint),
                to_world: false,
            });
            tree.push_body(part.name, part.body);
        }
        let frames = tree.links.iter().map(|link| {
            let frame = Frame {
                pose: link.pose,
                link: Some(link.name.clone()),
            };
            (link.name.clone(), frame)
        });
        let frames = frames.collect();
        (tree, frames)
    }

    fn push_body(&mut self, name: String, body: Body) {
        self.links.push(Link {
            name,
            pose: Isometry3::identity(),
            body,
            at: 0..0,
        });
    }

    fn read_link(
        &mut self,
        link: &WrittenPart,
        (role, stays): (Role, bool),
        shapes: &mut Shapes,
        reader: &mut Reader,
    ) {
        let at = link.model * pose(link.node, reader).unwrap_or_default();
        let body = sdf_link::read(link.node, &at, (role, stays), shapes, reader);
        let name = link.node.attribute("name").unwrap_or_default();
        self.links.push(Link {
            name: format!("{}{name}", link.prefix),
            pose: at,
            body,
            at: xml::span(link.node),
        });
    }

    /// Adds the links and joints of included models.
    fn add_included(&mut self, elements: &mut Elements, shapes: &mut Shapes, reader: &mut Reader) {
        for include in &elements.includes {
            let Some(model) = elements.models.remove(&include.node.range().start) else {
                continue;
            };
            shapes.digest.update(model.digest.as_bytes());
            let n_links = self.links.len() + model.tree.links.len();
            if let Some(own) = pose(include.node, reader)
                && check_size(n_links, include.node, reader).is_some()
            {
                let prefix = format!("{}{}", include.prefix, prefix(include.node, reader));
                self.add(model.tree, &(include.model * own), &prefix, include.node);
            }
        }
    }

    /// Adds a model at a pose. Its places in its own file become that of the `<include>`.
    fn add(&mut self, other: Self, at: &Isometry3<f64>, prefix: &str, include: Node) {
        let first = self.links.len();
        if other.collides.is_some() && self.collides.is_none() {
            self.collides = Some(xml::span(include));
        }
        self.links.extend(other.links.into_iter().map(|mut link| {
            link.body.transform(at);
            link.body.fixed = self.fixed;
            Link {
                name: format!("{prefix}{}", link.name),
                pose: at * link.pose,
                body: link.body,
                at: xml::span(include),
            }
        }));
        self.joints
            .extend(other.joints.into_iter().map(|joint| Joint {
                name: format!("{prefix}{}", joint.name),
                at: xml::span(include),
                parent: joint.parent.map(|idx| idx + first),
                child: joint.child.map(|idx| idx + first),
                moves: joint.moves.map(|moves| PartJoint {
                    axis: (at.rotation * Vector3::from(moves.axis)).into(),
                    anchor_m: (at * Point3::from(moves.anchor_m)).coords.into(),
                    ..moves
                }),
                to_world: joint.to_world,
            }));
    }

    /// Reads a joint of a model that can move. Reports W051 if it does not connect links.
    fn read_joint(&self, joint: &WrittenPart, reader: &mut Reader) -> Option<Joint> {
        let node = joint.node;
        sdf_joint::JOINT.check(node, reader);
        let is_rigid = sdf_joint::is_rigid(node);
        if !is_rigid {
            sdf_joint::kind(node, reader)?;
        }
        let name = node.attribute("name").unwrap_or_default();
        let links: Vec<&str> = self.links.iter().map(|link| link.name.as_str()).collect();
        let (parent, child) = (
            joint.end("parent", &links, reader),
            joint.end("child", &links, reader),
        );
        let (parent, child) = (parent?, child?);
        let to_world = [parent, child].contains(&JointEnd::World);
        let moves = if is_rigid {
            None
        } else {
            let usual = joint.frame_of_child(child, |idx| self.links[idx].pose, reader)?;
            let moves = sdf_joint::read(node, &usual, &joint.model, reader)?;
            if to_world {
                let message = format!("the joint `{name}` moves the whole model against the world");
                let help = "connect links of the model itself, or make the joint `fixed`";
                reader.error("W035", node, message, help);
                return None;
            }
            Some(moves)
        };
        Some(Joint {
            name: format!("{}{name}", joint.prefix),
            at: xml::span(node),
            parent: parent.link(),
            child: child.link(),
            moves,
            to_world,
        })
    }

    /// Returns the bodies that the links form: one, with those that joints move. Nothing moves in a
    /// model that is fixed, and after a fault. Reports links that no joint connects to the others
    /// (W035).
    pub(crate) fn into_body(self, role: Role, reader: &mut Reader) -> Body {
        let fixed = self.fixed || self.joints.iter().any(Joint::anchors);
        let joins: Vec<Join> = {
            let joints = self.joints.iter();
            joints.filter_map(|joint| joint.join(reader)).collect()
        };
        let joins = if self.fixed { Vec::new() } else { joins };
        let assembly = Assembly::of(self.links.len(), &joins, &mut reader.found);
        if !fixed && !self.has_faulty_joint {
            self.check_connected(&joins, reader);
        }
        let names: Vec<String> = self
            .links
            .iter()
            .map(|link| last_name(&link.name).to_owned())
            .collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let mut bodies = assembly.empty_bodies(fixed);
        for (idx, link) in self.links.into_iter().enumerate() {
            let body = &mut bodies[assembly.body_of(idx)];
            let material = Surface {
                friction: link.body.friction,
                restitution: link.body.restitution,
            };
            material.check(body, link.at, role, reader);
            body.add(link.body);
        }
        for body in &bodies {
            warn_of_usual_friction(body, self.at.clone(), reader);
        }
        let (body, _) = assembly.attach(bodies, &names, &mut reader.found);
        refuse_self_collision(&body, self.collides, reader);
        body
    }

    /// Checks that joints connect all links of a model that can move (W035): reports each group of
    /// links that is apart from the first link. A single one without shapes and mass is left out
    /// (W036).
    fn check_connected(&self, joins: &[Join], reader: &mut Reader) {
        let mut reached = BTreeSet::new();
        for start in 0..self.links.len() {
            if !reached.insert(start) {
                continue;
            }
            let mut open = vec![start];
            let mut n_links = 0;
            while let Some(link) = open.pop() {
                n_links += 1;
                for [from, to] in joins
                    .iter()
                    .flat_map(|join| [[join.parent, join.child], [join.child, join.parent]])
                {
                    if from == link && reached.insert(to) {
                        open.push(to);
                    }
                }
            }
            if start > 0 {
                self.report_loose(start, n_links, reader);
            }
        }
    }

    /// Reports a group of links that is apart from the others, by its first link.
    fn report_loose(&self, first: usize, n_links: usize, reader: &mut Reader) {
        let link = &self.links[first];
        let (name, at) = (&link.name, link.at.clone());
        let body = &link.body;
        if n_links == 1 && body.parts.is_empty() && body.masses.iter().all(|mass| mass.kg == 0.0) {
            let message = format!("`{name}` is left out: no joint connects it to the other links");
            let help = "it has no shape and no mass; a joint of the type `fixed` would hold it";
            reader.warning_at("W036", at, message, help);
            return;
        }
        let others = match n_links {
            1 => String::new(),
            2 => " and the link joined to it".to_owned(),
            _ => format!(" and the {} links joined to it", n_links - 1),
        };
        let message = format!("no joint connects `{name}`{others} to the other links");
        let help = "add a `<joint type=\"fixed\">`, or write `<static>true</static>`";
        reader.error_at("W035", at, message, help);
    }
}

impl Joint {
    /// Whether it ties the model to the world.
    fn anchors(&self) -> bool {
        self.to_world && self.moves.is_none()
    }

    fn join(&self, reader: &Reader) -> Option<Join> {
        Some(Join {
            place: reader.located(self.at.clone()),
            parent: self.parent?,
            child: self.child?,
            joint: self.moves,
        })
    }
}

/// Warns of a joint that does not move in a world.
fn warn_of_motion(joint: Node, role: Role, reader: &mut Reader) {
    if role == Role::Furniture && joint.attribute("type") != Some("fixed") {
        let name = joint.attribute("name").unwrap_or_default();
        let message = format!("the joint `{name}` does not move in a world here");
        reader.warning("W036", joint, message, "it stays as in the file");
    }
}

impl<'a> Elements<'a> {
    /// Reads all models that a model includes, so that their frames are known.
    fn include_all(
        &mut self,
        model: Node<'a>,
        (role, fixed): (Role, bool),
        shapes: &mut Shapes,
        reader: &mut Reader,
    ) {
        for child in model.children() {
            match child.tag_name().name() {
                "model" => self.include_all(child, (role, fixed), shapes, reader),
                "include" => {
                    if let Some(included) = include(child, (role, fixed), shapes, reader) {
                        self.models.insert(child.range().start, included);
                    }
                }
                _ => {}
            }
        }
    }

    /// Collects the elements of a model and of those nested in it.
    fn collect(
        &mut self,
        model: Node<'a>,
        at: &Isometry3<f64>,
        prefix: &str,
        (role, fixed): (Role, bool),
        reader: &mut Reader,
    ) {
        MODEL.check(model, reader);
        if !fixed && self.collides.is_none() {
            self.collides = self_collision(model, reader);
        }
        for child in model.children().filter(Node::is_element) {
            let written = |node| WrittenPart {
                node,
                model: *at,
                prefix: prefix.to_owned(),
            };
            match child.tag_name().name() {
                "link" => self.links.push(written(child)),
                "joint" => self.joints.push(written(child)),
                "include" => self.includes.push(written(child)),
                "model" => {
                    if !fixed && is_static(child, reader) {
                        refuse_static(child, reader);
                    }
                    if let Some(nested) = pose(child, reader) {
                        let prefix = format!("{prefix}{}", sdf_pose::prefix(child, reader));
                        self.collect(child, &(at * nested), &prefix, (role, fixed), reader);
                    }
                }
                "gripper" if role == Role::Object => {
                    let message = "`<gripper>` inside a model is not supported".to_owned();
                    let help = "leave it out; `[robot] profile` names robots";
                    reader.error("W035", child, message, help);
                }
                "plugin" => warn_of_plugin(child, reader),
                _ => {}
            }
        }
    }

    /// Whether a joint ties the model to the world, and none of its joints moves.
    fn stay(&self) -> bool {
        let to_world = |joint: &WrittenPart| {
            let name = |end| xml::child(joint.node, end).map(xml::text);
            [name("parent"), name("child")].contains(&Some("world"))
        };
        self.joints.iter().any(to_world)
            && self
                .joints
                .iter()
                .all(|joint| sdf_joint::is_rigid(joint.node))
    }
}

/// Returns the place of a switch of a model, or of one of its links, that makes links collide with
/// each other.
fn self_collision(model: Node, reader: &mut Reader) -> Option<Span> {
    let places = std::iter::once(model).chain(xml::children(model, "link"));
    places
        .filter_map(|place| xml::child(place, "self_collide"))
        .find(|switch| reader.boolean(*switch) == Some(true))
        .map(xml::span)
}

pub(super) fn warn_of_plugin(plugin: Node, reader: &mut Reader) {
    let message = "the plugin is not run".to_owned();
    let help = "forces and motions by plugins are not simulated";
    reader.warning("W036", plugin, message, help);
}

/// Reports a static model inside one that can move (W035).
pub(super) fn refuse_static(model: Node, reader: &mut Reader) {
    let message = "a static model inside one that can move can't be simulated".to_owned();
    let help = "remove its `<static>`, or make the whole model static";
    let node = xml::child(model, "static").unwrap_or(model);
    reader.error("W035", node, message, help);
}

/// Reads the model that an `<include>` in a model names. Returns `None` after it has reported a
/// fault.
fn include(
    include: Node,
    (role, fixed): (Role, bool),
    shapes: &mut Shapes,
    reader: &mut Reader,
) -> Option<SubModel> {
    check_include(include, |_| false, reader);
    let uri = reader.required(include, "uri")?;
    let merged = reader.boolean_attribute(include, "merge")?;
    let file = Including {
        path: shapes.path,
        lookup: shapes.lookup,
        inclusions: &shapes.inclusions,
    };
    let known = std::iter::empty();
    let mut model = folder::included(uri, &file, (role, fixed), known, reader)?;
    // A merged model leaves `<static>` to the model that includes it.
    let is_static = match xml::child(include, "static") {
        Some(written) => reader.boolean(written)?,
        None => model.is_static && !merged,
    };
    if is_static && !fixed {
        refuse_static(include, reader);
        return None;
    }
    model.place.merged = merged;
    register(include, &model.place, reader);
    Some(model)
}

/// Reports the elements of an `<include>` that are not read, other than those plugins which
/// `is_read` accepts.
pub(crate) fn check_include(include: Node, is_read: impl Fn(Node) -> bool, reader: &mut Reader) {
    INCLUDE.check(include, reader);
    for plugin in xml::children(include, "plugin").filter(|plugin| !is_read(*plugin)) {
        warn_of_plugin(plugin, reader);
    }
    if let Some(params) = prefixed(include, "experimental", "params") {
        let message = "changes of an included model can't be read".to_owned();
        let help = "write the changed model to a folder of its own";
        reader.error("W035", params, message, help);
    }
}

/// Makes the frames of an included model known to the elements of the file that includes it.
pub(crate) fn register(include: Node, place: &Included, reader: &mut Reader) {
    let mut place = place.clone();
    if let Some(name) = xml::child(include, "name") {
        xml::text(name).clone_into(&mut place.name);
    }
    reader.included.insert(include.range().start, place);
}
