//! Mines failure patterns: conditions on scenes under which runs fail more often than elsewhere
//! (subgroup discovery).
//!
//! The search is exhaustive: from the counts in the cells of each pair and triple of parameters,
//! the sum over any box takes about one addition, so that all boxes can be searched. A found
//! pattern is simplified, its bounds are refined, and it is tested with a correction for all boxes
//! tried, and again on held-out runs.
//!
//! Never: reads a history, depends on the meaning of parameters, or counts an undecided run as a
//! failure.

mod boxes;
mod cells;
mod condition;
mod confirm;
mod input;
mod likelihood;
mod mine;
mod refine;
mod simplify;
mod strongest;

pub use condition::{Condition, simplest_between};
pub use input::{Parameter, PatternInput, Values};
pub use mine::{Pattern, PatternOptions, Patterns, mine};
pub use strongest::Strongest;
