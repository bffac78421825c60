//! Geoms of bodies in MJCF, with their shapes, masses and friction.

use std::rc::Rc;

use nalgebra::{Isometry3, Point3};

use crate::foreign::geometry::Shapes;
use crate::foreign::hull::convex_hull;
use crate::foreign::mjcf::Model;
use crate::foreign::mjcf_compiler::{Compiler, Item, MeshAsset, MjcfAttributes};
use crate::foreign::mjcf_masks::{Mask, collides};
use crate::foreign::solid_mass::equivalent_box;
use crate::foreign::xml::{Bound, LONGEST, Node, Reader};
use actcheck_data::{Amount, Matter, Mesh, Shape, Spread, TreeGeometry, TreeSolid};

/// Density of geoms: MuJoCo's default. Unit: kg/m³.
const DENSITY: f64 = 1000.0;

/// A shape, and its pose in the frame of its geom if it has one of its own.
type Placed = (TreeGeometry, Option<Isometry3<f64>>);

impl<'a> Model<'a> {
    /// Returns the geoms in a body: those that collide, and those that are only seen. `own` is the
    /// frame of the body in that of its link.
    pub(super) fn geoms(
        &mut self,
        content: &[Item<'_>],
        own: &Isometry3<f64>,
        reader: &mut Reader,
    ) -> [Vec<TreeSolid>; 2] {
        let [mut solids, mut visuals] = [Vec::new(), Vec::new()];
        for item in content.iter().filter(|item| item.is("geom")) {
            let compiler = Rc::clone(&self.compiler);
            let attributes = compiler.attributes(item.node, item.class);
            let Some(solid) = self.geom(item, &attributes, own, reader) else {
                continue;
            };
            if collides(&attributes, &compiler) {
                solids.push(solid);
            } else {
                visuals.push(solid);
            }
        }
        [solids, visuals]
    }

    /// Reads a geom. Returns `None` for the ground, and after it has reported a fault.
    fn geom(
        &mut self,
        item: &Item<'_>,
        attributes: &MjcfAttributes<'_>,
        own: &Isometry3<f64>,
        reader: &mut Reader,
    ) -> Option<TreeSolid> {
        let geom = item.node;
        let is_solid = collides(attributes, &self.compiler);
        Mask::check(geom, attributes, reader);
        let kind = match attributes.get("type") {
            Some(kind) => kind,
            None if attributes.get("mesh").is_some() => "mesh",
            None => "sphere",
        };
        let shift = own * item.shift;
        let pose = shift * self.compiler.pose(attributes, geom, reader);
        let (geometry, moved) = match kind {
            "hfield" | "sdf" if is_solid && (kind == "sdf" || !self.is_robot()) => {
                let message = format!("a geom of the type {kind} can't be simulated");
                let help = "replace it by a mesh, or by boxes";
                reader.error("W035", geom, message, help);
                return None;
            }
            "plane" | "hfield" | "sdf" => {
                if is_solid {
                    let message = format!("the geom of the type {kind} is left out");
                    let help = "the floor and the furniture of a scene are those of its world";
                    reader.warning("W036", geom, message, help);
                }
                return None;
            }
            "mesh" => {
                let name = attributes.get("mesh").unwrap_or_default();
                (self.mesh(name, geom, reader)?, None)
            }
            _ if attributes.get("mesh").is_some() => self.fitted(kind, geom, attributes, reader)?,
            _ => primitive(kind, geom, attributes, &self.compiler, reader)?,
        };
        Some(TreeSolid {
            // A geom between two points has its pose from these.
            pose: match (moved, attributes.get("mesh")) {
                (Some(moved), None) => shift * moved,
                (Some(moved), Some(_)) => pose * moved,
                (None, _) => pose,
            },
            geometry,
            matter: self.matter(geom, attributes, reader),
            // MuJoCo takes a negative one for 0.
            friction: attributes
                .number("friction", reader)
                .map(|sliding| sliding.max(0.0)),
            colour: self.compiler.colour(geom, attributes, reader),
            place: reader.place(geom),
        })
    }

    /// The basis of a geom's mass; `None` if it has none.
    fn matter(
        &self,
        geom: Node,
        attributes: &MjcfAttributes<'_>,
        reader: &mut Reader,
    ) -> Option<Matter> {
        let [first, last] = self.compiler.masses.groups;
        let group = match attributes.get("group") {
            Some(text) => reader.numbers::<1>(geom, text, Bound::Finite)?[0],
            None => 0.0,
        };
        if group < first || group > last {
            return None;
        }
        let mesh = attributes
            .get("mesh")
            .and_then(|name| self.compiler.meshes.get(name));
        let spread = match (attributes.get("shellinertia"), mesh) {
            (Some("true"), _) => Spread::Shell,
            (_, Some(mesh)) => mesh.spread,
            (_, None) => Spread::Inside,
        };
        if spread == Spread::Shell && attributes.get("type") == Some("ellipsoid") {
            let message = "the inertia of a hollow ellipsoid is not read".to_owned();
            reader.error("W035", geom, message, "give its body an `<inertial>`");
            return None;
        }
        let mut number = |key: &str, bound: Bound| {
            let written = attributes.get(key)?;
            reader
                .numbers::<1>(geom, written, bound)
                .map(|[number]| number)
        };
        let amount = match number("mass", Bound::Mass) {
            Some(kg) => Amount::Mass(kg),
            None => Amount::Density(number("density", Bound::Mass).unwrap_or(DENSITY)),
        };
        Some(Matter { amount, spread })
    }

    /// Returns a mesh of `<asset>`. Returns `None` after it has reported a fault.
    fn mesh(&mut self, name: &str, geom: Node, reader: &mut Reader) -> Option<TreeGeometry> {
        let asset = self.asset(name, geom, reader)?;
        let is_moved = asset.origin != Isometry3::identity();
        match &asset.file {
            Some(file) if !is_moved => Some(TreeGeometry::Mesh {
                file: file.clone(),
                scale: asset.scale,
            }),
            _ => {
                let file = format!("<mesh name=\"{name}\">");
                let mesh = self.own_mesh(name, &asset, geom, reader)?;
                self.keep_mesh(&file, &mesh);
                Some(TreeGeometry::Mesh {
                    file,
                    scale: [1.0; 3],
                })
            }
        }
    }

    /// Returns a mesh in its own frame and at its own scale, which is computed once for all geoms.
    /// Returns `None` after it has reported a fault.
    fn own_mesh(
        &self,
        name: &str,
        asset: &MeshAsset,
        geom: Node,
        reader: &mut Reader,
    ) -> Option<Rc<Mesh>> {
        if let Some(known) = self.meshes.borrow().get(name) {
            return known.clone();
        }
        let mesh = self.vertices(asset, geom, reader).map(Rc::new);
        let mut known = self.meshes.borrow_mut();
        known.insert(name.to_owned(), mesh.clone());
        mesh
    }

    fn asset(&self, name: &str, geom: Node, reader: &mut Reader) -> Option<Rc<MeshAsset>> {
        let found = self.compiler.meshes.get(name).cloned();
        if found.is_none() {
            let message = format!("`<asset>` has no mesh `{name}`");
            let help = "add `<mesh name=\"…\" file=\"…\"/>` to `<asset>`";
            reader.error("W035", geom, message, help);
        }
        found
    }

    /// A reader of the meshes that the file names.
    pub(super) fn shapes(&self) -> Shapes<'a> {
        Shapes::new(self.file.lookup, self.file.path)
    }

