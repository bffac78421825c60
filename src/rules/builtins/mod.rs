//! The built-in functions of the rule language, by name.
//!
//! Never: depends on a predicate, a rule or a fact; a function depends only on its arguments.

mod bits;
mod geometry;
mod numeric;
mod table;
mod text;
mod types;

pub(crate) use geometry::GEO3D;
pub(crate) use numeric::{compare, equal};
pub(crate) use table::{Builtin, Value, builtin, builtin_in_words, builtin_names};
pub(crate) use text::compile_pattern;
