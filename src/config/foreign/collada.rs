//! Reads COLLADA (.dae) meshes: the geometry that the scene instances, with transforms and unit.
//!
//! Ignores `up_axis`, as Gazebo does: coordinates are used unchanged.

use std::collections::BTreeMap;
use std::rc::Rc;

use nalgebra::{Isometry3, Matrix4, Point3, Rotation3, Unit, Vector3};

use crate::foreign::colours;
use crate::foreign::mesh_file::{ColouredMesh, ColouredTriangles, MOST_TRIANGLES};
use crate::foreign::xml::{self, Node};
use actcheck_base::{Diagnostic, Diagnostics, Source};
use actcheck_data::Colour;

/// Limits on the depth and the number of nodes; only nodes that instance each other in a cycle
/// exceed them.
const DEEPEST: usize = 64;
const MOST_NODES: usize = 100_000;

/// Largest number of vertices with those of all instances, used or not.
const MOST_VERTICES: usize = 3 * MOST_TRIANGLES;
/// Largest offset of an input among the indices of a corner; files have a handful of inputs.
const LARGEST_OFFSET: usize = 255;
/// Longest text of a transform, which is read again for every instance. Unit: bytes.
const LONGEST_TRANSFORM: usize = 1_000;

/// Reads the geometry of a file's scene as one mesh.
///
/// # Errors
/// W031 if it is not XML, W037 if it has no usable geometry.
pub(crate) fn read(
    source: &Source,
    warnings: &mut Diagnostics,
) -> Result<ColouredMesh, Diagnostics> {
    let document = xml::parse(source, &source.text)?;
    let root = document.root_element();
    let fault = |node: Node, reason: String| -> Diagnostics {
        Diagnostic::error(
            "W037",
            format!("the mesh {} is unusable: {reason}", source.name),
        )
        .at(source, xml::span(node))
        .help("export it again, as triangles, to dae, stl or obj")
        .into()
    };
    if root.tag_name().name() != "COLLADA" {
        return Err(fault(
            root,
            format!(
                "its root is `<{}>` instead of `<COLLADA>`",
                root.tag_name().name()
            ),
        ));
    }
    let mut gathering = SceneTriangles::new(root);
    gathering
        .scene()
        .map_err(|(node, reason)| fault(node, reason))?;
    if let Some(up) = xml::child(root, "asset").and_then(|asset| xml::child(asset, "up_axis"))
        && xml::text(up) != "Z_UP"
    {
        let message = format!(
            "the mesh's up axis, {}, is ignored, as in Gazebo: coordinates are used unchanged",
            xml::text(up)
        );
        warnings.push(
            Diagnostic::warning("W036", message)
                .at(source, xml::span(up))
                .help("export it with z up, or rotate the geometry with a `<pose>`"),
        );
    }
    let unit = unit(root);
    let mut all = gathering.all;
    for vertex in &mut all.vertices {
        *vertex = vertex.map(|x| x * unit);
    }
    all.checked()
        .map_err(|reason| fault(root, reason.to_string()))
}

/// Returns the length of one unit of the file in metres.
fn unit(root: Node) -> f64 {
    let written = xml::child(root, "asset").and_then(|asset| xml::child(asset, "unit"));
    let metres = written.and_then(|unit| unit.attribute("meter")?.trim().parse().ok());
    metres
        .filter(|metres: &f64| metres.is_finite() && *metres > 0.0)
        .unwrap_or(1.0)
}

/// A faulty element and the reason.
type Fault<'a> = (Node<'a>, String);

/// A geometry in its own frame: its positions, and its triangles as indices of them. Unit: the
/// file's.
struct Geometry<'a> {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[usize; 3]>,
    /// The symbol of the material of all triangles from one on, until the next entry.
    materials: Vec<(usize, Option<&'a str>)>,
}

/// The scene's triangles so far, in the file's unit.
struct SceneTriangles<'a> {
    root: Node<'a>,
    /// Elements by kind and id; the first of several.
    by_id: BTreeMap<(&'a str, &'a str), Node<'a>>,
    /// Geometries that were read, by element: a scene may instance one thousands of times.
    known: BTreeMap<Node<'a>, Rc<Geometry<'a>>>,
    all: ColouredTriangles,
    depth: usize,
    n_nodes: usize,
}