    /// Returns a mesh in its own frame and at its own scale. Returns `None` after it has reported a
    /// fault.
    fn vertices(&self, asset: &MeshAsset, geom: Node, reader: &mut Reader) -> Option<Mesh> {
        let mesh = match &asset.file {
            Some(file) => {
                let mut shapes = self.shapes();
                let place = reader.place(geom);
                match shapes.mesh_at(&place, file, [1.0; 3], &mut reader.found)? {
                    Shape::Mesh { mesh } => mesh,
                    _ => return None,
                }
            }
            None => {
                let triangles = if asset.triangles.is_empty() {
                    convex_hull(&asset.vertices)
                } else {
                    asset.triangles.clone()
                };
                match Mesh::new(asset.vertices.clone(), triangles) {
                    Ok(mesh) => mesh,
                    Err(fault) => {
                        let help = if asset.triangles.is_empty() {
                            "give it at least four vertices that are not in one plane"
                        } else {
                            "each number in `face` is the place of a vertex, from 0 on"
                        };
                        reader.error("W037", geom, fault.to_string(), help);
                        return None;
                    }
                }
            }
        };
        // As in MuJoCo: moved, turned, then scaled.
        let inverse = asset.origin.inverse();
        let moved = |vertex: &[f64; 3]| (inverse * Point3::from(*vertex)).coords.into();
        let vertices = mesh.vertices.iter().map(moved).collect();
        let moved = Mesh::new(vertices, mesh.triangles).ok()?;
        let scaled = moved.scaled(asset.scale);
        let is_near = |along: &f64| along.abs() <= LONGEST;
        if !scaled.vertices.iter().flatten().all(is_near) {
            let message = format!("the mesh reaches beyond {LONGEST} m from its origin");
            let help = "lengths are in metres: write `scale` 0.001 for millimetres";
            reader.error("W034", geom, message, help);
            return None;
        }
        Some(scaled)
    }

