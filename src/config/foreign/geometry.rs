//! Shapes in SDF, and those of trees.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::path::Path;

use crate::foreign::inclusions::Inclusions;
use crate::foreign::lookup::Lookup;
use crate::foreign::mesh_file;
use crate::foreign::seen::SeenShapes;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostic, Diagnostics, Digest, SourceSpan};
use actcheck_data::{Mesh, ModelTree, Shape, TreeGeometry, TreeSolid};

/// Reads the shapes of one file.
pub(crate) struct Shapes<'a> {
    pub(crate) lookup: &'a Lookup<'a>,
    /// The file that contains the shapes.
    pub(crate) path: &'a Path,
    /// Digest of the mesh files and of included models.
    pub(crate) digest: Digest,
    /// The models that include this file's model.
    pub(crate) inclusions: Inclusions,
    /// Warnings about mesh files without a text, each of which is given once.
    pub(crate) warned: BTreeSet<String>,
    /// The reader of visual shapes, if they are to be read.
    pub(crate) seen: Option<SeenShapes<'a>>,
}

/// Help text with the supported kinds of geometry.
pub(crate) const KINDS: &str = "use a box, cylinder, sphere, capsule, cone, ellipsoid or mesh";

impl<'a> Shapes<'a> {
    pub(crate) fn new(lookup: &'a Lookup<'a>, path: &'a Path) -> Self {
        Self {
            lookup,
            path,
            digest: Digest::new(),
            inclusions: Inclusions::default(),
            warned: BTreeSet::new(),
            seen: lookup.looks.as_ref().map(|_| SeenShapes::new(lookup, path)),
        }
    }

    /// Reads the shape of an SDF `<geometry>`. Reports a fault and returns `None` if it is empty or
    /// invalid.
    pub(crate) fn sdf(&mut self, geometry: Node, reader: &mut Reader) -> Option<Shape> {
        let kind = kind_of(geometry, reader)?;
        if kind.tag_name().name() == "mesh" {
            return self.sdf_mesh(kind, reader);
        }
        match sdf_primitive(kind, reader)? {
            PrimitiveShape::Geometry(TreeGeometry::Ellipsoid { radii }) => {
                ellipsoid(radii).map(|mesh| Shape::Mesh { mesh })
            }
            PrimitiveShape::Geometry(geometry) => geometry.solid(),
            PrimitiveShape::Cone { radius, length } => {
                cone(radius, length).map(|mesh| Shape::Mesh { mesh })
            }
        }
    }

    fn sdf_mesh(&mut self, mesh: Node, reader: &mut Reader) -> Option<Shape> {
        reader.warn_about_unknown_children(
            mesh,
            &["uri", "scale", "submesh", "convex_decomposition"],
        );
        if let Some(submesh) = xml::child(mesh, "submesh") {
            let message = "`<submesh>` is not supported".to_owned();
            reader.error(
                "W035",
                submesh,
                message,
                "export that part of the mesh to its own file",
            );
        }
        let uri = reader.required(mesh, "uri")?;
        let scale = match xml::child(mesh, "scale") {
            Some(scale) => reader.numbers(scale, xml::text(scale), Bound::Finite)?,
            None => [1.0; 3],
        };
        self.mesh(uri, xml::text(uri), scale, reader)
    }

    fn mesh(
        &mut self,
        node: Node,
        uri: &str,
        scale: [f64; 3],
        reader: &mut Reader,
    ) -> Option<Shape> {
        let place = reader.place(node);
        self.mesh_at(&place, uri, scale, &mut reader.found)
    }

    /// Reads a mesh that is named at a place. Returns `None` after it has reported a fault there.
    pub(crate) fn mesh_at(
        &mut self,
        place: &SourceSpan,
        uri: &str,
        scale: [f64; 3],
        found: &mut Diagnostics,
    ) -> Option<Shape> {
        check_scale(scale, place, found)?;
        let mesh = self.unscaled(place, uri, found)?.scaled(scale);
        check_reach(&mesh, [1.0; 3], place, found).then(|| solid_of(mesh))
    }

