//! What a configuration file asks for, with nothing left to check.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use crate::base::{Diagnostic, Diagnostics, Files, Shard, Source, Span};
use crate::config::{Case, ObjectModel, OtherCounts, RobotProfile, Skill, WorldMap, designators};
use crate::search::Strategy;

/// One campaign: every test in `test_count` scenes, in each `repeat` times.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// The text that it was read from.
    pub source: Source,
    /// Lists of action names, performed in order (`tests`).
    pub tests: Vec<Vec<String>>,
    /// Scenes of each test (`test_count`).
    pub test_count: u32,
    /// Runs of each scene, each with other noise (`repeat`); without it, 1.
    pub repeat: u32,
    /// What performs the actions (`test_launcher`).
    pub launcher: Launcher,
    /// Seed of all randomness (`seed`); without one, 0.
    pub seed: u64,
    /// How scenes are chosen (`[search] strategy`); without one, at random.
    pub search: Strategy,
    /// The ontology's root file (`ontology`) and where it is read from.
    pub ontology: (Files, PathBuf),
    /// Models by name: all that `model_dir` (or the shipped folder) holds and the campaign can speak of.
    pub models: BTreeMap<String, Arc<ObjectModel>>,
    /// Names of models of which no file says what they are (`[categories]` may).
    pub uncategorised: BTreeSet<String>,
    /// The worlds that scenes lie in (`[world] worlds`), by name; without one there is a floor and nothing else.
    pub worlds: BTreeMap<String, Arc<WorldMap>>,
    /// The robot (`[robot]`).
    pub robot: Arc<RobotProfile>,
    /// Names of obstacle models in the way of the base (`nav_obstacle_list`).
    pub nav_obstacles: Vec<String>,
    /// How many obstacles stand in the way (`nav_obstacle_count`).
    pub nav_obstacle_count: u32,
    /// Candidate values by designator table: `world` → `worlds`, `pickObject` → `model_list`, and so on.
    ///
    /// A table named after a designator that has no special meaning gives its candidates under its own name.
    pub candidates: BTreeMap<String, Vec<String>>,
    /// How many other objects stand on the surfaces.
    pub other_counts: OtherCounts,
    /// Rules that a scene has to satisfy (`[scene] require`).
    pub scene_rule: Option<Source>,
    /// Shares of targets and of other objects that lie on their side (`[pickObject] lying`, `[surfaceObjects] lying`).
    pub lying: (f64, f64),
    /// Ranges of x, y and heading in which the base starts (`[robot] start_x_m`, `start_y_m`, `start_heading_rad`); without
    /// them it starts in front of the surface. Units: metres and radians.
    pub start: Option<[Range; 3]>,
    /// Ranges of what physics draws (`[physics]`).
    pub physics: Physics,
    /// What the sensors get wrong (`[sensing]`, `[camera]`).
    pub sensing: Sensing,
    /// Budgets of one action (`[budget]`).
    pub budget: Budget,
    /// Budgets of a run and of the whole campaign (`[budget]`).
    pub limits: Limits,
    /// The part of its runs that is to be made; nothing: all of them.
    pub shard: Option<Shard>,
    /// The one scene that every run makes (`[case]`); without one, scenes are drawn.
    pub case: Option<Case>,
    /// History folder (`[history] dir`), `.actcheck` beside the configuration by default.
    pub history: PathBuf,
    /// Where things are written, for faults that only a later stage can see: `tests.0.1` is the second action of
    /// the first test, `pickObject` the table's header, `pickObject.2` its third candidate.
    pub places: BTreeMap<String, Span>,
    /// What is left out of models that are named, and which of the others are wrong.
    pub warnings: Diagnostics,
}

impl Campaign {
    /// Names of the models that can stand in its scenes.
    pub fn used_models(&self) -> BTreeSet<String> {
        let named = designators::named_models(&self.candidates, &self.nav_obstacles);
        let standing = self.worlds.values().flat_map(|world| &world.furniture).map(|piece| piece.model.as_str());
        named.into_iter().chain(standing).map(str::to_owned).collect()
    }

    /// A fault of the configuration that a later stage found, at the place of `key` (see [`Campaign::places`]).
    pub fn fault(&self, code: &'static str, key: &str, message: impl Into<String>) -> Diagnostic {
        let fault = Diagnostic::error(code, message);
        match self.places.get(key) {
            Some(span) => fault.at(&self.source, span.clone()),
            None => fault.in_source(&self.source),
        }
    }
}

