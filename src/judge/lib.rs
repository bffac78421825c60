//! Judges one action of any simulator or robot by the rules of actcheck: plain values in, outcomes
//! with margins, witnesses and proofs out.
//!
//! ```text
//! values → Trace → facts → rules → Verdict
//! ```
//!
//! The facts, the rules and the outcomes are those of stored runs: the same values give the same
//! outcomes, bit for bit. Facts that are not given are missing ([`actcheck_data::Trace::lacks`]), and
//! never guessed: a property that can't be decided without them is inapplicable and names them.
//!
//! With the feature `python`, the crate is also the module `actcheck._judge` of the Python package.
//!
//! Never: reads or writes a file (except for an ontology that a caller names), steps a simulation, or
//! keeps anything between two judgements.

#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]

mod book;
mod course;
mod during;
mod lacks;
mod monitor;
#[cfg(feature = "python")]
mod python;
mod reader;
mod shapes;
mod snapshot;
#[cfg(test)]
mod tests;
mod trace;
mod value;
mod verdict;

pub use book::{Call, Judge, OwnRule};
pub use monitor::Monitor;
pub use value::{Key, Value};
pub use verdict::Verdict;
