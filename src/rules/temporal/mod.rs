//! Formulas over the course of an action: signal temporal logic with its robustness.
//!
//! Never: parses a formula, or records a quantity.

mod deciding;
mod evidence;
mod formula;
mod gap;
mod margin;
mod moment;
mod quantities;
mod semantics;
mod vacuous;
mod windows;

pub(crate) use evidence::Evidence;
pub(crate) use formula::{CheckedFormula, Quantity, Thing, Timed};
pub(crate) use margin::{add_margin, reads_course};
pub(crate) use moment::{add_moment, define_moment};
pub(crate) use quantities::{
    known_quantity, quantities_read, quantity_names, things_of, values_of,
};
pub(crate) use semantics::UNRECORDED;
pub(crate) use vacuous::mark_consequents;
