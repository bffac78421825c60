//! Datalog programs of their own: facts from files, closed by the same engine, written to files.
//!
//! Never: knows an action, a snapshot or an ontology; goes to the network; writes outside of the folder it is given.

mod export;
mod import;
mod program;
mod run;
mod stoppable;
mod table;
mod unfinished;

pub use program::{Closure, Engine, Program};
pub use run::{Summary, run};
