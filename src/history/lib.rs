//! The history: campaigns, runs, scenes, facts and outcomes in an RDF store on disk, with traces in files beside it.
//!
//! Never: judges, simulates, changes stored runs, or reads a clock.

mod answer;
mod counted;
mod detail;
mod dump;
mod evaluation;
mod fault;
mod folder;
mod frames;
mod graphs;
mod integrity;
mod light;
mod lists;
pub mod merge;
mod newest;
mod open;
mod query;
mod rdf_text;
mod read;
mod read_campaign;
mod recheck;
mod record;
mod resolve;
mod rows;
mod salvage;
mod scene_digest;
mod seal;
mod snapshot;
mod statements;
mod store;
mod syntax_fault;
mod terms;
mod trace_details;
mod trace_file;
mod vitals;
mod wire;
mod write_campaign;
mod write_run;
mod write_scene;

pub use answer::{Cancel, QueryAnswer};
pub use counted::newest_of_alike;
pub use integrity::{Damage, Integrity};
pub use lists::FAILED_AGAIN;
pub use newest::NewestOutcomes;
pub use rdf_text::{RdfSyntax, rdf_text};
pub use recheck::{Recheck, StoredJudgement};
pub use record::{CampaignEnd, CampaignRecord, Repetition, RunRecord, RunStatus, SkillRecord};
pub use rows::{ActionDetail, CampaignRow, ObjectDetail, OutcomeRow, RunDetail, RunFilter, RunRow};
pub use scene_digest::SceneDigest;
pub use store::History;
pub use vitals::RunVitals;
pub use wire::{WireFault, WireLimits, WireSyntax};
pub use write_scene::{NOISE_TERMS, noise};
