//! The links and joints of a robot in SDF together with those of the models in it.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::foreign::inclusions::check_size;
use crate::foreign::nested::{MODEL, refuse_static, warn_of_plugin};
use crate::foreign::sdf::is_static;
use crate::foreign::sdf_ends::{JointEnd, WrittenPart};
use crate::foreign::sdf_pose::{self, pose};
use crate::foreign::sdf_robot_include::{SdfFile, Submodels};
use crate::foreign::xml::{self, Bound, Node, Reader};
use crate::foreign::{sdf_robot_joint, sdf_robot_link};
use actcheck_base::{Diagnostics, did_you_mean};
use actcheck_data::{Mesh, TreeJoint, TreeLink, TreeMimic, TreeMotion};

/// Longest name of a link with those of the models around it: all pairs of links may be listed.
const LONGEST_NAME: usize = 500;

/// A link. The poses in it are in its own frame.
pub(crate) struct LinkAt {
    pub(crate) link: TreeLink,
    /// Frame: that of the outermost model.
    pub(crate) at: Isometry3<f64>,
    /// The beginning of the names in its own model.
    pub(crate) model: String,
    /// Whether its file says that it collides with the other links of its model.
    pub(crate) collides: Option<bool>,
    /// Faults of shapes that are only seen.
    pub(crate) faults_of_visuals: Option<Diagnostics>,
    /// Whether its file states no mass.
    pub(crate) lacks_mass: bool,
    /// Whether its file does not state all moments of inertia.
    pub(crate) lacks_moments: bool,
}

/// A joint. The names of its ends and its origin are those of its own file, or empty.
pub(crate) struct JointAt {
    /// Its axis is in the frame of the outermost model.
    pub(crate) joint: TreeJoint,
    /// Parent and child.
    pub(crate) ends: [JointEnd; 2],
    /// The frame of the joint. Frame: that of the outermost model.
    pub(crate) frame: Isometry3<f64>,
}

/// The links and joints of a model with those in it.
#[derive(Default)]
pub(crate) struct Group {
    pub(crate) links: Vec<LinkAt>,
    pub(crate) joints: Vec<JointAt>,
    /// Pairs of links that pass through each other.
    pub(crate) passing: Vec<[String; 2]>,
    /// Meshes without a file.
    pub(crate) meshes: BTreeMap<String, Mesh>,
    /// The texts of included files.
    pub(crate) texts: String,
}

impl Group {
    pub(crate) fn n_moving(&self) -> usize {
        let moves = |joint: &&JointAt| joint.joint.motion != TreeMotion::Fixed;
        self.joints.iter().filter(moves).count()
    }

    /// Adds a model at a pose, with names that begin with `prefix`.
    fn add(&mut self, mut other: Self, at: &Isometry3<f64>, prefix: &str) {
        let first = self.links.len();
        other.change_names(|name| format!("{prefix}{name}"));
        self.links
            .extend(other.links.into_iter().map(|link| LinkAt {
                at: at * link.at,
                ..link
            }));
        self.joints
            .extend(other.joints.into_iter().map(|mut moved| {
                moved.joint.axis = at.rotation * moved.joint.axis;
                JointAt {
                    joint: moved.joint,
                    ends: moved.ends.map(|end| match end {
                        JointEnd::Link(idx) => JointEnd::Link(idx + first),
                        JointEnd::World => JointEnd::World,
                    }),
                    frame: at * moved.frame,
                }
            }));
        self.passing.extend(other.passing);
        self.meshes.extend(other.meshes);
        self.texts.push_str(&other.texts);
    }

    /// Removes the beginning of all names.
    pub(crate) fn rename(&mut self, prefix: &str) {
        self.change_names(|name| name.strip_prefix(prefix).unwrap_or(name).to_owned());
    }

    fn change_names(&mut self, changed: impl Fn(&str) -> String) {
        let meshes = std::mem::take(&mut self.meshes);
        for link in &mut self.links {
            link.model = changed(&link.model);
            link.link.name = changed(&link.link.name);
            sdf_robot_link::rename_meshes(&mut link.link, &meshes, &changed);
        }
        self.meshes = meshes
            .into_iter()
            .map(|(name, mesh)| (changed(&name), mesh))
            .collect();
        for joint in &mut self.joints {
            joint.joint.name = changed(&joint.joint.name);
            if let Some(mimic) = &mut joint.joint.mimic {
                mimic.leader = changed(&mimic.leader);
            }
        }
        for name in self.passing.iter_mut().flatten() {
            *name = changed(name);
        }
    }

