//! A validated campaign configuration.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use crate::base::{Diagnostic, Diagnostics, Files, Shard, Source, Span};
use crate::config::{Case, ObjectModel, OtherCounts, RobotProfile, Skill, WorldMap, designators};
use crate::search::Strategy;

/// One campaign: runs every test in `test_count` scenes, `repeat` times in each.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// The configuration's text.
    pub source: Source,
    /// Lists of action names, performed in order (`tests`).
    pub tests: Vec<Vec<String>>,
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
    /// The worlds that contain the scenes (`[world] worlds`), by name; if empty, scenes have only a floor.
    pub worlds: BTreeMap<String, Arc<WorldMap>>,
    /// The robot (`[robot]`).
    pub robot: Arc<RobotProfile>,
    /// Names of the obstacle models (`nav_obstacle_list`).
    pub nav_obstacles: Vec<String>,
    /// Number of obstacles on the floor (`nav_obstacle_count`).
    pub nav_obstacle_count: u32,
    /// Candidate values by designator table: `world` → `worlds`, `pickObject` → `model_list`, and so on.
    ///
    /// The table of any other designator keeps its own name.
    pub candidates: BTreeMap<String, Vec<String>>,
    /// Numbers of other objects on the surfaces.
    pub other_counts: OtherCounts,
    /// Rules that every scene must satisfy (`[scene] require`).
    pub scene_rule: Option<Source>,
    /// Shares of targets and of other objects that lie on their side (`[pickObject] lying`, `[surfaceObjects] lying`).
    pub lying: (f64, f64),
    /// Ranges of the base's initial x, y and heading (`[robot] start_x_m`, `start_y_m`, `start_heading_rad`).
    /// If `None`, it starts in front of the surface. Units: metres and radians.
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
    /// Spans of keys and values, for faults that only a later stage can find: `tests.0.1` is the second action of
    /// the first test, `pickObject` the table's header, `pickObject.2` its third candidate.
    pub places: BTreeMap<String, Span>,
    /// Warnings about ignored parts of used models, and about unused models with errors.
    pub warnings: Diagnostics,
}

impl Campaign {
    /// Returns the names of the models that its scenes can contain.
    pub fn used_models(&self) -> BTreeSet<String> {
        let named = designators::named_models(&self.candidates, &self.nav_obstacles);
        let standing = self.worlds.values().flat_map(|world| &world.furniture).map(|piece| piece.model.as_str());
        named.into_iter().chain(standing).map(str::to_owned).collect()
    }

    /// Returns an error that a later stage found, at the span of `key` (see [`Campaign::places`]).
    pub fn fault(&self, code: &'static str, key: &str, message: impl Into<String>) -> Diagnostic {
        let fault = Diagnostic::error(code, message);
        match self.places.get(key) {
            Some(span) => fault.at(&self.source, span.clone()),
            None => fault.in_source(&self.source),
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
}

/// The skills that perform the actions.
#[derive(Debug, Clone, PartialEq)]
pub enum Launcher {
    /// The built-in reference skills, in process.
    Reference,
    /// An external program for the actions that it supports; the reference skills for the others.
    Program(Box<Skill>),
}

/// A range to sample from, both ends included.
pub type Range = (f64, f64);

/// Ranges of each object's physical parameters, and the settings of the solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Physics {
    /// Factor on the model's mass.
    pub mass_scale: Range,
    /// Factor on the model's friction.
    pub friction_scale: Range,
    /// Factor on the model's size.
    pub size_scale: Range,
    /// Coefficient of restitution.
    pub restitution: Range,
    /// Physics steps per second.
    pub steps_per_second: u32,
    /// Solver iterations per step.
    pub iterations: u32,
}

/// Standard deviations of sensing and localisation errors; 0 is perfect.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensing {
    /// Of a perceived object's position, along each horizontal axis. Unit: metres.
    pub position_noise_m: f64,
    /// Of a perceived object's height. Unit: metres.
    pub height_noise_m: f64,
    /// Of a perceived object's heading. Unit: radians.
    pub yaw_noise_rad: f64,
    /// Of a perceived object's dimensions. Unit: metres.
    pub size_noise_m: f64,
    /// Of the base's initial position estimate. Unit: metres.
    pub localisation_noise_m: f64,
    /// Of the base's initial heading estimate. Unit: radians.
    pub heading_noise_rad: f64,
    /// Of a measured finger opening. Unit: metres.
    pub gripper_noise_m: f64,
    /// Localisation while the base drives.
    pub odometry: Odometry,
    /// The depth camera (`[camera]`).
    pub camera: Camera,
}

/// Localisation while the base drives: keys of `[sensing]`. Standard deviations unless noted otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Position error per distance driven, along and across the path (`odometry_drift`).
    pub drift: f64,
    /// Heading error per radian turned and per metre driven (`heading_drift`). Unit: radians.
    pub heading_drift: f64,
    /// Distance driven between two landmark sightings, which correct the estimate (`landmark_every_m`); 0 means no
    /// landmarks. Unit: metres.
    pub landmark_every_m: f64,
    /// Error of a position measured by landmarks (`landmark_noise_m`). Unit: metres.
    pub landmark_noise_m: f64,
    /// Error of a heading measured by landmarks (`landmark_noise_rad`). Unit: radians.
    pub landmark_noise_rad: f64,
}

impl Odometry {
    /// Odometry without errors or landmarks: the initial localisation error stays constant.
    pub const IDEAL: Self =
        Self { drift: 0.0, heading_drift: 0.0, landmark_every_m: 0.0, landmark_noise_m: 0.0, landmark_noise_rad: 0.0 };
}

/// The depth camera on the robot's camera link: its intrinsics and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Image width. Unit: pixels.
    pub width: u32,
    /// Image height. Unit: pixels.
    pub height: u32,
    /// Angle between the outermost columns. Unit: radians. The vertical angle follows, as pixels are square.
    pub field_of_view_rad: f64,
    /// Nearest visible distance from the camera. Unit: metres.
    pub min_range_m: f64,
    /// Farthest visible distance from the camera. Unit: metres.
    pub max_range_m: f64,
    /// Standard deviation of the range at a distance of 1 m; it grows with the square of the distance. Unit: metres.
    pub range_noise_m: f64,
    /// Share of pixels that are dropped at random.
    pub dropout: f64,
    /// Angle between ray and surface below which pixels are dropped: all at 0, none at this angle. Unit: radians.
    pub grazing_rad: f64,
}

impl Camera {
    /// 320 × 240 pixels, 57 degrees wide, from 0.3 to 5 m like the depth cameras of service robots, and without noise.
    pub const IDEAL: Self = Self {
        width: 320,
        height: 240,
        field_of_view_rad: 1.0,
        min_range_m: 0.3,
        max_range_m: 5.0,
        range_noise_m: 0.0,
        dropout: 0.0,
        grazing_rad: 0.0,
    };
}

/// Limits on one action. An action that exceeds them ends as `timeout`.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// Simulated time of one action. Unit: seconds.
    pub action_secs: f64,
}

/// Limits on one run and on the whole campaign; `None` means unlimited.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Wall-clock time of one run; a longer run ends as `timeout`. Unit: seconds.
    pub run_secs: Option<f64>,
    /// Wall-clock time of the campaign. Unit: seconds.
    pub time_secs: Option<f64>,
    /// The campaign ends when the 95 % confidence interval of every property is at most this wide. In (0, 1).
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
