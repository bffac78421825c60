//! Export of runs as learning data: observations, commands, percepts, ground truth and outcomes.
//!
//! Never: simulates, renders an image, decides successes (the rules do), or leaves out failed runs.

mod columns;
mod sheet;
mod source;
mod write;

pub use write::{Dataset, export_dataset};
