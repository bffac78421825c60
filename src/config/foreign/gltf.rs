//! Reads glTF 2.0 meshes (.glb, .gltf): the triangles of the default scene, with the transforms of
//! its nodes.
//!
//! Coordinates are used unchanged, although glTF defines y as up. Source: gz-common's
//! `AssimpLoader::UpdatedRootNodeTransform`, which applies the transforms of nodes and no other.
//!
//! The crate `gltf` is not used: it panics on damaged accessors, rejects files for the faults of
//! their materials, and hides the compression of a mesh.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use base64::Engine;
use base64::engine::general_purpose::GeneralPurpose;
use base64::engine::{DecodePaddingMode, GeneralPurposeConfig};
use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, UnitQuaternion, Vector3};

use crate::foreign::gltf_document::{
    Accessor, BufferView, Document, GltfNode, Primitive, harmless_extension,
};
use crate::foreign::lookup;
use crate::foreign::mesh_file::{
    ColouredMesh, ColouredTriangles, MOST_TRIANGLES, MeshFileFault, WHITE,
};
use actcheck_base::{Diagnostic, Diagnostics, FileFault, Files};
use actcheck_data::Colour;

/// Largest number of vertices with those of all instances, used or not.
const MOST_VERTICES: usize = 3 * MOST_TRIANGLES;
/// Longest JSON text, which may contain buffers. Unit: bytes.
const LONGEST_JSON: usize = 256 << 20;
/// Largest size of all buffers. Unit: bytes.
const MOST_BYTES: usize = 512 << 20;
/// Kinds of components.
const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// Why a glTF file is unusable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum GltfFault {
    #[error("it ends too early")]
    Cut,
    #[error("it is glTF of version {0}; only version 2 is supported")]
    Version(String),
    #[error("its first part is not JSON")]
    NoJson,
    #[error("its JSON is longer than {} MiB", LONGEST_JSON >> 20)]
    LongJson,
    #[error("its JSON is not that of glTF: {0}")]
    Json(String),
    #[error("it requires the extension `{0}`, which is not supported")]
    Extension(String),
    #[error(
        "its mesh is compressed by `{0}`, which is not supported: export it without compression"
    )]
    Compressed(&'static str),
    #[error("it refers to the missing {0} {1}")]
    Missing(&'static str, usize),
    #[error("its node {0} is the child of two nodes, or of itself")]
    Tree(usize),
    #[error("its node {0} has a rotation that is not a unit quaternion")]
    Rotation(usize),
    #[error("its node {0} has {1}, which is not supported")]
    Node(usize, &'static str),
    #[error("the kind of primitive {0} does not exist")]
    Mode(u32),
    #[error("it refers to a missing vertex")]
    Vertex,
    #[error("its accessor {0} has a type or kind of component that it can't have")]
    Type(usize),
    #[error("its accessor {0} reaches beyond its data")]
    Beyond(usize),
    #[error("its buffer {0} has no data")]
    NoData(usize),
    #[error("its buffer {0} is not in base64")]
    Base64(usize),
    #[error("its buffer {0} is `{1}`, but must be a path relative to its file")]
    Address(usize, String),
    #[error("its buffer `{0}` can't be read: {1}")]
    File(String, FileFault),
    #[error("its buffers are larger than {} MiB", MOST_BYTES >> 20)]
    LargeBuffers,
    #[error("it has more than {MOST_VERTICES} vertices or {MOST_TRIANGLES} triangles")]
    Large,
}

/// A mesh of a glTF file.
pub(crate) struct GltfMesh {
    pub(crate) mesh: ColouredMesh,
    /// The bytes of its buffers in other files, for digests.
    pub(crate) others: Vec<u8>,
}

/// Reads the triangles of a file's scene as one mesh.
///
/// # Errors
/// [`MeshFileFault::Gltf`] if it can't be read, [`MeshFileFault::Mesh`] if it has no triangles.
pub(crate) fn read(
    files: &Files,
    path: &Path,
    bytes: &[u8],
    warnings: &mut Diagnostics,
) -> Result<GltfMesh, MeshFileFault> {
    let (json, binary) = parts(bytes)?;
    let document = parse(json)?;
    let mut buffers = Buffers {
        files,
        path,
        binary,
        known: BTreeMap::new(),
        total: 0,
        others: Vec::new(),
    };
    let mut gathering = GltfTriangles {
        document: &document,
        known: BTreeMap::new(),
        all: ColouredTriangles::default(),
        has_lines: false,
    };
    gathering.scene(&mut buffers)?;
    let mut warn = |message: &str, help: &str| {
        warnings.push(Diagnostic::warning("W036", message).help(help));
    };
    warn(
        "glTF defines y as up, but the mesh's coordinates are used unchanged, as in Gazebo",
        "export it with z up, or rotate the geometry by its `<origin>` or `<pose>`",
    );
    if gathering.has_lines {
        warn(
            "points and lines of the mesh are ignored",
            "they have no surface, so the model works without them",
        );
    }
    Ok(GltfMesh {
        mesh: gathering.all.checked()?,
        others: buffers.others,
    })
}

/// Returns the JSON of a file, and the binary data of a .glb file.
fn parts(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), GltfFault> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    };
    let (version, rest) = rest.split_first_chunk().ok_or(GltfFault::Cut)?;
    let version = u32::from_le_bytes(*version);
    if version != 2 {
        return Err(GltfFault::Version(version.to_string()));
    }
    let (length, _) = rest.split_first_chunk().ok_or(GltfFault::Cut)?;
    let length = u32::from_le_bytes(*length) as usize;
    let mut rest = bytes.get(12..length).ok_or(GltfFault::Cut)?;
    let (kind, json) = chunk(&mut rest)?;
    if kind != b"JSON" {
        return Err(GltfFault::NoJson);
    }
    while !rest.is_empty() {
        let (kind, data) = chunk(&mut rest)?;
        if kind == b"BIN\0" {
            return Ok((json, Some(data)));
        }
    }
    Ok((json, None))
}

