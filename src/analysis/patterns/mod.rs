//! When something fails: conditions on scenes under which it does so more often than elsewhere, found in the runs.
//!
//! The search is exhaustive: of the counts of every pair and triple of parameters, cell by cell, sums over all boxes follow at
//! about an addition each, so that no box has to be left out. What is found is folded into the simplest, its bounds are refined, it is
//! tested against all that was tried, and again on runs that took no part in finding it.
//!
//! Never: looks at a history, knows what a parameter means, or calls a run that was not decided a failure.

mod boxes;
mod cells;
mod condition;
mod confirm;
mod fold;
mod likelihood;
mod mine;
mod refine;
mod subject;

pub use condition::{Condition, simplest_between};
pub use mine::{Pattern, PatternOptions, Patterns, mine};
pub use subject::{Parameter, Subject, Values};
