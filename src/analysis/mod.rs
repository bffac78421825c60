//! History to tables and patterns: rates with intervals, and the ways in which runs fail.
//!
//! Never: judges, writes to a history, or hands out a type of the table library.

mod failure_modes;
mod frame;
mod property_rates;
mod wilson;

pub use failure_modes::{FailureMode, failure_modes};
pub use frame::AnalysisError;
pub use property_rates::{PropertyRate, property_rates};
pub use wilson::{Interval, wilson};
