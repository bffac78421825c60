//! Reads mesh files: stl and obj with the `mesh_loader` crate, dae with
//! [`collada`](super::collada), glb and gltf with [`gltf`](super::gltf), and MuJoCo's msh.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::foreign::gltf::GltfFault;
use crate::foreign::lookup::Lookup;
use crate::foreign::{collada, gltf};
use actcheck_base::{Diagnostic, Diagnostics, FileFault, Files, Source, xml_text};
use actcheck_data::{Colour, Mesh, MeshFault};

/// Largest number of triangles: more than any collision shape needs, and a larger file could
/// exhaust memory.
pub(crate) const MOST_TRIANGLES: usize = 2_000_000;

/// Help text on how models name mesh files.
pub(crate) const HOW_TO_NAME: &str = "the URI is `model://NAME/meshes/FILE`, `package://NAME/meshes/FILE` or a path relative to the model's file";

/// Why a mesh file is unusable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum MeshFileFault {
    #[error("`.{0}` files are not supported")]
    Format(String),
    /// It is a text in an unknown encoding.
    #[error("{0}")]
    Text(#[from] FileFault),
    #[error("it ends too early")]
    Cut,
    #[error("its length does not fit the numbers of its vertices and faces")]
    Length,
    #[error("it is too large")]
    TooLarge,
    #[error("it has {0} triangles, more than {MOST_TRIANGLES}")]
    TooManyTriangles(usize),
    #[error("{0}")]
    Gltf(#[from] GltfFault),
    /// The reader of the format does not accept it.
    #[error("{0}")]
    Syntax(String),
    /// Its points and triangles are not a mesh.
    #[error("{0}")]
    Mesh(#[from] MeshFault),
}

/// The contents of a mesh file.
pub(crate) struct MeshFile {
    pub(crate) mesh: Mesh,
    /// The colours of its triangles; empty if it states none.
    pub(crate) colours: Vec<Option<Colour>>,
    /// Its bytes and those of its other files, for digests.
    pub(crate) bytes: Vec<u8>,
    /// Warnings about ignored elements.
    pub(crate) warnings: Diagnostics,
}

/// Finds the mesh file that a model's file names.
///
/// # Errors
/// W037 if it is not there.
pub(crate) fn find(lookup: &Lookup, model: &Path, uri: &str) -> Result<PathBuf, Diagnostics> {
    let found = lookup.resolve(uri, model).map_err(|reason| {
        Diagnostic::error("W037", format!("cannot find the mesh `{uri}`: {reason}"))
            .help(HOW_TO_NAME)
    });
    Ok(found?)
}

/// Reads a mesh file; its extension determines the format. Files of materials beside it are not
/// read, because colours do not affect collisions.
///
/// # Errors
/// W037 if the file can't be read, has an unsupported or a wrong extension, or contains no
/// triangles.
pub(crate) fn read(files: &Files, path: &Path) -> Result<MeshFile, Diagnostics> {
    read_with(files, path, &mut |_| Ok(Vec::new()))
}

/// As [`read`], with the colours in files of materials. Reports those that can't be read (W036).
///
/// # Errors
/// As [`read`].
pub(crate) fn read_seen(files: &Files, path: &Path) -> Result<MeshFile, Diagnostics> {
    let mut missing = Diagnostics::new();
    let mut read = read_with(files, path, &mut |materials| {
        files.read_bytes(materials).map_err(|fault| {
            let message = format!(
                "the colours of {} in {} can't be read: {fault}",
                path.display(),
                materials.display()
            );
            let help = "the mesh is drawn without them";
            missing.push(Diagnostic::warning("W036", message).help(help));
            std::io::ErrorKind::Other.into()
        })
    })?;
    read.warnings.extend(missing);
    Ok(read)
}

fn read_with(
    files: &Files,
    path: &Path,
    materials: &mut dyn FnMut(&Path) -> std::io::Result<Vec<u8>>,
) -> Result<MeshFile, Diagnostics> {
    let shown = path.display();
    let mut bytes = files.read_bytes(path).map_err(|reason| -> Diagnostics {
        Diagnostic::error("W037", format!("cannot read the mesh {shown}: {reason}"))
            .help(HOW_TO_NAME)
            .into()
    })?;
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let mut warnings = Diagnostics::new();
    let unusable = |reason: MeshFileFault| -> Diagnostics {
        Diagnostic::error("W037", format!("the mesh {shown} is unusable: {reason}"))
            .help("export it again, as triangles, to stl, obj, dae or glb")
            .into()
    };
    let mesh = match ending.as_str() {
        "stl" => of_scene(mesh_loader::stl::from_slice(&as_binary(&bytes))),
        "obj" => {
            let corners = corners_of_obj(&bytes);
            of_scene(mesh_loader::obj::from_slice(
                &corners,
                Some(path),
                materials,
            ))
        }
        "msh" => of_msh(&bytes),
        "glb" | "gltf" => gltf::read(files, path, &bytes, &mut warnings).map(|read| {
            bytes.extend(read.others);
            read.mesh
        }),
        "dae" => {
            let text = xml_text(bytes.clone()).map_err(|fault| unusable(fault.into()))?;
            let read = collada::read(&Source::new(shown.to_string(), text), &mut warnings)?;
            return Ok(read.file(bytes, warnings));
        }
        _ => Err(MeshFileFault::Format(ending)),
    };
    Ok(mesh.map_err(unusable)?.file(bytes, warnings))
}

/// Returns an OBJ file without textures and normals, which do not affect collisions: many files have
/// them for some of their faces only. Lines keep their numbers.
fn corners_of_obj(bytes: &[u8]) -> Vec<u8> {
    let mut corners = Vec::with_capacity(bytes.len());
    let mut element: &[u8] = b"";
    let mut continues = false;
    // Lines that a face goes on in.
    let mut joined = 0;
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii_end();
        let (text, is_continued) = match text.strip_suffix(b"\\") {
            Some(text) => (text, true),
            None => (text, false),
        };
        let words = text
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty());
        if !continues {
            element = words.clone().next().unwrap_or_default();
        }
        continues = is_continued;
        match element {
            b"vt" | b"vn" => corners.push(b'\n'),
            b"f" => {
                for word in words {
                    corners.extend(word.iter().take_while(|byte| **byte != b'/'));
                    corners.push(b' ');
                }
                if continues {
                    joined += 1;
                } else {
                    corners.resize(corners.len() + joined + 1, b'\n');
                    joined = 0;
                }
            }
            _ => corners.extend(line),
        }
    }
    corners
}

