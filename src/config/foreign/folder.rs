//! Finds and reads SDF, URDF and MJCF models in a folder with Gazebo's or MuJoCo's layout.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

use crate::foreign::body::{Role, SdfModel};
use crate::foreign::footprint::turned;
use crate::foreign::frames::Included;
use crate::foreign::geometry::Shapes;
use crate::foreign::inclusions::Inclusions;
use crate::foreign::lenient::repaired;
use crate::foreign::lookup::{Lookup, beside, spellings};
use crate::foreign::nested::{SubModel, Tree};
use crate::foreign::xml::{self, Node, Reader};
use crate::foreign::{mjcf, root_name, sdf, tree_object, urdf};
use actcheck_base::{
    Diagnostic, Diagnostics, FileFault, Files, Severity, Source, did_you_mean, xml_text,
};
use actcheck_data::{ObjectModel, SeenPart};

/// A model found in a folder.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// Name in configurations: the folder's, or that of the SDF, URDF or MJCF file without its
    /// extension.
    pub(crate) name: String,
    /// Path of its `model.config`, SDF, URDF or MJCF file.
    pub(crate) path: PathBuf,
}

/// Finds the models of a folder, sorted by name: `NAME/model.config`, `NAME/model.sdf`,
/// `NAME/model.urdf`, `NAME/NAME.sdf`, `NAME/NAME.urdf`, `NAME.sdf`, `NAME.urdf`, and of MJCF
/// `NAME/NAME.xml`, `NAME/model.xml`, `NAME.xml`.
pub(crate) fn find(files: &Files, folder: &Path) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    for model in files.folders(folder) {
        if let (Some(path), Some(name)) = (model_file(files, &model), model.file_name()) {
            found.push(Found {
                name: name.to_string_lossy().into_owned(),
                path,
            });
        }
    }
    for path in files.list(folder) {
        if let (true, Some(stem)) = (is_model(files, &path), path.file_stem()) {
            found.push(Found {
                name: stem.to_string_lossy().into_owned(),
                path: path.clone(),
            });
        }
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

/// A model of a file.
pub(crate) struct Read {
    pub(crate) model: ObjectModel,
    /// Whether the file gives the model a pose, which the pose of an `<include>` replaces.
    pub(crate) has_pose: bool,
    /// Warnings about ignored elements.
    pub(crate) warnings: Diagnostics,
}

/// Reads a model.
///
/// # Errors
/// All faults of its files: an unreadable file (W030), text that is not XML (W031) or not a model
/// (W032), a missing element (W033), an invalid value (W034), an element that can't be simulated
/// (W035), an unusable mesh (W037), no solid shape (W038), or an included model that is missing or
/// has faults (W040).
pub(crate) fn read(found: &Found, lookup: &Lookup) -> Result<Read, Diagnostics> {
    let (sdf, pose, warnings) = placed(found, lookup)?;
    let has_pose = pose != Isometry3::identity();
    Ok(Read {
        model: sdf.body.into_model(&found.name, sdf.digest, &pose),
        has_pose,
        warnings,
    })
}

/// Reads the appearance of a model, without its moving parts. Frame: the model's. Faults of visual
/// shapes are reported as warnings. `None` if it looks like its collision shapes, or can't be read.
pub(crate) fn seen(
    found: &Found,
    files: &Files,
    folders: &[PathBuf],
    faults: &mut Diagnostics,
) -> Option<Vec<SeenPart>> {
    let lookup = Lookup {
        looks: Some(RefCell::default()),
        ..Lookup::new(files, folders.to_vec())
    };
    let (sdf, pose, _) = placed(found, &lookup).ok()?;
    faults.extend(lookup.looks.map(RefCell::into_inner).unwrap_or_default());
    sdf.body.seen_in_model(&pose)
}

/// Reads a model, with its pose in scenes and warnings.
fn placed(
    found: &Found,
    lookup: &Lookup,
) -> Result<(SdfModel, Isometry3<f64>, Diagnostics), Diagnostics> {
    let source = Opened::of(found, lookup)?;
    let (sdf, warnings) = match source.format {
        Format::Sdf => {
            let (model, said) = sdf::read(&source.text, &source.path, lookup);
            model.map(|model| (model, said.clone())).ok_or(said)?
        }
        _ => source.body(lookup)?,
    };
    let turn = sdf.body.turn_of_footprint(&sdf.pose);
    let pose = if turn == 0.0 {
        sdf.pose
    } else {
        turned(turn) * sdf.pose
    };
    Ok((sdf, pose, warnings))
}

/// A model's file.
struct Opened {
    path: PathBuf,
    text: Source,
    format: Format,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Sdf,
    Urdf,
    Mjcf,
}

impl Opened {
    /// Opens the file that a model is, or that its `model.config` names.
    ///
    /// # Errors
    /// The file is unreadable (W030), or `model.config` names none (W033).
    fn of(found: &Found, lookup: &Lookup) -> Result<Self, Diagnostics> {
        let path = match found.path.file_name().and_then(|name| name.to_str()) {
            Some("model.config") => sdf_path(&found.path, lookup.files)?,
            _ => found.path.clone(),
        };
        let text = lookup
            .files
            .read(&path)
            .map_err(|reason| unreadable(&path, &reason))?;
        let format = match path.extension().and_then(|ending| ending.to_str()) {
            Some("urdf") => Format::Urdf,
            Some("xml") if is_mjcf(lookup.files, &path) => Format::Mjcf,
            _ => Format::Sdf,
        };
        Ok(Self { path, text, format })
    }

    /// Reads an object of URDF or MJCF. Also returns warnings.
    ///
    /// # Errors
    /// As [`read`].
    fn body(&self, lookup: &Lookup) -> Result<(SdfModel, Diagnostics), Diagnostics> {
        let (model, said) = if self.format == Format::Mjcf {
            read_mjcf(&self.text, &self.path, lookup)?
        } else {
            urdf::read(&self.text, &self.path, lookup)
        };
        model.map(|model| (model, said.clone())).ok_or(said)
    }

    /// Reads a model that others include, and that never moves if `fixed`.
    ///
    /// # Errors
    /// As [`read`].
    fn included(
        &self,
        lookup: &Lookup,
        (role, fixed): (Role, bool),
        inclusions: Inclusions,
    ) -> Result<SubModel, Diagnostics> {
        if self.format == Format::Sdf {
            let (model, said) =
                sdf::read_included(&self.text, &self.path, lookup, (role, fixed), inclusions);
            return model.ok_or(said);
        }
        let (model, _) = self.body(lookup)?;
        let (tree, mut frames) = Tree::of_body(model.body, fixed);
        frames.extend(model.frames);
        let stem = self.path.file_stem();
        Ok(SubModel {
            tree,
            place: Included {
                name: stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
                stated: model.pose,
                placement: Isometry3::identity(),
                merged: false,
                frames,
            },
            is_static: model.is_static,
            digest: model.digest,
        })
    }
}

/// Reads an object in MJCF and its faults. The object is `None` if there are errors.
///
/// # Errors
/// Faults of its text.
fn read_mjcf(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
) -> Result<(Option<SdfModel>, Diagnostics), Diagnostics> {
    let (tree, text, mut said) = mjcf::object(source, path, lookup)?;
    let mut shapes = Shapes::new(lookup, path);
    shapes.digest.update(text.text.as_bytes());
    let (model, found) = tree_object::read(&tree, &mut shapes);
    said.extend(found);
    if model
        .as_ref()
        .is_some_and(|model| model.body.parts.is_empty())
    {
        let message = "the object has no solid shape: none of its geoms collides";
        let help = "set `contype` and `conaffinity` of a geom to 1; a geom for which both are 0 is only seen";
        said.push(
            Diagnostic::error("W038", message)
                .at(source, 0..0)
                .help(help),
        );
        return Ok((None, said));
    }
    Ok((model, said))
}

/// Returns the name of the model that a URI means: the path in a model folder, or the last part of
/// a web address.
pub(crate) fn name_in(uri: &str) -> String {
    let path = uri.trim_end_matches('/');
    match path.split_once("://") {
        Some(("model" | "package", path)) => path.to_owned(),
        Some(("http" | "https", address)) => {
            // Fuel's addresses end in `models/NAME` or `models/NAME/VERSION`.
            let name = address
                .split_once("/models/")
                .map_or(address, |(_, name)| name);
            name.split('/').next().unwrap_or(name).to_owned()
        }
        _ => path.to_owned(),
    }
}

/// A file with elements that include models.
pub(crate) struct Including<'a> {
    pub(crate) path: &'a Path,
    pub(crate) lookup: &'a Lookup<'a>,
    pub(crate) inclusions: &'a Inclusions,
}

