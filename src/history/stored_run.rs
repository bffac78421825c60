//! A run as its history stores it, without its choices, states and motion: plain values, from which
//! its rows in lists, its details and its statements are made.

use std::collections::BTreeMap;

use oxigraph::model::Literal;
use serde::{Deserialize, Serialize};

use crate::{
    ActionDetail, EpisodeRecord, ObjectDetail, Repetition, RunDetail, RunObject, RunRecord, RunRow,
    RunStatus, SceneDigest,
};
use actcheck_base::Judgement;
use actcheck_data::{ActionEnd, ActionTrace, Quality, Role, Scene};

/// Local names of the terms for sensing errors, in the order of [`noise`].
pub const NOISE_TERMS: [&str; 13] = [
    "positionNoise",
    "heightNoise",
    "yawNoise",
    "sizeNoise",
    "localisationNoise",
    "headingNoise",
    "gripperNoise",
    "rangeNoise",
    "odometryDrift",
    "odometryHeadingDrift",
    "landmarkDistance",
    "landmarkNoise",
    "landmarkHeadingNoise",
];

/// Returns the sensing errors of a scene, most of them standard deviations, with the local names of
/// their terms. Units: those of the terms.
pub fn noise(scene: &Scene) -> [(&'static str, f64); 13] {
    let sensing = &scene.sensing;
    let odometry = &sensing.odometry;
    let values = [
        sensing.position_noise_m,
        sensing.height_noise_m,
        sensing.yaw_noise_rad,
        sensing.size_noise_m,
        sensing.localisation_noise_m,
        sensing.heading_noise_rad,
        sensing.gripper_noise_m,
        sensing.camera.range_noise_m,
        odometry.drift,
        odometry.heading_drift,
        odometry.landmark_every_m,
        odometry.landmark_noise_m,
        odometry.landmark_noise_rad,
    ];
    std::array::from_fn(|idx| (NOISE_TERMS[idx], values[idx]))
}

/// The values of one run. Its campaign's id is that of the place where it is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StoredRun {
    /// Position in the campaign, from 0.
    pub index: u64,
    pub repetition: Option<Repetition>,
    pub weight: Option<f64>,
    /// Id of the run that it was shrunk from, in any campaign.
    pub shrunk_from: Option<String>,
    pub test: String,
    pub seed: u64,
    pub status: RunStatus,
    pub reason: Option<String>,
    pub program_output: Option<String>,
    pub score: f64,
    pub discards: Vec<String>,
    /// Digest over every state.
    pub trace_hash: String,
    pub quality: Option<Quality>,
    /// RFC 3339.
    pub started: String,
    pub wall_secs: f64,
    pub elapsed_secs: f64,
    /// Version of the program that ran it.
    pub program_version: String,
    /// The episode that it was imported from.
    pub episode: Option<EpisodeRecord>,
    pub scene: StoredScene,
    /// Number of states between actions.
    pub states: u32,
    pub actions: Vec<StoredAction>,
}

/// The scene of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StoredScene {
    pub world: String,
    /// Name of the robot's profile.
    pub robot: String,
    /// Initial pose of the base. Units: metres, metres, radians.
    pub base: [f64; 3],
    /// Sensing errors, in the order of [`crate::NOISE_TERMS`]; empty for an imported run.
    pub noise: Vec<f64>,
    pub designators: BTreeMap<String, Vec<String>>,
    /// The objects in the order of the scene.
    pub objects: Vec<ObjectDetail>,
}

/// One action of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StoredAction {
    /// IRI; `None` if the run broke before its actions were known.
    pub action: Option<String>,
    /// The paper's A.
    pub score: Option<f64>,
    pub reported: Option<bool>,
    pub message: Option<String>,
    /// Simulated time. Unit: seconds.
    pub duration_secs: f64,
    /// The word for how it ended.
    pub end: String,
    pub parameters: BTreeMap<String, Vec<String>>,
    /// Whether anything happened during the action that is stated as a fact.
    pub has_events: bool,
    /// Outcomes in the order of the action's properties.
    pub judgements: Vec<Judgement>,
}