impl<'a> SceneTriangles<'a> {
    fn new(root: Node<'a>) -> Self {
        let mut by_id = BTreeMap::new();
        for node in root.descendants().filter(Node::is_element) {
            if let Some(id) = node.attribute("id") {
                by_id.entry((node.tag_name().name(), id)).or_insert(node);
            }
        }
        Self {
            root,
            by_id,
            known: BTreeMap::new(),
            all: ColouredTriangles::default(),
            depth: 0,
            n_nodes: 0,
        }
    }

    /// Gathers the scene that the file instances, or else its first scene, or else every geometry
    /// without transforms.
    fn scene(&mut self) -> Result<(), Fault<'a>> {
        let named = xml::child(self.root, "scene")
            .and_then(|scene| xml::child(scene, "instance_visual_scene"));
        let scene = match named {
            Some(instance) => Some(self.target(instance, "visual_scene")?),
            None => self
                .root
                .descendants()
                .find(|node| node.tag_name().name() == "visual_scene"),
        };
        let identity = Matrix4::identity();
        match scene {
            Some(scene) => {
                xml::children(scene, "node").try_for_each(|node| self.node(node, &identity))
            }
            None => {
                let geometries = self
                    .root
                    .descendants()
                    .filter(|node| node.tag_name().name() == "geometry");
                geometries
                    .collect::<Vec<_>>()
                    .into_iter()
                    .try_for_each(|node| self.geometry(node, None, &identity))
            }
        }
    }

    fn node(&mut self, node: Node<'a>, parent: &Matrix4<f64>) -> Result<(), Fault<'a>> {
        self.n_nodes += 1;
        if self.depth >= DEEPEST || self.n_nodes > MOST_NODES {
            return Err((
                node,
                "its nodes are nested too deeply or instance each other".to_owned(),
            ));
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
                    self.geometry(geometry, Some(inner), &at)?;
                }
                "instance_controller" => {
                    return Err((
                        inner,
                        "a surface moved by a skeleton is not supported".to_owned(),
                    ));
                }
                _ => {}
            }
        }
        self.depth -= 1;
        Ok(())
    }

    /// Finds the element that a `url` or `source` refers to.
    fn target(&self, instance: Node<'a>, kind: &'static str) -> Result<Node<'a>, Fault<'a>> {
        let url = instance
            .attribute("url")
            .or_else(|| instance.attribute("source"))
            .unwrap_or_default();
        let id = url.trim_start_matches('#');
        self.by_id
            .get(&(kind, id))
            .copied()
            .ok_or_else(|| (instance, format!("there is no `<{kind} id=\"{id}\">`")))
    }

    /// Adds a geometry to the scene, with the colours that its instance gives to its materials.
    fn geometry(
        &mut self,
        node: Node<'a>,
        instance: Option<Node<'a>>,
        at: &Matrix4<f64>,
    ) -> Result<(), Fault<'a>> {
        let geometry = match self.known.get(&node) {
            Some(known) => Rc::clone(known),
            None => {
                let read = Rc::new(self.read_geometry(node)?);
                self.known.insert(node, Rc::clone(&read));
                read
            }
        };
        let before = self.all.vertices.len();
        if before + geometry.positions.len() > MOST_VERTICES {
            return Err((
                node,
                format!("its instances have more than {MOST_VERTICES} vertices"),
            ));
        }
        if self.all.triangles.len() + geometry.triangles.len() > MOST_TRIANGLES {
            return Err((
                node,
                format!("its instances have more than {MOST_TRIANGLES} triangles"),
            ));
        }
        let placed = geometry
            .positions
            .iter()
            .map(|position| <[f64; 3]>::from(at.transform_point(position).coords));
        self.all.vertices.extend(placed);
        let ends = geometry.materials.iter().skip(1).map(|(start, _)| *start);
        let ends = ends.chain([geometry.triangles.len()]);
        for ((start, symbol), end) in geometry.materials.iter().zip(ends) {
            let colour = symbol.and_then(|symbol| self.colour(symbol, instance));
            self.all.begin(colour);
            for corners in &geometry.triangles[*start..end] {
                let narrow = corners.map(|corner| u32::try_from(corner + before));
                let [Ok(a), Ok(b), Ok(c)] = narrow else {
                    return Err((node, "it is too large".to_owned()));
                };
                self.all.triangles.push([a, b, c]);
            }
        }
        Ok(())
    }

    /// The colour in diffuse light of a material, which an instance of its geometry binds to its
    /// symbol. `None` if it has none, or a texture, which is not read.
    fn colour(&self, symbol: &str, instance: Option<Node<'a>>) -> Option<Colour> {
        let bound = instance.and_then(|instance| {
            instance.descendants().find(|node| {
                node.tag_name().name() == "instance_material"
                    && node.attribute("symbol") == Some(symbol)
            })
        });
        let id = match bound {
            Some(bound) => bound.attribute("target")?.trim_start_matches('#'),
            None => symbol,
        };
        let material = self.by_id.get(&("material", id))?;
        let effect = self.target(xml::child(*material, "instance_effect")?, "effect");
        let diffuse = effect.ok()?.descendants();
        let mut diffuse = diffuse.filter(|node| node.tag_name().name() == "diffuse");
        let numbers = colours::numbers(xml::text(xml::child(diffuse.next()?, "color")?))?;
        Some(Colour::of_srgb(*numbers.first_chunk()?))
    }

    fn read_geometry(&self, node: Node<'a>) -> Result<Geometry<'a>, Fault<'a>> {
        let mut geometry = Geometry {
            positions: Vec::new(),
            triangles: Vec::new(),
            materials: Vec::new(),
        };
        let Some(mesh) = xml::child(node, "mesh") else {
            return Ok(geometry);
        };
        for primitive in mesh.children().filter(|child| child.is_element()) {
            // Lines and points have no surface.
            match primitive.tag_name().name() {
                "triangles" | "polylist" | "polygons" | "trifans" | "tristrips" => {
                    self.primitive(primitive, &mut geometry)?;
                }
                _ => {}
            }
        }
        Ok(geometry)
    }

    /// Adds triangles, or polygons, fans and strips as triangles.
    fn primitive(&self, primitive: Node<'a>, geometry: &mut Geometry<'a>) -> Result<(), Fault<'a>> {
        if let Some(holes) = xml::child(primitive, "ph") {
            return Err((holes, "polygons with holes are not supported".to_owned()));
        }
        let inputs: Vec<Node> = xml::children(primitive, "input").collect();
        let offsets = inputs
            .iter()
            .map(|input| offset(*input))
            .collect::<Result<Vec<usize>, _>>()?;
        let stride = offsets.iter().max().map_or(1, |last| last + 1);
        let vertex = inputs
            .iter()
            .zip(&offsets)
            .find(|(input, _)| input.attribute("semantic") == Some("VERTEX"));
        let (vertex, offset) =
            vertex.ok_or_else(|| (primitive, "it has no input VERTEX".to_owned()))?;
        let positions = self.positions(*vertex)?;
        let corners_of = |node: Node<'a>| -> Result<Vec<usize>, Fault<'a>> {
            let indices: Vec<usize> = list(node, "p")?;
            let corners: Vec<usize> = indices
                .chunks_exact(stride)
                .filter_map(|all| all.get(*offset).copied())
                .collect();
            if corners.iter().any(|corner| *corner >= positions.len()) {
                return Err((primitive, "it refers to a missing vertex".to_owned()));
            }
            Ok(corners)
        };
        let lists = xml::children(primitive, "p")
            .map(corners_of)
            .collect::<Result<Vec<_>, _>>()?;
        let before = geometry.positions.len();
        if before + positions.len() > MOST_VERTICES {
            return Err((
                primitive,
                format!("it has more than {MOST_VERTICES} vertices"),
            ));
        }
        geometry.positions.extend(positions);
        geometry
            .materials
            .push((geometry.triangles.len(), primitive.attribute("material")));
        let pieces = pieces(primitive, &lists)?;
        let is_strip = primitive.tag_name().name() == "tristrips";
        for piece in pieces {
            for (idx, pair) in piece.get(1..).unwrap_or_default().windows(2).enumerate() {
                if geometry.triangles.len() >= MOST_TRIANGLES {
                    return Err((
                        primitive,
                        format!("it has more than {MOST_TRIANGLES} triangles"),
                    ));
                }
                // Each triangle of a strip begins with the next corner, and every other one is the
                // other way round.
                let triangle = match is_strip {
                    false => [piece[0], pair[0], pair[1]],
                    true if idx % 2 == 0 => [piece[idx], pair[0], pair[1]],
                    true => [piece[idx], pair[1], pair[0]],
                };
                geometry
                    .triangles
                    .push(triangle.map(|corner| corner + before));
            }
        }
        Ok(())
    }

    /// Returns the positions of a VERTEX input, from its POSITION source.
    fn positions(&self, input: Node<'a>) -> Result<Vec<Point3<f64>>, Fault<'a>> {
        let vertices = self.target(input, "vertices")?;
        let position = xml::children(vertices, "input")
            .find(|input| input.attribute("semantic") == Some("POSITION"));
        let position = position.ok_or_else(|| (vertices, "it has no input POSITION".to_owned()))?;
        let source = self.target(position, "source")?;
        let array = xml::child(source, "float_array")
            .ok_or_else(|| (source, "it has no `<float_array>`".to_owned()))?;
        let accessor = source
            .descendants()
            .find(|node| node.tag_name().name() == "accessor");
        let stride = accessor
            .and_then(|accessor| accessor.attribute("stride")?.parse().ok())
            .unwrap_or(3_usize);
        let numbers: Vec<f64> = list(array, "float_array")?;
        let places = numbers
            .chunks_exact(stride.max(3))
            .map(|place| Point3::new(place[0], place[1], place[2]));
        Ok(places.collect())
    }
}

