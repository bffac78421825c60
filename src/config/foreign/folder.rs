//! Finds and reads SDF and URDF models in a folder with Gazebo's layout.

use std::path::{Path, PathBuf};

use crate::foreign::lookup::Lookup;
use crate::foreign::xml::{self, Reader};
use crate::foreign::{sdf, urdf};
use actcheck_base::{Diagnostic, Diagnostics, Files};
use actcheck_data::ObjectModel;

/// A model found in a folder.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// Name in configurations: the folder's, or the URDF's without its extension.
    pub(crate) name: String,
    /// Path of its `model.config`, `model.sdf` or URDF.
    pub(crate) path: PathBuf,
}

/// Finds the models of a folder, sorted by name: `NAME/model.config`, `NAME/model.sdf`, `NAME/model.urdf`, `NAME.urdf`.
pub(crate) fn find(files: &Files, folder: &Path) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    for model in files.folders(folder) {
        let inside = files.list(&model);
        let first = ["model.config", "model.sdf", "model.urdf"]
            .iter()
            .map(|file| model.join(file))
            .find(|path| inside.contains(path));
        if let (Some(path), Some(name)) = (first, model.file_name()) {
            found.push(Found { name: name.to_string_lossy().into_owned(), path });
        }
    }
    for path in files.list(folder) {
        if let (Some("urdf"), Some(stem)) = (path.extension().and_then(|ending| ending.to_str()), path.file_stem()) {
            found.push(Found { name: stem.to_string_lossy().into_owned(), path: path.clone() });
        }
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

/// Reads a model. Also returns warnings about ignored elements.
///
/// # Errors
/// All faults of its files: an unreadable file (W030), text that is not XML (W031) or not a model (W032), a missing
/// element (W033), an invalid value (W034), an element that can't be simulated (W035), an unusable mesh (W037), or no
/// solid shape (W038).
pub(crate) fn read(found: &Found, lookup: &Lookup) -> Result<(ObjectModel, Diagnostics), Diagnostics> {
    let path = match found.path.file_name().and_then(|name| name.to_str()) {
        Some("model.config") => sdf_path(&found.path, lookup.files)?,
        _ => found.path.clone(),
    };
    let source = lookup.files.read(&path).map_err(|reason| unreadable(&path, &reason))?;
    let is_urdf = path.extension().is_some_and(|ending| ending == "urdf");
    let (model, said) = if is_urdf { urdf::read(&source, &path, lookup) } else { sdf::read(&source, &path, lookup) };
    match model {
        Some(model) => Ok((model.body.into_model(&found.name, model.digest, &model.pose), said)),
        None => Err(said),
    }
}

fn unreadable(path: &Path, reason: &str) -> Diagnostic {
    Diagnostic::error("W030", format!("cannot read the model {}: {reason}", path.display()))
        .help("a model is a folder with `model.config` and the SDF file that it names, or a URDF file")
}

/// Returns the SDF file named by a `model.config`; if there are several, that of the newest version.
fn sdf_path(config: &Path, files: &Files) -> Result<PathBuf, Diagnostics> {
    let source = files.read(config).map_err(|reason| unreadable(config, &reason))?;
    let document = xml::parse(&source)?;
    let mut reader = Reader::new(&source);
    let root = document.root_element();
    let newest = xml::children(root, "sdf").max_by_key(|sdf| {
        let minor = sdf.attribute("version").and_then(|version| version.strip_prefix("1.")?.parse::<u32>().ok());
        minor.unwrap_or(0)
    });
    let Some(named) = newest.filter(|sdf| !xml::text(*sdf).is_empty()) else {
        let message = format!("`<{}>` names no SDF file", root.tag_name().name());
        reader.error("W033", root, message, "add `<sdf version=\"1.6\">model.sdf</sdf>`");
        return Err(reader.found);
    };
    let path = config.parent().unwrap_or(Path::new("")).join(xml::text(named));
    match files.read_bytes(&path) {
        Ok(_) => Ok(path),
        Err(reason) => {
            let message = format!("cannot read the model {}: {reason}", path.display());
            reader.error("W030", named, message, "the path is relative to the folder of `model.config`");
            Err(reader.found)
        }
    }
}
