//! The history: campaigns, runs, states and outcomes in append-only segments, and their RDF as a
//! view.
//!
//! Never: judges, simulates, changes stored runs, or reads a clock.

mod answer;
mod beside;
mod campaign;
mod campaign_state;
mod campaigns;
mod counted;
mod cross_check;
mod dump;
mod entry;
mod evaluation;
mod fault;
mod folder;
mod foreign;
mod frames;
mod graphs;
mod history;
mod ids;
mod integrity;
mod judged;
mod light;
pub mod merge;
mod newest;
mod parts;
mod query;
mod rdf_text;
mod read_trace;
mod recheck;
mod record;
mod related;
mod resolve;
mod restore;
mod rows;
mod scene_digest;
mod segment;
mod statements;
mod stored_run;
mod syntax_fault;
mod tails;
mod terms;
mod threads;
mod trace_codec;
mod view;
mod vitals;
mod wire;
mod write_campaign;
mod write_run;
mod write_scene;
mod writers;

pub use answer::{Cancel, QueryAnswer};
pub use counted::{FAILED_AGAIN, newest_of_alike, without_counts};
pub use cross_check::CrossCheck;
pub use dump::RdfExport;
pub use entry::Entry;
pub use foreign::{ForeignAnswer, check_query};
pub use history::History;
pub use integrity::{Damage, Integrity};
pub use judged::{JudgedOutcome, JudgedRun, Judgements, LaterRules, Wish};
pub use newest::NewestOutcomes;
pub use parts::HistoryPart;
pub use rdf_text::{RdfSyntax, rdf_text};
pub use read_trace::Traces;
pub use recheck::{NewestJudgements, Recheck, StoredJudgement};
pub use record::{
    CampaignEnd, CampaignRecord, EpisodeRecord, FindingRecord, Repetition, RunObject, RunRecord,
    RunScene, RunStatus, SkillRecord,
};
pub use related::{RELATED, RelatedPair, RelatedRuns};
pub use restore::Restore;
pub use rows::{ActionDetail, CampaignRow, ObjectDetail, OutcomeRow, RunDetail, RunFilter, RunRow};
pub use scene_digest::SceneDigest;
pub use stored_run::{NOISE_TERMS, noise};
pub use vitals::RunVitals;
pub use wire::{WireFault, WireLimits, WireSyntax};
