//! Shapes in SDF and URDF.

use std::path::Path;

use crate::foreign::lookup::Lookup;
use crate::foreign::mesh_file;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostic, Diagnostics, Digest};
use actcheck_data::Shape;

/// Reads the shapes of one file.
pub(crate) struct Shapes<'a> {
    pub(crate) lookup: &'a Lookup<'a>,
    /// The file that contains the shapes.
    pub(crate) path: &'a Path,
    /// Digest of the mesh files and of included models.
    pub(crate) digest: Digest,
    /// Number of models that include this file's model.
    pub(crate) depth: usize,
}

/// Help text with the supported kinds of geometry.
const KINDS: &str = "use a box, cylinder, sphere, capsule or mesh";

impl<'a> Shapes<'a> {
    pub(crate) fn new(lookup: &'a Lookup<'a>, path: &'a Path) -> Self {
        Self { lookup, path, digest: Digest::new(), depth: 0 }
    }

    /// Reads the shape of an SDF `<geometry>`. Reports a fault and returns `None` if it is empty or invalid.
    pub(crate) fn sdf(&mut self, geometry: Node, reader: &mut Reader) -> Option<Shape> {
        let kind = kind_of(geometry, reader)?;
        if kind.tag_name().name() == "mesh" {
            return self.sdf_mesh(kind, reader);
        }
        primitive(kind, reader, |name, reader| {
            let node = reader.required(kind, name)?;
            Some((node, xml::text(node)))
        })
    }

    fn sdf_mesh(&mut self, mesh: Node, reader: &mut Reader) -> Option<Shape> {
        reader.warn_about_unknown_children(mesh, &["uri", "scale", "submesh", "convex_decomposition"]);
        if let Some(submesh) = xml::child(mesh, "submesh") {
            let message = "`<submesh>` is not supported".to_owned();
            reader.error("W035", submesh, message, "export that part of the mesh to its own file");
        }
        let uri = reader.required(mesh, "uri")?;
        let scale = match xml::child(mesh, "scale") {
            Some(scale) => reader.numbers(scale, xml::text(scale), Bound::Finite)?,
            None => [1.0; 3],
        };
        self.mesh(uri, xml::text(uri), scale, reader)
    }

    /// Reads the shape of a URDF `<geometry>`. Returns `None` after it has reported a fault.
    pub(crate) fn urdf(&mut self, geometry: Node, reader: &mut Reader) -> Option<Shape> {
        let kind = kind_of(geometry, reader)?;
        if kind.tag_name().name() != "mesh" {
            return primitive(kind, reader, |name, reader| Some((kind, reader.attribute(kind, name)?)));
        }
        let uri = reader.attribute(kind, "filename")?;
        let scale = match kind.attribute("scale") {
            Some(scale) => reader.numbers(kind, scale, Bound::Finite)?,
            None => [1.0; 3],
        };
        self.mesh(kind, uri, scale, reader)
    }

    pub(crate) fn mesh(&mut self, node: Node, uri: &str, scale: [f64; 3], reader: &mut Reader) -> Option<Shape> {
        if scale.contains(&0.0) {
            reader.error("W034", node, "the mesh's scale must not be 0".to_owned(), "write 1 for the file's own size");
            return None;
        }
        match self.mesh_file(uri) {
            Ok(file) => {
                self.digest.update(&file.bytes);
                reader.found.extend(file.warnings);
                let mesh = file.mesh.scaled(scale);
                // With the backs of its faces, a mesh has no volume.
                let mesh = if mesh.volume() > LEAST_VOLUME { mesh } else { mesh.one_sided() };
                Some(Shape::Mesh { mesh })
            }
            Err(faults) => {
                // A fault without a source, as of a binary mesh file, is reported where the file is named.
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

/// Returns the element that determines the kind of a geometry.
fn kind_of<'n>(geometry: Node<'n>, reader: &mut Reader) -> Option<Node<'n>> {
    let kind = geometry.children().find(Node::is_element);
    if kind.is_none() {
        reader.error("W033", geometry, "`<geometry>` is empty".to_owned(), KINDS);
    }
    kind
}

/// Reads a primitive shape. `written` finds its parameters by name: elements in SDF, attributes in URDF.
fn primitive<'n>(
    kind: Node<'n>,
    reader: &mut Reader,
    written: impl Fn(&str, &mut Reader) -> Option<(Node<'n>, &'n str)>,
) -> Option<Shape> {
    let number = |reader: &mut Reader, name: &str| {
        let (node, text) = written(name, reader)?;
        reader.numbers::<1>(node, text, Bound::Positive).map(|[number]| number)
    };
    match kind.tag_name().name() {
        "box" => {
            let (node, text) = written("size", reader)?;
            Some(Shape::Box { size: reader.numbers(node, text, Bound::Positive)? })
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
        other => {
            reader.error("W035", kind, format!("the geometry `<{other}>` can't be simulated"), KINDS);
            None
        }
    }
}

/// Smallest volume of a collision mesh: that of a cube of 0.1 mm. Unit: cubic metres.
const LEAST_VOLUME: f64 = 1e-12;

/// Reports W037 if the shape of a `<collision>` is a mesh without a volume.
pub(crate) fn check_volume(shape: &Shape, collision: Node, reader: &mut Reader) {
    let Shape::Mesh { mesh } = shape else { return };
    if mesh.volume() > LEAST_VOLUME {
        return;
    }
    let message = "the mesh has no volume".to_owned();
    reader.error("W037", collision, message, "a collision mesh must be a closed surface; use a thin box for a sheet");
}
