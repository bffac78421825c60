//! The contents of the folders of `model_dir`, and the shipped models: objects, worlds and robots
//! by name.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::foreign::{self, Lookup};
use crate::paths::resolve_path;
use crate::visuals::{RobotPlace, VisualFiles};
use crate::{Furniture, Located, Table, WorldMap, model, robot, world_map};
use actcheck_base::{Diagnostic, Diagnostics, Files, Severity, Span, did_you_mean};
use actcheck_data::{ObjectModel, Range, StatedRobot};

/// Folder of the models embedded in the program.
const SHIPPED_MODELS: &str = "models";
/// The robot if the configuration names none.
const DEFAULT_ROBOT: &str = "mobile_manipulator";

/// The models that a configuration can name.
pub(crate) struct ModelLibrary {
    files: Files,
    /// Folders of models. The first one with a name has it.
    folders: Vec<PathBuf>,
    /// Objects by name.
    pub(crate) models: BTreeMap<String, Arc<ObjectModel>>,
    /// Names of object files, including invalid ones, so that an invalid model is not also reported
    /// as missing.
    names: Vec<String>,
    /// Faults of models, reported in full only if the configuration names the model.
    diagnostics: BTreeMap<String, Diagnostics>,
    /// Names of models whose files give them a pose.
    posed: BTreeSet<String>,
    /// Models without a category.
    pub(crate) uncategorised: BTreeSet<String>,
    /// The worlds that the configuration names.
    pub(crate) worlds: BTreeMap<String, Arc<WorldMap>>,
    /// Ranges of the base's initial x, y and heading.
    pub(crate) start: Option<[Range; 3]>,
    /// The files of SDF, URDF and MJCF models, by the model's name.
    foreign: BTreeMap<String, PathBuf>,
    /// Where the robot is.
    robot: Option<RobotPlace>,
    /// Where `profile` of the table `[robot]` is.
    pub(crate) profile_at: Option<Span>,
    /// Warnings about ignored parts of the worlds.
    warnings: Diagnostics,
}

/// Most models with faults that the configuration does not name and that get a warning each.
const MOST_UNUSABLE: usize = 3;

/// The world with only a floor, which needs no file.
const FLOOR_ALONE: &str = "empty";

/// Reads all models of `model_dir`, or of the shipped folder. Faults of models are reported by
/// [`ModelLibrary::report`]. Shipped models that the folders lack are read when they are named.
pub(crate) fn read(table: &mut Table, folder: &Path, found: &mut Diagnostics) -> ModelLibrary {
    let written = table.string_or_strings("model_dir");
    let (files, folders) = match written.is_empty() {
        true => (Files::Shipped, vec![PathBuf::from(SHIPPED_MODELS)]),
        false => (
            Files::Disk,
            written
                .iter()
                .map(|written| resolve_path(folder, &written.value))
                .collect(),
        ),
    };
    let mut library = ModelLibrary {
        files,
        folders,
        models: BTreeMap::new(),
        names: Vec::new(),
        diagnostics: BTreeMap::new(),
        posed: BTreeSet::new(),
        uncategorised: BTreeSet::new(),
        worlds: BTreeMap::new(),
        start: None,
        foreign: BTreeMap::new(),
        robot: None,
        profile_at: None,
        warnings: Diagnostics::new(),
    };
    for path in library.toml_files("objects") {
        if library.names.contains(&stem(&path)) {
            library.ignore_second(&stem(&path), &path);
            continue;
        }
        library.names.push(stem(&path));
        match library.files.read(&path) {
            Ok(source) => match model::read(&source) {
                Ok(model) => _ = library.models.insert(model.name.clone(), Arc::new(model)),
                Err(faults) => library
                    .diagnostics
                    .entry(stem(&path))
                    .or_default()
                    .extend(faults),
            },
            Err(reason) => {
                let message = format!("cannot read the model {}: {reason}", path.display());
                table.fault(
                    "C014",
                    0..0,
                    message,
                    "every file in `objects` of the model folder is read",
                );
            }
        }
    }
    library.read_foreign();
    let help = "it needs a folder `objects` with one TOML file for each model, or a folder with `model.config` and \
        `model.sdf` for each; without `model_dir`, the shipped models are used";
    for (written, folder) in written.into_iter().zip(library.folders.clone()) {
        if library.is_bare(&folder) {
            let message = format!("the model folder {} contains no models", folder.display());
            table.fault("C010", written.span, message, help);
        }
    }
    library.read_categories(table, found);
    library
}

