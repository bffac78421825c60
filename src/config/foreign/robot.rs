//! Reads a robot's file, of whatever format, as a tree, with its collision meshes.

use std::collections::BTreeMap;
use std::path::Path;

use crate::foreign::geometry::Shapes;
use crate::foreign::lookup::Lookup;
use crate::foreign::robot_inertia::{self, Mend};
use crate::foreign::seen::SeenShapes;
use crate::foreign::urdf_tree::{self, URDF_ROOT, UrdfTree};
use crate::foreign::xml::{self, Reader};
use crate::foreign::{mjcf, robot_shapes, root_name, sdf_robot, seen, tree_checks, urdf_writer};
use actcheck_base::{Diagnostic, Diagnostics, Source, digest_of};
use actcheck_data::{ModelTree, SeenLink, Shape};

/// A robot as its file states it.
pub(crate) struct RobotFile {
    pub(crate) tree: ModelTree,
    /// Meshes by their file name in the tree.
    pub(crate) meshes: BTreeMap<String, Vec<Shape>>,
    /// Digest of the mesh files and of the masses that follow from them, which the text does not
    /// determine; `None` for a URDF without collision meshes.
    digest: Option<String>,
    /// The text with all that it includes.
    pub(crate) text: Source,
    /// The robot in URDF: its own text, or its tree in this form.
    pub(crate) urdf: Source,
    /// Proposed changes of impossible moments of inertia; only for URDF.
    pub(crate) mends: Vec<Mend>,
}

impl RobotFile {
    /// Adds the digest of the mesh files to that of a text.
    pub(crate) fn digest_with(&self, text: String) -> String {
        match &self.digest {
            Some(meshes) => digest_of(&format!("{text}{meshes}")),
            None => text,
        }
    }
}

/// A tree before its shapes are read.
struct Bare {
    tree: ModelTree,
    text: Source,
    /// Faults of shapes that are only seen.
    faults_of_visuals: BTreeMap<String, Diagnostics>,
    is_urdf: bool,
}

/// Reads the links, joints and collision meshes, and reports every fault with its place. Returns
/// `None` if the text has no tree.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
    found: &mut Diagnostics,
) -> Option<RobotFile> {
    let bare = bare(source, path, lookup, found)?;
    Some(complete(bare, path, lookup, found))
}

/// Reads the appearance of the links, in their frames. `without` names those whose collision shapes
/// are left out. Faults of visual shapes are reported as warnings; the text has no others.
pub(crate) fn seen(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
    without: &[String],
    found: &mut Diagnostics,
) -> BTreeMap<String, SeenLink> {
    // Whatever else the text has to report was said when it was read for the simulation.
    let Some(mut bare) = bare(source, path, lookup, &mut Diagnostics::new()) else {
        return BTreeMap::new();
    };
    let mut shapes = SeenShapes::new(lookup, path);
    let mut links = BTreeMap::new();
    for link in &bare.tree.links {
        if let Some(faults) = bare.faults_of_visuals.remove(&link.name) {
            found.extend(faults.into_iter().map(seen::as_warning).collect());
        }
        let seen = shapes.of_link(link, !without.contains(&link.name), &bare.tree, found);
        links.insert(link.name.clone(), seen);
    }
    links
}

/// Reads the links and joints.
fn bare(source: &Source, path: &Path, lookup: &Lookup, found: &mut Diagnostics) -> Option<Bare> {
    let bare = match root_name(&source.text) {
        Some("mujoco") => mjcf::robot(source, path, lookup).map(|(tree, text, said)| {
            found.extend(said);
            (tree, text, BTreeMap::new(), false)
        }),
        Some("sdf") => sdf_robot::read(source, path, lookup, found)
            .map(|read| (read.tree, read.text, read.faults_of_visuals, false)),
        _ => urdf(source, found)
            .map(|read| (read.tree, source.clone(), read.faults_of_visuals, true)),
    };
    let (tree, text, faults_of_visuals, is_urdf) = match bare {
        Ok(bare) => bare,
        Err(faults) => {
            found.extend(faults);
            return None;
        }
    };
    let bare = Bare {
        tree,
        text,
        faults_of_visuals,
        is_urdf,
    };
    (!bare.tree.links.is_empty()).then_some(bare)
}

/// Reads the tree of a text of URDF.
///
/// # Errors
/// As [`read`], but for meshes and masses.
pub(crate) fn tree_of_urdf(source: &Source) -> Result<ModelTree, Diagnostics> {
    let mut found = Diagnostics::new();
    let read = urdf(source, &mut found)?;
    found.or(read.tree)
}

/// Reads a text of URDF; a tree without links after a fault of its root.
fn urdf(source: &Source, found: &mut Diagnostics) -> Result<UrdfTree, Diagnostics> {
    let document = xml::parse_model(source, &source.text)?;
    let mut reader = Reader::new(source);
    let root = document.root_element();
    let read = match reader.root(root, "robot", URDF_ROOT) {
        Some(()) => urdf_tree::read(root, &mut reader),
        None => UrdfTree {
            tree: ModelTree::default(),
            is_whole: false,
            faults_of_visuals: BTreeMap::new(),
        },
    };
    found.extend(reader.found);
    Ok(read)
}

/// Reads the collision meshes of a tree, and checks it.
fn complete(mut bare: Bare, path: &Path, lookup: &Lookup, found: &mut Diagnostics) -> RobotFile {
    let tree = &mut bare.tree;
    tree_checks::check(tree, found);
    robot_shapes::complete_gripper(tree, &mut bare.faults_of_visuals, found);
    let mut shapes = Shapes::new(lookup, path);
    let mut meshes = BTreeMap::new();
    for link in &tree.links {
        for solid in &link.solids {
            shapes.load(solid, tree, &mut meshes, found);
        }
    }
    if !bare.is_urdf {
        // The masses may follow from meshes that are only seen.
        let masses = tree.links.iter().map(|link| &link.inertial);
        for mass in masses.flatten() {
            let numbers = format!("{} {} {}", mass.kg, mass.pose, mass.about_com);
            shapes.digest.update(numbers.as_bytes());
        }
    }
    let mends = robot_inertia::check(tree, &meshes, bare.is_urdf, found);
    let urdf = if bare.is_urdf {
        bare.text.clone()
    } else {
        let written = urdf_writer::write(&bare.tree).unwrap_or_else(|error| {
            let message = format!("the robot can't be written as URDF for skills: {error}");
            let help = "report this bug; name a URDF instead";
            found.push(
                Diagnostic::error("W020", message)
                    .in_source(&bare.text)
                    .help(help),
            );
            String::new()
        });
        Source::new(bare.text.name.to_string(), written)
    };
    let is_in_text = bare.is_urdf && meshes.is_empty();
    let digest = (!is_in_text).then(|| shapes.digest.finish());
    RobotFile {
        urdf,
        meshes,
        digest,
        text: bare.text,
        mends,
        tree: bare.tree,
    }
}