/// Takes the next chunk of a .glb file: its kind, and its data.
fn chunk<'a>(rest: &mut &'a [u8]) -> Result<(&'a [u8; 4], &'a [u8]), GltfFault> {
    let (length, after) = rest.split_first_chunk().ok_or(GltfFault::Cut)?;
    let (kind, after) = after.split_first_chunk().ok_or(GltfFault::Cut)?;
    let length = u32::from_le_bytes(*length) as usize;
    let (data, after) = after.split_at_checked(length).ok_or(GltfFault::Cut)?;
    *rest = after;
    Ok((kind, data))
}

fn parse(json: &[u8]) -> Result<Document, GltfFault> {
    if json.len() > LONGEST_JSON {
        return Err(GltfFault::LongJson);
    }
    let document: Document =
        serde_json::from_slice(json).map_err(|error| GltfFault::Json(error.to_string()))?;
    if !document.asset.version.starts_with("2.") {
        return Err(GltfFault::Version(document.asset.version));
    }
    let unknown = document
        .extensions_required
        .iter()
        .find(|name| !harmless_extension(name));
    match unknown {
        None => Ok(document),
        Some(name) => Err(GltfFault::Extension(name.clone())),
    }
}

/// The data to which accessors refer.
struct Buffers<'a> {
    files: &'a Files,
    path: &'a Path,
    binary: Option<&'a [u8]>,
    /// The buffers that were read, by index.
    known: BTreeMap<usize, Rc<[u8]>>,
    /// The size of all known buffers. Unit: bytes.
    total: usize,
    others: Vec<u8>,
}

impl Buffers<'_> {
    fn get(&mut self, document: &Document, idx: usize) -> Result<Rc<[u8]>, GltfFault> {
        if let Some(known) = self.known.get(&idx) {
            return Ok(Rc::clone(known));
        }
        let buffer = document
            .buffers
            .get(idx)
            .ok_or(GltfFault::Missing("buffer", idx))?;
        let data: Rc<[u8]> = match (&buffer.uri, self.binary) {
            (Some(uri), _) => self.of_uri(idx, uri)?.into(),
            (None, Some(binary)) if idx == 0 => binary.into(),
            _ => return Err(GltfFault::NoData(idx)),
        };
        self.total = self.total.saturating_add(data.len());
        if self.total > MOST_BYTES {
            return Err(GltfFault::LargeBuffers);
        }
        if data.len() < buffer.byte_length as usize {
            return Err(GltfFault::Cut);
        }
        self.known.insert(idx, Rc::clone(&data));
        Ok(data)
    }

    fn of_uri(&mut self, idx: usize, uri: &str) -> Result<Vec<u8>, GltfFault> {
        /// With or without the signs that fill the last group.
        const BASE64: GeneralPurpose = GeneralPurpose::new(
            &base64::alphabet::STANDARD,
            GeneralPurposeConfig::new()
                .with_decode_padding_mode(DecodePaddingMode::Indifferent)
                .with_decode_allow_trailing_bits(true),
        );
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, text) = data.split_once(";base64,").ok_or(GltfFault::Base64(idx))?;
            return BASE64.decode(text).map_err(|_| GltfFault::Base64(idx));
        }
        if uri.starts_with(['/', '\\']) || uri.contains(':') {
            let beginning = uri.chars().take(60).collect();
            return Err(GltfFault::Address(idx, beginning));
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let data = self
            .files
            .read_bytes(&lookup::beside(self.files, folder, uri))
            .map_err(|fault| GltfFault::File(uri.to_owned(), fault))?;
        if self.total.saturating_add(data.len()) <= MOST_BYTES {
            self.others.extend(&data);
        }
        Ok(data)
    }
}

/// A mesh in its own frame. Unit: metres.
struct GltfGeometry {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[usize; 3]>,
    /// The colour of all triangles from one on, until the next entry.
    colours: Vec<(usize, Option<Colour>)>,
}

/// The scene's triangles so far. Unit: metres.
struct GltfTriangles<'a> {
    document: &'a Document,
    /// Meshes that were read, by index: a scene may instance one thousands of times.
    known: BTreeMap<usize, Rc<GltfGeometry>>,
    all: ColouredTriangles,
    /// Whether a mesh has points or lines.
    has_lines: bool,
}

