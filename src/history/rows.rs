//! Plain data that is read from a history.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::campaign_state::CampaignState;
use crate::{EpisodeRecord, Repetition, RunStatus, SkillRecord};
use actcheck_base::{Judgement, Outcome};
use actcheck_data::Role;

/// Selects runs; the default selects all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RunFilter {
    /// Only runs of this campaign.
    pub campaign: Option<String>,
    /// Only runs of this test (names of its actions, joined by a space).
    pub test: Option<String>,
    /// Only runs with this status.
    pub status: Option<RunStatus>,
}

/// One run in a list.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRow {
    /// Its id, such as `k7f3-3`.
    pub run: String,
    /// Id of its campaign.
    pub campaign: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Scene and repetition, if scenes are run more than once.
    pub repetition: Option<Repetition>,
    /// Importance weight of its scene, if scenes were drawn from another distribution than the
    /// configuration's.
    pub weight: Option<f64>,
    /// Names of the actions, joined by a space.
    pub test: String,
    /// How it ended.
    pub status: RunStatus,
    /// The paper's S.
    pub score: f64,
    /// Digest over every state.
    pub trace_hash: String,
    /// RFC 3339.
    pub started: String,
}

/// One campaign in a list.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRow {
    /// Its id, such as `k7f3`.
    pub id: String,
    /// Name of its configuration.
    pub name: String,
    /// RFC 3339.
    pub started: String,
    /// RFC 3339; `None` if the program was killed.
    pub ended: Option<String>,
    /// The budget that ended it: `time`, `width` or `failures`.
    pub ended_by: Option<String>,
    /// Whether it was stopped before all its runs were done or a budget was spent.
    pub interrupted: bool,
    /// Seed of all randomness.
    pub seed: u64,
    /// Number of planned runs.
    pub planned_runs: u64,
    /// Number of stored runs.
    pub runs: u64,
    /// The paper's T.
    pub score: Option<f64>,
    /// The same without the broken runs.
    pub score_without_broken: Option<f64>,
    /// Counts of outcomes; empty if the campaign never ended.
    pub outcomes: BTreeMap<Outcome, u64>,
    /// Version of the program that ran it.
    pub program_version: String,
    /// Digest of the configuration's text.
    pub config_digest: String,
    /// Digest of the ontology.
    pub ontology_digest: String,
    /// The program that performed actions; `None` if the reference skills performed all.
    pub skill: Option<SkillRecord>,
    /// The engine of an imported campaign; `None` if it was simulated here.
    pub imported_from: Option<String>,
}

impl CampaignRow {
    pub(crate) fn of(state: &CampaignState, runs: u64) -> Self {
        let (record, end) = (&state.record, state.end.as_ref());
        Self {
            id: record.id.clone(),
            imported_from: record.imported_from.clone(),
            name: record.name.clone(),
            started: record.started.clone(),
            ended: end.map(|end| end.ended.clone()),
            ended_by: end.and_then(|end| end.ended_by.clone()),
            interrupted: end.is_none_or(|end| end.interrupted),
            seed: record.seed,
            planned_runs: record.planned_runs,
            runs,
            score: end.and_then(|end| end.score),
            score_without_broken: end.and_then(|end| end.score_without_broken),
            outcomes: end.map(|end| end.outcomes.clone()).unwrap_or_default(),
            program_version: record.program_version.clone(),
            config_digest: record.config_digest.clone(),
            ontology_digest: record.ontology_digest.clone(),
            skill: record.skill.clone(),
        }
    }
}

/// Outcome of one property in one action execution.
#[derive(Debug, Clone, PartialEq)]
pub struct OutcomeRow {
    /// Id of the run.
    pub run: String,
    /// Id of its campaign.
    pub campaign: String,
    /// Position of the run in the campaign, from 0.
    pub index: u64,
    /// Names of the run's actions, joined by a space.
    pub test: String,
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// IRI of the property.
    pub property: String,
    /// The outcome.
    pub outcome: Outcome,
    /// How far the outcome was from flipping, in the property's unit.
    pub margin: Option<f64>,
}

/// All details of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunDetail {
    /// The run as in a list.
    pub row: RunRow,
    /// Seed of the campaign.
    pub seed: u64,
    /// Why it did not complete.
    pub reason: Option<String>,
    /// The last lines that the program printed, if its fault ended the run.
    pub program_output: Option<String>,
    /// Why each scene that was drawn before was discarded, in order.
    pub discards: Vec<String>,
    /// Unit: seconds.
    pub wall_secs: f64,
    /// Wall-clock time from the campaign's start until the run was stored. Unit: seconds.
    pub elapsed_secs: f64,
    /// Name of the world.
    pub world: String,
    /// The episode that it was imported from; `None` if it was simulated here.
    pub episode: Option<EpisodeRecord>,
    /// Version of the program that ran it.
    pub program_version: String,
    /// Initial pose of the base. Units: metres, metres, radians. Shape: x, y, heading.
    pub robot_base: [f64; 3],
    /// Standard deviations of sensing by name of their term, such as `positionNoise`. Units:
    /// metres, radians.
    pub noise: BTreeMap<String, f64>,
    /// Values of the designators.
    pub designators: BTreeMap<String, Vec<String>>,
    /// Objects of the scene: platforms, targets, others, obstacles; each kind by id.
    pub objects: Vec<ObjectDetail>,
    /// Its actions in order.
    pub actions: Vec<ActionDetail>,
}

/// One object of a run's scene: its initial pose, its physics, and its later displacement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectDetail {
    /// Id in the scene.
    pub id: String,
    /// Name of its model.
    pub model: String,
    /// Its class: an IRI.
    pub category: String,
    /// Its role in the scene.
    pub role: Role,
    /// Unit: metres.
    pub x: f64,
    /// Unit: metres.
    pub y: f64,
    /// Unit: metres.
    pub z: f64,
    /// Unit: radians.
    pub yaw: f64,
    /// Unit: kilograms.
    pub mass_kg: f64,
    /// Sliding friction coefficient.
    pub friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Horizontal distance from the base. Unit: metres.
    pub robot_distance_m: f64,
    /// Horizontal distance to the nearest other object, except platforms. Unit: metres.
    pub neighbour_distance_m: Option<f64>,
    /// Horizontal distance to the nearest target; `None` for a target. Unit: metres.
    pub target_distance_m: Option<f64>,
    /// Largest distance from its position before an action. Unit: metres.
    pub displacement_m: Option<f64>,
    /// Largest angle from the vertical during an action. Unit: radians.
    pub max_tilt_rad: Option<f64>,
}

/// One action of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActionDetail {
    /// Position in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// The paper's A.
    pub score: f64,
    /// Whether it reported success; `None` without a report.
    pub reported: Option<bool>,
    /// The message of its report, or why it did not complete.
    pub message: Option<String>,
    /// Simulated time. Unit: seconds.
    pub duration_secs: f64,
    /// `completed`, `broken`, `timeout` or `untested`.
    pub end: String,
    /// Values of the designators in force.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// Outcomes, sorted by property.
    pub judgements: Vec<Judgement>,
}