impl ModelLibrary {
    /// Reads the SDF and URDF models.
    fn read_foreign(&mut self) {
        let files = self.files.clone();
        let lookup = Lookup::new(&files, self.foreign_folders());
        for model in self
            .foreign_folders()
            .iter()
            .flat_map(|folder| foreign::find(&files, folder))
        {
            if self.names.contains(&model.name) {
                self.ignore_second(&model.name, &model.path);
                continue;
            }
            match foreign::read(&model, &lookup) {
                Ok(read) => {
                    self.foreign.insert(model.name.clone(), model.path.clone());
                    self.models.insert(model.name.clone(), Arc::new(read.model));
                    self.uncategorised.insert(model.name.clone());
                    self.diagnostics.insert(model.name.clone(), read.warnings);
                    if read.has_pose {
                        self.posed.insert(model.name.clone());
                    }
                }
                Err(faults) => _ = self.diagnostics.insert(model.name.clone(), faults),
            }
            self.names.push(model.name);
        }
    }

    /// Returns where the visual shapes are; `None` without a robot.
    pub(crate) fn visuals(&self) -> Option<VisualFiles> {
        Some(VisualFiles {
            robot: self.robot.clone()?,
            files: self.files.clone(),
            folders: self.foreign_folders(),
            models: self.foreign.clone(),
        })
    }

    /// Warns about a second model of a name.
    fn ignore_second(&mut self, name: &str, path: &Path) {
        let message = format!(
            "there are two models `{name}`: {} is ignored",
            path.display()
        );
        let fault = Diagnostic::warning("W036", message).help("give one of them another name");
        self.diagnostics
            .entry(name.to_owned())
            .or_default()
            .push(fault);
    }

    /// The folders with SDF and URDF models.
    fn foreign_folders(&self) -> Vec<PathBuf> {
        self.folders
            .iter()
            .flat_map(|folder| [folder.clone(), folder.join("objects")])
            .collect()
    }

    /// Whether a folder of models has none.
    fn is_bare(&self, folder: &Path) -> bool {
        let objects = folder.join("objects");
        let has_toml = self.files.list(&objects).iter().any(|path| is_toml(path));
        let has_worlds = self
            .files
            .list(&folder.join("worlds"))
            .iter()
            .any(|path| is_world(path));
        !has_toml
            && !has_worlds
            && [folder, &objects]
                .iter()
                .all(|place| foreign::find(&self.files, place).is_empty())
    }

    /// Reads `[categories]`: categories by model name, which override those in the models' files.
    fn read_categories(&mut self, root: &mut Table, found: &mut Diagnostics) {
        let Some(mut table) = root.table("categories") else {
            return;
        };
        for key in table.keys() {
            let name = Located {
                value: key.clone(),
                span: table.key_span(&key).unwrap_or(0..0),
            };
            self.check_name(&mut table, &name);
            let Some(written) = table.string(&key) else {
                continue;
            };
            match model::full_iri(&written.value) {
                Some(category) => {
                    if let Some(model) = self.models.get_mut(&key) {
                        Arc::make_mut(model).category = category;
                        self.uncategorised.remove(&key);
                    }
                }
                None => {
                    let message = format!("the category `{}` is not an IRI", written.value);
                    table.fault(
                        "W003",
                        written.span,
                        message,
                        format!("write it like `{key} = \"act:Glass\"`"),
                    );
                }
            }
        }
        table.finish(found);
    }