impl GltfTriangles<'_> {
    /// Gathers the default scene, or else the first, or else all nodes without a parent, or else
    /// every mesh without transforms.
    fn scene(&mut self, buffers: &mut Buffers) -> Result<(), GltfFault> {
        let document = self.document;
        let roots: Vec<u32> = match document.scene {
            Some(idx) => {
                let idx = idx as usize;
                let scene = document.scenes.get(idx);
                scene.ok_or(GltfFault::Missing("scene", idx))?.nodes.clone()
            }
            None => match document.scenes.first() {
                Some(scene) => scene.nodes.clone(),
                None => document.roots(),
            },
        };
        if document.nodes.is_empty() && document.scenes.is_empty() {
            return (0..document.meshes.len())
                .try_for_each(|mesh| self.instance(mesh, &Matrix4::identity(), buffers));
        }
        let mut is_visited = vec![false; document.nodes.len()];
        let mut open: Vec<(u32, Matrix4<f64>)> = Vec::new();
        let add = |open: &mut Vec<_>, nodes: &[u32], at: Matrix4<f64>| {
            open.extend(nodes.iter().rev().map(|node| (*node, at)));
        };
        add(&mut open, &roots, Matrix4::identity());
        while let Some((idx, parent)) = open.pop() {
            let idx = idx as usize;
            let node = document
                .nodes
                .get(idx)
                .ok_or(GltfFault::Missing("node", idx))?;
            if std::mem::replace(&mut is_visited[idx], true) {
                return Err(GltfFault::Tree(idx));
            }
            let at = parent * transform(idx, node)?;
            if let Some(mesh) = node.mesh {
                check_static(document, idx, node)?;
                self.instance(mesh as usize, &at, buffers)?;
            }
            add(&mut open, &node.children, at);
        }
        Ok(())
    }

    /// Adds a mesh to the scene.
    fn instance(
        &mut self,
        idx: usize,
        at: &Matrix4<f64>,
        buffers: &mut Buffers,
    ) -> Result<(), GltfFault> {
        let geometry = match self.known.get(&idx) {
            Some(known) => Rc::clone(known),
            None => {
                let read = Rc::new(self.geometry(idx, buffers)?);
                self.known.insert(idx, Rc::clone(&read));
                read
            }
        };
        let before = self.all.vertices.len();
        if before + geometry.positions.len() > MOST_VERTICES
            || self.all.triangles.len() + geometry.triangles.len() > MOST_TRIANGLES
        {
            return Err(GltfFault::Large);
        }
        let linear: Matrix3<f64> = at.fixed_view::<3, 3>(0, 0).into_owned();
        let shift: Vector3<f64> = at.fixed_view::<3, 1>(0, 3).into_owned();
        let placed = geometry
            .positions
            .iter()
            .map(|position| <[f64; 3]>::from(linear * position.coords + shift));
        self.all.vertices.extend(placed);
        // A node that mirrors its mesh turns its triangles round.
        let is_mirrored = linear.determinant() < 0.0;
        let ends = geometry.colours.iter().skip(1).map(|(start, _)| *start);
        let ends = ends.chain([geometry.triangles.len()]);
        for ((start, colour), end) in geometry.colours.iter().zip(ends) {
            self.all.begin(*colour);
            for [a, b, c] in &geometry.triangles[*start..end] {
                let corners = if is_mirrored { [a, c, b] } else { [a, b, c] };
                let narrow = corners.map(|corner| u32::try_from(corner + before));
                let [Ok(a), Ok(b), Ok(c)] = narrow else {
                    return Err(GltfFault::Large);
                };
                self.all.triangles.push([a, b, c]);
            }
        }
        Ok(())
    }

    fn geometry(&mut self, idx: usize, buffers: &mut Buffers) -> Result<GltfGeometry, GltfFault> {
        let document = self.document;
        let mesh = document
            .meshes
            .get(idx)
            .ok_or(GltfFault::Missing("mesh", idx))?;
        let mut geometry = GltfGeometry {
            positions: Vec::new(),
            triangles: Vec::new(),
            colours: Vec::new(),
        };
        for primitive in &mesh.primitives {
            match primitive.mode {
                0..=3 => self.has_lines = true,
                4..=6 => read_primitive(document, primitive, buffers, &mut geometry)?,
                mode => return Err(GltfFault::Mode(mode)),
            }
        }
        Ok(geometry)
    }
}

/// Reports a node whose mesh is not where its accessors and transforms place it.
fn check_static(document: &Document, idx: usize, node: &GltfNode) -> Result<(), GltfFault> {
    if node.skin.is_some() {
        return Err(GltfFault::Node(idx, "a surface moved by a skeleton"));
    }
    if node.extensions.instancing.is_some() {
        return Err(GltfFault::Node(idx, "`EXT_mesh_gpu_instancing`"));
    }
    let mesh = node
        .mesh
        .and_then(|mesh| document.meshes.get(mesh as usize));
    let Some(mesh) = mesh else { return Ok(()) };
    let weights = match node.weights.is_empty() {
        true => &mesh.weights,
        false => &node.weights,
    };
    let has_weight = weights.iter().any(|weight| *weight != 0.0);
    if has_weight && mesh.primitives.iter().any(|one| one.targets > 0) {
        return Err(GltfFault::Node(idx, "morph targets with weights"));
    }
    Ok(())
}

/// Returns the transform of a node from its parent's frame.
fn transform(idx: usize, node: &GltfNode) -> Result<Matrix4<f64>, GltfFault> {
    if let Some(columns) = &node.matrix {
        return Ok(Matrix4::from_column_slice(columns));
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6)
        .ok_or(GltfFault::Rotation(idx))?;
    let shift = Vector3::from(node.translation.unwrap_or_default());
    let scale = Vector3::from(node.scale.unwrap_or([1.0; 3]));
    Ok(Matrix4::new_translation(&shift)
        * rotation.to_homogeneous()
        * Matrix4::new_nonuniform_scaling(&scale))
}

