//! What `model_dir` holds: objects and robots by name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::base::{Diagnostics, Files, did_you_mean};
use crate::config::load::beside;
use crate::config::{Located, ObjectModel, RobotProfile, Table, model, robot};

/// Where models lie inside the program.
const SHIPPED_MODELS: &str = "models";
/// The robot that serves where none is named.
const DEFAULT_ROBOT: &str = "mobile_manipulator";

/// The models that a configuration can name.
pub(crate) struct Shelf {
    files: Files,
    folder: PathBuf,
    /// Objects by name.
    pub(crate) models: BTreeMap<String, Arc<ObjectModel>>,
    /// Names of object files, readable or not, so that a wrong model is not reported as a missing one too.
    names: Vec<String>,
}

/// Reads all models of `model_dir`, or of the shipped folder. A wrong one is reported with its own place.
pub(crate) fn read(table: &mut Table, folder: &Path, found: &mut Diagnostics) -> Shelf {
    let (files, dir) = match table.string("model_dir") {
        Some(written) => (Files::Disk, checked_folder(table, folder, &written)),
        None => (Files::Shipped, PathBuf::from(SHIPPED_MODELS)),
    };
    let mut shelf = Shelf { files, folder: dir, models: BTreeMap::new(), names: Vec::new() };
    for path in shelf.toml_files("objects") {
        shelf.names.push(stem(&path));
        match shelf.files.read(&path) {
            Ok(source) => match model::read(&source) {
                Ok(model) => _ = shelf.models.insert(model.name.clone(), Arc::new(model)),
                Err(faults) => found.extend(faults),
            },
            Err(reason) => {
                let message = format!("cannot read the model {}: {reason}", path.display());
                table.fault("C014", 0..0, message, "every file in `objects` of the model folder is read");
            }
        }
    }
    shelf
}

fn checked_folder(table: &mut Table, folder: &Path, written: &Located<String>) -> PathBuf {
    let dir = beside(folder, &written.value);
    if Files::Disk.list(&dir.join("objects")).is_empty() {
        let message = format!("the model folder {} holds no models", dir.display());
        let help = "it needs a folder `objects` with one TOML file for each model; without `model_dir` the shipped models serve";
        table.fault("C010", written.span.clone(), message, help);
    }
    dir
}

impl Shelf {
    /// Reports a name that no model has (C008).
    pub(crate) fn check_name(&self, table: &mut Table, name: &Located<String>) {
        // With an empty shelf, its absence has been reported already.
        if !self.names.is_empty() && !self.names.contains(&name.value) {
            let message = format!("there is no model `{}` in {}", name.value, self.folder.join("objects").display());
            table.fault("C008", name.span.clone(), message, choose(&name.value, &self.names));
        }
    }

    /// The robot that `[robot] profile` names: a path to a TOML file, or a name from the model folder or the shipped one.
    pub(crate) fn read_robot(
        &self,
        root: &mut Table,
        folder: &Path,
        found: &mut Diagnostics,
    ) -> Option<Arc<RobotProfile>> {
        let mut table = root.table("robot");
        let written = table.as_mut().and_then(|table| table.string("profile"));
        let name = written.as_ref().map_or(DEFAULT_ROBOT, |written| &written.value);
        let place = match &written {
            Some(path) if path.value.ends_with(".toml") => {
                let place = beside(folder, &path.value);
                Files::Disk.read(&place).map(|_| (Files::Disk, place.clone())).map_err(|reason| {
                    let help = "the path is relative to the configuration";
                    (format!("cannot read the robot profile {}: {reason}", place.display()), help.to_owned())
                })
            }
            _ => self.find_robot(name),
        };
        if let Err((message, help)) = &place {
            match (&written, &mut table) {
                (Some(written), Some(table)) => table.fault("C011", written.span.clone(), message, help),
                _ => root.fault("C011", 0..0, message, help),
            }
        }
        if let Some(table) = table {
            table.finish(found);
        }
        let (files, path) = place.ok()?;
        robot::read(&files, &path).map(Arc::new).map_err(|faults| found.extend(faults)).ok()
    }

    /// A robot's profile by name, or what is wrong and what to do.
    fn find_robot(&self, name: &str) -> Result<(Files, PathBuf), (String, String)> {
        self.robots().into_iter().find(|(_, path)| stem(path) == name).ok_or_else(|| {
            let mut known: Vec<String> = self.robots().iter().map(|(_, path)| stem(path)).collect();
            known.dedup();
            (format!("there is no robot `{name}`"), choose(name, &known))
        })
    }

    /// The robots of the model folder, then the shipped ones.
    fn robots(&self) -> Vec<(Files, PathBuf)> {
        let own = self.toml_files("robots").into_iter().map(|path| (self.files.clone(), path));
        let shipped = Files::Shipped.list(&Path::new(SHIPPED_MODELS).join("robots"));
        let shipped = shipped.into_iter().filter(|path| is_toml(path)).map(|path| (Files::Shipped, path));
        own.chain(shipped).collect()
    }

    fn toml_files(&self, kind: &str) -> Vec<PathBuf> {
        self.files.list(&self.folder.join(kind)).into_iter().filter(|path| is_toml(path)).collect()
    }
}

fn is_toml(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "toml")
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// "did you mean", or the whole list.
fn choose(name: &str, known: &[String]) -> String {
    did_you_mean(name, known.iter().map(String::as_str))
}
