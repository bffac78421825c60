//! Export of runs as learning data: observations, commands, percepts, ground truth and outcomes.
//!
//! Never: simulates, draws an image (the caller does), decides successes (the rules do), or leaves out failed runs.

mod columns;
mod course;
mod fact_columns;
mod fact_source;
mod images;
mod lerobot;
mod sheet;
mod sheets;
mod source;
mod write;

pub use images::{DatasetImage, DrawImages};
pub use lerobot::{LerobotDataset, export_lerobot};
pub use write::{Dataset, DatasetRuns, export_dataset, export_facts};
