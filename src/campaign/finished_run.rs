//! A run that is made and judged, before it has a place in a history.

use actcheck_base::{Judgement, RunFacts};
use actcheck_data::{Choice, Quality, Scene, Trace};
use actcheck_history::{Repetition, RunRecord, RunScene, RunStatus};

/// The results of a run.
#[derive(Debug)]
pub(super) struct FinishedRun {
    /// Position in the campaign, from 0.
    pub(super) index: u64,
    /// Names of the actions, joined by a space.
    pub(super) test: String,
    /// Seed of the campaign.
    pub(super) seed: u64,
    pub(super) status: RunStatus,
    /// Why it did not complete; `None` if it did.
    pub(super) reason: Option<String>,
    /// The last lines that the program printed, if its fault ended the run.
    pub(super) program_output: Option<String>,
    pub(super) score: f64,
    pub(super) action_scores: Vec<f64>,
    pub(super) choices: Vec<Choice>,
    pub(super) scene: Scene,
    /// IRIs of the actions.
    pub(super) actions: Vec<String>,
    pub(super) trace: Trace,
    pub(super) facts: RunFacts,
    pub(super) judgements: Vec<Vec<Judgement>>,
    /// `None` if the scene could not be simulated.
    pub(super) quality: Option<Quality>,
    /// RFC 3339.
    pub(super) started: String,
    pub(super) wall_secs: f64,
}

/// The place of a run in a history.
#[derive(Debug, Clone)]
pub(super) struct RunPlace {
    /// Id of its campaign.
    pub(super) campaign: String,
    /// Id of the run that it was shrunk from.
    pub(super) shrunk_from: Option<String>,
    /// Scene and repetition, if scenes are run more than once.
    pub(super) repetition: Option<Repetition>,
    /// Importance weight of its scene, if a search chose it.
    pub(super) weight: Option<f64>,
    /// Why each scene that was drawn before was discarded, in order.
    pub(super) discards: Vec<String>,
    /// Wall-clock time from the campaign's start until the run is made. Unit: seconds.
    pub(super) elapsed_secs: f64,
}

impl RunPlace {
    /// The place of the only run of a campaign, or of a run that is not stored. It takes no time of
    /// a campaign.
    pub(super) fn alone(campaign: &str) -> Self {
        Self {
            campaign: campaign.to_owned(),
            shrunk_from: None,
            repetition: None,
            weight: None,
            discards: Vec::new(),
            elapsed_secs: 0.0,
        }
    }
}

impl FinishedRun {
    /// The record of the run for a history.
    pub(super) fn into_record(self, place: RunPlace) -> RunRecord {
        RunRecord {
            id: format!("{}-{}", place.campaign, self.index + 1),
            campaign: place.campaign,
            shrunk_from: place.shrunk_from,
            index: self.index,
            repetition: place.repetition,
            weight: place.weight,
            test: self.test,
            seed: self.seed,
            status: self.status,
            reason: self.reason,
            program_output: self.program_output,
            score: self.score,
            action_scores: self.action_scores,
            discards: place.discards,
            choices: self.choices,
            scene: RunScene::of(&self.scene),
            episode: None,
            trace: self.trace,
            facts: self.facts,
            actions: self.actions,
            judgements: self.judgements,
            quality: self.quality,
            started: self.started,
            wall_secs: self.wall_secs,
            elapsed_secs: place.elapsed_secs,
        }
    }
}