/// Returns the bytes of an STL file so that a binary one is recognised as such: many begin with
/// `solid`, the word that marks files of text. The length of a binary file follows from its number
/// of triangles.
fn as_binary(bytes: &[u8]) -> Cow<'_, [u8]> {
    let count = bytes
        .get(80..84)
        .and_then(|count| count.try_into().ok())
        .map(u32::from_le_bytes);
    let is_binary = count.is_some_and(|count| bytes.len() as u64 == 84 + 50 * u64::from(count));
    if !(is_binary && bytes.starts_with(b"solid")) {
        return Cow::Borrowed(bytes);
    }
    let mut marked = bytes.to_vec();
    marked[..5].copy_from_slice(b"     ");
    Cow::Owned(marked)
}

/// Reads a binary mesh of MuJoCo: the numbers of vertices, normals, texture coordinates and faces,
/// then these.
///
/// Source: MuJoCo's documentation, "XML Reference", `asset/mesh`.
fn of_msh(bytes: &[u8]) -> Result<ColouredMesh, MeshFileFault> {
    let words: Vec<[u8; 4]> = bytes
        .chunks_exact(4)
        .filter_map(|word| word.try_into().ok())
        .collect();
    let counts = words
        .first_chunk::<4>()
        .ok_or(MeshFileFault::Cut)?
        .map(u32::from_le_bytes);
    let [vertices, normals, texture, faces] = counts.map(|count| count as usize);
    let before_faces = 4 + 3 * vertices + 3 * normals + 2 * texture;
    if !bytes.len().is_multiple_of(4) || words.len() != before_faces + 3 * faces {
        return Err(MeshFileFault::Length);
    }
    let (points, _) = words[4..4 + 3 * vertices].as_chunks::<3>();
    let (triangles, _) = words[before_faces..].as_chunks::<3>();
    let vertices = points
        .iter()
        .map(|point| point.map(|word| f64::from(f32::from_le_bytes(word))));
    let triangles = triangles
        .iter()
        .map(|corners| corners.map(u32::from_le_bytes));
    ColouredTriangles {
        vertices: vertices.collect(),
        triangles: triangles.collect(),
        colours: Vec::new(),
    }
    .checked()
}

/// Merges all meshes of a file.
fn of_scene(scene: std::io::Result<mesh_loader::Scene>) -> Result<ColouredMesh, MeshFileFault> {
    let scene = scene.map_err(|error| MeshFileFault::Syntax(error.to_string().to_lowercase()))?;
    let mut all = ColouredTriangles::default();
    for (idx, mesh) in scene.meshes.iter().enumerate() {
        let before = u32::try_from(all.vertices.len()).map_err(|_| MeshFileFault::TooLarge)?;
        all.begin(scene.materials.get(idx).and_then(diffuse));
        all.vertices
            .extend(mesh.vertices.iter().map(|vertex| vertex.map(f64::from)));
        let shifted = mesh
            .faces
            .iter()
            .map(|face| face.map(|idx| idx.saturating_add(before)));
        all.triangles.extend(shifted);
    }
    all.checked()
}

/// The colour of a material in diffuse light. White is that of most materials with a texture, which
/// is not read.
fn diffuse(material: &mesh_loader::Material) -> Option<Colour> {
    let [red, green, blue, _] = material.color.diffuse?.map(f64::from);
    let colour = Colour::of_srgb([red, green, blue]);
    let is_textured = material.texture.diffuse.is_some();
    (!is_textured || colour != WHITE).then_some(colour)
}

/// The colour that leaves a texture as it is.
pub(crate) const WHITE: Colour = Colour([u8::MAX; 3]);

