//! Several histories as one: campaigns that are parts of a whole become it, and what is met twice is kept once.
//!
//! First everything is read and checked ([`plan`]); only what has no conflict is then written ([`carry_out`]), each campaign so
//! that whoever ends the program at any moment leaves a history that the same command completes.
//!
//! Never: writes before all is checked, changes a history that is merged from, or decides between two results.

mod carry_out;
mod conflict;
mod copy;
mod plan;
mod renames;
mod survey;

pub use carry_out::{Merged, carry_out};
pub use plan::{MergeOptions, MergePlan, PlannedMerge, plan};