/// Reads the model that the `<uri>` of an `<include>` in a file names. `known` are the names that
/// the user may have meant. The model never moves if `fixed`. Reports W040 and returns `None` if the
/// model is missing or has faults.
pub(crate) fn included<'a>(
    uri: Node,
    file: &Including,
    (role, fixed): (Role, bool),
    known: impl Iterator<Item = &'a str>,
    reader: &mut Reader,
) -> Option<SubModel> {
    file.inclusions.check_room(uri, reader)?;
    let name = name_in(xml::text(uri));
    let Some(found) = named_by(xml::text(uri), file.path, file.lookup) else {
        let message = format!("the model `{name}` is missing");
        let known: Vec<&str> = known.collect();
        let help = match known.is_empty() {
            true => "put its folder beside those of the other models".to_owned(),
            false => did_you_mean(&name, known),
        };
        reader.error("W040", uri, message, help);
        return None;
    };
    let model = match Opened::of(&found, file.lookup) {
        Ok(opened) => {
            let inclusions =
                file.inclusions
                    .enter(file.path, &opened.path, &opened.text, uri, reader)?;
            opened.included(file.lookup, (role, fixed), inclusions)
        }
        Err(faults) => Err(faults),
    };
    match model {
        Ok(model) => Some(model),
        Err(faults) => {
            let first = faults
                .iter()
                .find(|fault| fault.severity == Severity::Error);
            let reason = first.map_or("", |fault| fault.message.as_str());
            let message = format!("the model `{name}` can't be used: {reason}");
            reader.error(
                "W040",
                uri,
                message,
                "mend that model, or remove the `<include>`",
            );
            None
        }
    }
}

