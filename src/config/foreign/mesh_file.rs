//! Mesh files: stl and obj by a library, dae by [`collada`](super::collada).

use std::path::Path;

use crate::base::{Diagnostic, Diagnostics, Files, Source};
use crate::config::foreign::collada;
use crate::config::mesh::Mesh;

/// More triangles than any collision shape needs; a larger file would fill the memory.
pub(crate) const MOST_TRIANGLES: usize = 2_000_000;

/// How models name mesh files.
pub(crate) const HOW_TO_NAME: &str =
    "the URI is `model://NAME/meshes/FILE`, `package://NAME/meshes/FILE` or a path beside the model's file";

/// A mesh file as it was read.
pub(crate) struct MeshFile {
    pub(crate) mesh: Mesh,
    /// Its bytes, for digests.
    pub(crate) bytes: Vec<u8>,
    /// What was left out of it.
    pub(crate) warnings: Diagnostics,
}

/// Reads a mesh file; its ending says of what kind it is.
///
/// # Errors
/// A fault of the file (W037): it can't be read, is of another kind, is not what its ending says, or has no triangles.
pub(crate) fn read(files: &Files, path: &Path) -> Result<MeshFile, Diagnostics> {
    let shown = path.display();
    let bytes = files.read_bytes(path).map_err(|reason| -> Diagnostics {
        Diagnostic::error("W037", format!("cannot read the mesh {shown}: {reason}")).help(HOW_TO_NAME).into()
    })?;
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut warnings = Diagnostics::new();
    let unusable = |reason: String| -> Diagnostics {
        Diagnostic::error("W037", format!("the mesh {shown} is unusable: {reason}"))
            .help("export it again, as triangles, to stl, obj or dae")
            .into()
    };
    let mesh = match ending.as_str() {
        "stl" => of_scene(mesh_loader::stl::from_slice(&bytes)),
        // Materials have no bearing on what a thing bumps into, so their files are not read.
        "obj" => of_scene(mesh_loader::obj::from_slice(&bytes, Some(path), |_| Ok(Vec::new()))),
        "dae" => {
            let text = std::str::from_utf8(&bytes).map_err(|_| unusable("it is not UTF-8 text".to_owned()))?;
            return collada::read(&Source::new(shown.to_string(), text), &mut warnings).map(|mesh| MeshFile {
                mesh,
                bytes,
                warnings,
            });
        }
        _ => Err(format!("`.{ending}` files are not read")),
    };
    let mesh = mesh.map_err(unusable)?;
    Ok(MeshFile { mesh, bytes, warnings })
}

/// All meshes of a file as one.
fn of_scene(scene: std::io::Result<mesh_loader::Scene>) -> Result<Mesh, String> {
    let scene = scene.map_err(|error| error.to_string().to_lowercase())?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in scene.meshes {
        let before = u32::try_from(vertices.len()).map_err(|_| "it is too large".to_owned())?;
        vertices.extend(mesh.vertices.iter().map(|vertex| vertex.map(f64::from)));
        let shifted = mesh.faces.iter().map(|face| face.map(|idx| idx.saturating_add(before)));
        triangles.extend(shifted);
    }
    checked(vertices, triangles)
}

/// A welded mesh of a bearable size.
pub(crate) fn checked(vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Result<Mesh, String> {
    if triangles.len() > MOST_TRIANGLES {
        return Err(format!("it has {} triangles, more than {MOST_TRIANGLES}", triangles.len()));
    }
    let welded = Mesh::new(vertices, triangles)?.welded();
    Mesh::new(welded.vertices, welded.triangles)
}