    /// Reads a mesh as its file has it. Returns `None` after it has reported a fault at a place.
    fn unscaled(&mut self, place: &SourceSpan, uri: &str, found: &mut Diagnostics) -> Option<Mesh> {
        // A fault without a source, as of a binary mesh file, is reported where the file is named.
        let placed = |fault: Diagnostic| match fault.source {
            None => fault.at(&place.source, xml::tag(place)),
            Some(_) => fault,
        };
        let file = match self.mesh_file(uri) {
            Ok(file) => file,
            Err(faults) => {
                found.extend(faults.into_iter().map(placed).collect());
                return None;
            }
        };
        self.digest.update(&file.bytes);
        let warnings = file.warnings.into_iter().filter(|warning| {
            warning.source.is_some() || self.warned.insert(warning.message.clone())
        });
        found.extend(warnings.map(placed).collect());
        Some(file.mesh)
    }

    /// Reads the mesh of a solid of a tree, if it has one that is not known yet. It is not scaled.
    pub(crate) fn load(
        &mut self,
        solid: &TreeSolid,
        tree: &ModelTree,
        meshes: &mut BTreeMap<String, Vec<Shape>>,
        found: &mut Diagnostics,
    ) {
        let TreeGeometry::Mesh { file, scale } = &solid.geometry else {
            return;
        };
        if !meshes.contains_key(file) {
            let mesh = match tree.inline_meshes.get(file) {
                Some(mesh) => {
                    self.digest.update(mesh.digest().as_bytes());
                    Some(Shape::Mesh { mesh: mesh.clone() })
                }
                None => self.unscaled(&solid.place, file, found).map(solid_of),
            };
            meshes.extend(mesh.map(|shape| (file.clone(), vec![shape])));
        }
        if let Some(Shape::Mesh { mesh }) = meshes.get(file).and_then(|shapes| shapes.first()) {
            check_reach(mesh, *scale, &solid.place, found);
        }
    }

    fn mesh_file(&self, uri: &str) -> Result<mesh_file::MeshFile, Diagnostics> {
        let path = mesh_file::find(self.lookup, self.path, uri)?;
        mesh_file::read(self.lookup.files, &path)
    }
}

/// Returns the shape of a mesh. With the backs of its faces, it would have no volume.
fn solid_of(mesh: Mesh) -> Shape {
    let mesh = match mesh.volume() > LEAST_VOLUME {
        true => mesh,
        false => mesh.one_sided(),
    };
    Shape::Mesh { mesh }
}

/// Returns `Some` if a mesh has an extent along each axis. Otherwise reports W034 at a place.
pub(crate) fn check_scale(
    scale: [f64; 3],
    place: &SourceSpan,
    found: &mut Diagnostics,
) -> Option<()> {
    if !scale.contains(&0.0) {
        return Some(());
    }
    let fault = Diagnostic::error("W034", "the mesh's scale must not be 0")
        .at(&place.source, xml::tag(place));
    found.push(fault.help("write 1 for the file's own size"));
    None
}

/// Whether a scaled mesh is not too large. Otherwise reports W034 at a place.
pub(crate) fn check_reach(
    mesh: &Mesh,
    scale: [f64; 3],
    place: &SourceSpan,
    found: &mut Diagnostics,
) -> bool {
    let along = |vertex: &[f64; 3]| {
        let scaled = vertex.iter().zip(&scale);
        scaled.fold(0.0_f64, |most, (along, by)| most.max((along * by).abs()))
    };
    let longest = mesh.vertices.iter().map(along).fold(0.0, f64::max);
    if longest <= xml::LONGEST {
        return true;
    }
    let message = format!(
        "the mesh reaches {longest:.0} m from its origin, which is beyond {} m",
        xml::LONGEST
    );
    let help = "lengths are in metres: write `scale` 0.001 for millimetres";
    let fault = Diagnostic::error("W034", message).at(&place.source, xml::tag(place));
    found.push(fault.help(help));
    false
}