    /// Returns the faults of models: all of them for a model that the configuration names, and only
    /// the errors, as warnings, for the others. Of more than three others, one warning has the
    /// first error of each (W045).
    pub(crate) fn report(&self, named: &BTreeSet<&str>) -> Diagnostics {
        let (mut report, mut unusable) = (self.warnings.clone(), Vec::new());
        for (name, diagnostics) in &self.diagnostics {
            if named.contains(name.as_str()) {
                report.extend(diagnostics.clone());
            } else if diagnostics.has_errors() {
                unusable.push((
                    name,
                    diagnostics
                        .iter()
                        .filter(|fault| fault.severity == Severity::Error),
                ));
            }
        }
        if unusable.len() <= MOST_UNUSABLE {
            let errors = unusable.into_iter().flat_map(|(_, errors)| errors);
            let as_warning = |fault: &Diagnostic| Diagnostic {
                severity: Severity::Warning,
                ..fault.clone()
            };
            report.extend(errors.map(as_warning).collect());
        } else {
            let message = format!(
                "{} models in {} can't be used",
                unusable.len(),
                self.told_folders()
            );
            let reasons = unusable.into_iter().filter_map(|(name, mut errors)| {
                errors
                    .next()
                    .map(|fault| format!("\n{name}: {}", fault.message))
            });
            let help = "`[pickObject] model_list = [\"NAME\"]` shows all faults of a model";
            let help = format!("{help}{}", reasons.collect::<String>());
            report.push(Diagnostic::warning("W045", message).help(help));
        }
        report
    }

    /// Takes a model by name: one of the model folders', or else a shipped one. Reports an unknown
    /// name (C008).
    pub(crate) fn check_name(&mut self, table: &mut Table, name: &Located<String>) {
        if self.names.contains(&name.value) {
            return;
        }
        let shipped = shipped_models()
            .into_iter()
            .find(|path| stem(path) == name.value);
        if let Some(model) = shipped.and_then(|path| read_shipped(&path)) {
            self.names.push(model.name.clone());
            self.models.insert(model.name.clone(), Arc::new(model));
            return;
        }
        let message = format!(
            "there is no model `{}` in {}",
            name.value,
            self.told_folders()
        );
        let known: Vec<String> = self
            .names
            .iter()
            .cloned()
            .chain(shipped_models().iter().map(|path| stem(path)))
            .collect();
        table.fault(
            "C008",
            name.span.clone(),
            message,
            choose(&name.value, &known),
        );
    }

    /// Reads a world by name from the model folder, or else from the shipped one.
    pub(crate) fn read_world(
        &mut self,
        table: &mut Table,
        name: &Located<String>,
        found: &mut Diagnostics,
    ) {
        if name.value == FLOOR_ALONE {
            self.worlds.insert(
                name.value.clone(),
                Arc::new(WorldMap::floor_only(FLOOR_ALONE)),
            );
            return;
        }
        let Some((files, path)) = self
            .world_files()
            .into_iter()
            .find(|(_, path)| stem(path) == name.value)
        else {
            let known: Vec<String> = self
                .world_files()
                .iter()
                .map(|(_, path)| stem(path))
                .collect();
            let message = format!("there is no world `{}`", name.value);
            table.fault(
                "C020",
                name.span.clone(),
                message,
                choose(&name.value, &known),
            );
            return;
        };
        if files != self.files {
            self.add_shipped_models();
        }
        let source = match files.read(&path) {
            Ok(source) => source,
            Err(reason) => {
                let message = format!("cannot read the world {}: {reason}", path.display());
                table.fault(
                    "C020",
                    name.span.clone(),
                    message,
                    "worlds are in the folder `worlds` of the model folder",
                );
                return;
            }
        };
        let (world, diagnostics) = if is_toml(&path) {
            let model = |name: &str| self.models.get(name).map(|model| &**model);
            let known: Vec<String> = self.models.keys().cloned().collect();
            match world_map::read(&name.value, &source, model, &known) {
                Ok(world) => (Some(world), Diagnostics::new()),
                Err(faults) => (None, faults),
            }
        } else {
            let lookup = Lookup::new(&files, self.foreign_folders());
            let included = foreign::world::WorldModels {
                models: &self.models,
                posed: &self.posed,
                lookup: &lookup,
            };
            let (world, diagnostics) = foreign::world::read(&name.value, &source, &path, &included);
            (world.map(|world| self.add_models_of(world)), diagnostics)
        };
        let (errors, warnings): (Vec<Diagnostic>, Vec<Diagnostic>) = diagnostics
            .into_iter()
            .partition(|fault| fault.severity == Severity::Error);
        found.extend(errors.into_iter().collect());
        self.warnings.extend(warnings.into_iter().collect());
        if let Some(world) = world {
            self.worlds.insert(world.name.clone(), Arc::new(world));
        }
    }