/// What the command line says instead of the file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overrides {
    /// Instead of `test_count`; at least 1.
    pub runs: Option<u32>,
    /// Instead of `seed`.
    pub seed: Option<u64>,
    /// Instead of `repeat`; at least 1.
    pub repeat: Option<u32>,
    /// Instead of `[budget] time`. Unit: seconds.
    pub time_secs: Option<f64>,
    /// Instead of `[budget] until_width`.
    pub until_width: Option<f64>,
    /// Instead of `[budget] max_failures`.
    pub max_failures: Option<u64>,
    /// Only this part of the runs.
    pub shard: Option<Shard>,
    /// Instead of `[search] strategy`.
    pub search: Option<Strategy>,
    /// Instead of `[history] dir`; relative to where the program runs.
    pub history: Option<PathBuf>,
}

/// What performs the actions.
#[derive(Debug, Clone, PartialEq)]
pub enum Launcher {
    /// Our own skills, in process.
    Reference,
    /// A program of somebody's, for the actions that it knows; our own skills for the others.
    Program(Box<Skill>),
}

/// A range to draw from, both ends included.
pub type Range = (f64, f64);

/// What physics draws for each object, and what it is stepped with.
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
    /// Physics steps in a second.
    pub steps_per_second: u32,
    /// Solver iterations in a step.
    pub iterations: u32,
}

/// Standard deviations of what the robot senses and where it starts; 0 is perfect.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensing {
    /// Of a perceived object's position, horizontally. Unit: metres.
    pub position_noise_m: f64,
    /// Of a perceived object's height. Unit: metres.
    pub height_noise_m: f64,
    /// Of a perceived object's heading. Unit: radians.
    pub yaw_noise_rad: f64,
    /// Of a perceived object's dimensions. Unit: metres.
    pub size_noise_m: f64,
    /// Of where the base believes that it stands. Unit: metres.
    pub localisation_noise_m: f64,
    /// Of where the base believes that it heads. Unit: radians.
    pub heading_noise_rad: f64,
    /// Of a measured finger opening. Unit: metres.
    pub gripper_noise_m: f64,
    /// How the base finds out where it is while it drives.
    pub odometry: Odometry,
    /// The depth camera (`[camera]`).
    pub camera: Camera,
}

/// How the base's belief of where it stands changes as it drives; what counts in `[sensing]`. Standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Error of the way over the way, along it and across (`odometry_drift`).
    pub drift: f64,
    /// Error of the heading for each radian turned and for each metre of way (`heading_drift`). Unit: radians.
    pub heading_drift: f64,
    /// Way between two sights of landmarks, which correct the belief (`landmark_every_m`); 0 where there are none. Unit:
    /// metres.
    pub landmark_every_m: f64,
    /// Error of the position by landmarks (`landmark_noise_m`). Unit: metres.
    pub landmark_noise_m: f64,
    /// Error of the heading by landmarks (`landmark_noise_rad`). Unit: radians.
    pub landmark_noise_rad: f64,
}

impl Odometry {
    /// What the base believes at first it goes on believing.
    pub const IDEAL: Self =
        Self { drift: 0.0, heading_drift: 0.0, landmark_every_m: 0.0, landmark_noise_m: 0.0, landmark_noise_rad: 0.0 };
}

/// The depth camera on the robot's camera link: what its pictures are like, and what they get wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Angle between the outermost columns. Unit: radians. Pixels are square, which gives the other angle.
    pub field_of_view_rad: f64,
    /// Nothing nearer is seen. Unit: metres from the camera.
    pub min_range_m: f64,
    /// Nothing farther is seen. Unit: metres from the camera.
    pub max_range_m: f64,
    /// Standard deviation of the range at a distance of 1 m; it grows with the square of the distance. Unit: metres.
    pub range_noise_m: f64,
    /// Share of pixels without a value, anywhere.
    pub dropout: f64,
    /// Angle between ray and surface below which pixels are lost: all of them at 0, none at this angle. Unit: radians.
    pub grazing_rad: f64,
}

impl Camera {
    /// 320 × 240 pixels, 57 degrees wide, from 0.3 to 5 m like the depth cameras of service robots, and without faults.
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

/// Limits on one action. Beyond them it ends as `timeout`.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// Simulated time of one action. Unit: seconds.
    pub action_secs: f64,
}

/// Limits on one run and on the whole campaign; nothing means none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Time of one run on the clock; beyond it the run ends as `timeout`. Unit: seconds.
    pub run_secs: Option<f64>,
    /// Time of the campaign on the clock. Unit: seconds.
    pub time_secs: Option<f64>,
    /// The campaign ends when the 95 % interval of every property is at most so wide. In (0, 1).
    pub until_width: Option<f64>,
    /// The campaign ends when in so many runs a property failed; at least 1.
    pub max_failures: Option<u64>,
}

impl Limits {
    /// The same with what the command line says instead.
    pub(super) fn overridden(self, overrides: &Overrides) -> Self {
        Self {
            run_secs: self.run_secs,
            time_secs: overrides.time_secs.or(self.time_secs),
            until_width: overrides.until_width.or(self.until_width),
            max_failures: overrides.max_failures.or(self.max_failures),
        }
    }
}
