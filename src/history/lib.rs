//! The history: campaigns, runs, scenes, facts and outcomes in an RDF store on disk, with traces in
//! files beside it.
//!
//! Never: judges, simulates, changes stored runs, or reads a clock.

mod answer;
mod chosen;
mod columns;
mod counted;
mod detail;
mod dump;
mod entry;
mod evaluation;
mod fault;
mod folder;
mod foreign;
mod frames;
mod graphs;
mod inflate;
mod integrity;
mod journal;
mod judged;
mod light;
mod lists;
pub mod merge;
mod newest;
mod open;
mod outlined;
mod outlines;
mod parts;
mod pending;
mod quad_source;
mod query;
mod rdf_text;
mod read;
mod read_campaign;
mod read_trace;
mod recheck;
mod record;
mod resolve;
mod rows;
mod salvage;
mod scene_digest;
mod seal;
// The next form of the history, which is not used yet.
#[cfg(test)]
mod segment;
mod snapshot;
mod statements;
mod store;
mod stored_run;
mod syntax_fault;
mod tail;
mod terms;
mod threads;
mod trace_file;
mod trace_parts;
mod vertical;
mod vitals;
mod wanted;
mod wire;
mod write_campaign;
mod write_run;
mod write_scene;

pub use answer::{Cancel, QueryAnswer};
pub use counted::{newest_of_alike, without_counts};
pub use entry::Entry;
pub use foreign::{ForeignAnswer, check_query};
pub use integrity::{Damage, Integrity};
pub use judged::{JudgedOutcome, JudgedRun, Judgements, LaterRules, Wish};
pub use lists::FAILED_AGAIN;
pub use newest::NewestOutcomes;
pub use outlines::Restore;
pub use parts::HistoryPart;
pub use rdf_text::{RdfSyntax, rdf_text};
pub use recheck::{NewestJudgements, Recheck, StoredJudgement};
pub use record::{
    CampaignEnd, CampaignRecord, FindingRecord, Repetition, RunRecord, RunStatus, SkillRecord,
};
pub use rows::{ActionDetail, CampaignRow, ObjectDetail, OutcomeRow, RunDetail, RunFilter, RunRow};
pub use scene_digest::SceneDigest;
pub use store::History;
pub use vitals::RunVitals;
pub use wire::{WireFault, WireLimits, WireSyntax};
pub use write_scene::{NOISE_TERMS, noise};
