//! Outcomes as a table: one row for each run and property.

use polars::prelude::{Column, DataFrame, PolarsError};

use crate::history::OutcomeRow;

/// A table could not be computed: a fault of this program, never of a history.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a table could not be computed: {0}")]
pub struct AnalysisError(String);

impl From<PolarsError> for AnalysisError {
    fn from(error: PolarsError) -> Self {
        Self(error.to_string().to_lowercase())
    }
}

/// Columns: run, place (of the run among all, from 0), index, test, action, property, outcome, margin.
///
/// Shape: one row for each outcome, in the order given.
pub(super) fn frame(rows: &[OutcomeRow]) -> Result<DataFrame, PolarsError> {
    let mut place = 0u32;
    let places: Vec<u32> = rows
        .iter()
        .enumerate()
        .map(|(idx, row)| {
            place += u32::from(idx > 0 && rows[idx - 1].run != row.run);
            place
        })
        .collect();
    let texts = |name: &str, text: fn(&OutcomeRow) -> &str| {
        Column::new(name.into(), rows.iter().map(text).collect::<Vec<&str>>())
    };
    DataFrame::new(
        rows.len(),
        vec![
            texts("run", |row| &row.run),
            Column::new("place".into(), places),
            Column::new("index".into(), rows.iter().map(|row| row.index).collect::<Vec<u64>>()),
            texts("test", |row| &row.test),
            texts("action", |row| &row.action),
            texts("property", |row| &row.property),
            texts("outcome", |row| row.outcome.word()),
            Column::new("margin".into(), rows.iter().map(|row| row.margin).collect::<Vec<Option<f64>>>()),
        ],
    )
}
