//! A validated campaign configuration.

use actcheck_base::{Diagnostic, Diagnostics, Files, Keeping, Shard, Source, Span};
use actcheck_data::{Budget, ObjectModel, Physics, Range, Sensing, StatedRobot};
use actcheck_search::Strategy;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use crate::{Case, Launcher, OtherCounts, Relation, Step, VisualFiles, WorldMap, designators};

/// One campaign: runs every test in `test_count` scenes, `repeat` times in each.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// The configuration's text.
    pub source: Source,
    /// Lists of actions, performed in order (`tests`).
    pub tests: Vec<Vec<Step>>,
    /// Scenes of each test (`test_count`).
    pub test_count: u32,
    /// Runs of each scene, each with different noise (`repeat`; default 1).
    pub repeat: u32,
    /// The skills that perform the actions (`test_launcher`).
    pub launcher: Launcher,
    /// Seed of all randomness (`seed`; default 0).
    pub seed: u64,
    /// How scenes are chosen (`[search] strategy`; default random).
    pub search: Strategy,
    /// The files that the ontology is read from, and its root file (`ontology`).
    pub ontology: (Files, PathBuf),
    /// Usable models by name: those of `model_dir` (or the shipped folder), and of shipped worlds.
    pub models: BTreeMap<String, Arc<ObjectModel>>,
    /// Names of models without a category, neither in their own files nor in `[categories]`.
    pub uncategorised: BTreeSet<String>,
    /// The worlds that contain the scenes (`[world] worlds`), by name; if empty, scenes have only a
    /// floor.
    pub worlds: BTreeMap<String, Arc<WorldMap>>,
    /// The robot as its profile states it (`[robot]`).
    pub robot: Arc<StatedRobot>,
    /// Where the visual shapes are, for pictures.
    pub visuals: VisualFiles,
    /// Names of the obstacle models (`nav_obstacle_list`).
    pub nav_obstacles: Vec<String>,
    /// Number of obstacles on the floor (`nav_obstacle_count`).
    pub nav_obstacle_count: u32,
    /// Whether obstacles may be on locations and close paths (`[nav] may_block`; default `false`).
    pub nav_may_block: bool,
    /// Candidate values by designator table: `world` → `worlds`, `pickObject` → `model_list`, and
    /// so on.
    ///
    /// The table of any other designator keeps its own name.
    pub candidates: BTreeMap<String, Vec<String>>,
    /// Numbers of other objects on the surfaces.
    pub other_counts: OtherCounts,
    /// Rules that every scene must satisfy (`[scene] require`).
    pub scene_rule: Option<Source>,
    /// Relations between pairs of runs (`[relations]`).
    pub relations: Vec<Relation>,
    /// Shares of targets and of other objects that lie on their side (`[pickObject] lying`,
    /// `[surfaceObjects] lying`).
    pub lying: (f64, f64),
    /// Ranges of the base's initial x, y and heading (`[robot] start_x_m`, `start_y_m`,
    /// `start_heading_rad`). If `None`, it starts in front of the surface. Units: metres and
    /// radians.
    pub start: Option<[Range; 3]>,
    /// Ranges of physical parameters, and time stepping (`[physics]`).
    pub physics: Physics,
    /// Sensor errors and the camera (`[sensing]`, `[camera]`).
    pub sensing: Sensing,
    /// Budgets of one action (`[budget]`).
    pub budget: Budget,
    /// Budgets of a run and of the whole campaign (`[budget]`).
    pub limits: Limits,
    /// The part of the campaign to run; `None` runs all of it.
    pub shard: Option<Shard>,
    /// The fixed scene of every run (`[case]`); if `None`, scenes are sampled.
    pub case: Option<Case>,
    /// History folder (`[history] dir`), `.actcheck` next to the configuration by default.
    pub history: PathBuf,
    /// Whether each run is written to the disk at once (`[history] sync`; default `false`).
    pub sync_each_run: bool,
    /// Which runs the history keeps whole (`[history] keep` and `keep_whole`; by default all).
    pub keeping: Keeping,
    /// Spans of keys and values, for faults that only a later stage can find: `tests.0.1` is the
    /// second action of the first test, `tests.0.1.pickObject` the value that it gives to this
    /// designator, `pickObject` the table's header, `pickObject.2` its third candidate.
    pub places: BTreeMap<String, Span>,
    /// Warnings about ignored parts of used models, and about unused models with errors.
    pub warnings: Diagnostics,
}

impl Campaign {
    /// Returns the names of the models that its scenes can contain.
    pub fn used_models(&self) -> BTreeSet<String> {
        let named = designators::named_models(&self.candidates, &self.nav_obstacles);
        let standing = self
            .worlds
            .values()
            .flat_map(|world| &world.furniture)
            .map(|piece| piece.model.as_str());
        named
            .into_iter()
            .chain(standing)
            .map(str::to_owned)
            .collect()
    }

    /// Returns an error that a later stage found, at the span of `key` (see [`Campaign::places`]).
    pub fn fault(&self, code: &'static str, key: &str, message: impl Into<String>) -> Diagnostic {
        self.placed(Diagnostic::error(code, message), key)
    }

    /// Returns a warning of a later stage, at the span of `key`.
    pub fn warning(&self, code: &'static str, key: &str, message: impl Into<String>) -> Diagnostic {
        self.placed(Diagnostic::warning(code, message), key)
    }

    fn placed(&self, diagnostic: Diagnostic, key: &str) -> Diagnostic {
        match self.places.get(key) {
            Some(span) => diagnostic.at(&self.source, span.clone()),
            None => diagnostic.in_source(&self.source),
        }
    }
}

/// Command-line options that override the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overrides {
    /// Overrides `test_count`; at least 1.
    pub runs: Option<u32>,
    /// Overrides `seed`.
    pub seed: Option<u64>,
    /// Overrides `repeat`; at least 1.
    pub repeat: Option<u32>,
    /// Overrides `[budget] time`. Unit: seconds.
    pub time_secs: Option<f64>,
    /// Overrides `[budget] until_width`.
    pub until_width: Option<f64>,
    /// Overrides `[budget] max_failures`.
    pub max_failures: Option<u64>,
    /// Runs only this part of the campaign.
    pub shard: Option<Shard>,
    /// Overrides `[search] strategy`.
    pub search: Option<Strategy>,
    /// Overrides `[history] dir`; relative to the current directory.
    pub history: Option<PathBuf>,
    /// Replaces `test_launcher` and `[skill]`, which are then not read.
    pub launcher: Option<Launcher>,
}

/// Limits on one run and on the whole campaign; `None` means unlimited.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Wall-clock time of one run; a longer run ends as `timeout`. Unit: seconds.
    pub run_secs: Option<f64>,
    /// Wall-clock time of the campaign. Unit: seconds.
    pub time_secs: Option<f64>,
    /// The campaign ends when the 95 % confidence interval of every property is at most this wide.
    /// In (0, 1).
    pub until_width: Option<f64>,
    /// The campaign ends after this many runs with a failed property; at least 1.
    pub max_failures: Option<u64>,
}

impl Limits {
    /// Returns the limits with the overrides of the command line applied.
    pub(super) fn overridden(self, overrides: &Overrides) -> Self {
        Self {
            run_secs: self.run_secs,
            time_secs: overrides.time_secs.or(self.time_secs),
            until_width: overrides.until_width.or(self.until_width),
            max_failures: overrides.max_failures.or(self.max_failures),
        }
    }
}
