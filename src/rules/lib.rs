//! Rules: parsed, checked, stratified, planned, and evaluated over the facts of an action.
//!
//! Two languages query the same facts: Datalog in `.rls` files (Nemo's dialect) and SPARQL in `.rq` files.
//! The stages in order: `lex` and `parse`, `check` with `translate` and `safety`, `stratify`, `plan`, `evaluate`
//! (and `naive`, its oracle), `reading`.
//!
//! Never: decides an outcome, steps the simulation, writes to a history, or prints.

mod aggregate;
mod book;
mod builtins;
mod check;
mod dataset;
mod evaluate;
pub mod explain;
mod expression;
mod expressions;
mod findings;
mod given;
mod join;
mod ledger;
mod lex;
mod lex_text;
mod limits;
mod load;
mod meter;
mod naive;
mod options;
mod owl;
mod parse;
mod parse_expression;
mod plan;
mod prepare;
mod program;
mod query_text;
mod ranges;
mod reading;
mod relation;
mod safety;
mod sparql;
pub mod standalone;
mod stratify;
mod syntax;
mod translate;
mod units;
mod universe;
mod values;

pub use book::RuleBook;
pub use findings::Budget;
pub use owl::owl_closure;
pub use parse::parse;
