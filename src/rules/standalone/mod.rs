//! Standalone Datalog programs: they read facts from files, run on the same engine, and write their results to files.
//!
//! Never: depends on an action, a snapshot or an ontology; uses the network; writes outside the given folder.

mod export;
mod import;
mod program;
mod run;
mod stoppable;
mod table;
mod unfinished;

pub use program::{Closure, Engine, Program};
pub use run::{Summary, run};
