//! Checked rules and the terms they compute with: the product of the check and the input of the
//! engine.
//!
//! Never: reports a diagnostic, or derives a tuple.

pub(crate) mod datatypes;
pub(crate) mod datetime;
pub(crate) mod expression;
pub(crate) mod given;
pub(crate) mod program;
pub(crate) mod rdf;
pub(crate) mod universe;
pub(crate) mod values;