    /// Adds the models that only a world has, and returns its map. Configurations can't name these
    /// models.
    fn add_models_of(&mut self, world: foreign::world::World) -> WorldMap {
        for model in world.models {
            self.uncategorised.insert(model.name.clone());
            self.models.insert(model.name.clone(), Arc::new(model));
        }
        world.map
    }

    /// The worlds of the model folder, then the shipped ones.
    fn world_files(&self) -> Vec<(Files, PathBuf)> {
        let own = self
            .folders
            .iter()
            .flat_map(|folder| self.files.list(&folder.join("worlds")));
        let own = own.map(|path| (self.files.clone(), path));
        let shipped = Files::Shipped.list(&Path::new(SHIPPED_MODELS).join("worlds"));
        own.chain(shipped.into_iter().map(|path| (Files::Shipped, path)))
            .filter(|(_, path)| is_world(path))
            .collect()
    }

    /// Adds the shipped models, which shipped worlds use as furniture.
    fn add_shipped_models(&mut self) {
        for path in shipped_models() {
            if let Some(model) =
                read_shipped(&path).filter(|model| !self.names.contains(&model.name))
            {
                self.models
                    .entry(model.name.clone())
                    .or_insert_with(|| Arc::new(model));
            }
        }
    }

    /// Reports a location that no named world has (C021). If no world has locations, any name is
    /// accepted for the place in front of the surface that holds the objects, if there is one.
    pub(crate) fn check_location(
        &self,
        table: &mut Table,
        name: &Located<String>,
        has_surface: bool,
    ) {
        let known: Vec<String> = self
            .worlds
            .values()
            .flat_map(|world| &world.locations)
            .map(|location| location.name.clone())
            .collect();
        if known.is_empty() && !has_surface {
            let mut worlds: Vec<String> = self
                .worlds
                .keys()
                .map(|world| format!("`{world}`"))
                .collect();
            let message = match worlds.len() {
                0 => format!(
                    "there is no location `{}`: the configuration names no world",
                    name.value
                ),
                1 => format!(
                    "there is no location `{}`: the world {} has none",
                    name.value,
                    worlds.remove(0)
                ),
                _ => format!(
                    "there is no location `{}`: the worlds {} have none",
                    name.value,
                    worlds.join(", ")
                ),
            };
            let help = "name a world that has it, or add `[objectSurface]`: the location is then the place in front of it";
            table.fault("C021", name.span.clone(), message, help);
            return;
        }
        let is_named = known.is_empty() || known.contains(&name.value);
        if !is_named {
            let message = format!(
                "no world of the configuration has a location `{}`",
                name.value
            );
            table.fault(
                "C021",
                name.span.clone(),
                message,
                choose(&name.value, &known),
            );
        }
    }

