//! The stored data of campaigns and runs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use actcheck_base::{Diagnostic, Judgement, Outcome, RunFacts, Shard};
use actcheck_data::{Choice, Pose, Quality, Role, Scene, SceneObject, Trace};

/// A campaign, written before its first run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CampaignRecord {
    /// Short id, such as `k7f3`; unique in its history.
    pub id: String,
    /// The configuration's file name without its extension.
    pub name: String,
    /// The configuration's text.
    pub config_text: String,
    /// Digest of that text.
    pub config_digest: String,
    /// Path of the configuration relative to the history's folder; absolute if no relative path
    /// exists.
    pub config_path: String,
    /// Digest of the ontology.
    pub ontology_digest: String,
    /// Property IRI, rule path and digest of the rule file (with its libraries), sorted.
    pub rules: Vec<(String, String, String)>,
    /// Warnings about the ontology and the rules, sorted.
    pub findings: Vec<FindingRecord>,
    /// Digests of robot and models by name, sorted.
    pub models: Vec<(String, String)>,
    /// The program that performed actions; `None` if the reference skills performed all.
    pub skill: Option<SkillRecord>,
    /// Seed of all randomness.
    pub seed: u64,
    /// Number of planned runs; an upper limit if a budget ends the campaign.
    pub planned_runs: u64,
    /// Runs of each scene.
    pub repeat: u32,
    /// Budget of wall-clock time. Unit: seconds.
    pub time_secs: Option<f64>,
    /// Width of intervals at which the campaign ends.
    pub until_width: Option<f64>,
    /// Number of failed runs at which the campaign ends.
    pub max_failures: Option<u64>,
    /// The parts that the campaign consists of, sorted; empty if it was run as a whole.
    pub shards: Vec<Shard>,
    /// Name of the strategy by which its scenes were chosen.
    pub strategy: String,
    /// RFC 3339.
    pub started: String,
    /// Version of this program.
    pub program_version: String,
    /// Digest of the program's sources.
    pub program_digest: String,
    /// Version of the program's physics.
    pub physics: u32,
    /// The engine that computed the episodes of an imported campaign, such as `MuJoCo 3.3.1`; `None`
    /// if the campaign was simulated here.
    pub imported_from: Option<String>,
}

/// A warning about the ontology or the rules of a campaign.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FindingRecord {
    /// Its code, such as `R046`.
    pub code: String,
    /// The problem.
    pub message: String,
    /// File, line and column, as far as they are known.
    pub place: Option<String>,
}

impl FindingRecord {
    /// The record of a diagnostic.
    pub fn of(found: &Diagnostic) -> Self {
        Self {
            code: found.code.to_owned(),
            message: found.message.clone(),
            place: found.place(),
        }
    }
}

/// A program that performs actions, as recorded with a campaign.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkillRecord {
    /// Its command with its arguments, as the user wrote them.
    pub command: String,
    /// Digest of the command and its files.
    pub digest: String,
    /// Whether it received the ground truth of scenes, which no real robot has.
    pub privileged: bool,
}

impl SkillRecord {
    /// Remark on campaigns whose program received the ground truth.
    pub const PRIVILEGED: &str = "the program received the ground truth (`[skill] privileged = true`), which no real robot has";
}

/// How a run ended as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum RunStatus {
    /// Every action ended on its own.
    Completed,
    /// Simulation or tool failed.
    Broken,
    /// A budget was spent.
    Timeout,
}

impl RunStatus {
    /// The word for the status.
    pub fn word(self) -> &'static str {
        match self {
            Self::Completed => "completed",
            Self::Broken => "broken",
            Self::Timeout => "timeout",
        }
    }

    /// Parses the word of a status. Returns `None` for any other word.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Completed, Self::Broken, Self::Timeout]
            .into_iter()
            .find(|status| status.word() == word)
    }
}

/// The end of a campaign, with its results.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CampaignEnd {
    /// RFC 3339.
    pub ended: String,
    /// The paper's T; `None` without runs.
    pub score: Option<f64>,
    /// The same without the broken runs.
    pub score_without_broken: Option<f64>,
    /// Counts of all outcomes.
    pub outcomes: BTreeMap<Outcome, u64>,
    /// Number of discarded scenes.
    pub discards: u64,
    /// The budget that ended it: `time`, `width` or `failures`.
    pub ended_by: Option<String>,
    /// Whether it was stopped before all its runs were done or a budget was spent.
    pub interrupted: bool,
}

/// One of several runs of a scene, each with different noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Repetition {
    /// Number of the scene in its campaign, from 0.
    pub scene: u64,
    /// Number of the run among those of the scene, from 0.
    pub number: u64,
}

