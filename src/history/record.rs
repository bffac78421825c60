//! What is kept of a campaign and of a run.

use std::collections::BTreeMap;

use crate::actions::{Quality, Trace};
use crate::base::{Choice, Shard};
use crate::facts::RunFacts;
use crate::scenario::Scene;
use crate::verdict::{Judgement, Outcome};

/// A campaign, written before its first run.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRecord {
    /// Short id, such as `k7f3`; unique in its history.
    pub id: String,
    /// The configuration's file name without its ending.
    pub name: String,
    /// The configuration's text.
    pub config_text: String,
    /// Digest of that text.
    pub config_digest: String,
    /// Where the configuration lies, seen from the history's folder; absolute where there is no way from there.
    pub config_path: String,
    /// Digest of the ontology.
    pub ontology_digest: String,
    /// Property IRI, rule path and digest of the rule file (with its libraries), sorted.
    pub rules: Vec<(String, String, String)>,
    /// Digests of robot and models by name, sorted.
    pub models: Vec<(String, String)>,
    /// The program that performed actions; nothing where the reference skills performed all.
    pub skill: Option<SkillRecord>,
    /// Seed of all randomness.
    pub seed: u64,
    /// How many runs were asked for; where budgets end the campaign, at most so many.
    pub planned_runs: u64,
    /// Runs of each scene.
    pub repeat: u32,
    /// Budget of time on the clock. Unit: seconds.
    pub time_secs: Option<f64>,
    /// Width of intervals at which the campaign ends.
    pub until_width: Option<f64>,
    /// Number of failed runs at which the campaign ends.
    pub max_failures: Option<u64>,
    /// The parts of these runs that it is made of, sorted; none: it was run as a whole.
    pub shards: Vec<Shard>,
    /// Name of the strategy by which its scenes were chosen.
    pub strategy: String,
    /// RFC 3339.
    pub started: String,
    /// Version of this program.
    pub program_version: String,
    /// Digest of its sources; empty where an earlier one wrote the campaign.
    pub program_digest: String,
}

/// A program that performs actions, as a campaign's record has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SkillRecord {
    /// Its command with its arguments, as the user wrote them.
    pub command: String,
    /// Digest of the command and of its files.
    pub digest: String,
    /// Whether it was told the truth about scenes, which no robot knows.
    pub privileged: bool,
}

impl SkillRecord {
    /// What is to be said of campaigns whose program was told the truth.
    pub const PRIVILEGED: &str =
        "the program was told where everything truly is (`[skill] privileged = true`), which no robot is";
}

/// How a run ended as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RunStatus {
    /// Every action came to its own end.
    Completed,
    /// Simulation or tool failed.
    Broken,
    /// A budget was spent.
    Timeout,
}

impl RunStatus {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Completed => "completed",
            Self::Broken => "broken",
            Self::Timeout => "timeout",
        }
    }

    /// The status of a word.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Completed, Self::Broken, Self::Timeout].into_iter().find(|status| status.word() == word)
    }
}

/// What is known of a campaign when it ends.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CampaignEnd {
    /// RFC 3339.
    pub ended: String,
    /// The paper's T; nothing where there was no run.
    pub score: Option<f64>,
    /// The same over the runs that were not broken.
    pub score_without_broken: Option<f64>,
    /// Counts of all outcomes.
    pub outcomes: BTreeMap<Outcome, u64>,
    /// Scenes that were drawn for its runs and discarded.
    pub discards: u64,
    /// The budget that ended it: `time`, `width` or `failures`.
    pub ended_by: Option<String>,
    /// Whether it was stopped before all its runs were done or a budget was spent.
    pub interrupted: bool,
}

/// One of several runs of a scene, each with other noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Repetition {
    /// Number of the scene in its campaign, from 0.
    pub scene: u64,
    /// Number of the run among those of the scene, from 0.
    pub number: u64,
}

/// One run, complete: written in one transaction.
#[derive(Debug, Clone)]
pub struct RunRecord {
    /// `CAMPAIGN-NUMBER`, such as `k7f3-3`. The number is the index + 1.
    pub id: String,
    /// Id of its campaign.
    pub campaign: String,
    /// Id of the run that it is a smaller form of.
    pub shrunk_from: Option<String>,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Which run of which scene it is, where scenes are run more than once.
    pub repetition: Option<Repetition>,
    /// Importance weight of its scene, where scenes are not drawn as the configuration's ranges say: the nominal
    /// density by the one that it was drawn from.
    pub weight: Option<f64>,
    /// Names of the actions, joined by a space.
    pub test: String,
    /// Seed of the campaign.
    pub seed: u64,
    /// How it ended.
    pub status: RunStatus,
    /// Why, where it did not complete.
    pub reason: Option<String>,
    /// The last lines that the program printed, where a fault of its own ended the run: it performs the actions then.
    pub program_output: Option<String>,
    /// Mean of the action scores (the paper's S).
    pub score: f64,
    /// One for each action (the paper's A).
    pub action_scores: Vec<f64>,
    /// Why each scene that was drawn for it before could not be used, in order.
    pub discards: Vec<String>,
    /// Every decision.
    pub choices: Vec<Choice>,
    /// The scene.
    pub scene: Scene,
    /// What happened.
    pub trace: Trace,
    /// The same as facts.
    pub facts: RunFacts,
    /// IRIs of the actions, one for each action of the trace.
    pub actions: Vec<String>,
    /// One list for each action, in the order of its success properties.
    pub judgements: Vec<Vec<Judgement>>,
    /// What simulation got wrong; nothing where it did not come to that.
    pub quality: Option<Quality>,
    /// RFC 3339.
    pub started: String,
    /// Wall time. Unit: seconds.
    pub wall_secs: f64,
    /// Time on the clock that the campaign had taken when it was kept. Unit: seconds.
    pub elapsed_secs: f64,
}
