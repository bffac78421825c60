//! Reports for the terminal, one file for each summary; and rules for scenes, which are text too.
//!
//! Never: computes the printed values (see `summary`), or writes to a stream.

mod by_action;
mod campaign;
mod case;
mod collisions;
mod compare;
mod engines;
mod failure;
mod findings;
mod health;
mod labels;
mod oracles;
mod page;
mod recheck;
mod relations;
mod repeated;
mod ruled;
mod run;
mod scene_rule;
mod shrunk;
mod skill;
mod weighted;

pub use campaign::{campaign_result_text, campaign_runs_text, campaign_text};
pub use case::case_text;
pub(crate) use case::regressions_text;
pub use compare::compare_text;
pub use engines::engines_text;
pub use failure::FailureLines;
pub use findings::findings_text;
pub use health::{health_lines, health_text};
pub use labels::labels_text;
pub use oracles::oracles_text;
pub use page::Page;
pub(crate) use page::command;
pub use recheck::recheck_text;
pub use relations::relations_text;
pub(crate) use ruled::{align, fit, fitted, ruled, stacked};
pub use run::run_text;
pub use scene_rule::scene_rule;
pub use shrunk::shrunk_text;
pub use skill::skill_text;
