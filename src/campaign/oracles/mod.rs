//! Tests of the oracles: runs with faults put in on purpose, to see which properties notice.
//!
//! Never: keeps such a run in a history, where it would count as the robot's, or decides what noticing is.

mod faults;
mod trials;

pub use faults::{FAULTS, Fault};
pub use trials::{Trial, TrialOptions, try_faults};
