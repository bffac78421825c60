//! Surfaces of COLLADA (.dae) files: what the scene instances, with its transforms and its unit.
//!
//! The axis that a file calls up is left alone, as Gazebo does: the numbers are taken as they stand.

use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};

use crate::base::{Diagnostic, Diagnostics, Source};
use crate::config::foreign::mesh_file::{MOST_TRIANGLES, checked};
use crate::config::foreign::xml::{self, Node};
use crate::config::mesh::Mesh;

/// Nodes nested deeper than this, or more of them than that, are no drawing of a thing: they instance each other.
const DEEPEST: usize = 64;
const MOST_NODES: usize = 100_000;

/// Elements that hold a surface and are not read. Lines and points have no surface, so their absence changes nothing.
const UNREAD: [&str; 3] = ["trifans", "tristrips", "polygons"];

/// Reads the geometry that a file's scene shows, as one surface.
///
/// # Errors
/// W031 it is not XML, W037 it has no usable geometry.
pub(crate) fn read(source: &Source, warnings: &mut Diagnostics) -> Result<Mesh, Diagnostics> {
    let document = xml::parse(source)?;
    let root = document.root_element();
    let fault = |node: Node, reason: String| -> Diagnostics {
        Diagnostic::error("W037", format!("the mesh {} is unusable: {reason}", source.name))
            .at(source, xml::span(node))
            .help("export it again, as triangles, to dae, stl or obj")
            .into()
    };
    if root.tag_name().name() != "COLLADA" {
        return Err(fault(root, format!("its root is `<{}>` and not `<COLLADA>`", root.tag_name().name())));
    }
    let mut gathering = Gathering { root, vertices: Vec::new(), triangles: Vec::new(), depth: 0, n_nodes: 0 };
    gathering.scene().map_err(|(node, reason)| fault(node, reason))?;
    if let Some(up) = xml::child(root, "asset").and_then(|asset| xml::child(asset, "up_axis"))
        && xml::text(up) != "Z_UP"
    {
        let message =
            format!("the mesh calls {} up, and its numbers are taken as they stand, as Gazebo does", xml::text(up));
        warnings.push(
            Diagnostic::warning("W036", message)
                .at(source, xml::span(up))
                .help("export it with z up, or turn the geometry by a `<pose>`"),
        );
    }
    let unit = unit(root);
    let vertices = gathering.vertices.iter().map(|vertex| vertex.map(|x| x * unit)).collect();
    checked(vertices, gathering.triangles).map_err(|reason| fault(root, reason))
}

/// Metres in one unit of the file.
fn unit(root: Node) -> f64 {
    let written = xml::child(root, "asset").and_then(|asset| xml::child(asset, "unit"));
    let metres = written.and_then(|unit| unit.attribute("meter")?.trim().parse().ok());
    metres.filter(|metres: &f64| metres.is_finite() && *metres > 0.0).unwrap_or(1.0)
}

/// What is wrong, and where.
type Fault<'a> = (Node<'a>, String);

/// The scene's triangles so far, in the file's unit.
struct Gathering<'a> {
    root: Node<'a>,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    depth: usize,
    n_nodes: usize,
}