/// The triangles of a file, with their colours.
#[derive(Default)]
pub(crate) struct ColouredTriangles {
    pub(crate) vertices: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The colour of all triangles from one on, until the next entry.
    colours: Vec<(usize, Option<Colour>)>,
}

impl ColouredTriangles {
    /// Sets the colour of the triangles that are added from now on.
    pub(crate) fn begin(&mut self, colour: Option<Colour>) {
        if self.colours.last().is_none_or(|(_, last)| *last != colour) {
            self.colours.push((self.triangles.len(), colour));
        }
    }

    /// Welds the mesh.
    ///
    /// # Errors
    /// [`MeshFileFault`] if the mesh is invalid or has more than [`MOST_TRIANGLES`] triangles.
    pub(crate) fn checked(self) -> Result<ColouredMesh, MeshFileFault> {
        if self.triangles.len() > MOST_TRIANGLES {
            return Err(MeshFileFault::TooManyTriangles(self.triangles.len()));
        }
        let mesh = Mesh::new(self.vertices, self.triangles)?;
        let colours = colours_of_welded(&mesh, &self.colours);
        let welded = mesh.welded();
        let mesh = Mesh::new(welded.vertices, welded.triangles)?;
        Ok(ColouredMesh { mesh, colours })
    }
}

/// The colours of the triangles that remain when a mesh is welded: those with three different
/// corners.
fn colours_of_welded(mesh: &Mesh, starts: &[(usize, Option<Colour>)]) -> Vec<Option<Colour>> {
    if starts.iter().all(|(_, colour)| colour.is_none()) {
        return Vec::new();
    }
    let mut colours = Vec::with_capacity(mesh.triangles.len());
    let ends = starts.iter().skip(1).map(|(start, _)| *start);
    for ((start, colour), end) in starts.iter().zip(ends.chain([mesh.triangles.len()])) {
        let triangles = mesh.triangles.get(*start..end).unwrap_or_default();
        let remaining = triangles.iter().filter(|corners| {
            let [a, b, c] = corners.map(|idx| mesh.vertices[idx as usize]);
            a != b && b != c && a != c
        });
        colours.extend(remaining.map(|_| *colour));
    }
    colours
}

/// The mesh of a file, with the colours of its triangles; without colours if it states none.
pub(crate) struct ColouredMesh {
    pub(crate) mesh: Mesh,
    pub(crate) colours: Vec<Option<Colour>>,
}

impl ColouredMesh {
    fn file(self, bytes: Vec<u8>, warnings: Diagnostics) -> MeshFile {
        MeshFile {
            mesh: self.mesh,
            colours: self.colours,
            bytes,
            warnings,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some faces of an OBJ file have textures and normals and others have none, in one group.
    #[test]
    fn faces_of_an_obj_file_may_have_textures() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\n\
                    f 1/1/1 3/1/1 2/1/1\nf 1//1 2//1\\\n 4//1\nf 1 4 3\nf -3/-1 -2 -1//-1\n";
        let read = |bytes: &[u8]| {
            let scene = mesh_loader::obj::from_slice(bytes, None::<&Path>, |_| Ok(Vec::new()));
            of_scene(scene).map(|read| read.mesh)
        };
        let mesh = read(&corners_of_obj(text.as_bytes())).expect("it is a tetrahedron");
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-9);
        assert_eq!(
            corners_of_obj(text.as_bytes())
                .split(|byte| *byte == b'\n')
                .count(),
            text.split('\n').count()
        );
        assert!(read(&corners_of_obj(b"v 0 0 0\nf 1 2 3\n")).is_err());
    }

    #[test]
    fn a_mesh_of_mujoco_is_read_and_a_cut_one_is_refused() {
        let mut bytes: Vec<u8> = [4_u32, 1, 2, 4]
            .into_iter()
            .flat_map(u32::to_le_bytes)
            .collect();
        let numbers: [f32; 19] = [
            0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 9.0, 9.0, 9.0, 9.0, 9.0,
            9.0, 9.0,
        ];
        bytes.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
        bytes.extend(
            [0_u32, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
                .into_iter()
                .flat_map(u32::to_le_bytes),
        );
        let mesh = of_msh(&bytes).expect("it is a tetrahedron").mesh;
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-9);
        assert!((0..bytes.len()).all(|length| of_msh(&bytes[..length]).is_err()));
        let mut large = bytes.clone();
        large[..4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(of_msh(&large).is_err());
    }

    /// Binary files of some exporters begin with the word that marks files of text.
    #[test]
    fn a_binary_stl_that_begins_with_solid_is_read() {
        let mut bytes = b"solid exported".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(1u32.to_le_bytes());
        for number in [
            0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        ] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([0, 0]);
        let mesh = of_scene(mesh_loader::stl::from_slice(&as_binary(&bytes)))
            .expect("it is an STL file")
            .mesh;
        assert_eq!(mesh.triangles.len(), 1);
        let text = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
        assert!(matches!(as_binary(text), Cow::Borrowed(_)));
    }
}