    /// Reports worlds that have none of the named locations (C021), unless no world has them: then
    /// each name is reported already. For scenes without a surface, in front of which a location
    /// could be.
    pub(crate) fn check_locations_of(
        &self,
        table: &mut Table,
        worlds: &[Located<String>],
        names: &[Located<String>],
    ) {
        let has_any = |world: &WorldMap| {
            let mut there = world.locations.iter();
            there.any(|location| names.iter().any(|name| name.value == location.name))
        };
        if !self.worlds.values().any(|world| has_any(world)) {
            return;
        }
        for name in worlds {
            let Some(world) = self.worlds.get(&name.value).filter(|world| !has_any(world)) else {
                continue;
            };
            let message = format!("the world `{}` has none of the locations", name.value);
            let there: Vec<&str> = world
                .locations
                .iter()
                .map(|location| location.name.as_str())
                .collect();
            let help = match there.is_empty() {
                true => "it has no locations: remove the world from the list".to_owned(),
                false => format!(
                    "add one of its own to `location_list`: {}",
                    there.join(", ")
                ),
            };
            table.fault("C021", name.span.clone(), message, help);
        }
    }

    /// Reports a surface that is not furniture of a named world (C021). If a world has no surfaces,
    /// models are accepted too (else C008).
    pub(crate) fn check_surface(&mut self, table: &mut Table, name: &Located<String>) {
        let surfaces = |world: &WorldMap| -> Vec<String> {
            let carries = |piece: &&Furniture| {
                self.models
                    .get(&piece.model)
                    .is_some_and(|model| model.surface.is_some())
            };
            world
                .furniture
                .iter()
                .filter(carries)
                .map(|piece| piece.name.clone())
                .collect()
        };
        let known: Vec<String> = self
            .worlds
            .values()
            .flat_map(|world| surfaces(world))
            .collect();
        let takes_models =
            known.is_empty() || self.worlds.values().any(|world| surfaces(world).is_empty());
        if known.contains(&name.value) {
            return;
        }
        if takes_models {
            self.check_name(table, name);
        } else {
            let message = format!(
                "no world of the configuration has a surface `{}`",
                name.value
            );
            table.fault(
                "C021",
                name.span.clone(),
                message,
                choose(&name.value, &known),
            );
        }
    }

    /// Returns the folders of objects for messages: `objects` of each model folder if it has files,
    /// else that folder.
    fn told_folders(&self) -> String {
        let told = self.folders.iter().map(|folder| {
            let objects = folder.join("objects");
            if self.files.list(&objects).is_empty() {
                folder.display().to_string()
            } else {
                objects.display().to_string()
            }
        });
        told.collect::<Vec<_>>().join(" or ")
    }

    /// Reads the robot of `[robot] profile`: a path to a TOML file, or a name in the model folder
    /// or the shipped one.
    pub(crate) fn read_robot(
        &mut self,
        root: &mut Table,
        folder: &Path,
        found: &mut Diagnostics,
    ) -> Option<Arc<StatedRobot>> {
        let (files, profile, packages) = self.locate_robot(root, folder, found)?;
        let read = robot::read_telling(&files, &profile, &packages);
        self.robot = Some(RobotPlace {
            files,
            profile,
            packages,
        });
        match read {
            Ok((profile, warnings)) => {
                found.extend(warnings);
                Some(Arc::new(profile))
            }
            Err(faults) => {
                found.extend(faults);
                None
            }
        }
    }

