//! Syntax trees to checked rules: names, arities, safety, units, ranges and strata. All errors are
//! reported at once.
//!
//! Never: reads a fact, or evaluates a rule.

pub(crate) mod checking;
mod expressions;
pub(crate) mod facts_read;
pub(crate) mod formulas;
mod left;
mod making;
pub(crate) mod options;
mod predicates;
pub(crate) mod ranges;
mod safety;
pub(crate) mod sides;
pub(crate) mod stratify;
mod temporal;
pub(crate) mod termination;
mod translate;
pub(crate) mod unchanging;
pub(crate) mod units;