    /// Adds the pairs of links of one model that pass through each other, because one of the two has
    /// `<self_collide>` of false.
    /// Reports names that are too long (W055).
    fn add_passing(&mut self, reader: &mut Reader) {
        let longest = self.links.iter().max_by_key(|link| link.link.name.len());
        if let Some(link) = longest.filter(|link| link.link.name.len() > LONGEST_NAME) {
            let message = format!(
                "with its models, the name of this link is longer than {LONGEST_NAME} bytes"
            );
            let help = "give links and models shorter names";
            reader.error_in("W055", xml::at_tag(&link.link.place), message, help);
            return;
        }
        let solid = || {
            self.links
                .iter()
                .filter(|link| !link.link.solids.is_empty())
        };
        for (idx, first) in solid().enumerate() {
            for second in solid().skip(idx + 1) {
                let is_pair = first.model == second.model
                    && [first.collides, second.collides].contains(&Some(false));
                if is_pair {
                    self.passing
                        .push([first.link.name.clone(), second.link.name.clone()]);
                }
            }
        }
        for link in &mut self.links {
            link.collides = None;
        }
    }
}

/// A link of a model, before it is read.
struct WrittenLink<'a> {
    part: WrittenPart<'a>,
    /// Whether links of its model collide with each other.
    collides: Option<bool>,
}

/// The elements of a model and of the models nested in it, and the models that they include.
#[derive(Default)]
pub(crate) struct RobotElements<'a> {
    links: Vec<WrittenLink<'a>>,
    joints: Vec<WrittenPart<'a>>,
    includes: Vec<WrittenPart<'a>>,
    /// Plugins by which a joint follows another.
    couplings: Vec<WrittenPart<'a>>,
    pub(crate) models: Submodels,
}

impl<'a> RobotElements<'a> {
    /// Adds a `<model>` or an `<include>`. `places`: its own pose counts, and its names have a
    /// beginning.
    pub(crate) fn add(
        &mut self,
        node: Node<'a>,
        at: &Isometry3<f64>,
        (places, prefix): (bool, &str),
        reader: &mut Reader,
    ) {
        if node.tag_name().name() == "include" {
            self.includes.push(WrittenPart {
                node,
                model: *at,
                prefix: String::new(),
            });
            return;
        }
        let own = match places {
            true => pose(node, reader).unwrap_or_default(),
            false => Isometry3::identity(),
        };
        if is_static(node, reader) {
            let message = "a robot that is `<static>` can't move".to_owned();
            let help = "remove it; a joint of the type `fixed` to `world` holds the robot's base";
            reader.error(
                "W035",
                xml::child(node, "static").unwrap_or(node),
                message,
                help,
            );
        }
        self.add_model(node, &(at * own), prefix, reader);
    }

    /// Adds the elements of a model and of those nested in it.
    pub(crate) fn add_model(
        &mut self,
        model: Node<'a>,
        at: &Isometry3<f64>,
        prefix: &str,
        reader: &mut Reader,
    ) {
        MODEL.check(model, reader);
        let collides = xml::child(model, "self_collide").and_then(|node| reader.boolean(node));
        for child in model.children().filter(Node::is_element) {
            let written = |node| WrittenPart {
                node,
                model: *at,
                prefix: prefix.to_owned(),
            };
            match child.tag_name().name() {
                "link" => self.links.push(WrittenLink {
                    part: written(child),
                    collides,
                }),
                "joint" => self.joints.push(written(child)),
                "include" => self.includes.push(written(child)),
                "model" => {
                    if is_static(child, reader) {
                        refuse_static(child, reader);
                    }
                    if let Some(nested) = pose(child, reader) {
                        let prefix = format!("{prefix}{}", sdf_pose::prefix(child, reader));
                        self.add_model(child, &(at * nested), &prefix, reader);
                    }
                }
                "plugin" if sdf_robot_joint::is_coupling(child) => {
                    self.couplings.push(written(child));
                }
                "plugin" => warn_of_plugin(child, reader),
                "gripper" => {
                    let message = "`<gripper>` in `<model>` is ignored".to_owned();
                    reader.warning("W036", child, message, "grippers hold by friction here");
                }
                _ => {}
            }
        }
    }