/// The text of a model's file.
pub(crate) struct ModelText {
    pub(crate) path: PathBuf,
    pub(crate) source: Source,
}

/// Returns the text of the model that a URI in a file names; `None` if the model is missing.
///
/// # Errors
/// Its file is unreadable (W030), or its `model.config` names none (W033).
pub(crate) fn text_of(
    uri: &str,
    file: &Path,
    lookup: &Lookup,
) -> Result<Option<ModelText>, Diagnostics> {
    let Some(found) = named_by(uri, file, lookup) else {
        return Ok(None);
    };
    let Opened { path, text, .. } = Opened::of(&found, lookup)?;
    Ok(Some(ModelText { path, source: text }))
}

/// Finds the model that a URI in a file names. One without a scheme is first relative to the file,
/// and then a path in the folders of models.
fn named_by(uri: &str, file: &Path, lookup: &Lookup) -> Option<Found> {
    let by_name = || named(&name_in(uri), lookup);
    match is_path(uri) {
        true => at_path(uri, file, lookup).or_else(by_name),
        false => by_name().or_else(|| at_path(uri, file, lookup)),
    }
}

/// Whether a URI without a scheme means a model beside the file that contains it.
pub(crate) fn is_beside(uri: &str, file: &Path, lookup: &Lookup) -> bool {
    is_path(uri) && at_path(uri, file, lookup).is_some()
}

fn is_path(uri: &str) -> bool {
    !uri.contains("://")
}

/// Finds the model whose folder or file is at the path of a URI.
fn at_path(uri: &str, file: &Path, lookup: &Lookup) -> Option<Found> {
    let path = lookup.resolve(uri, file).ok()?;
    let found = model_file(lookup.files, &path).or_else(|| {
        let is_file = is_model(lookup.files, &path) && lookup.files.read(&path).is_ok();
        is_file.then(|| path.clone())
    })?;
    Some(Found {
        name: uri.to_owned(),
        path: found,
    })
}