/// Adds the triangles of a primitive, or those of its strip or fan.
fn read_primitive(
    document: &Document,
    primitive: &Primitive,
    buffers: &mut Buffers,
    geometry: &mut GltfGeometry,
) -> Result<(), GltfFault> {
    let is_compressed = primitive.extensions.draco.is_some();
    let Some(positions) = primitive.attributes.position else {
        // Its vertices would have no place; the standard lets programs leave it out.
        return Ok(());
    };
    let accessors = [Some(positions), primitive.indices];
    for idx in accessors.into_iter().flatten() {
        let accessor = document.accessor(idx as usize)?;
        if is_compressed && accessor.buffer_view.is_none() && accessor.sparse.is_none() {
            return Err(GltfFault::Compressed("KHR_draco_mesh_compression"));
        }
    }
    let before = geometry.positions.len();
    let positions = read_positions(document, positions as usize, buffers)?;
    let n_positions = positions.len();
    if before + n_positions > MOST_VERTICES {
        return Err(GltfFault::Large);
    }
    geometry.positions.extend(positions);
    let corners: Vec<usize> = match primitive.indices {
        Some(indices) => read_indices(document, indices as usize, buffers)?,
        None => (0..n_positions).collect(),
    };
    if corners.iter().any(|corner| *corner >= n_positions) {
        return Err(GltfFault::Vertex);
    }
    let triangles = match primitive.mode {
        // Each triangle of a strip begins with the next corner, and every other one is the other
        // way round.
        5 => triangles_of(corners.windows(3), |idx, [a, b, c]| match idx % 2 {
            0 => [a, b, c],
            _ => [a, c, b],
        }),
        6 => {
            let first = corners.first().copied().unwrap_or_default();
            let rest = corners.get(1..).unwrap_or_default();
            rest.windows(2)
                .filter_map(|pair| pair.first_chunk())
                .map(|[b, c]| [first, *b, *c])
                .collect()
        }
        _ => triangles_of(corners.chunks_exact(3), |_, corners| corners),
    };
    if geometry.triangles.len() + triangles.len() > MOST_TRIANGLES {
        return Err(GltfFault::Large);
    }
    geometry
        .colours
        .push((geometry.triangles.len(), document.colour(primitive)));
    let shifted = triangles
        .into_iter()
        .map(|corners| corners.map(|corner| corner + before));
    geometry.triangles.extend(shifted);
    Ok(())
}

fn triangles_of<'a>(
    corners: impl Iterator<Item = &'a [usize]>,
    turned: impl Fn(usize, [usize; 3]) -> [usize; 3],
) -> Vec<[usize; 3]> {
    corners
        .filter_map(|corners| corners.first_chunk())
        .enumerate()
        .map(|(idx, corners)| turned(idx, *corners))
        .collect()
}

fn read_positions(
    document: &Document,
    idx: usize,
    buffers: &mut Buffers,
) -> Result<Vec<Point3<f64>>, GltfFault> {
    let accessor = document.accessor(idx)?;
    let component = Component::of(accessor.component_type).ok_or(GltfFault::Type(idx))?;
    if accessor.kind != "VEC3" || component.kind == UNSIGNED_INT {
        return Err(GltfFault::Type(idx));
    }
    let numbers = read_numbers(document, idx, component, 3, buffers)?;
    let (places, _) = numbers.as_chunks::<3>();
    let normalised = |number: f64| match accessor.normalized {
        true => component.normalised(number),
        false => number,
    };
    Ok(places
        .iter()
        .map(|place| Point3::from(place.map(normalised)))
        .collect())
}

fn read_indices(
    document: &Document,
    idx: usize,
    buffers: &mut Buffers,
) -> Result<Vec<usize>, GltfFault> {
    let accessor = document.accessor(idx)?;
    let component = Component::of(accessor.component_type)
        .filter(|component| component.is_index() && accessor.kind == "SCALAR")
        .ok_or(GltfFault::Type(idx))?;
    let numbers = read_numbers(document, idx, component, 1, buffers)?;
    // Integers of 32 bits are exact.
    Ok(numbers.into_iter().map(|number| number as usize).collect())
}

/// Reads the numbers of an accessor whose elements have this many components, with its sparse
/// changes.
fn read_numbers(
    document: &Document,
    idx: usize,
    component: Component,
    n_components: usize,
    buffers: &mut Buffers,
) -> Result<Vec<f64>, GltfFault> {
    let accessor = document.accessor(idx)?;
    let count = accessor.count as usize;
    if count > MOST_VERTICES {
        return Err(GltfFault::Large);
    }
    let mut numbers = match accessor.buffer_view {
        Some(view) => {
            let elements = AccessorElements {
                accessor: idx,
                view: view as usize,
                offset: accessor.byte_offset as usize,
                count,
                component,
                n_components,
            };
            elements.read(document, buffers)?
        }
        None => vec![0.0; count * n_components],
    };
    let Some(sparse) = &accessor.sparse else {
        return Ok(numbers);
    };
    let n_changes = sparse.count as usize;
    if n_changes > count {
        return Err(GltfFault::Beyond(idx));
    }
    let places = AccessorElements {
        accessor: idx,
        view: sparse.indices.buffer_view as usize,
        offset: sparse.indices.byte_offset as usize,
        count: n_changes,
        component: Component::of(sparse.indices.component_type)
            .filter(Component::is_index)
            .ok_or(GltfFault::Type(idx))?,
        n_components: 1,
    };
    let values = AccessorElements {
        view: sparse.values.buffer_view as usize,
        offset: sparse.values.byte_offset as usize,
        component,
        n_components,
        ..places
    };
    let places = places.read(document, buffers)?;
    let values = values.read(document, buffers)?;
    for (place, value) in places.into_iter().zip(values.chunks_exact(n_components)) {
        let start = place as usize * n_components;
        numbers
            .get_mut(start..start + n_components)
            .ok_or(GltfFault::Beyond(idx))?
            .copy_from_slice(value);
    }
    Ok(numbers)
}

/// A kind of numbers.
#[derive(Clone, Copy)]
struct Component {
    kind: u32,
    /// Unit: bytes.
    size: usize,
}

impl Component {
    fn of(kind: u32) -> Option<Self> {
        let size = match kind {
            BYTE | UNSIGNED_BYTE => 1,
            SHORT | UNSIGNED_SHORT => 2,
            UNSIGNED_INT | FLOAT => 4,
            _ => return None,
        };
        Some(Self { kind, size })
    }

    fn is_index(&self) -> bool {
        [UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT].contains(&self.kind)
    }

