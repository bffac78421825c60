//! Reads a robot in SDF, Gazebo's format: a model with the models in it, or the models of a world
//! that joints connect.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};

use crate::foreign::inclusions::Inclusions;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::Lookup;
use crate::foreign::sdf::check_version;
use crate::foreign::sdf_pose::{self, pose};
use crate::foreign::sdf_robot_include::{SdfFile, Submodels};
use crate::foreign::sdf_robot_model::{Group, RobotElements};
use crate::foreign::sdf_robot_tree;
use crate::foreign::world::is_always_there;
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::ModelTree;

/// Heights and tilts below this are rounded zeros. Units: metres, radians.
const ROUNDED: f64 = 1e-9;

/// A robot of an SDF file.
pub(crate) struct SdfRobot {
    pub(crate) tree: ModelTree,
    /// The text, followed by those of included models.
    pub(crate) text: Source,
    /// Faults of shapes that are only seen, by link.
    pub(crate) faults_of_visuals: BTreeMap<String, Diagnostics>,
}

/// Reads the robot of a text: its only model, or that with the most moving joints together with
/// those that joints connect to it. Reports its faults: W031 to W036, W040, W051. The tree has no
/// links if there is no robot.
///
/// # Errors
/// The text is not XML (W031), or too large (W055).
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
    found: &mut Diagnostics,
) -> Result<SdfRobot, Diagnostics> {
    let text = repaired(&source.text);
    let document = xml::parse_model(source, &text)?;
    let mut reader = Reader::new(source);
    let file = SdfFile {
        lookup,
        path,
        inclusions: Inclusions::default(),
    };
    let (name, group) = robot(document.root_element(), &file, &mut reader).unwrap_or_default();
    let text = match group.texts.as_str() {
        "" => source.clone(),
        texts => Source::new(source.name.clone(), format!("{}{texts}", source.text)),
    };
    let robot = sdf_robot_tree::assemble(name, group, &mut reader);
    found.extend(reader.found);
    Ok(SdfRobot {
        tree: robot.tree,
        text,
        faults_of_visuals: robot.faults_of_visuals,
    })
}

/// A model at the top of a file or of a world.
struct Candidate<'a> {
    node: Node<'a>,
    name: String,
    models: Submodels,
    found: Diagnostics,
    n_moving: usize,
}

impl<'a> Candidate<'a> {
    /// Reads the models that a model includes, or that an `<include>` names.
    fn new(node: Node<'a>, file: &SdfFile, reader: &mut Reader) -> Self {
        let (models, found) = reader.aside(|reader| {
            let mut models = Submodels::default();
            models.read(node, file, reader);
            models
        });
        let own = node
            .descendants()
            .filter(|inner| inner.has_tag_name("joint") && inner.attribute("type") != Some("fixed"))
            .count();
        Self {
            node,
            name: sdf_pose::name_of(node, reader).unwrap_or_default(),
            n_moving: own + models.n_moving(),
            models,
            found,
        }
    }
}

/// Reads the robot of a document, with its name.
fn robot(root: Node, file: &SdfFile, reader: &mut Reader) -> Option<(String, Group)> {
    check_version(root, reader)?;
    let mut worlds = xml::children(root, "world");
    let world = worlds.next();
    if let Some(second) = worlds.next() {
        let message = "the file contains more than one world".to_owned();
        reader.error("W032", second, message, "give each a file of its own");
    }
    let container = world.unwrap_or(root);
    let is_robot = |node: &Node| match node.tag_name().name() {
        "model" => true,
        "include" => xml::child(*node, "uri").is_none_or(|uri| !is_always_there(uri)),
        _ => false,
    };
    let mut candidates: Vec<Candidate> = container
        .children()
        .filter(is_robot)
        .map(|node| Candidate::new(node, file, reader))
        .collect();
    let joints: Vec<Node> = xml::children(container, "joint").collect();
    let Some(chosen) = choose(&candidates, &joints, reader) else {
        reader.error(
            "W032",
            root,
            "the file contains no `<model>`".to_owned(),
            "a robot is a `<model>` with joints",
        );
        return None;
    };
    let name = candidates[chosen[0]].name.clone();
    leave_others(&candidates, &chosen, &name, reader);
    // The robot is in the frame of its first model: a scene places the whole.
    let base = candidates[chosen[0]].node;
    warn_of_pose(base, reader);
    let is_placed = world.is_some() || base.tag_name().name() == "include";
    let to_robot = match is_placed {
        true => pose(base, reader).unwrap_or_default().inverse(),
        false => Isometry3::identity(),
    };
    let mut elements = RobotElements::default();
    for idx in &chosen {
        let candidate = &mut candidates[*idx];
        reader.found.extend(std::mem::take(&mut candidate.found));
        elements
            .models
            .extend(std::mem::take(&mut candidate.models));
        let prefix = match world {
            Some(_) => sdf_pose::prefix(candidate.node, reader),
            None => String::new(),
        };
        elements.add(
            candidate.node,
            &to_robot,
            (world.is_some(), &prefix),
            reader,
        );
    }
    if world.is_some() {
        let names: Vec<&str> = chosen
            .iter()
            .map(|idx| candidates[*idx].name.as_str())
            .collect();
        let own = joints.iter().filter(|joint| {
            ends(**joint, reader)
                .iter()
                .flatten()
                .any(|end| names.contains(&end.as_str()))
        });
        let own: Vec<Node> = own.copied().collect();
        elements.add_joints(&own, &to_robot);
    }
    let mut group = elements.into_group(file, reader);
    if chosen.len() == 1 && (world.is_some() || base.has_tag_name("include")) {
        group.rename(&format!("{name}::"));
    }
    Some((name, group))
}

