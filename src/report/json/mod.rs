//! Whole reports as one JSON object each, one file for each summary. Their keys are an interface
//! for other programs.
//!
//! Never: computes the printed values (see `summary`), or writes to a stream.

mod campaign;
mod case;
mod compare;
mod engines;
mod findings;
mod health;
mod labels;
mod oracles;
mod recheck;
mod relations;
mod repeated;
mod run;
mod shrunk;
mod skill;
mod weighted;

pub use campaign::campaign_json;
pub use case::case_json;
pub use compare::compare_json;
pub use engines::engines_json;
pub use findings::findings_json;
pub(crate) use findings::findings_with;
pub use health::health_json;
pub use labels::labels_json;
pub use oracles::oracles_json;
pub use recheck::recheck_json;
pub use relations::relations_json;
pub use run::run_json;
pub use shrunk::shrunk_json;
pub use skill::skill_json;
