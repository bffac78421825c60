//! Validates the text of a robot's URDF and reads its collision meshes.

use std::collections::BTreeMap;
use std::path::Path;

use crate::foreign::geometry::Shapes;
use crate::foreign::lookup::Lookup;
use crate::foreign::robot_inertia::{self, Mend};
use crate::foreign::robot_shapes;
use crate::foreign::robot_text::{self, Edit};
use crate::foreign::robot_tree::{self, Tree};
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::{Diagnostics, Source};
use actcheck_data::Shape;

/// The parts of a URDF that a profile needs.
pub(crate) struct RobotText {
    /// Meshes by their file name in the URDF.
    pub(crate) meshes: BTreeMap<String, Vec<Shape>>,
    /// Digest of the mesh files.
    pub(crate) digest: String,
    /// Its links and joints; `None` if the text is not a URDF or has no links.
    pub(crate) tree: Option<Tree>,
    /// Proposed changes of impossible moments of inertia.
    pub(crate) mends: Vec<Mend>,
    /// Collision shapes for the links of the gripper, if they have none, and repairs.
    pub(crate) edits: Vec<Edit>,
}

/// Reads the links, joints and collision meshes, and reports every fault with its span.
pub(crate) fn read(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
    found: &mut Diagnostics,
) -> RobotText {
    let mut shapes = Shapes::new(lookup, path);
    let mut meshes = BTreeMap::new();
    let document = match xml::parse_model(source, &source.text) {
        Ok(document) => document,
        Err(faults) => {
            found.extend(faults);
            return RobotText {
                meshes,
                digest: shapes.digest.finish(),
                tree: None,
                mends: Vec::new(),
                edits: Vec::new(),
            };
        }
    };
    let mut reader = Reader::new(source);
    let root = document.root_element();
    let tree = if root.tag_name().name() == "robot" {
        Some(robot_tree::read(root, &mut reader)).filter(|tree| !tree.links.is_empty())
    } else {
        let message = format!(
            "the root is `<{}>` instead of `<robot>`",
            root.tag_name().name()
        );
        reader.error(
            "W032",
            root,
            message,
            "a URDF file begins with `<robot name=\"…\">`",
        );
        None
    };
    for link in xml::children(root, "link") {
        for collision in
            xml::children(link, "collision").filter(|one| robot_text::placeholder(*one).is_none())
        {
            read_collision(collision, &mut shapes, &mut meshes, &mut reader);
        }
    }
    let mut edits = robot_text::repairs(root, &mut reader);
    for change in robot_shapes::of_gripper(root, &mut reader) {
        if let Some(seen) = change.seen {
            read_collision(seen, &mut shapes, &mut meshes, &mut reader);
        }
        edits.push(change.edit);
    }
    let mends = robot_inertia::check(root, &meshes, &mut reader);
    found.extend(reader.found);
    RobotText {
        meshes,
        digest: shapes.digest.finish(),
        tree,
        mends,
        edits,
    }
}

fn read_collision(
    collision: Node,
    shapes: &mut Shapes,
    meshes: &mut BTreeMap<String, Vec<Shape>>,
    reader: &mut Reader,
) {
    let Some(geometry) = reader.required(collision, "geometry") else {
        return;
    };
    let Some(mesh) = xml::child(geometry, "mesh") else {
        // Primitives are created with the robot; this only validates their numbers.
        shapes.urdf(geometry, reader);
        return;
    };
    let Some(name) = reader.attribute(mesh, "filename") else {
        return;
    };
    if !meshes.contains_key(name)
        && let Some(shape) = shapes.mesh(mesh, name, [1.0; 3], reader)
    {
        meshes.insert(name.to_owned(), vec![shape]);
    }
}
