//! Export of runs as learning data: observations, commands, percepts, ground truth and outcomes.
//!
//! Never: simulates, renders an image, decides successes (the rules do), or leaves out failed runs.

mod columns;
mod course;
mod fact_columns;
mod fact_source;
mod sheet;
mod sheets;
mod source;
mod write;

pub use write::{Dataset, DatasetRuns, export_dataset, export_facts};
