//! The collision meshes that a robot's URDF names.

use std::collections::BTreeMap;
use std::path::Path;

use crate::base::{Diagnostics, Digest, Source};
use crate::config::Shape;
use crate::config::foreign::geometry::Shapes;
use crate::config::foreign::lookup::Lookup;
use crate::config::foreign::xml::{self, Reader};

/// Meshes by the name that the URDF gives their file, with a digest of the files.
pub(crate) struct RobotMeshes {
    pub(crate) meshes: BTreeMap<String, Vec<Shape>>,
    pub(crate) digest: String,
}

/// Reads every mesh that a link of a URDF collides with. What else is wrong with the text is for others to say.
pub(crate) fn read(source: &Source, path: &Path, lookup: &Lookup, found: &mut Diagnostics) -> RobotMeshes {
    let mut reader = Reader::new(source);
    let mut shapes = Shapes { lookup, path, digest: Digest::new() };
    let mut meshes = BTreeMap::new();
    if let Ok(document) = xml::parse(source) {
        let collisions = document.descendants().filter(|node| node.tag_name().name() == "collision");
        for mesh in collisions.filter_map(|collision| xml::child(xml::child(collision, "geometry")?, "mesh")) {
            let Some(name) = mesh.attribute("filename").filter(|name| !meshes.contains_key(*name)) else { continue };
            if let Some(shape) = shapes.mesh(mesh, name, [1.0; 3], &mut reader) {
                meshes.insert(name.to_owned(), vec![shape]);
            }
        }
    }
    found.extend(reader.found);
    RobotMeshes { meshes, digest: shapes.digest.finish() }
}
