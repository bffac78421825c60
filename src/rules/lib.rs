//! Rules: parsed, checked, stratified, planned, and evaluated over the facts of an action.

mod book;
mod builtins;
mod check;
mod engine;
pub mod explain;
mod model;
#[cfg(feature = "sparql")]
mod sparql;
pub mod standalone;
pub mod syntax;

pub use book::{RuleBook, owl_closure};
pub use engine::budget::Budget;
pub use syntax::parse;
