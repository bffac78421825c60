//! The built-in functions of the rule language, by name.
//!
//! A function returns `None` if its arguments are outside its domain: the condition does not hold,
//! or the variable gets no value.
//!
//! Never: depends on a predicate, a rule or a fact; a function depends only on its arguments, and
//! stops at the budget.

mod bits;
mod dates;
mod geometry;
mod hashes;
mod numeric;
mod table;
mod text;
mod types;
mod value;

pub(crate) use geometry::GEO3D;
pub(crate) use numeric::{compare, equal};
#[cfg(feature = "sparql")]
pub(crate) use table::builtin_by_exact_name;
pub(crate) use table::{Builtin, builtin, builtin_names, is_equality, is_reserved};
pub(crate) use text::{compile_pattern, compile_pattern_as, matches};
pub(crate) use value::Value;
