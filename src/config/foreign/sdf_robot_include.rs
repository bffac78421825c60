//! Reads the models that a robot in SDF includes, each with the places of its own file.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use crate::foreign::folder::{self, ModelText};
use crate::foreign::frames::{Frame, Included, OWN};
use crate::foreign::inclusions::Inclusions;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::nested::{check_include, refuse_static, register};
use crate::foreign::sdf::{is_static, root_model};
use crate::foreign::sdf_ends::JointEnd;
use crate::foreign::sdf_pose;
use crate::foreign::sdf_robot_joint::is_coupling;
use crate::foreign::sdf_robot_model::{Group, JointAt, LinkAt, RobotElements};
use crate::foreign::xml::{self, Node, Reader};
use crate::foreign::{mjcf, root_name, urdf_tree};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::{ModelTree, TreeGeometry, TreeJoint};

/// A file of a robot.
pub(crate) struct SdfFile<'a> {
    pub(crate) lookup: &'a Lookup<'a>,
    pub(crate) path: &'a Path,
    /// The models that include this one.
    pub(crate) inclusions: Inclusions,
}

impl SdfFile<'_> {
    /// Returns a mesh's URI as a path that does not depend on this file, if that is an included one.
    pub(crate) fn mesh(&self, uri: &str) -> String {
        match self.lookup.resolve(uri, self.path) {
            Ok(path) if self.inclusions.is_inside() => format!("file://{}", path.display()),
            _ => uri.to_owned(),
        }
    }
}

/// A model that another one includes.
pub(crate) struct Submodel {
    pub(crate) group: Group,
    place: Included,
    is_static: bool,
}

/// The included models that have been read, by the offset of their `<include>`.
#[derive(Default)]
pub(crate) struct Submodels(BTreeMap<usize, Group>);

impl Submodels {
    /// Reads the model of an `<include>`, or all that a model includes, and makes their frames
    /// known.
    pub(crate) fn read(&mut self, node: Node, file: &SdfFile, reader: &mut Reader) {
        match node.tag_name().name() {
            "model" => node
                .children()
                .for_each(|child| self.read(child, file, reader)),
            "include" => {
                if let Some(model) = include(node, file, reader) {
                    self.0.insert(node.range().start, model);
                }
            }
            _ => {}
        }
    }

    pub(crate) fn n_moving(&self) -> usize {
        self.0.values().map(Group::n_moving).sum()
    }

    pub(crate) fn extend(&mut self, others: Self) {
        self.0.extend(others.0);
    }

    /// Returns the model of an `<include>`; `None` after a fault.
    pub(crate) fn take(&mut self, include: Node) -> Option<Group> {
        self.0.remove(&include.range().start)
    }
}

/// Reads the model of an `<include>`. Returns `None` after it has reported a fault.
fn include(include: Node, file: &SdfFile, reader: &mut Reader) -> Option<Group> {
    check_include(include, is_coupling, reader);
    let uri = reader.required(include, "uri")?;
    file.inclusions.check_room(uri, reader)?;
    let merged = reader.boolean_attribute(include, "merge")?;
    let text = match folder::text_of(xml::text(uri), file.path, file.lookup) {
        Ok(Some(text)) => text,
        Ok(None) => {
            let message = format!("the model `{}` is missing", xml::text(uri));
            let help =
                "put its folder beside the robot's file, or name its folder with `--packages`";
            reader.error("W040", uri, message, help);
            return None;
        }
        Err(faults) => {
            reader.found.extend(faults);
            return None;
        }
    };
    let inclusions = file
        .inclusions
        .enter(file.path, &text.path, &text.source, uri, reader)?;
    let mut model = submodel(&text, file.lookup, inclusions, reader)?;
    let is_static = match xml::child(include, "static") {
        Some(written) => reader.boolean(written)?,
        None => model.is_static && !merged,
    };
    if is_static {
        refuse_static(include, reader);
    }
    model.place.merged = merged;
    register(include, &model.place, reader);
    model.group.texts.insert_str(0, &text.source.text);
    Some(model.group)
}

/// Reads a model of another file.
fn submodel(
    text: &ModelText,
    outer: &Lookup,
    inclusions: Inclusions,
    reader: &mut Reader,
) -> Option<Submodel> {
    let mut folders: Vec<_> = text
        .path
        .parent()
        .map(Path::to_path_buf)
        .into_iter()
        .collect();
    folders.extend(outer.folders.iter().cloned());
    let lookup = Lookup::new(outer.files, folders);
    let inner = SdfFile {
        lookup: &lookup,
        path: &text.path,
        inclusions,
    };
    let read = match root_name(&text.source.text) {
        Some("mujoco") => mjcf::robot(&text.source, &text.path, &lookup).map(|(tree, _, said)| {
            reader.found.extend(said);
            of_tree(tree, BTreeMap::new(), &inner)
        }),
        Some("robot") => urdf(&text.source, &inner, &mut reader.found),
        _ => sdf(&text.source, &inner, &mut reader.found),
    };
    match read {
        Ok(model) => model,
        Err(faults) => {
            reader.found.extend(faults);
            None
        }
    }
}