    /// Returns the number in the first bytes; 0 if there are too few.
    fn read(self, bytes: &[u8]) -> f64 {
        let one = bytes.first().copied().unwrap_or_default();
        let two = bytes.first_chunk().copied().unwrap_or_default();
        let four = bytes.first_chunk().copied().unwrap_or_default();
        match self.kind {
            BYTE => f64::from(one.cast_signed()),
            UNSIGNED_BYTE => f64::from(one),
            SHORT => f64::from(i16::from_le_bytes(two)),
            UNSIGNED_SHORT => f64::from(u16::from_le_bytes(two)),
            UNSIGNED_INT => f64::from(u32::from_le_bytes(four)),
            _ => f64::from(f32::from_le_bytes(four)),
        }
    }

    /// Returns the number from −1 to 1 that an integer represents.
    fn normalised(self, number: f64) -> f64 {
        let most = match self.kind {
            BYTE => f64::from(i8::MAX),
            UNSIGNED_BYTE => f64::from(u8::MAX),
            SHORT => f64::from(i16::MAX),
            UNSIGNED_SHORT => f64::from(u16::MAX),
            _ => return number,
        };
        (number / most).max(-1.0)
    }
}

/// Numbers in a view of a buffer.
#[derive(Clone, Copy)]
struct AccessorElements {
    /// The accessor to which they belong.
    accessor: usize,
    view: usize,
    /// Unit: bytes from the start of the view.
    offset: usize,
    count: usize,
    component: Component,
    n_components: usize,
}

impl AccessorElements {
    fn read(&self, document: &Document, buffers: &mut Buffers) -> Result<Vec<f64>, GltfFault> {
        let view = document
            .buffer_views
            .get(self.view)
            .ok_or(GltfFault::Missing("buffer view", self.view))?;
        let buffer = buffers
            .get(document, view.buffer as usize)
            .map_err(|fault| match (&fault, view.compression()) {
                (GltfFault::NoData(_), Some(extension)) => GltfFault::Compressed(extension),
                _ => fault,
            })?;
        let data = self
            .data(view, &buffer)
            .ok_or(GltfFault::Beyond(self.accessor))?;
        let size = self.component.size;
        let stride = self.stride(view);
        let mut numbers = Vec::with_capacity(self.count * self.n_components);
        for element in data.chunks(stride.max(1)) {
            let components = element.chunks(size).take(self.n_components);
            numbers.extend(components.map(|bytes| self.component.read(bytes)));
        }
        Ok(numbers)
    }

    /// Bytes from an element to the next one.
    fn stride(&self, view: &BufferView) -> usize {
        let packed = self.component.size * self.n_components;
        view.byte_stride.map_or(packed, |stride| stride as usize)
    }

    /// The bytes from the first element to the end of the last one.
    fn data<'a>(&self, view: &BufferView, buffer: &'a [u8]) -> Option<&'a [u8]> {
        let packed = self.component.size * self.n_components;
        let stride = self.stride(view);
        let start = view.byte_offset as usize;
        let end = start.checked_add(view.byte_length as usize)?;
        let view = buffer.get(start..end)?;
        let Some(before_last) = self.count.checked_sub(1) else {
            return Some(&[]);
        };
        let length = stride.checked_mul(before_last)?.checked_add(packed)?;
        let end = self.offset.checked_add(length)?;
        view.get(self.offset..end).filter(|_| stride >= packed)
    }
}

impl Document {
    /// The colour of a primitive's material; `None` if it has none, or a texture, which is not
    /// read. A mesh whose material has a fault is read all the same.
    fn colour(&self, primitive: &Primitive) -> Option<Colour> {
        let idx = usize::try_from(primitive.material.as_ref()?.as_u64()?).ok()?;
        let material = self.materials.as_ref()?.get(idx)?;
        let factor = material.pointer("/pbrMetallicRoughness/baseColorFactor");
        let channel = |idx: usize| factor?.get(idx)?.as_f64();
        let channels = [0, 1, 2].map(|idx| channel(idx).unwrap_or(1.0));
        let colour = Colour::of_linear(channels);
        let is_textured = material
            .pointer("/pbrMetallicRoughness/baseColorTexture")
            .is_some();
        (!is_textured || colour != WHITE).then_some(colour)
    }

    fn accessor(&self, idx: usize) -> Result<&Accessor, GltfFault> {
        let accessor = self.accessors.get(idx);
        accessor.ok_or(GltfFault::Missing("accessor", idx))
    }

