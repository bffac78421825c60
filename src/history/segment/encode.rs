//! A run as the contents of two frames: its values in lists, and all others.
//!
//! TextTable that are alike in many runs are stored once in a segment: the frame in which one
//! occurs first holds it, later ones its number.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::segment::frame::FramePlace;
use crate::stored_run::{StoredAction, StoredRun, StoredScene};
use crate::{Repetition, RunStatus, SceneDigest};
use actcheck_base::{Judgement, Outcome};
use actcheck_data::Quality;

/// Where the other frames of a run are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Places {
    pub details: FramePlace,
    pub states: FramePlace,
    /// `None` if its motion is not kept.
    pub motion: Option<FramePlace>,
}

/// The values of a run in lists.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct RunEntry {
    /// Position in the campaign, from 0.
    pub index: u64,
    pub repetition: Option<Repetition>,
    pub weight: Option<f64>,
    /// Number of the text.
    pub test: u32,
    pub status: RunStatus,
    pub score: f64,
    trace_hash: Hash,
    pub started: String,
    pub wall_secs: f64,
    pub elapsed_secs: f64,
    pub quality: Option<Quality>,
    scene: [Hash; 2],
    /// Numbers of the actions' IRIs.
    pub actions: Vec<Option<u32>>,
    pub outcomes: Vec<EntryOutcome>,
    pub places: Places,
}

/// One outcome of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct EntryOutcome {
    /// Position of the action, from 0.
    pub action: u32,
    /// Number of the property's IRI.
    pub property: u32,
    pub outcome: Outcome,
    pub margin: Option<f64>,
}

/// A digest: 32 hexadecimal digits take 16 bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum Hash {
    Bytes([u8; 16]),
    Text(String),
}

impl Hash {
    fn of(text: &str) -> Self {
        match u128::from_str_radix(text, 16) {
            Ok(value) if format!("{value:032x}") == text => Self::Bytes(value.to_be_bytes()),
            _ => Self::Text(text.to_owned()),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Bytes(bytes) => format!("{:032x}", u128::from_be_bytes(*bytes)),
            Self::Text(text) => text.clone(),
        }
    }
}