    /// Returns the profile of the robot, where it is, and the folders of `package_dirs`. Reports
    /// the faults of the table `[robot]`.
    pub(crate) fn locate_robot(
        &mut self,
        root: &mut Table,
        folder: &Path,
        found: &mut Diagnostics,
    ) -> Option<(Files, PathBuf, Vec<PathBuf>)> {
        let mut table = root.table("robot");
        let written = table.as_mut().and_then(|table| table.string("profile"));
        self.profile_at = written.as_ref().map(|written| written.span.clone());
        let name = written
            .as_ref()
            .map_or(DEFAULT_ROBOT, |written| &written.value);
        let place = match &written {
            Some(path) if path.value.ends_with(".toml") => {
                let place = resolve_path(folder, &path.value);
                Files::Disk
                    .read(&place)
                    .map(|_| (Files::Disk, place.clone()))
                    .map_err(|reason| {
                        let help = "the path is relative to the configuration";
                        (
                            format!(
                                "cannot read the robot profile {}: {reason}",
                                place.display()
                            ),
                            help.to_owned(),
                        )
                    })
            }
            _ => self.find_robot(name),
        };
        if let Err((message, help)) = &place {
            match (&written, &mut table) {
                (Some(written), Some(table)) => {
                    table.fault("C011", written.span.clone(), message, help)
                }
                _ => root.fault("C011", 0..0, message, help),
            }
        }
        let mut packages = Vec::new();
        if let Some(mut table) = table {
            let written = table.strings("package_dirs").unwrap_or_default();
            self.start = read_start(&mut table);
            packages = written
                .iter()
                .map(|written| resolve_path(folder, &written.value))
                .collect();
            table.finish(found);
        }
        let (files, path) = place.ok()?;
        Some((files, path, packages))
    }

    /// Finds a robot's profile by name.
    ///
    /// # Errors
    /// A message and a help text if there is no such robot.
    fn find_robot(&self, name: &str) -> Result<(Files, PathBuf), (String, String)> {
        self.robots()
            .into_iter()
            .find(|(_, path)| stem(path) == name)
            .ok_or_else(|| {
                let mut known: Vec<String> =
                    self.robots().iter().map(|(_, path)| stem(path)).collect();
                known.dedup();
                (format!("there is no robot `{name}`"), choose(name, &known))
            })
    }

    /// The robots of the model folder, then the shipped ones.
    fn robots(&self) -> Vec<(Files, PathBuf)> {
        let own = self
            .toml_files("robots")
            .into_iter()
            .map(|path| (self.files.clone(), path));
        let shipped = Files::Shipped.list(&Path::new(SHIPPED_MODELS).join("robots"));
        let shipped = shipped
            .into_iter()
            .filter(|path| is_toml(path))
            .map(|path| (Files::Shipped, path));
        own.chain(shipped).collect()
    }

    fn toml_files(&self, kind: &str) -> Vec<PathBuf> {
        let all = self
            .folders
            .iter()
            .flat_map(|folder| self.files.list(&folder.join(kind)));
        all.filter(|path| is_toml(path)).collect()
    }
}

/// The files of the shipped objects.
fn shipped_models() -> Vec<PathBuf> {
    let all = Files::Shipped
        .list(&Path::new(SHIPPED_MODELS).join("objects"))
        .into_iter();
    all.filter(|path| is_toml(path)).collect()
}

fn read_shipped(path: &Path) -> Option<ObjectModel> {
    Files::Shipped
        .read(path)
        .ok()
        .and_then(|source| model::read(&source).ok())
}

/// Reads `start_x_m`, `start_y_m` and `start_heading_rad`, which must be given together.
fn read_start(table: &mut Table) -> Option<[Range; 3]> {
    let keys = ["start_x_m", "start_y_m", "start_heading_rad"];
    if !keys.iter().any(|key| table.has(key)) {
        return None;
    }
    table.require(&keys);
    let (x, y) = (
        table.range(keys[0], -14.0..=14.0),
        table.range(keys[1], -14.0..=14.0),
    );
    let heading = table.range(keys[2], -std::f64::consts::TAU..=std::f64::consts::TAU);
    Some([x?, y?, heading?])
}

/// Whether a file in `worlds` is a world.
fn is_world(path: &Path) -> bool {
    path.extension().is_some_and(|ending| {
        ["toml", "world", "sdf", "xml"]
            .iter()
            .any(|known| ending == *known)
    })
}

fn is_toml(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "toml")
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// Returns "did you mean", or the whole list.
fn choose(name: &str, known: &[String]) -> String {
    did_you_mean(name, known.iter().map(String::as_str))
}
