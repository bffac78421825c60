//! Standalone Datalog programs: they read facts from files, run on the same engine, and write their
//! results to files.
//!
//! Never: depends on an action, a snapshot or an ontology; uses the network; writes outside the
//! given folder.

mod export;
mod faults;
mod import;
mod input;
mod json;
mod program;
mod records;
mod run;
mod settings;
mod sink;
mod statements;
mod table;

#[cfg(test)]
mod tests;

pub use program::{Closure, Engine, FactFault, Loading, Program};
pub use run::{Summary, run, run_as};