fn sdf(
    source: &Source,
    file: &SdfFile,
    found: &mut Diagnostics,
) -> Result<Option<Submodel>, Diagnostics> {
    let text = repaired(&source.text);
    let document = xml::parse_model(source, &text)?;
    let mut reader = Reader::new(source);
    let model = root_model(document.root_element(), &mut reader).and_then(|model| {
        let mut elements = RobotElements::default();
        elements.models.read(model, file, &mut reader);
        elements.add_model(model, &Isometry3::identity(), "", &mut reader);
        let place = sdf_pose::place(model, &mut reader)?;
        Some(Submodel {
            group: elements.into_group(file, &mut reader),
            place,
            is_static: is_static(model, &mut reader),
        })
    });
    found.extend(reader.found);
    Ok(model)
}

fn urdf(
    source: &Source,
    file: &SdfFile,
    found: &mut Diagnostics,
) -> Result<Option<Submodel>, Diagnostics> {
    let document = xml::parse_model(source, &source.text)?;
    let mut reader = Reader::new(source);
    let read = urdf_tree::read(document.root_element(), &mut reader);
    found.extend(reader.found);
    Ok(of_tree(read.tree, read.faults_of_visuals, file))
}

/// Returns the links and joints of a model in another format, with all joints at 0.
fn of_tree(
    tree: ModelTree,
    mut faults_of_visuals: BTreeMap<String, Diagnostics>,
    file: &SdfFile,
) -> Option<Submodel> {
    let mut poses: BTreeMap<String, Isometry3<f64>> = BTreeMap::new();
    let is_child = |name: &str| tree.joints.iter().any(|joint| joint.child == name);
    let root = tree
        .links
        .iter()
        .find(|link| !is_child(&link.name))?
        .name
        .clone();
    poses.insert(root.clone(), Isometry3::identity());
    for _ in 0..tree.joints.len() {
        let before = poses.len();
        for joint in &tree.joints {
            if let (Some(parent), false) =
                (poses.get(&joint.parent), poses.contains_key(&joint.child))
            {
                poses.insert(joint.child.clone(), parent * joint.origin);
            }
        }
        if poses.len() == before {
            break;
        }
    }
    let at = |name: &str| poses.get(name).copied().unwrap_or_default();
    let frame = |name: &str| Frame {
        pose: at(name),
        link: Some(name.to_owned()),
    };
    let mut frames: BTreeMap<String, Frame> = tree
        .links
        .iter()
        .map(|link| (link.name.clone(), frame(&link.name)))
        .collect();
    frames.insert(
        OWN.to_owned(),
        Frame {
            pose: Isometry3::identity(),
            link: Some(root),
        },
    );
    let position = |name: &str| tree.links.iter().position(|link| link.name == name);
    let end = |name: &str| position(name).map_or(JointEnd::World, JointEnd::Link);
    let joints = tree.joints.iter().map(|joint| {
        let frame = at(&joint.child);
        JointAt {
            ends: [end(&joint.parent), end(&joint.child)],
            joint: TreeJoint {
                axis: frame.rotation * joint.axis,
                ..joint.clone()
            },
            frame,
        }
    });
    let mut group = Group {
        joints: joints.collect(),
        passing: tree.passing.clone(),
        meshes: tree.inline_meshes.clone(),
        ..Group::default()
    };
    for mut link in tree.links {
        for solid in link.solids.iter_mut().chain(&mut link.visuals) {
            if let TreeGeometry::Mesh { file: uri, .. } = &mut solid.geometry
                && !group.meshes.contains_key(uri)
            {
                *uri = file.mesh(uri);
            }
        }
        group.links.push(LinkAt {
            at: poses.get(&link.name).copied().unwrap_or_default(),
            faults_of_visuals: faults_of_visuals.remove(&link.name),
            link,
            model: String::new(),
            collides: None,
            lacks_mass: false,
            lacks_moments: false,
        });
    }
    Some(Submodel {
        group,
        place: Included {
            name: tree.name,
            stated: Isometry3::identity(),
            placement: Isometry3::identity(),
            merged: false,
            frames,
        },
        is_static: false,
    })
}