    /// The nodes without a parent.
    fn roots(&self) -> Vec<u32> {
        let mut is_root = vec![true; self.nodes.len()];
        for child in self.nodes.iter().flat_map(|node| &node.children) {
            if let Some(child) = is_root.get_mut(*child as usize) {
                *child = false;
            }
        }
        let roots = (0_u32..).zip(is_root).filter(|(_, is_root)| *is_root);
        roots.map(|(idx, _)| idx).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Mesh;

    /// The JSON of a tetrahedron with its corner at the origin and edges of 1 m along the axes, in
    /// a buffer of 48 bytes of positions, and 12 indices of one byte. `$` is replaced.
    const TETRAHEDRON: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0$NODE}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1$PRIMITIVE}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"$POSITION},
        {"bufferView":1,"componentType":5121,"count":12,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":48$VIEW},{"buffer":0,"byteOffset":48,"byteLength":12}],
        "buffers":[{"byteLength":60$BUFFER}]$ROOT}"#;
    const CORNERS: [u8; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];

    fn floats(numbers: &[f32]) -> Vec<u8> {
        numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    fn tetrahedron_data() -> Vec<u8> {
        let mut data = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.]);
        data.extend(CORNERS);
        data
    }

    /// The JSON with one of its places filled.
    fn with(place: &str, text: &str) -> String {
        let mut json = TETRAHEDRON.to_owned();
        for name in ["NODE", "PRIMITIVE", "POSITION", "VIEW", "BUFFER", "ROOT"] {
            let text = if name == place { text } else { "" };
            json = json.replace(&format!("${name}"), text);
        }
        json
    }

    fn glb(json: &str, data: &[u8]) -> Vec<u8> {
        let mut file = b"glTF\x02\0\0\0".to_vec();
        let length = 12 + 8 + json.len() + 8 + data.len();
        file.extend(u32::try_from(length).expect("it is short").to_le_bytes());
        for (kind, part) in [(b"JSON", json.as_bytes()), (b"BIN\0", data)] {
            file.extend(
                u32::try_from(part.len())
                    .expect("it is short")
                    .to_le_bytes(),
            );
            file.extend(kind);
            file.extend(part);
        }
        file
    }

    fn of_bytes(bytes: &[u8]) -> Result<Mesh, String> {
        let mut warnings = Diagnostics::new();
        let read = read(&Files::Disk, Path::new("m.glb"), bytes, &mut warnings);
        read.map(|read| read.mesh.mesh)
            .map_err(|fault| fault.to_string())
    }

    fn of_glb(json: &str, data: &[u8]) -> Result<Mesh, String> {
        of_bytes(&glb(json, data))
    }

    /// The extents of a mesh, and whether its triangles face outwards: then its volume is above 0.
    fn shape(mesh: &Mesh) -> ([f64; 3], [f64; 3], f64) {
        let bound = |start: f64, of: fn(f64, f64) -> f64| {
            [0, 1, 2].map(|axis| {
                let along = mesh.vertices.iter().map(|vertex| vertex[axis]);
                along.fold(start, of)
            })
        };
        let corner = |idx: u32| Vector3::from(mesh.vertices[idx as usize]);
        let sixfold: f64 = mesh
            .triangles
            .iter()
            .map(|corners| corners.map(corner))
            .map(|[a, b, c]| a.dot(&b.cross(&c)))
            .sum();
        (
            bound(f64::MAX, f64::min),
            bound(f64::MIN, f64::max),
            sixfold / 6.0,
        )
    }

    fn is_near(found: [f64; 3], expected: [f64; 3]) -> bool {
        found
            .iter()
            .zip(expected)
            .all(|(found, expected)| (found - expected).abs() < 1e-6)
    }

    #[test]
    fn nodes_place_and_mirror_their_meshes() {
        for (node, low, high, volume) in [
            ("", [0.0; 3], [1.0; 3], 1.0),
            (
                r#","translation":[1,2,3],"scale":[2,1,1]"#,
                [1.0, 2.0, 3.0],
                [3.0, 3.0, 4.0],
                2.0,
            ),
            // A quarter turn about x: y becomes z.
            (
                r#","rotation":[0.70710678,0,0,0.70710678]"#,
                [0.0, -1.0, 0.0],
                [1.0, 0.0, 1.0],
                1.0,
            ),
            (
                r#","matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,5,6,7,1]"#,
                [4.0, 6.0, 7.0],
                [5.0, 7.0, 8.0],
                1.0,
            ),
            (
                r#","scale":[-1,1,1]"#,
                [-1.0, 0.0, 0.0],
                [0.0, 1.0, 1.0],
                1.0,
            ),
        ] {
            let mesh = of_glb(&with("NODE", node), &tetrahedron_data()).expect(node);
            let (lowest, highest, found) = shape(&mesh);
            assert!(is_near(lowest, low) && is_near(highest, high), "{node}");
            assert!((found - volume / 6.0).abs() < 1e-6, "{node}: {found}");
        }
        // A chain of nodes, a node twice as large, and a node outside of the scene.
        let json = with("", "").replace(
            r#""nodes":[{"mesh":0}]"#,
            r#""nodes":[{"translation":[1,0,0],"children":[1,2]},{"mesh":0,"translation":[0,1,0]},
               {"mesh":0,"scale":[2,2,2]},{"mesh":0,"translation":[50,0,0]}]"#,
        );
        let (low, high, volume) = shape(&of_glb(&json, &tetrahedron_data()).expect("a chain"));
        assert!(is_near(low, [1.0, 0.0, 0.0]) && is_near(high, [3.0, 2.0, 2.0]));
        assert!((volume - 9.0 / 6.0).abs() < 1e-6);
        let without_scenes = json.replace(r#""scene":0,"scenes":[{"nodes":[0]}],"#, "");
        let (_, high, _) = shape(&of_glb(&without_scenes, &tetrahedron_data()).expect("roots"));
        assert!(is_near(high, [51.0, 2.0, 2.0]));
    }

    #[test]
    fn all_kinds_of_numbers_and_primitives_are_read() {
        let positions = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.]);
        let joined = |first: &[u8], second: Vec<u8>| [first, &second].concat();
        let indices = |size: usize| -> Vec<u8> {
            let wide = CORNERS
                .iter()
                .map(|corner| u32::from(*corner).to_le_bytes());
            wide.flat_map(|bytes| bytes[..size].to_vec()).collect()
        };
        for (kind, size) in [(5121, 1), (5123, 2), (5125, 4)] {
            let length = 12 * size;
            let json = with("", "")
                .replace("5121", &kind.to_string())
                .replace("\"byteLength\":12", &format!("\"byteLength\":{length}"))
                .replace(
                    "\"byteLength\":60",
                    &format!("\"byteLength\":{}", 48 + length),
                );
            let mesh = of_glb(&json, &joined(&positions, indices(size))).expect("indices");
            assert!((shape(&mesh).2 - 1.0 / 6.0).abs() < 1e-6, "{kind}");
        }
        // Interleaved with four other bytes each, and quantised to 127ths.
        let mut spread = Vec::new();
        for place in positions.chunks(12) {
            spread.extend(place);
            spread.extend([9; 4]);
        }
        spread.extend(CORNERS);
        let json = with("VIEW", ",\"byteStride\":16")
            .replace("\"byteLength\":48", "\"byteLength\":64")
            .replace("\"byteOffset\":48", "\"byteOffset\":64")
            .replace("\"byteLength\":60", "\"byteLength\":76");
        assert!((shape(&of_glb(&json, &spread).expect("a stride")).2 - 1.0 / 6.0).abs() < 1e-6);
        let small: Vec<u8> = [0, 0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127]
            .into_iter()
            .chain([0; 36])
            .chain(CORNERS)
            .collect();
        let json = with("POSITION", ",\"normalized\":true").replace("5126", "5120");
        assert!((shape(&of_glb(&json, &small).expect("quantised")).2 - 1.0 / 6.0).abs() < 1e-6);
        // A strip and a fan of the same square, which faces upwards, and triangles of an accessor.
        let square = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.]);
        for (mode, corners) in [
            (4, vec![0, 1, 2, 1, 3, 2]),
            (5, vec![0, 1, 2, 3]),
            (6, vec![0, 1, 3, 2]),
        ] {
            let json = with("PRIMITIVE", &format!(",\"mode\":{mode}"))
                .replace("\"count\":12", &format!("\"count\":{}", corners.len()));
            let mut corners = corners;
            corners.resize(12, 0);
            let mesh = of_glb(&json, &joined(&square, corners)).expect("a square");
            assert_eq!(mesh.triangles.len(), 2, "{mode}");
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|idx| Vector3::from(mesh.vertices[idx as usize]));
                assert!((b - a).cross(&(c - a)).z > 0.9, "{mode}");
            }
        }
        let json = with("", "")
            .replace(",\"indices\":1", "")
            .replace("\"count\":4", "\"count\":3");
        let mesh = of_glb(&json, &tetrahedron_data()).expect("one triangle");
        assert_eq!(mesh.triangles.len(), 1);
    }

    /// The top of the tetrahedron is moved from 1 to 2, and all of it from zeros.
    #[test]
    fn sparse_accessors_change_numbers() {
        let mut data = tetrahedron_data();
        data.extend([3, 0, 0, 0]);
        data.extend(floats(&[0.0, 0.0, 2.0]));
        let sparse = r#","sparse":{"count":1,"indices":{"bufferView":2,"componentType":5121},"values":{"bufferView":2,"byteOffset":4}}"#;
        let json = with("POSITION", sparse)
            .replace(
                r#""byteLength":12}"#,
                r#""byteLength":12},{"buffer":0,"byteOffset":60,"byteLength":16}"#,
            )
            .replace(r#""byteLength":60"#, r#""byteLength":76"#);
        let (_, high, _) = shape(&of_glb(&json, &data).expect("it is sparse"));
        assert!(is_near(high, [1.0, 1.0, 2.0]));
        data[60] = 4;
        assert_eq!(
            of_glb(&json, &data),
            Err("its accessor 0 reaches beyond its data".to_owned())
        );
    }

    #[test]
    fn buffers_are_read_from_text_and_from_files_beside() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("a b.bin"), tetrahedron_data()).expect("a file");
        std::fs::write(folder.path().join("cut.bin"), [0; 20]).expect("a file");
        let text = base64::engine::general_purpose::STANDARD.encode(tetrahedron_data());
        let read_uri = |uri: &str| {
            let json = with("BUFFER", &format!(",\"uri\":\"{uri}\""));
            let mut warnings = Diagnostics::new();
            let path = folder.path().join("m.gltf");
            read(&Files::Disk, &path, json.as_bytes(), &mut warnings)
                .map(|read| (shape(&read.mesh.mesh).2, read.others.len()))
                .map_err(|fault| fault.to_string())
        };
        for (uri, others) in [
            ("a b.bin", 60),
            ("a%20b.bin", 60),
            ("./a b.bin", 60),
            (&format!("data:application/octet-stream;base64,{text}"), 0),
            (&format!("data:;base64,{}", text.trim_end_matches('=')), 0),
        ] {
            let (volume, length) = read_uri(uri).expect(uri);
            assert!((volume - 1.0 / 6.0).abs() < 1e-6);
            assert_eq!(length, others, "{uri}");
        }
        for (uri, said) in [
            (
                "c.bin",
                "its buffer `c.bin` can't be read: there is no such file",
            ),
            ("cut.bin", "it ends too early"),
            (".", "its buffer `.` can't be read: it is a folder"),
            ("data:;base64,????", "its buffer 0 is not in base64"),
            ("data:text/plain,abc", "its buffer 0 is not in base64"),
            (
                "https://example.org/a.bin",
                "its buffer 0 is `https://example.org/a.bin`, but must be a path relative to its file",
            ),
            (
                "/dev/zero",
                "its buffer 0 is `/dev/zero`, but must be a path relative to its file",
            ),
        ] {
            assert_eq!(read_uri(uri), Err(said.to_owned()));
        }
    }

    #[test]
    fn meshes_that_would_be_others_are_faults() {
        for (place, text, said) in [
            (
                "ROOT",
                r#","extensionsRequired":["ACME_holes"]"#,
                "it requires the extension `ACME_holes`",
            ),
            (
                "ROOT",
                r#","extensionsRequired":["KHR_materials_unlit","KHR_texture_transform","KHR_mesh_quantization"]"#,
                "",
            ),
            (
                "NODE",
                r#","skin":0"#,
                "its node 0 has a surface moved by a skeleton",
            ),
            (
                "NODE",
                r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{}}}"#,
                "its node 0 has `EXT_mesh_gpu_instancing`",
            ),
            (
                "NODE",
                r#","children":[0]"#,
                "its node 0 is the child of two nodes",
            ),
            (
                "NODE",
                r#","children":[7]"#,
                "it refers to the missing node 7",
            ),
            (
                "NODE",
                r#","rotation":[0,0,0,0]"#,
                "its node 0 has a rotation",
            ),
            (
                "NODE",
                r#","translation":[1e999,0,0]"#,
                "its JSON is not that of glTF",
            ),
            ("PRIMITIVE", r#","mode":1"#, "it has no triangles"),
            ("PRIMITIVE", r#","mode":9"#, "the kind of primitive 9"),
            (
                "POSITION",
                r#","normalized":3"#,
                "its JSON is not that of glTF",
            ),
            (
                "VIEW",
                r#","byteStride":4"#,
                "its accessor 0 reaches beyond",
            ),
            (
                "VIEW",
                r#","byteStride":0"#,
                "its accessor 0 reaches beyond",
            ),
            (
                "VIEW",
                r#","byteOffset":4294967295"#,
                "its accessor 0 reaches beyond",
            ),
            ("PRIMITIVE", r#","targets":[{"POSITION":0}]"#, ""),
        ] {
            let read = of_glb(&with(place, text), &tetrahedron_data());
            match read {
                Ok(_) => assert_eq!(said, "", "{text}"),
                Err(fault) => assert!(
                    !said.is_empty() && fault.starts_with(said),
                    "{text}: {fault}"
                ),
            }
        }
        let morphed = with("PRIMITIVE", r#","targets":[{"POSITION":0}]"#)
            .replace(r#"{"mesh":0"#, r#"{"mesh":0,"weights":[0.5]"#);
        assert_eq!(
            of_glb(&morphed, &tetrahedron_data()),
            Err("its node 0 has morph targets with weights, which is not supported".to_owned())
        );
    }

    /// Compressed data is an error only if the file has no other.
    #[test]
    fn compressed_meshes_are_faults() {
        let draco = r#","extensions":{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":0}}}"#;
        assert!(of_glb(&with("PRIMITIVE", draco), &tetrahedron_data()).is_ok());
        let alone = with("PRIMITIVE", draco).replace(
            r#"{"bufferView":0,"componentType":5126"#,
            r#"{"componentType":5126"#,
        );
        let said = of_glb(&alone, &tetrahedron_data()).expect_err("it has no data");
        assert!(
            said.starts_with("its mesh is compressed by `KHR_draco_mesh_compression`"),
            "{said}"
        );
        let meshopt = r#","extensions":{"EXT_meshopt_compression":{"buffer":0,"byteLength":3}}"#;
        assert!(of_glb(&with("VIEW", meshopt), &tetrahedron_data()).is_ok());
        let alone = with("VIEW", meshopt)
            .replace(
                r#""bufferViews":[{"buffer":0"#,
                r#""bufferViews":[{"buffer":1"#,
            )
            .replace(r#""buffers":["#, r#""buffers":[{"byteLength":60},"#);
        let said = of_glb(&alone, &tetrahedron_data()).expect_err("it has no data");
        assert!(
            said.starts_with("its mesh is compressed by `EXT_meshopt_compression`"),
            "{said}"
        );
    }

    /// Prefixes, and each number replaced by others up to the limits of its type.
    #[test]
    fn damaged_files_are_refused() {
        let json = with("VIEW", ",\"byteOffset\":0,\"byteStride\":12");
        let file = glb(&json, &tetrahedron_data());
        assert!(of_bytes(&file).is_ok());
        for end in 0..file.len() {
            assert!(of_bytes(&file[..end]).is_err(), "{end}");
            let mut other = file.clone();
            other[end] ^= 0xff;
            let _ = of_bytes(&other);
        }
        for (at, _) in json.match_indices(|letter: char| letter.is_ascii_digit()) {
            for number in [
                "0",
                "1",
                "5",
                "99999999",
                "4294967295",
                "18446744073709551616",
                "-1",
                "null",
            ] {
                let mut other = json.clone();
                other.replace_range(at..=at, number);
                let _ = of_glb(&other, &tetrahedron_data());
            }
        }
        for text in [
            "",
            "{}",
            "[]",
            "glTF",
            "glTF\x01\0\0\0",
            "{\"asset\":{\"version\":\"1.0\"}}",
        ] {
            assert!(of_bytes(text.as_bytes()).is_err(), "{text}");
        }
        let many = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{}{{}}]}}"#,
            "{},".repeat(100_000)
        );
        let said = of_bytes(many.as_bytes()).expect_err("it has too many nodes");
        assert!(said.contains("expected a list of at most 100000"), "{said}");
    }

    /// A mesh of 12 bytes that claims a thousand times as much, and many instances of one.
    #[test]
    fn huge_numbers_need_no_memory() {
        let json = with("", "").replace("\"count\":4,", "\"count\":4294967295,");
        let said = of_glb(&json, &tetrahedron_data()).expect_err("it is too large");
        assert!(
            said.starts_with("it has more than 6000000 vertices"),
            "{said}"
        );
        let nodes = "{\"mesh\":0},".repeat(99_999);
        let numbers: Vec<String> = (0..100_000).map(|idx| idx.to_string()).collect();
        let json = with("", "")
            .replace(
                "\"nodes\":[{\"mesh\":0",
                &format!("\"nodes\":[{nodes}{{\"mesh\":0"),
            )
            .replace(
                "\"nodes\":[0]",
                &format!("\"nodes\":[{}]", numbers.join(",")),
            );
        assert_eq!(
            of_glb(&json, &tetrahedron_data()).map(|mesh| mesh.triangles.len()),
            Ok(400_000)
        );
        let json = json.replace("\"count\":12,", "\"count\":4294967,");
        assert!(of_glb(&json, &tetrahedron_data()).is_err());
    }
}
