//! Checked rules and facts to derived tuples: semi-naive evaluation within a budget, and its naive
//! oracle.
//!
//! Never: parses or checks a rule, or decides an outcome.

pub(crate) mod access;
pub(crate) mod aggregate;
pub(crate) mod budget;
pub(crate) mod collect;
pub(crate) mod equal;
pub(crate) mod evaluate;
pub(crate) mod join;
pub(crate) mod load;
pub(crate) mod lower;
pub(crate) mod making;
pub(crate) mod meter;
pub(crate) mod naive;
pub(crate) mod plan;
pub(crate) mod reading;
pub(crate) mod relation;
pub(crate) mod sample;
pub(crate) mod variant;

#[cfg(test)]
mod order_tests;
