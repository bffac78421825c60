//! The built-in functions of the rule language, by name.
//!
//! Never: depends on a predicate, a rule or a fact; a function depends only on its arguments.

mod bits;
mod geometry;
mod numeric;
mod table;
mod text;
mod types;
mod value;

pub(crate) use geometry::GEO3D;
pub(crate) use numeric::{compare, equal};
#[cfg(feature = "sparql")]
pub(crate) use table::builtin_by_exact_name;
pub(crate) use table::{Builtin, builtin, builtin_names};
pub(crate) use text::compile_pattern;
pub(crate) use value::Value;