    /// Returns a primitive that is fitted to a mesh: the one with the same moments of inertia.
    fn fitted(
        &self,
        kind: &str,
        geom: Node,
        attributes: &MjcfAttributes<'_>,
        reader: &mut Reader,
    ) -> Option<Placed> {
        let name = attributes.get("mesh").unwrap_or_default();
        let asset = self.asset(name, geom, reader)?;
        if self.compiler.fits_boxes {
            let message =
                "`fitaabb` is not read: a primitive can't be fitted to the box around a mesh";
            let help = "state the `size` of the geom, and leave out its `mesh`";
            reader.error("W035", geom, message.to_owned(), help);
            return None;
        }
        let mesh = self.own_mesh(name, &asset, geom, reader)?;
        let Some((pose, half)) = equivalent_box(&mesh) else {
            let message = format!("the mesh `{name}` has no volume to fit a primitive to");
            reader.error("W037", geom, message, "name a closed mesh");
            return None;
        };
        let scale = match attributes.get("fitscale") {
            Some(text) => reader.numbers::<1>(geom, text, Bound::Length)?[0],
            None => 1.0,
        };
        let [x, y, z] = half.map(|half| half * scale);
        let radius = (x + y) / 2.0;
        let geometry = match kind {
            "sphere" => TreeGeometry::Sphere {
                radius: (x + y + z) / 3.0,
            },
            "capsule" => TreeGeometry::Capsule {
                radius,
                length: 2.0 * (z - radius / 2.0).max(0.0),
            },
            "cylinder" => TreeGeometry::Cylinder {
                radius,
                length: 2.0 * z,
            },
            "ellipsoid" => TreeGeometry::Ellipsoid { radii: [x, y, z] },
            _ => TreeGeometry::Box {
                size: [2.0 * x, 2.0 * y, 2.0 * z],
            },
        };
        Some((geometry, Some(pose)))
    }
}

/// Reads a primitive; with a pose if the geom is given by its ends. Returns `None` after it has
/// reported a fault.
fn primitive(
    kind: &str,
    geom: Node,
    attributes: &MjcfAttributes<'_>,
    compiler: &Compiler,
    reader: &mut Reader,
) -> Option<Placed> {
    let size: Vec<f64> = reader.list(geom, "size", attributes.get("size").unwrap_or_default())?;
    let between = match attributes.get("fromto") {
        Some(_) => Some(compiler.between(attributes, geom, reader)?),
        None => None,
    };
    let wanted = match (kind, between) {
        ("sphere", _) | (_, Some(_)) => 1,
        ("cylinder" | "capsule", None) => 2,
        _ => 3,
    };
    let is_possible = |number: &f64| *number > 0.0 && *number <= LONGEST;
    if size.len() < wanted || !size[..wanted].iter().all(is_possible) {
        let message =
            format!("a geom of the type {kind} needs {wanted} positive numbers in `size`");
        let help = "sizes are radii and half lengths in metres";
        reader.error("W034", geom, message, help);
        return None;
    }
    let [x, y, z] = match (&between, wanted) {
        // Between its ends, a geom is as wide as it is deep.
        (Some((_, half)), _) => [size[0], size[0], *half],
        (None, 1) => [size[0]; 3],
        (None, 2) => [size[0], size[0], size[1]],
        (None, _) => [size[0], size[1], size[2]],
    };
    let geometry = match kind {
        "sphere" => TreeGeometry::Sphere { radius: x },
        "cylinder" => TreeGeometry::Cylinder {
            radius: x,
            length: 2.0 * z,
        },
        "capsule" => TreeGeometry::Capsule {
            radius: x,
            length: 2.0 * z,
        },
        "ellipsoid" => TreeGeometry::Ellipsoid { radii: [x, y, z] },
        _ => TreeGeometry::Box {
            size: [2.0 * x, 2.0 * y, 2.0 * z],
        },
    };
    Some((geometry, between.map(|(pose, _)| pose)))
}