/// The values of a run that lists don't need.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Details {
    shrunk_from: Option<String>,
    seed: u64,
    reason: Option<String>,
    program_output: Option<String>,
    discards: Vec<String>,
    program_version: String,
    scene: StoredScene,
    states: u32,
    actions: Vec<ActionDetails>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct ActionDetails {
    score: Option<f64>,
    reported: Option<bool>,
    message: Option<String>,
    duration_secs: f64,
    end: String,
    parameters: std::collections::BTreeMap<String, Vec<String>>,
    has_events: bool,
    evidence: Vec<Evidence>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Evidence {
    witness: String,
    rule_digest: String,
    held_before: Option<bool>,
    vacuous: Option<bool>,
}

/// The texts of a segment by their numbers.
#[derive(Debug, Default)]
pub(crate) struct TextTable {
    all: Vec<String>,
    numbers: HashMap<String, u32>,
}

impl TextTable {
    fn number(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = u32::try_from(self.all.len()).unwrap_or(u32::MAX);
        self.numbers.insert(text.to_owned(), number);
        self.all.push(text.to_owned());
        number
    }

    /// The text of a number; empty if there is none, which only a damaged frame could ask for.
    pub(crate) fn text(&self, number: u32) -> &str {
        self.all.get(number as usize).map_or("", String::as_str)
    }

    /// Forgets the texts after the first `count`: the frame that would have held them was not
    /// written.
    pub(crate) fn truncate(&mut self, count: usize) {
        for text in self.all.drain(count.min(self.all.len())..) {
            self.numbers.remove(&text);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.all.len()
    }
}

/// The content of a frame in the column of runs.
///
/// # Errors
/// It can't be encoded. (The current types never cause this.)
pub(crate) fn encode_row(
    stored: &StoredRun,
    places: Places,
    texts: &mut TextTable,
) -> postcard::Result<Vec<u8>> {
    let known = texts.len();
    let digest = stored.scene_digest();
    let actions = stored.actions.iter();
    let actions = actions.map(|action| action.action.as_deref().map(|iri| texts.number(iri)));
    let actions = actions.collect();
    let mut outcomes = Vec::new();
    for (step, action) in (0..).zip(&stored.actions) {
        outcomes.extend(action.judgements.iter().map(|judgement| EntryOutcome {
            action: step,
            property: texts.number(&judgement.property),
            outcome: judgement.outcome,
            margin: judgement.margin,
        }));
    }
    let row = RunEntry {
        index: stored.index,
        repetition: stored.repetition,
        weight: stored.weight,
        test: texts.number(&stored.test),
        status: stored.status,
        score: stored.score,
        trace_hash: Hash::of(&stored.trace_hash),
        started: stored.started.clone(),
        wall_secs: stored.wall_secs,
        elapsed_secs: stored.elapsed_secs,
        quality: stored.quality,
        scene: [&digest.arrangement, &digest.physics].map(|text| Hash::of(text)),
        actions,
        outcomes,
        places,
    };
    postcard::to_stdvec(&(&texts.all[known..], row))
}

/// The row of a frame, whose new texts are added to those before it.
///
/// # Errors
/// The content is none of this program.
pub(crate) fn decode_row(content: &[u8], texts: &mut TextTable) -> postcard::Result<RunEntry> {
    let (new, row): (Vec<String>, RunEntry) = postcard::from_bytes(content)?;
    for text in &new {
        texts.number(text);
    }
    Ok(row)
}

impl RunEntry {
    /// Digest over every state.
    pub(crate) fn trace_hash(&self) -> String {
        self.trace_hash.text()
    }

    /// Digests of its scene.
    pub(crate) fn scene(&self) -> SceneDigest {
        let [arrangement, physics] = [0, 1].map(|n: usize| self.scene[n].text());
        SceneDigest {
            arrangement,
            physics,
        }
    }
}

/// The content of a frame in the column of details, before compression.
///
/// # Errors
/// It can't be encoded. (The current types never cause this.)
pub(crate) fn encode_details(stored: &StoredRun) -> postcard::Result<Vec<u8>> {
    let evidence = |judgement: &Judgement| Evidence {
        witness: judgement.witness.clone(),
        rule_digest: judgement.rule_digest.clone(),
        held_before: judgement.held_before,
        vacuous: judgement.vacuous,
    };
    let action = |action: &StoredAction| ActionDetails {
        score: action.score,
        reported: action.reported,
        message: action.message.clone(),
        duration_secs: action.duration_secs,
        end: action.end.clone(),
        parameters: action.parameters.clone(),
        has_events: action.has_events,
        evidence: action.judgements.iter().map(evidence).collect(),
    };
    postcard::to_stdvec(&Details {
        shrunk_from: stored.shrunk_from.clone(),
        seed: stored.seed,
        reason: stored.reason.clone(),
        program_output: stored.program_output.clone(),
        discards: stored.discards.clone(),
        program_version: stored.program_version.clone(),
        scene: stored.scene.clone(),
        states: stored.states,
        actions: stored.actions.iter().map(action).collect(),
    })
}

/// A run from both contents. Returns `None` if they don't belong together, or are none of this
/// program.
pub(crate) fn decode(row: &RunEntry, details: &[u8], texts: &TextTable) -> Option<StoredRun> {
    let details: Details = postcard::from_bytes(details).ok()?;
    if details.actions.len() != row.actions.len() {
        return None;
    }
    let mut outcomes = row.outcomes.iter().peekable();
    let mut actions = Vec::new();
    for ((step, action), iri) in (0..).zip(details.actions).zip(&row.actions) {
        let mut judgements = Vec::new();
        for evidence in action.evidence {
            let judged = outcomes.next_if(|judged| judged.action == step)?;
            judgements.push(Judgement {
                property: texts.text(judged.property).to_owned(),
                outcome: judged.outcome,
                margin: judged.margin,
                witness: evidence.witness,
                rule_digest: evidence.rule_digest,
                held_before: evidence.held_before,
                vacuous: evidence.vacuous,
            });
        }
        actions.push(StoredAction {
            action: iri.map(|number| texts.text(number).to_owned()),
            score: action.score,
            reported: action.reported,
            message: action.message,
            duration_secs: action.duration_secs,
            end: action.end,
            parameters: action.parameters,
            has_events: action.has_events,
            judgements,
        });
    }
    if outcomes.next().is_some() {
        return None;
    }
    Some(StoredRun {
        index: row.index,
        repetition: row.repetition,
        weight: row.weight,
        shrunk_from: details.shrunk_from,
        test: texts.text(row.test).to_owned(),
        seed: details.seed,
        status: row.status,
        reason: details.reason,
        program_output: details.program_output,
        score: row.score,
        discards: details.discards,
        trace_hash: row.trace_hash(),
        quality: row.quality,
        started: row.started.clone(),
        wall_secs: row.wall_secs,
        elapsed_secs: row.elapsed_secs,
        program_version: details.program_version,
        scene: details.scene,
        states: details.states,
        actions,
    })
}
