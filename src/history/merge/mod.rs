//! Merges several histories into one: parts of a campaign become one campaign, and duplicates are
//! kept once.
//!
//! [`plan`] first reads and checks everything; [`carry_out`] then writes it if there is no
//! conflict. If the program is ended at any moment, the same command completes the history.
//!
//! Never: writes before everything is checked, changes a source history, or chooses between two
//! results.

mod carry_out;
mod conflict;
mod plan;
mod survey;

pub use carry_out::{Merged, carry_out};
pub use plan::{MergeOptions, MergePlan, PlannedMerge, plan};
