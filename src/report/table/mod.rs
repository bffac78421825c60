//! Flat tables with one record a row, for CSV, JSON and the terminal; one file for each summary.
//!
//! Never: computes the printed values (see `summary`), or writes to a stream.

mod answer;
mod campaign;
mod compare;
mod engines;
mod findings;
mod health;
mod labels;
mod oracles;
mod recheck;
mod relations;
mod render;
mod shrunk;

pub use answer::{answer_cells, answer_table};
pub use campaign::campaign_table;
pub use compare::compare_table;
pub use engines::engines_table;
pub(crate) use engines::{percent_interval, settings_table};
pub use findings::{findings_table, maps_table};
pub use health::health_table;
pub use labels::labels_table;
pub use oracles::oracles_table;
pub use recheck::recheck_table;
pub use relations::relations_table;
pub use render::{Table, TableFormat, TableParts};
pub use shrunk::with_shrunk;