/// One run, complete.
#[derive(Debug, Clone)]
pub struct RunRecord {
    /// `CAMPAIGN-NUMBER`, such as `k7f3-3`. The number is the index + 1.
    pub id: String,
    /// Id of its campaign.
    pub campaign: String,
    /// Id of the run that it was shrunk from.
    pub shrunk_from: Option<String>,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Scene and repetition, if scenes are run more than once.
    pub repetition: Option<Repetition>,
    /// Importance weight of its scene, if a search draws scenes from another distribution than the
    /// configuration's: the nominal density divided by the sampling density.
    pub weight: Option<f64>,
    /// Names of the actions, joined by a space.
    pub test: String,
    /// Seed of the campaign.
    pub seed: u64,
    /// How it ended.
    pub status: RunStatus,
    /// Why it did not complete; `None` if it did.
    pub reason: Option<String>,
    /// The last lines that the program (which performs the actions) printed, if its fault ended the
    /// run.
    pub program_output: Option<String>,
    /// Mean of the action scores (the paper's S).
    pub score: f64,
    /// One for each action (the paper's A).
    pub action_scores: Vec<f64>,
    /// Why each scene that was drawn before was discarded, in order.
    pub discards: Vec<String>,
    /// Every choice.
    pub choices: Vec<Choice>,
    /// The scene.
    pub scene: RunScene,
    /// The trace.
    pub trace: Trace,
    /// The trace as facts.
    pub facts: RunFacts,
    /// IRIs of the actions, one for each action of the trace.
    pub actions: Vec<String>,
    /// One list for each action, in the order of its success properties.
    pub judgements: Vec<Vec<Judgement>>,
    /// Errors of the simulation; `None` if the scene could not be simulated.
    pub quality: Option<Quality>,
    /// The episode that it was imported from; `None` if it was simulated here.
    pub episode: Option<EpisodeRecord>,
    /// RFC 3339.
    pub started: String,
    /// Wall time. Unit: seconds.
    pub wall_secs: f64,
    /// Wall-clock time from the campaign's start until the run was stored. Unit: seconds.
    pub elapsed_secs: f64,
}

/// The scene of a run, as a history keeps it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunScene {
    /// Name of its world.
    pub world: String,
    /// Name of the robot.
    pub robot: String,
    /// Initial pose of the robot's base. Units: metres, metres, radians. Shape: x, y, heading.
    pub base: [f64; 3],
    /// Sensing errors with the local names of their terms ([`noise`](crate::noise)); empty for a
    /// run that was not simulated here.
    pub noise: Vec<(&'static str, f64)>,
    /// Values of the designators: ids of objects, or names of locations.
    pub designators: BTreeMap<String, Vec<String>>,
    /// Its objects in order.
    pub objects: Vec<RunObject>,
}

/// One object of a [`RunScene`].
#[derive(Debug, Clone, PartialEq)]
pub struct RunObject {
    /// Unique in the scene.
    pub id: String,
    /// Name of its model.
    pub model: String,
    /// IRI of its class.
    pub category: String,
    /// Its role in the scene.
    pub role: Role,
    /// Initial pose of the model's origin.
    pub pose: Pose,
    /// Unit: kilograms.
    pub mass_kg: f64,
    /// Sliding friction coefficient.
    pub friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
}

impl RunScene {
    /// The record of a simulated scene.
    pub fn of(scene: &Scene) -> Self {
        Self {
            world: scene.world.clone(),
            robot: scene.robot.profile.core.name.clone(),
            base: scene.robot.base,
            noise: crate::noise(scene).into(),
            designators: scene.designators.clone(),
            objects: scene.objects.iter().map(RunObject::of).collect(),
        }
    }
}

impl RunObject {
    fn of(object: &SceneObject) -> Self {
        Self {
            id: object.id.clone(),
            model: object.model.name.clone(),
            category: object.model.category.clone(),
            role: object.role,
            pose: object.pose,
            mass_kg: object.mass_kg,
            friction: object.friction,
            restitution: object.restitution,
        }
    }
}

/// The origin of a run that was imported from an episode of another simulator, or of a robot.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EpisodeRecord {
    /// Path of the file, as given.
    pub file: String,
    /// Key of the episode in its file; empty if the file holds only one.
    pub key: String,
    /// Digest of the states as they were imported.
    pub digest: String,
    /// Everything that the recorder or the converter stated: engine, versions, environment, task,
    /// source and notes.
    pub about: BTreeMap<String, String>,
}
