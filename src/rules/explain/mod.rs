//! Why something holds, as a proof down to facts; and why it does not, as the rule that came closest and what it lacked.
//!
//! Never: changes what is derived, decides an outcome, or costs anything while nobody asks.

mod book;
mod export;
mod miss;
mod model;
mod program;
mod proof;
mod search;
mod shown;
mod text;

pub use model::{Explanation, Failure, Miss, Premise, Proof, RuleRef, Support};
