//! Rows: the values of a run in lists, and where the rest of it is.
//!
//! Texts that are alike in many runs are stored once in a segment: the row in which one occurs
//! first holds it, later ones its number.

use std::collections::HashMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::segment::frame::FramePlace;
use crate::stored_run::StoredRun;
use crate::{Repetition, RunRow, RunStatus, SceneDigest};
use actcheck_base::Outcome;
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
    pub started: Box<str>,
    pub wall_secs: f64,
    pub elapsed_secs: f64,
    pub quality: Option<Quality>,
    scene: [Hash; 2],
    /// Whether it was shrunk from another run.
    pub is_shrunk: bool,
    /// Number of scenes that were discarded before its own.
    pub discards: u32,
    /// Numbers of the actions' IRIs.
    pub actions: Box<[Option<u32>]>,
    pub outcomes: Box<[EntryOutcome]>,
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
    Text(Box<str>),
}

impl Hash {
    fn of(text: &str) -> Self {
        match u128::from_str_radix(text, 16) {
            Ok(value) if format!("{value:032x}") == text => Self::Bytes(value.to_be_bytes()),
            _ => Self::Text(text.into()),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Bytes(bytes) => format!("{:032x}", u128::from_be_bytes(*bytes)),
            Self::Text(text) => text.clone().into(),
        }
    }
}

/// The texts of a segment by their numbers.
#[derive(Debug, Default)]
pub(super) struct TextTable {
    all: Vec<Arc<str>>,
    numbers: HashMap<Arc<str>, u32>,
}

impl TextTable {
    fn number(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = u32::try_from(self.all.len()).unwrap_or(u32::MAX);
        let text: Arc<str> = text.into();
        self.numbers.insert(Arc::clone(&text), number);
        self.all.push(text);
        number
    }

    /// The text of a number; empty if there is none, which only a damaged frame could ask for.
    pub(super) fn text(&self, number: u32) -> Arc<str> {
        self.all
            .get(number as usize)
            .map_or_else(|| "".into(), Arc::clone)
    }

    /// Forgets the texts after the first `count`: the frame that would have held them was not
    /// written.
    pub(super) fn truncate(&mut self, count: usize) {
        for text in self.all.drain(count.min(self.all.len())..) {
            self.numbers.remove(&text);
        }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }
}

impl RunEntry {
    /// The row of a run, whose texts are added to those of its segment.
    pub(super) fn of(stored: &StoredRun, places: Places, texts: &mut TextTable) -> Self {
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
        Self {
            index: stored.index,
            repetition: stored.repetition,
            weight: stored.weight,
            test: texts.number(&stored.test),
            status: stored.status,
            score: stored.score,
            trace_hash: Hash::of(&stored.trace_hash),
            started: stored.started.as_str().into(),
            wall_secs: stored.wall_secs,
            elapsed_secs: stored.elapsed_secs,
            quality: stored.quality,
            scene: [&digest.arrangement, &digest.physics].map(|text| Hash::of(text)),
            is_shrunk: stored.shrunk_from.is_some(),
            discards: u32::try_from(stored.discards.len()).unwrap_or(u32::MAX),
            actions,
            outcomes: outcomes.into(),
            places,
        }
    }

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

    /// Whether its motion is kept.
    pub(crate) fn is_whole(&self) -> bool {
        self.places.motion.is_some()
    }

    /// The run as in a list.
    pub(super) fn as_run(&self, campaign: &str, texts: &TextTable) -> RunRow {
        RunRow {
            run: format!("{campaign}-{}", self.index + 1),
            campaign: campaign.to_owned(),
            index: self.index,
            repetition: self.repetition,
            weight: self.weight,
            test: texts.text(self.test).as_ref().to_owned(),
            status: self.status,
            score: self.score,
            trace_hash: self.trace_hash(),
            started: self.started.as_ref().to_owned(),
        }
    }
}

/// The content of a frame in the column of runs: the texts that are new with it, and the row.
///
/// # Errors
/// It can't be encoded. (The current types never cause this.)
pub(super) fn encode_row(
    stored: &StoredRun,
    places: Places,
    texts: &mut TextTable,
) -> postcard::Result<Vec<u8>> {
    let known = texts.len();
    let row = RunEntry::of(stored, places, texts);
    let new: Vec<&str> = texts.all[known..].iter().map(AsRef::as_ref).collect();
    postcard::to_stdvec(&(new, row))
}

/// The row of a frame, whose new texts are added to those before it.
///
/// # Errors
/// The content is none of this program.
pub(super) fn decode_row(content: &[u8], texts: &mut TextTable) -> postcard::Result<RunEntry> {
    let (new, row): (Vec<&str>, RunEntry) = postcard::from_bytes(content)?;
    for text in new {
        texts.number(text);
    }
    Ok(row)
}
