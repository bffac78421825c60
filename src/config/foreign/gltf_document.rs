//! The JSON of a glTF 2.0 file, as far as it determines a mesh and its colours; the rest is skipped.
//!
//! Source: glTF 2.0 Specification, section 5, "Properties Reference".

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Error, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Value;

/// Largest number of elements in a list of JSON: more could exhaust memory.
const MOST_ELEMENTS: usize = 100_000;

/// Whether a mesh is the same without an extension that its file requires, or its reader knows it.
pub(super) fn harmless_extension(name: &str) -> bool {
    const PREFIXES: [&str; 7] = [
        "KHR_materials_",
        "KHR_texture_",
        "EXT_texture_",
        "MSFT_texture_",
        "KHR_lights_",
        "EXT_lights_",
        "KHR_xmp",
    ];
    // The last three are errors only if a mesh of the scene has no other data.
    const KNOWN: [&str; 4] = [
        "KHR_mesh_quantization",
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "KHR_meshopt_compression",
    ];
    PREFIXES.iter().any(|prefix| name.starts_with(prefix)) || KNOWN.contains(&name)
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) asset: Asset,
    pub(super) scene: Option<u32>,
    #[serde(default, deserialize_with = "few")]
    pub(super) scenes: Vec<Scene>,
    #[serde(default, deserialize_with = "few")]
    pub(super) nodes: Vec<GltfNode>,
    #[serde(default, deserialize_with = "few")]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default, deserialize_with = "few")]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default, deserialize_with = "few")]
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(default, deserialize_with = "few")]
    pub(super) buffers: Vec<Buffer>,
    /// As they are: those with faults do not make a file unusable.
    pub(super) materials: Option<Value>,
    #[serde(default, deserialize_with = "few")]
    pub(super) extensions_required: Vec<String>,
}

#[derive(Deserialize)]
pub(super) struct Asset {
    pub(super) version: String,
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default, deserialize_with = "few")]
    pub(super) nodes: Vec<u32>,
}

#[derive(Deserialize)]
pub(super) struct GltfNode {
    #[serde(default, deserialize_with = "few")]
    pub(super) children: Vec<u32>,
    pub(super) mesh: Option<u32>,
    pub(super) skin: Option<u32>,
    /// By columns.
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    /// x, y, z, w.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "few")]
    pub(super) weights: Vec<f64>,
    #[serde(default)]
    pub(super) extensions: NodeExtensions,
}

#[derive(Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<IgnoredAny>,
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    #[serde(deserialize_with = "few")]
    pub(super) primitives: Vec<Primitive>,
    #[serde(default, deserialize_with = "few")]
    pub(super) weights: Vec<f64>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: VertexAttributes,
    pub(super) indices: Option<u32>,
    pub(super) material: Option<Value>,
    #[serde(default = "triangles")]
    pub(super) mode: u32,
    /// The number of morph targets.
    #[serde(default, deserialize_with = "length")]
    pub(super) targets: usize,
    #[serde(default)]
    pub(super) extensions: PrimitiveExtensions,
}

#[derive(Deserialize)]
pub(super) struct VertexAttributes {
    #[serde(rename = "POSITION")]
    pub(super) position: Option<u32>,
}

#[derive(Default, Deserialize)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<u32>,
    #[serde(default)]
    pub(super) byte_offset: u32,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u32,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u32,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: u32,
    #[serde(default)]
    pub(super) byte_offset: u32,
    pub(super) component_type: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: u32,
    #[serde(default)]
    pub(super) byte_offset: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: u32,
    #[serde(default)]
    pub(super) byte_offset: u32,
    pub(super) byte_length: u32,
    pub(super) byte_stride: Option<u32>,
    #[serde(default)]
    extensions: ViewExtensions,
}

impl BufferView {
    /// The extension that compresses the view's data.
    pub(super) fn compression(&self) -> Option<&'static str> {
        let of_ext = self.extensions.ext.as_ref();
        let of_khr = self.extensions.khr.as_ref();
        of_ext
            .map(|_| "EXT_meshopt_compression")
            .or_else(|| of_khr.map(|_| "KHR_meshopt_compression"))
    }
}

#[derive(Default, Deserialize)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext: Option<IgnoredAny>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u32,
}

fn triangles() -> u32 {
    4
}

/// Reads a list of at most [`MOST_ELEMENTS`].
fn few<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    deserializer.deserialize_seq(Few(PhantomData))
}

/// Counts the elements of a list.
fn length<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    let all: Vec<IgnoredAny> = few(deserializer)?;
    Ok(all.len())
}

struct Few<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Few<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a list of at most {MOST_ELEMENTS}")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<Vec<T>, A::Error> {
        let mut list = Vec::new();
        while let Some(element) = all.next_element()? {
            if list.len() == MOST_ELEMENTS {
                return Err(A::Error::invalid_length(MOST_ELEMENTS + 1, &self));
            }
            list.push(element);
        }
        Ok(list)
    }
}