impl<'a> Gathering<'a> {
    /// The scene that the file instances; without one, its first, and without any, every geometry as it stands.
    fn scene(&mut self) -> Result<(), Fault<'a>> {
        let named = xml::child(self.root, "scene").and_then(|scene| xml::child(scene, "instance_visual_scene"));
        let scene = match named {
            Some(instance) => Some(self.target(instance, "visual_scene")?),
            None => self.root.descendants().find(|node| node.tag_name().name() == "visual_scene"),
        };
        let identity = Matrix4::identity();
        match scene {
            Some(scene) => xml::children(scene, "node").try_for_each(|node| self.node(node, &identity)),
            None => {
                let geometries = self.root.descendants().filter(|node| node.tag_name().name() == "geometry");
                geometries.collect::<Vec<_>>().into_iter().try_for_each(|node| self.geometry(node, &identity))
            }
        }
    }

    fn node(&mut self, node: Node<'a>, parent: &Matrix4<f64>) -> Result<(), Fault<'a>> {
        self.n_nodes += 1;
        if self.depth >= DEEPEST || self.n_nodes > MOST_NODES {
            return Err((node, "its nodes instance each other without end".to_owned()));
        }
        self.depth += 1;
        let at = parent * transform(node)?;
        for inner in node.children().filter(|child| child.is_element()) {
            match inner.tag_name().name() {
                "node" => self.node(inner, &at)?,
                "instance_node" => {
                    let target = self.target(inner, "node")?;
                    self.node(target, &at)?;
                }
                "instance_geometry" => {
                    let geometry = self.target(inner, "geometry")?;
                    self.geometry(geometry, &at)?;
                }
                "instance_controller" => return Err((inner, "a skeleton moves its surface".to_owned())),
                _ => {}
            }
        }
        self.depth -= 1;
        Ok(())
    }

    /// The element that a `url` or `source` names.
    fn target(&self, instance: Node<'a>, kind: &str) -> Result<Node<'a>, Fault<'a>> {
        let url = instance.attribute("url").or_else(|| instance.attribute("source")).unwrap_or_default();
        let id = url.trim_start_matches('#');
        self.root
            .descendants()
            .find(|node| node.tag_name().name() == kind && node.attribute("id") == Some(id))
            .ok_or_else(|| (instance, format!("there is no `<{kind} id=\"{id}\">`")))
    }

    fn geometry(&mut self, geometry: Node<'a>, at: &Matrix4<f64>) -> Result<(), Fault<'a>> {
        let Some(mesh) = xml::child(geometry, "mesh") else { return Ok(()) };
        for primitive in mesh.children().filter(|child| child.is_element()) {
            match primitive.tag_name().name() {
                "triangles" | "polylist" => self.primitive(primitive, at)?,
                unread if UNREAD.contains(&unread) => {
                    return Err((primitive, format!("`<{unread}>` is not read")));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Triangles, or polygons cut into fans of triangles.
    fn primitive(&mut self, primitive: Node<'a>, at: &Matrix4<f64>) -> Result<(), Fault<'a>> {
        let inputs: Vec<Node> = xml::children(primitive, "input").collect();
        let offset = |input: &Node| input.attribute("offset").and_then(|at| at.parse::<usize>().ok()).unwrap_or(0);
        let stride = inputs.iter().map(offset).max().map_or(1, |last| last + 1);
        let vertex = inputs.iter().find(|input| input.attribute("semantic") == Some("VERTEX"));
        let vertex = vertex.ok_or_else(|| (primitive, "it has no input VERTEX".to_owned()))?;
        let positions = self.positions(*vertex)?;
        let indices: Vec<usize> = list(xml::child(primitive, "p").unwrap_or(primitive), "p")?;
        let corners: Vec<usize> =
            indices.chunks_exact(stride).filter_map(|all| all.get(offset(vertex)).copied()).collect();
        if corners.iter().any(|corner| *corner >= positions.len()) {
            return Err((primitive, "it speaks of a vertex that is not there".to_owned()));
        }
        let before = self.vertices.len();
        self.vertices.extend(positions.iter().map(|position| <[f64; 3]>::from(at.transform_point(position).coords)));
        let counts: Vec<usize> = match xml::child(primitive, "vcount") {
            Some(counts) => list(counts, "vcount")?,
            None => vec![3; corners.len() / 3],
        };
        let mut rest = corners.as_slice();
        for count in counts {
            let Some((polygon, behind)) = rest.split_at_checked(count) else {
                return Err((primitive, "it counts more corners than it lists".to_owned()));
            };
            rest = behind;
            for pair in polygon.get(1..).unwrap_or_default().windows(2) {
                self.triangle(primitive, [polygon[0], pair[0], pair[1]].map(|corner| corner + before))?;
            }
        }
        Ok(())
    }

    fn triangle(&mut self, primitive: Node<'a>, corners: [usize; 3]) -> Result<(), Fault<'a>> {
        let narrow = corners.map(u32::try_from);
        let [Ok(a), Ok(b), Ok(c)] = narrow else { return Err((primitive, "it is too large".to_owned())) };
        if self.triangles.len() >= MOST_TRIANGLES {
            return Err((primitive, format!("it has more than {MOST_TRIANGLES} triangles")));
        }
        self.triangles.push([a, b, c]);
        Ok(())
    }

    /// The places of a VERTEX input: its POSITION source.
    fn positions(&self, input: Node<'a>) -> Result<Vec<Point3<f64>>, Fault<'a>> {
        let vertices = self.target(input, "vertices")?;
        let position = xml::children(vertices, "input").find(|input| input.attribute("semantic") == Some("POSITION"));
        let position = position.ok_or_else(|| (vertices, "it has no input POSITION".to_owned()))?;
        let source = self.target(position, "source")?;
        let array =
            xml::child(source, "float_array").ok_or_else(|| (source, "it has no `<float_array>`".to_owned()))?;
        let accessor = source.descendants().find(|node| node.tag_name().name() == "accessor");
        let stride = accessor.and_then(|accessor| accessor.attribute("stride")?.parse().ok()).unwrap_or(3_usize);
        let numbers: Vec<f64> = list(array, "float_array")?;
        let places = numbers.chunks_exact(stride.max(3)).map(|place| Point3::new(place[0], place[1], place[2]));
        Ok(places.collect())
    }
}

/// What a node's own transforms do, in the order in which they stand.
fn transform(node: Node<'_>) -> Result<Matrix4<f64>, Fault<'_>> {
    let mut product = Matrix4::identity();
    for element in node.children().filter(|child| child.is_element()) {
        let kind = element.tag_name().name();
        let length = match kind {
            "matrix" => 16,
            "translate" | "scale" => 3,
            "rotate" => 4,
            "lookat" | "skew" => return Err((element, format!("`<{kind}>` is not read"))),
            _ => continue,
        };
        let numbers: Vec<f64> = list(element, kind)?;
        if numbers.len() != length {
            return Err((element, format!("`<{kind}>` must hold {length} numbers")));
        }
        product *= match kind {
            "matrix" => Matrix4::from_row_slice(&numbers),
            "translate" => Matrix4::new_translation(&Vector3::from_row_slice(&numbers)),
            "scale" => Matrix4::new_nonuniform_scaling(&Vector3::from_row_slice(&numbers)),
            _ => match Unit::try_new(Vector3::from_row_slice(&numbers[..3]), 1e-9) {
                Some(axis) => Rotation3::from_axis_angle(&axis, numbers[3].to_radians()).to_homogeneous(),
                None => Matrix4::identity(),
            },
        };
    }
    Ok(product)
}

/// All numbers that an element lists.
fn list<'a, T: std::str::FromStr>(node: Node<'a>, what: &str) -> Result<Vec<T>, Fault<'a>> {
    let words = xml::text(node).split_whitespace();
    words
        .map(|word| word.parse().map_err(|_| (node, format!("`<{what}>` holds `{word}`, which is no number"))))
        .collect()
}