    /// Adds joints of the world that contains the robot.
    pub(crate) fn add_joints(&mut self, joints: &[Node<'a>], to_robot: &Isometry3<f64>) {
        self.joints.extend(joints.iter().map(|node| WrittenPart {
            node: *node,
            model: *to_robot,
            prefix: String::new(),
        }));
    }

    /// Reads all elements.
    pub(crate) fn into_group(mut self, file: &SdfFile, reader: &mut Reader) -> Group {
        let mut group = Group::default();
        for link in &self.links {
            read_link(link, &mut group, file, reader);
        }
        for include in &self.includes {
            let Some(model) = self.models.take(include.node) else {
                continue;
            };
            let n_links = group.links.len() + model.links.len();
            if let Some(own) = pose(include.node, reader)
                && check_size(n_links, include.node, reader).is_some()
            {
                let prefix = format!(
                    "{}{}",
                    include.prefix,
                    sdf_pose::prefix(include.node, reader)
                );
                group.add(model, &(include.model * own), &prefix);
                let plugins = xml::children(include.node, "plugin");
                let couplings = plugins.filter(|plugin| sdf_robot_joint::is_coupling(*plugin));
                self.couplings.extend(couplings.map(|node| WrittenPart {
                    node,
                    model: include.model,
                    prefix: prefix.clone(),
                }));
            }
        }
        group.add_passing(reader);
        for joint in &self.joints {
            if let Some(read) = read_joint(joint, &group, reader) {
                group.joints.push(read);
            }
        }
        for coupling in &self.couplings {
            couple(coupling, &mut group, reader);
        }
        group
    }
}

fn read_link(
    WrittenLink {
        part: link,
        collides,
    }: &WrittenLink,
    group: &mut Group,
    file: &SdfFile,
    reader: &mut Reader,
) {
    let at = link.model * pose(link.node, reader).unwrap_or_default();
    let Some(name) = reader.attribute(link.node, "name") else {
        return;
    };
    let name = format!("{}{name}", link.prefix);
    if group.links.iter().any(|known| known.link.name == name) {
        let message = format!("there are two links `{name}`");
        reader.error("W051", link.node, message, "give one of them another name");
        return;
    }
    let mut read = sdf_robot_link::read(link.node, &name, file, &mut group.meshes, reader);
    read.at = at;
    read.model.clone_from(&link.prefix);
    read.collides = read.collides.or(*collides);
    group.links.push(read);
}

/// Reads a joint. Returns `None` if it does not connect links, after it has reported the fault. One
/// with another fault is of an unknown kind.
fn read_joint(joint: &WrittenPart, group: &Group, reader: &mut Reader) -> Option<JointAt> {
    let node = joint.node;
    let own_name = reader.attribute(node, "name")?;
    let name = format!("{}{own_name}", joint.prefix);
    if group.joints.iter().any(|known| known.joint.name == name) {
        let message = format!("there are two joints `{name}`");
        reader.error("W051", node, message, "give one of them another name");
        return None;
    }
    let links = group.links.iter().map(|link| link.link.name.as_str());
    let links: Vec<&str> = links.collect();
    let [parent, child] = ["parent", "child"].map(|which| joint.end(which, &links, reader));
    let (parent, child) = (parent?, child?);
    let usual = joint.frame_of_child(child, |idx| group.links[idx].at, reader)?;
    let frame = usual * pose(node, reader)?;
    let own = joint.model.rotation.inverse() * frame.rotation;
    let fixed = TreeJoint::fixed(name, ["", ""], Isometry3::identity(), reader.place(node));
    let mut read = sdf_robot_joint::read(node, fixed.clone(), own, reader).unwrap_or(TreeJoint {
        motion: TreeMotion::Unknown,
        ..fixed
    });
    read.axis = joint.model.rotation * read.axis;
    if let Some(mimic) = &mut read.mimic {
        mimic.leader.insert_str(0, &joint.prefix);
    }
    Some(JointAt {
        joint: read,
        ends: [parent, child],
        frame,
    })
}

/// Gives a joint the coupling of a plugin.
fn couple(plugin: &WrittenPart, group: &mut Group, reader: &mut Reader) {
    let node = plugin.node;
    let named = |which: &str| {
        let name = xml::child(node, which).map_or("", xml::text);
        format!("{}{name}", plugin.prefix)
    };
    let (leader, follower) = (named("joint"), named("mimicJoint"));
    let mut number = |name: &str, otherwise: f64| match xml::child(node, name) {
        Some(written) => reader.number(written, Bound::Finite).unwrap_or(otherwise),
        None => otherwise,
    };
    let (factor, offset) = (number("multiplier", 1.0), number("offset", 0.0));
    let place = reader.place(node);
    let joint = group
        .joints
        .iter_mut()
        .find(|joint| joint.joint.name == follower);
    match joint {
        Some(joint) => {
            joint.joint.mimic = Some(TreeMimic {
                leader,
                factor,
                offset,
                place,
            });
        }
        None => {
            let known = group.joints.iter().map(|joint| joint.joint.name.as_str());
            let help = did_you_mean(&follower, known);
            let message = format!("the model has no joint `{follower}` to follow `{leader}`");
            reader.error("W051", node, message, help);
        }
    }
}