impl StoredRun {
    pub(crate) fn of(record: &RunRecord) -> Self {
        Self {
            index: record.index,
            repetition: record.repetition,
            weight: record.weight,
            shrunk_from: record.shrunk_from.clone(),
            test: record.test.clone(),
            seed: record.seed,
            status: record.status,
            reason: record.reason.clone(),
            program_output: record.program_output.clone(),
            score: record.score,
            discards: record.discards.clone(),
            trace_hash: record.trace.hash.clone(),
            quality: record.quality,
            started: record.started.clone(),
            wall_secs: record.wall_secs,
            elapsed_secs: record.elapsed_secs,
            program_version: env!("CARGO_PKG_VERSION").to_owned(),
            episode: record.episode.clone(),
            scene: StoredScene::of(record),
            states: u32::try_from(record.facts.snapshots.len()).unwrap_or(u32::MAX),
            actions: record
                .trace
                .actions
                .iter()
                .enumerate()
                .map(|(step, action)| StoredAction::of(record, step, action))
                .collect(),
        }
    }

    /// Its id in a campaign.
    pub(crate) fn id_in(&self, campaign: &str) -> String {
        format!("{campaign}-{}", self.index + 1)
    }

    /// The objects of its scene, sorted by role and id.
    pub(crate) fn objects(&self) -> Vec<ObjectDetail> {
        let mut objects = self.scene.objects.clone();
        objects.sort_by(|a, b| (a.role, &a.id).cmp(&(b.role, &b.id)));
        objects
    }

    /// Its actions, with their outcomes sorted by property.
    pub(crate) fn actions(&self) -> Vec<ActionDetail> {
        let action = |(step, action): (u32, &StoredAction)| {
            let mut judgements = action.judgements.clone();
            judgements.sort_by(|a, b| a.property.cmp(&b.property));
            ActionDetail {
                step,
                action: action.action.clone().unwrap_or_default(),
                score: action.score.unwrap_or_default(),
                reported: action.reported,
                message: action.message.clone(),
                duration_secs: action.duration_secs,
                end: action.end.clone(),
                parameters: sorted(&action.parameters),
                judgements,
            }
        };
        (1..).zip(&self.actions).map(action).collect()
    }

    /// Digests of its scene.
    pub(crate) fn scene_digest(&self) -> SceneDigest {
        let [x, y, yaw] = self
            .scene
            .base
            .map(|value| Literal::from(value).value().to_owned());
        let whole = [self.test.clone(), self.scene.world.clone(), x, y, yaw];
        SceneDigest::of(&whole, &sorted(&self.scene.designators), &self.objects())
    }
}

impl StoredRun {
    /// The run as in a list.
    pub(crate) fn row(&self, campaign: &str) -> RunRow {
        RunRow {
            run: self.id_in(campaign),
            campaign: campaign.to_owned(),
            index: self.index,
            repetition: self.repetition,
            weight: self.weight,
            test: self.test.clone(),
            status: self.status,
            score: self.score,
            trace_hash: self.trace_hash.clone(),
            started: self.started.clone(),
        }
    }

    /// All its details: objects sorted by role and id, outcomes by property, designators' values
    /// alphabetically.
    pub(crate) fn detail(&self, campaign: &str) -> RunDetail {
        RunDetail {
            row: self.row(campaign),
            seed: self.seed,
            reason: self.reason.clone(),
            program_output: self.program_output.clone(),
            discards: self.discards.clone(),
            wall_secs: self.wall_secs,
            elapsed_secs: self.elapsed_secs,
            world: self.scene.world.clone(),
            episode: self.episode.clone(),
            program_version: self.program_version.clone(),
            robot_base: self.scene.base,
            noise: crate::NOISE_TERMS
                .into_iter()
                .map(str::to_owned)
                .zip(self.scene.noise.iter().copied())
                .collect(),
            designators: sorted(&self.scene.designators),
            objects: self.objects(),
            actions: self.actions(),
        }
    }
}

