//! The rules of an ontology, prepared once and applied to every action.
//!
//! Never: decides an outcome, or writes to a history.

pub(crate) mod judge;
mod owl;
mod parts;
mod prepare;

pub use judge::RuleBook;
pub use owl::owl_closure;