/// Returns the element that determines the kind of a geometry.
pub(crate) fn kind_of<'n>(geometry: Node<'n>, reader: &mut Reader) -> Option<Node<'n>> {
    let kind = geometry.children().find(Node::is_element);
    if kind.is_none() {
        reader.error("W033", geometry, "`<geometry>` is empty".to_owned(), KINDS);
    }
    kind
}

/// A shape that is not that of a mesh file.
pub(crate) enum PrimitiveShape {
    Geometry(TreeGeometry),
    /// With its tip above and its middle at the origin. Units: metres.
    Cone {
        radius: f64,
        length: f64,
    },
}

/// Reads a primitive of SDF. Returns `None` after it has reported a fault.
pub(crate) fn sdf_primitive(kind: Node, reader: &mut Reader) -> Option<PrimitiveShape> {
    primitive(kind, reader, |name, reader| {
        let node = reader.required(kind, name)?;
        Some((node, xml::text(node)))
    })
}

/// Reads a primitive. `written` finds its parameters by name: elements in SDF, attributes in URDF.
/// Returns `None` after it has reported a fault.
pub(crate) fn primitive<'n>(
    kind: Node<'n>,
    reader: &mut Reader,
    written: impl Fn(&str, &mut Reader) -> Option<(Node<'n>, &'n str)>,
) -> Option<PrimitiveShape> {
    let number = |reader: &mut Reader, name: &str| {
        let (node, text) = written(name, reader)?;
        reader
            .numbers::<1>(node, text, Bound::Length)
            .map(|[number]| number)
    };
    let three = |reader: &mut Reader, name: &str| {
        let (node, text) = written(name, reader)?;
        reader.numbers::<3>(node, text, Bound::Length)
    };
    let geometry = match kind.tag_name().name() {
        "box" => TreeGeometry::Box {
            size: three(reader, "size")?,
        },
        "sphere" => TreeGeometry::Sphere {
            radius: number(reader, "radius")?,
        },
        "ellipsoid" => TreeGeometry::Ellipsoid {
            radii: three(reader, "radii")?,
        },
        round @ ("cylinder" | "capsule" | "cone") => {
            let (radius, length) = (number(reader, "radius"), number(reader, "length"));
            let (radius, length) = (radius?, length?);
            match round {
                "cylinder" => TreeGeometry::Cylinder { radius, length },
                "capsule" => TreeGeometry::Capsule { radius, length },
                _ => return Some(PrimitiveShape::Cone { radius, length }),
            }
        }
        other => {
            let message = format!("the geometry `<{other}>` can't be simulated");
            reader.error("W035", kind, message, KINDS);
            return None;
        }
    };
    Some(PrimitiveShape::Geometry(geometry))
}

/// Number of faces around a cone or an ellipsoid; from pole to pole, an ellipsoid has half as many.
const AROUND: u32 = 24;

/// Returns a cone as a mesh, with its tip above and its middle at the origin. Units: metres.
pub(super) fn cone(radius: f64, length: f64) -> Option<Mesh> {
    let mut vertices = vec![[0.0, 0.0, length / 2.0], [0.0, 0.0, -length / 2.0]];
    vertices.extend((0..AROUND).map(|step| {
        let [x, y] = around(step);
        [radius * x, radius * y, -length / 2.0]
    }));
    let on = |step: u32| 2 + step % AROUND;
    let triangles =
        (0..AROUND).flat_map(|step| [[0, on(step), on(step + 1)], [1, on(step + 1), on(step)]]);
    Mesh::new(vertices, triangles.collect()).ok()
}

/// Returns a point on the unit circle.
fn around(step: u32) -> [f64; 2] {
    let angle = 2.0 * PI * f64::from(step) / f64::from(AROUND);
    [libm::cos(angle), libm::sin(angle)]
}