/// Finds a model by its path in the folders. Names of web addresses may differ from folders in case
/// and spaces.
fn named(name: &str, lookup: &Lookup) -> Option<Found> {
    let spellings = spellings(name);
    let folder_names = spellings.iter().flat_map(|name| {
        let of_web = name.to_lowercase().replace(' ', "_");
        [name.clone(), of_web]
    });
    let folder_names: Vec<String> = folder_names.collect();
    let mut places = lookup
        .folders
        .iter()
        .flat_map(|folder| folder_names.iter().map(|name| folder.join(name)));
    places.find_map(|place| {
        let flat = FLAT.map(|ending| place.with_added_extension(ending));
        let is_file = |path: &PathBuf| {
            is_model(lookup.files, path)
                && lookup
                    .files
                    .list(path.parent().unwrap_or(Path::new("")))
                    .contains(path)
        };
        let path = model_file(lookup.files, &place).or_else(|| {
            std::iter::once(place.clone())
                .chain(flat)
                .find(|path| is_file(path))
        })?;
        Some(Found {
            name: name.to_owned(),
            path,
        })
    })
}

/// The endings of models that are a file in a folder of models.
const FLAT: [&str; 3] = ["sdf", "urdf", "xml"];

/// Whether a path is that of a model by its ending; one of MJCF also by its root.
fn is_model(files: &Files, path: &Path) -> bool {
    let ends_in = |ending: &str| path.extension().is_some_and(|found| found == ending);
    ends_in("sdf") || ends_in("urdf") || is_mjcf(files, path)
}

/// Returns the file of a model's folder that names or is the model.
fn model_file(files: &Files, folder: &Path) -> Option<PathBuf> {
    let inside = files.list(folder);
    let known = ["model.config", "model.sdf", "model.urdf"].map(|file| folder.join(file));
    let of_name = folder
        .file_name()
        .map(|name| FLAT.map(|ending| folder.join(name).with_added_extension(ending)));
    let others = of_name
        .into_iter()
        .flatten()
        .chain([folder.join("model.xml")])
        .filter(|path| is_model(files, path));
    known
        .into_iter()
        .chain(others)
        .find(|path| inside.contains(path))
}

/// Whether a file is MJCF: XML whose root is `<mujoco>`, or `<mujocoinclude>`. A URDF may have such an
/// element, too, but not as its root.
fn is_mjcf(files: &Files, path: &Path) -> bool {
    let is_xml = path.extension().is_some_and(|ending| ending == "xml");
    let begins = |text: &str| root_name(text).is_some_and(|root| root.starts_with("mujoco"));
    is_xml
        && files.read_bytes(path).is_ok_and(|bytes| {
            // A file with faults in its encoding is MJCF, too; its reader reports them.
            begins(&String::from_utf8_lossy(&bytes))
                || xml_text(bytes).is_ok_and(|text| begins(&text))
        })
}

fn unreadable(path: &Path, reason: &FileFault) -> Diagnostic {
    Diagnostic::error(
        "W030",
        format!("cannot read the model {}: {reason}", path.display()),
    )
    .help("a model is a folder with `model.config` and the SDF file that it names, or a file of URDF or MJCF")
}

/// Returns the SDF file named by a `model.config`; if there are several, that of the newest
/// version.
fn sdf_path(config: &Path, files: &Files) -> Result<PathBuf, Diagnostics> {
    let source = files
        .read(config)
        .map_err(|reason| unreadable(config, &reason))?;
    let text = repaired(&source.text);
    let document = xml::parse(&source, &text)?;
    let mut reader = Reader::new(&source);
    let root = document.root_element();
    let newest = xml::children(root, "sdf").max_by_key(|sdf| {
        let minor = sdf
            .attribute("version")
            .and_then(|version| version.strip_prefix("1.")?.parse::<u32>().ok());
        minor.unwrap_or(0)
    });
    let Some(named) = newest.filter(|sdf| !xml::text(*sdf).is_empty()) else {
        let message = format!("`<{}>` names no SDF file", root.tag_name().name());
        reader.error(
            "W033",
            root,
            message,
            "add `<sdf version=\"1.6\">model.sdf</sdf>`",
        );
        return Err(reader.found);
    };
    let folder = config.parent().unwrap_or(Path::new(""));
    let path = beside(files, folder, xml::text(named));
    match files.read_bytes(&path) {
        Ok(_) => Ok(path),
        Err(reason) => {
            let message = format!("cannot read the model {}: {reason}", path.display());
            reader.error(
                "W030",
                named,
                message,
                "the path is relative to the folder of `model.config`",
            );
            Err(reader.found)
        }
    }
}