/// Designators whose values are sorted: the order of several values has no meaning.
fn sorted(designators: &BTreeMap<String, Vec<String>>) -> BTreeMap<String, Vec<String>> {
    let sorted = |values: &Vec<String>| {
        let mut values = values.clone();
        values.sort();
        values.dedup();
        values
    };
    designators
        .iter()
        .map(|(name, values)| (name.clone(), sorted(values)))
        .collect()
}

impl StoredScene {
    fn of(record: &RunRecord) -> Self {
        let scene = &record.scene;
        Self {
            world: scene.world.clone(),
            robot: scene.robot.clone(),
            base: scene.base,
            noise: scene.noise.iter().map(|(_, value)| *value).collect(),
            designators: scene.designators.clone(),
            objects: scene
                .objects
                .iter()
                .map(|object| stored_object(record, object))
                .collect(),
        }
    }
}

fn stored_object(record: &RunRecord, object: &RunObject) -> ObjectDetail {
    let extremes = || {
        let actions = record.trace.actions.iter();
        actions
            .flat_map(|action| &action.extremes)
            .filter(|extremes| extremes.id == object.id)
    };
    let [x, y, z] = object.pose.position;
    let base = record.scene.base;
    let is_neither = object.role != Role::Platform && object.role != Role::Target;
    ObjectDetail {
        id: object.id.clone(),
        model: object.model.clone(),
        category: object.category.clone(),
        role: object.role,
        x,
        y,
        z,
        yaw: object.pose.yaw(),
        mass_kg: object.mass_kg,
        friction: object.friction,
        restitution: object.restitution,
        robot_distance_m: libm::hypot(x - base[0], y - base[1]),
        neighbour_distance_m: nearest(record, object, |other| other.role != Role::Platform),
        target_distance_m: is_neither
            .then(|| nearest(record, object, |other| other.role == Role::Target))
            .flatten(),
        displacement_m: largest(extremes().map(|extremes| extremes.max_displacement_m)),
        max_tilt_rad: largest(extremes().map(|extremes| extremes.max_tilt_rad)),
    }
}

/// Horizontal distance from an object to the nearest other object that satisfies `among`.
fn nearest(
    record: &RunRecord,
    object: &RunObject,
    among: impl Fn(&RunObject) -> bool,
) -> Option<f64> {
    let [x, y, _] = object.pose.position;
    record
        .scene
        .objects
        .iter()
        .filter(|other| other.id != object.id && among(other))
        .map(|other| libm::hypot(other.pose.position[0] - x, other.pose.position[1] - y))
        .min_by(f64::total_cmp)
}

fn largest(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.max_by(f64::total_cmp)
}

impl StoredAction {
    fn of(record: &RunRecord, step: usize, action: &ActionTrace) -> Self {
        Self {
            action: record.actions.get(step).cloned(),
            score: record.action_scores.get(step).copied(),
            reported: action.report.as_ref().map(|report| report.succeeded),
            message: message(action).map(str::to_owned),
            duration_secs: action.duration_secs,
            end: end_word(&action.end).to_owned(),
            parameters: action.parameters.clone(),
            has_events: record
                .facts
                .during
                .get(step)
                .is_some_and(|during| !during.is_empty()),
            judgements: record.judgements.get(step).cloned().unwrap_or_default(),
        }
    }
}

/// The word for how an action ended.
fn end_word(end: &ActionEnd) -> &'static str {
    match end {
        ActionEnd::Completed => "completed",
        ActionEnd::Broken(_) => "broken",
        ActionEnd::Timeout(_) | ActionEnd::Cut(_) => "timeout",
        ActionEnd::NotReached => "untested",
        ActionEnd::NotPerformed(_) => "inapplicable",
    }
}