/// The models at the ends of a joint of a world.
fn ends(joint: Node, reader: &Reader) -> [Option<String>; 2] {
    ["parent", "child"].map(|which| {
        let named = xml::text(xml::child(joint, which)?);
        let link = sdf_pose::carrier(joint, named, reader).unwrap_or(named.to_owned());
        link.split_once("::").map(|(model, _)| model.to_owned())
    })
}

/// Returns the models that joints of the world connect to the one with the most moving joints. The
/// first is the one that carries the others.
fn choose(candidates: &[Candidate], joints: &[Node], reader: &Reader) -> Option<Vec<usize>> {
    let position = |name: &String| candidates.iter().position(|one| one.name == *name);
    let pairs: Vec<[usize; 2]> = joints
        .iter()
        .filter_map(|joint| {
            let [parent, child] = ends(*joint, reader);
            Some([position(&parent?)?, position(&child?)?])
        })
        .collect();
    let mut group_of: Vec<usize> = (0..candidates.len()).collect();
    for [first, second] in &pairs {
        let (kept, other) = (group_of[*first], group_of[*second]);
        for group in &mut group_of {
            if *group == other {
                *group = kept;
            }
        }
    }
    let members = |group: usize| (0..candidates.len()).filter(move |idx| group_of[*idx] == group);
    let moving = |group: usize| -> usize {
        let idxs = members.clone()(group);
        idxs.map(|idx| candidates[idx].n_moving).sum()
    };
    let best =
        (0..candidates.len()).max_by_key(|group| (moving(*group), std::cmp::Reverse(*group)))?;
    let mut chosen: Vec<usize> = members(best).collect();
    let is_carried = |idx: &usize| pairs.iter().any(|[_, child]| child == idx);
    chosen.sort_by_key(|idx| (is_carried(idx), *idx));
    Some(chosen)
}

/// Warns of models that are not part of the robot (W036).
fn leave_others(candidates: &[Candidate], chosen: &[usize], robot: &str, reader: &mut Reader) {
    for (idx, other) in candidates.iter().enumerate() {
        if !chosen.contains(&idx) {
            let message = format!("`{}` is left out: the robot is `{robot}`", other.name);
            let help = "no joint connects them; furniture belongs in a world of `model_dir`";
            reader.warning("W036", other.node, message, help);
        }
    }
}

/// Warns of a height or tilt of the whole robot (W036), which scenes and profiles give it.
fn warn_of_pose(model: Node, reader: &mut Reader) {
    // That of an `<include>` may be in the file of its model.
    let element = xml::child(model, "pose").unwrap_or(model);
    let (Some(at), _) = reader.aside(|reader| pose(model, reader)) else {
        return;
    };
    let tilt = (at.rotation * Vector3::z() - Vector3::z()).norm();
    if at.translation.z.abs() > ROUNDED || tilt > ROUNDED {
        let message = "the height and tilt of the whole robot are left out".to_owned();
        let help = "the floor carries a robot; a profile mounts it with `mount_height_m`";
        reader.warning("W036", element, message, help);
    }
}
