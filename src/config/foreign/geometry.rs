//! Shapes as SDF and URDF write them.

use std::path::Path;

use crate::base::{Diagnostic, Diagnostics, Digest};
use crate::config::foreign::lookup::Lookup;
use crate::config::foreign::mesh_file;
use crate::config::foreign::xml::{self, Bound, Node, Reader};
use crate::config::{Mesh, Shape};

/// What the shapes of one file are read with.
pub(crate) struct Shapes<'a> {
    pub(crate) lookup: &'a Lookup<'a>,
    /// The file that holds them.
    pub(crate) path: &'a Path,
    /// Digest of the files that were read for them.
    pub(crate) digest: Digest,
}

/// Kinds of geometry that simulation has.
const KINDS: &str = "use a box, cylinder, sphere, capsule or mesh";

impl Shapes<'_> {
    /// The shape of an SDF `<geometry>`; nothing where it is empty or wrong, which has then been noted.
    pub(crate) fn sdf(&mut self, geometry: Node, reader: &mut Reader) -> Option<Shape> {
        let Some(kind) = geometry.children().find(Node::is_element) else {
            reader.error("W033", geometry, "`<geometry>` is empty".to_owned(), KINDS);
            return None;
        };
        let number = |reader: &mut Reader, name: &str| {
            let node = reader.required(kind, name)?;
            reader.number(node, Bound::Positive)
        };
        match kind.tag_name().name() {
            "box" => {
                let size = reader.required(kind, "size")?;
                Some(Shape::Box { size: reader.numbers(size, xml::text(size), Bound::Positive)? })
            }
            "cylinder" => {
                let (radius, length) = (number(reader, "radius"), number(reader, "length"));
                Some(Shape::Cylinder { radius: radius?, height: length? })
            }
            "capsule" => {
                let (radius, length) = (number(reader, "radius"), number(reader, "length"));
                Some(Shape::Capsule { radius: radius?, height: length? })
            }
            "sphere" => Some(Shape::Sphere { radius: number(reader, "radius")? }),
            "mesh" => {
                reader.leaves_out(kind, &["uri", "scale", "submesh", "convex_decomposition"]);
                if let Some(submesh) = xml::child(kind, "submesh") {
                    reader.error(
                        "W035",
                        submesh,
                        "a part of a mesh file can't be taken alone".to_owned(),
                        "export that part to a file of its own",
                    );
                }
                let uri = reader.required(kind, "uri")?;
                let scale = match xml::child(kind, "scale") {
                    Some(scale) => reader.numbers(scale, xml::text(scale), Bound::Finite)?,
                    None => [1.0; 3],
                };
                self.mesh(uri, xml::text(uri), scale, reader)
            }
            other => {
                reader.error("W035", kind, format!("the geometry `<{other}>` can't be simulated"), KINDS);
                None
            }
        }
    }

    /// The shape of a URDF `<geometry>`.
    pub(crate) fn urdf(&mut self, geometry: Node, reader: &mut Reader) -> Option<Shape> {
        let Some(kind) = geometry.children().find(Node::is_element) else {
            reader.error("W033", geometry, "`<geometry>` is empty".to_owned(), KINDS);
            return None;
        };
        let number = |reader: &mut Reader, name: &str| {
            let written = reader.attribute(kind, name)?;
            reader.numbers::<1>(kind, written, Bound::Positive).map(|[number]| number)
        };
        match kind.tag_name().name() {
            "box" => {
                let size = reader.attribute(kind, "size")?;
                Some(Shape::Box { size: reader.numbers(kind, size, Bound::Positive)? })
            }
            "cylinder" => {
                let (radius, length) = (number(reader, "radius"), number(reader, "length"));
                Some(Shape::Cylinder { radius: radius?, height: length? })
            }
            "capsule" => {
                let (radius, length) = (number(reader, "radius"), number(reader, "length"));
                Some(Shape::Capsule { radius: radius?, height: length? })
            }
            "sphere" => Some(Shape::Sphere { radius: number(reader, "radius")? }),
            "mesh" => {
                let uri = reader.attribute(kind, "filename")?;
                let scale = match kind.attribute("scale") {
                    Some(scale) => reader.numbers(kind, scale, Bound::Finite)?,
                    None => [1.0; 3],
                };
                self.mesh(kind, uri, scale, reader)
            }
            other => {
                reader.error("W035", kind, format!("the geometry `<{other}>` can't be simulated"), KINDS);
                None
            }
        }
    }

    pub(crate) fn mesh(&mut self, node: Node, uri: &str, scale: [f64; 3], reader: &mut Reader) -> Option<Shape> {
        if scale.contains(&0.0) {
            reader.error(
                "W034",
                node,
                "a scale of 0 leaves nothing of the mesh".to_owned(),
                "write 1 for the file's own size",
            );
            return None;
        }
        match self.mesh_file(uri) {
            Ok(file) => {
                self.digest.update(&file.bytes);
                reader.found.extend(file.warnings);
                Some(Shape::Mesh { mesh: file.mesh.scaled(scale) })
            }
            Err(faults) => {
                // A mesh file without lines is told of where it is named.
                let placed = |fault: Diagnostic| match fault.source {
                    None => fault.at(reader.source, xml::span(node)),
                    Some(_) => fault,
                };
                let faults: Diagnostics = faults.into_iter().map(placed).collect();
                reader.found.extend(faults);
                None
            }
        }
    }

    fn mesh_file(&self, uri: &str) -> Result<mesh_file::MeshFile, Diagnostics> {
        let path = self.lookup.resolve(uri, self.path).map_err(|reason| {
            Diagnostic::error("W037", format!("cannot find the mesh `{uri}`: {reason}")).help(mesh_file::HOW_TO_NAME)
        })?;
        mesh_file::read(self.lookup.files, &path)
    }
}

/// Whether a mesh encloses anything worth the name. Unit of the bound: cubic metres (a cube of a tenth of a millimetre).
pub(crate) fn has_volume(mesh: &Mesh) -> bool {
    mesh.volume() > 1e-12
}