/// The message of an action: why it did not complete, or the message of its report.
fn message(action: &ActionTrace) -> Option<&str> {
    match &action.end {
        ActionEnd::Broken(reason)
        | ActionEnd::Timeout(reason)
        | ActionEnd::Cut(reason)
        | ActionEnd::NotPerformed(reason) => Some(reason),
        ActionEnd::Completed | ActionEnd::NotReached => {
            action.report.as_ref().map(|report| report.message.as_str())
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use actcheck_base::Outcome;

    /// A run of a campaign of picks: every third one fails.
    pub(crate) fn sample(index: u64) -> StoredRun {
        let failed = index.is_multiple_of(3);
        let object = |id: &str, role, x| ObjectDetail {
            id: id.to_owned(),
            model: "glass".to_owned(),
            category: "https://w3id.org/actcheck/objects#Glass".to_owned(),
            role,
            x,
            y: 0.1 * index as f64,
            z: 0.7,
            yaw: -0.0,
            mass_kg: 0.3,
            friction: 0.6,
            restitution: 1e-300,
            robot_distance_m: 1.0,
            neighbour_distance_m: Some(0.25),
            target_distance_m: (role == Role::Other).then_some(0.25),
            displacement_m: None,
            max_tilt_rad: Some(0.01),
        };
        let judgement = |property: &str, outcome| Judgement {
            property: format!("http://actions#{property}"),
            outcome,
            margin: (property == "CloseObject").then_some(0.01 * index as f64),
            witness: format!("glass_1 is {index} cm from the gripper"),
            rule_digest: "0123456789abcdef0123456789abcdef".to_owned(),
            held_before: (index == 1).then_some(true),
            vacuous: None,
        };
        let outcome = if failed {
            Outcome::Failed
        } else {
            Outcome::Passed
        };
        StoredRun {
            index,
            repetition: (index == 2).then_some(Repetition {
                scene: 1,
                number: 1,
            }),
            weight: (index == 3).then_some(0.5),
            shrunk_from: None,
            test: "Pick".to_owned(),
            seed: u64::MAX,
            status: RunStatus::Completed,
            reason: failed.then(|| "it fell".to_owned()),
            program_output: None,
            score: 0.1 + 0.2,
            discards: vec!["found no free place for `plate`".to_owned(); index as usize % 2],
            // A run that broke before its first state has no hash.
            trace_hash: if index == 4 {
                String::new()
            } else {
                format!("{:032x}", u128::from(index) << 90)
            },
            quality: (!failed).then_some(Quality::default()),
            started: "2026-08-01T12:00:00.25Z".to_owned(),
            wall_secs: 1.25,
            elapsed_secs: 2.5,
            program_version: "0.1.0".to_owned(),
            episode: (index == 3).then(|| EpisodeRecord {
                file: "demo.hdf5".to_owned(),
                key: "demo_1".to_owned(),
                digest: "0123".to_owned(),
                about: [("engine".to_owned(), "MuJoCo".to_owned())].into(),
            }),
            scene: StoredScene {
                world: "room".to_owned(),
                robot: "fixed_arm".to_owned(),
                base: [0.5, -1.0, 0.0],
                noise: vec![0.0; 13],
                designators: [("pickObject".to_owned(), vec!["glass_1".to_owned()])].into(),
                objects: vec![
                    object("glass_1", Role::Target, 0.2),
                    object("glass_2", Role::Other, 0.4),
                ],
            },
            states: 2,
            actions: vec![
                StoredAction {
                    action: Some("http://actions#Pick".to_owned()),
                    score: Some(1.0),
                    reported: Some(true),
                    message: None,
                    duration_secs: 19.5,
                    end: "completed".to_owned(),
                    parameters: BTreeMap::new(),
                    has_events: true,
                    judgements: vec![
                        judgement("CloseObject", outcome),
                        judgement("MovedObject", Outcome::Passed),
                    ],
                },
                StoredAction {
                    action: None,
                    score: None,
                    reported: None,
                    message: Some("not reached".to_owned()),
                    duration_secs: 0.0,
                    end: "untested".to_owned(),
                    parameters: BTreeMap::new(),
                    has_events: false,
                    judgements: Vec::new(),
                },
            ],
        }
    }
}