/// Returns an ellipsoid as a mesh whose vertices are on it, and which has 97 % of its volume. Unit:
/// metres.
fn ellipsoid(radii: [f64; 3]) -> Option<Mesh> {
    let rings = AROUND / 2;
    let mut vertices = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..rings {
        let polar = PI * f64::from(ring) / f64::from(rings);
        vertices.extend((0..AROUND).map(|step| {
            let [x, y] = around(step);
            [libm::sin(polar) * x, libm::sin(polar) * y, libm::cos(polar)]
        }));
    }
    let on = |ring: u32, step: u32| 2 + (ring - 1) * AROUND + step % AROUND;
    let mut triangles = Vec::new();
    for step in 0..AROUND {
        triangles.push([0, on(1, step), on(1, step + 1)]);
        triangles.push([1, on(rings - 1, step + 1), on(rings - 1, step)]);
        for ring in 1..rings - 1 {
            let [a, b, c, d] = [
                on(ring, step),
                on(ring, step + 1),
                on(ring + 1, step),
                on(ring + 1, step + 1),
            ];
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    Mesh::new(vertices, triangles)
        .ok()
        .map(|mesh| mesh.scaled(radii))
}

/// Smallest volume of a collision mesh: that of a cube of 0.1 mm. Unit: cubic metres.
const LEAST_VOLUME: f64 = 1e-12;

/// Reports W037 if the shape of a `<collision>` is a mesh without a volume.
pub(crate) fn check_volume(shape: &Shape, collision: Node, reader: &mut Reader) {
    let place = reader.place(collision);
    report_volume(shape, &place, &mut reader.found);
}

/// Reports W037 at a place if a shape is a mesh without a volume.
pub(crate) fn report_volume(shape: &Shape, place: &SourceSpan, found: &mut Diagnostics) {
    let Shape::Mesh { mesh } = shape else { return };
    if mesh.volume() > LEAST_VOLUME {
        return;
    }
    let error = Diagnostic::error("W037", "the mesh has no volume");
    found.push(
        error
            .at(&place.source, xml::tag(place))
            .help("a collision mesh must be a closed surface; use a thin box for a sheet"),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_of_primitives_have_their_extents_and_volumes() {
        let extents = |mesh: &Mesh| {
            let along = |axis: usize| mesh.vertices.iter().map(move |vertex| vertex[axis]);
            [0, 1, 2].map(|axis| {
                (
                    along(axis).fold(f64::MAX, f64::min),
                    along(axis).fold(f64::MIN, f64::max),
                )
            })
        };
        let near = |found: [(f64, f64); 3], expected: [(f64, f64); 3]| {
            let is_near = |(found, expected): (&(f64, f64), &(f64, f64))| {
                (found.0 - expected.0).abs() < 1e-9 && (found.1 - expected.1).abs() < 1e-9
            };
            found.iter().zip(&expected).all(is_near)
        };
        let ellipsoid = ellipsoid([0.1, 0.05, 0.2]).expect("it is a mesh");
        assert!(near(
            extents(&ellipsoid),
            [(-0.1, 0.1), (-0.05, 0.05), (-0.2, 0.2)]
        ));
        let share = ellipsoid.volume() / (4.0 / 3.0 * PI * 0.1 * 0.05 * 0.2);
        assert!((0.965..1.0).contains(&share), "{share}");
        let cone = cone(0.1, 0.3).expect("it is a mesh");
        assert!(near(
            extents(&cone),
            [(-0.1, 0.1), (-0.1, 0.1), (-0.15, 0.15)]
        ));
        // The area of a regular polygon with 24 corners.
        let base = 12.0 * 0.1 * 0.1 * libm::sin(2.0 * PI / 24.0);
        assert!(
            (cone.volume() - base * 0.3 / 3.0).abs() < 1e-9,
            "{}",
            cone.volume()
        );
    }
}