/// Returns the corners of each polygon, fan or strip of a primitive with these lists `<p>`: one
/// list of all triangles, one of all polygons with their numbers of corners, or one for each piece.
fn pieces<'l, 'a>(
    primitive: Node<'a>,
    lists: &'l [Vec<usize>],
) -> Result<Vec<&'l [usize]>, Fault<'a>> {
    let kind = primitive.tag_name().name();
    let (true, Some(corners)) = (matches!(kind, "triangles" | "polylist"), lists.first()) else {
        return Ok(lists.iter().map(Vec::as_slice).collect());
    };
    let Some(counts) = xml::child(primitive, "vcount") else {
        return Ok(corners.chunks_exact(3).collect());
    };
    let (mut pieces, mut rest) = (Vec::new(), corners.as_slice());
    for count in list::<usize>(counts, "vcount")? {
        let Some((piece, behind)) = rest.split_at_checked(count) else {
            return Err((
                primitive,
                "`<vcount>` counts more corners than `<p>` lists".to_owned(),
            ));
        };
        pieces.push(piece);
        rest = behind;
    }
    Ok(pieces)
}

/// Returns the position of an input among the indices of a corner; 0 if it is not written.
fn offset(input: Node<'_>) -> Result<usize, Fault<'_>> {
    let Some(written) = input.attribute("offset") else {
        return Ok(0);
    };
    let offset = written
        .trim()
        .parse()
        .ok()
        .filter(|offset| *offset <= LARGEST_OFFSET);
    offset.ok_or_else(|| {
        (
            input,
            format!("an `offset` must be a number from 0 to {LARGEST_OFFSET}"),
        )
    })
}

/// Returns the product of a node's own transforms, in document order.
fn transform(node: Node<'_>) -> Result<Matrix4<f64>, Fault<'_>> {
    let mut product = Matrix4::identity();
    for element in node.children().filter(|child| child.is_element()) {
        let kind = element.tag_name().name();
        let length = match kind {
            "matrix" => 16,
            "translate" | "scale" => 3,
            "rotate" => 4,
            "lookat" => 9,
            "skew" => return Err((element, format!("`<{kind}>` is not supported"))),
            _ => continue,
        };
        if xml::text(element).len() > LONGEST_TRANSFORM {
            return Err((
                element,
                format!("`<{kind}>` is longer than {LONGEST_TRANSFORM} characters"),
            ));
        }
        let numbers: Vec<f64> = list(element, kind)?;
        if numbers.len() != length {
            return Err((element, format!("`<{kind}>` must hold {length} numbers")));
        }
        product *= match kind {
            "matrix" => Matrix4::from_row_slice(&numbers),
            "translate" => Matrix4::new_translation(&Vector3::from_row_slice(&numbers)),
            "scale" => Matrix4::new_nonuniform_scaling(&Vector3::from_row_slice(&numbers)),
            "lookat" => {
                let [eye, target] = [0, 3].map(|at| Point3::from_slice(&numbers[at..at + 3]));
                let up = Vector3::from_row_slice(&numbers[6..]);
                if (target - eye).cross(&up).norm() < 1e-9 {
                    return Err((
                        element,
                        "`<lookat>` must look in a direction other than up".to_owned(),
                    ));
                }
                // A node that looks along its own −z axis.
                Isometry3::look_at_rh(&eye, &target, &up)
                    .inverse()
                    .to_homogeneous()
            }
            _ => match Unit::try_new(Vector3::from_row_slice(&numbers[..3]), 1e-9) {
                Some(axis) => {
                    Rotation3::from_axis_angle(&axis, numbers[3].to_radians()).to_homogeneous()
                }
                None => Matrix4::identity(),
            },
        };
    }
    Ok(product)
}

/// Parses the list of numbers in an element.
fn list<'a, T: std::str::FromStr>(node: Node<'a>, what: &str) -> Result<Vec<T>, Fault<'a>> {
    let words = xml::text(node).split_whitespace();
    words
        .map(|word| {
            word.parse().map_err(|_| {
                (
                    node,
                    format!("`<{what}>` contains `{word}`, which is not a number"),
                )
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;

    /// A square as each kind of primitive: all have two triangles with the same way round.
    #[test]
    fn polygons_fans_and_strips_become_triangles() {
        let read_as = |primitive: &str| {
            let input = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>\
                         <input semantic=\"NORMAL\" source=\"#n\" offset=\"1\"/>";
            let text = format!(
                "<COLLADA><library_geometries><geometry id=\"g\"><mesh>\
                 <source id=\"p\"><float_array>0 0 0 1 0 0 1 1 0 0 1 0</float_array></source>\
                 <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>{}\
                 </mesh></geometry></library_geometries>\
                 <library_visual_scenes><visual_scene id=\"s\"><node><instance_geometry url=\"#g\"/></node></visual_scene>\
                 </library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>",
                primitive.replace("INPUT", input),
            );
            let source = Source::new("square.dae".to_owned(), text);
            let read = read(&source, &mut Diagnostics::new()).map_err(|found| found.to_string())?;
            let mesh = read.mesh;
            let corner = |idx: u32| mesh.vertices[idx as usize];
            Ok::<_, String>(
                mesh.triangles
                    .iter()
                    .map(|triangle| triangle.map(corner))
                    .collect::<Vec<_>>(),
            )
        };
        let squares = [
            "<triangles>INPUT<p>0 0 1 0 2 0 0 0 2 0 3 0</p></triangles>",
            "<polylist>INPUT<vcount>4</vcount><p>0 0 1 0 2 0 3 0</p></polylist>",
            "<polygons>INPUT<p>0 0 1 0 2 0 3 0</p></polygons>",
            "<polygons>INPUT<p>0 0 1 0 2 0</p><p>0 0 2 0 3 0</p></polygons>",
            "<trifans>INPUT<p>0 0 1 0 2 0 3 0</p></trifans>",
            "<tristrips>INPUT<p>0 0 1 0 3 0 2 0</p></tristrips>",
        ];
        for square in squares {
            let triangles = read_as(square).expect("it is a square");
            assert_eq!(triangles.len(), 2, "{square}");
            for [a, b, c] in triangles {
                let [a, b, c] = [a, b, c].map(Vector3::from);
                assert!((b - a).cross(&(c - a)).z > 0.9, "{square}: {a} {b} {c}");
            }
        }
        let holes = "<polygons>INPUT<ph><p>0 0 1 0 2 0 3 0</p><h>0 0 1 0 2 0</h></ph></polygons>";
        assert!(
            read_as(holes)
                .is_err_and(|said| said.contains("polygons with holes are not supported"))
        );
    }

    #[test]
    fn a_node_looks_along_its_own_axis() {
        let moved = |text: &str, point: [f64; 3]| {
            let text = format!("<node>{text}</node>");
            let document = roxmltree::Document::parse(&text).expect("it is XML");
            let matrix = transform(document.root_element()).map_err(|(_, message)| message)?;
            Ok::<_, String>((matrix * Vector4::new(point[0], point[1], point[2], 1.0)).xyz())
        };
        // From (1, 2, 3) along +y, with +z above.
        let view = "<lookat>1 2 3 1 5 3 0 0 1</lookat>";
        for (point, expected) in [
            ([0.0, 0.0, -1.0], [1.0, 3.0, 3.0]),
            ([0.0, 1.0, 0.0], [1.0, 2.0, 4.0]),
        ] {
            let found = moved(view, point).expect("it looks somewhere");
            assert!((found - Vector3::from(expected)).norm() < 1e-9, "{found}");
        }
        assert!(
            moved("<lookat>1 2 3 1 2 5 0 0 1</lookat>", [0.0; 3]).is_err(),
            "it looks up"
        );
    }
}
