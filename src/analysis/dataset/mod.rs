//! Runs as data for learning: what the robot measured and was told, what it took things for, where they truly were, and what came
//! of it.
//!
//! Never: simulates, draws a picture, decides what is a success (outcomes are the rules'), or leaves out runs that failed.

mod columns;
mod sheet;
mod source;
mod write;

pub use write::{Dataset, export_dataset};
