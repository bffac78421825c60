//! Runs as a table: one row for each outcome of a property, with the data of the run, the action
//! and the scene.
//!
//! The table is in the history's folder `tables`: a mirror in Parquet that analyses and notebooks
//! read much faster than the store. Store and traces are authoritative; the mirror can be rebuilt
//! from them at any time.
//!
//! Never: changes runs, holds data that the segments lack, or reads a mirror that
//! lacks runs of the store.

mod adopt;
mod cell;
mod checked;
mod columns;
mod effect_columns;
mod frames;
mod mirror;
mod outcomes;
mod row_source;
mod table_files;
mod write;

pub(super) use cell::Cell;
pub use columns::{Column, ColumnKind, ColumnRole, columns};
pub(super) use frames::{kinds_of, series};
pub(super) use mirror::unwritten;
pub use mirror::{Mirror, MirrorChange};
pub use outcomes::{OutcomeTable, TableFilter, TextColumn};
pub use row_source::Hierarchy;
pub use write::{export_csv, export_parquet};
pub(super) use write::{new_text, pending_parquet, schema as outcomes_schema};
