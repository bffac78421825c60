//! Turns a trace into RDF facts: raw quantities with their units, interned once.
//!
//! Never: steps the simulation, holds a threshold, depends on a rule, or decides a verdict.

mod course;
mod during;
mod extract;
mod intervals;
mod places;
mod robot_course;
mod snapshot;
mod solids;
mod writer;

pub use extract::{extract, extract_complete};
pub use writer::thing_iri;
