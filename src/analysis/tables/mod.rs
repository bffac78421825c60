//! Runs as a table: one row for each outcome of a property, with all that is known of the run, the action and the scene.
//!
//! The table lies beside the history, in its folder `tables`: a mirror in Parquet that analysis and notebooks read in a fraction of
//! the time that the store takes. The store is the truth; the mirror can be made again from it at any time.
//!
//! Never: changes what was kept, holds what the store does not, or reads a mirror that lacks runs of the store.

mod cell;
mod columns;
mod frames;
mod mirror;
mod outcomes;
mod place;
mod write;

pub(super) use cell::Cell;
pub use columns::{Column, ColumnKind, columns};
pub(super) use frames::series;
pub(super) use mirror::unwritten;
pub use mirror::{Mirror, MirrorChange};
pub use outcomes::{OutcomeTable, TableFilter, TextColumn};
pub use place::Hierarchy;
pub(super) use write::schema as outcomes_schema;
pub use write::{export_csv, export_parquet};
