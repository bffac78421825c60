//! Explanations: the proof of a goal that holds, or the closest rule and its failed condition for
//! one that does not.
//!
//! Never: changes a result, decides an outcome, or costs time unless an explanation is requested.

mod book;
mod dot;
mod goal;
#[cfg(feature = "json")]
mod json;
mod miss;
mod model;
mod program;
mod proof;
mod search;
mod shown;
mod text;

pub use model::{Explanation, Failure, Miss, Premise, Proof, RuleRef, Support, UnknownTerm};
