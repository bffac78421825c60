//! Converts runs to rows of the table, and rows to data frames.

use std::collections::BTreeMap;

use polars::prelude::{Column as Series, DataFrame, NamedFrom as _, PolarsError, Series as Values};

use crate::TableRun;
use crate::tables::cell::Cell;
use crate::tables::columns::{Column, ColumnKind, columns};
use crate::tables::row_source::{ActionScene, Hierarchy, RowSource};
use actcheck_base::names;

/// Columns of categories, with the columns of their superclasses.
const KINDS: [(&str, &str); 5] = [
    ("surface_category", "surface_kinds"),
    ("target_category", "target_kinds"),
    ("neighbour_category", "neighbour_kinds"),
    ("first_contact_category", "first_contact_kinds"),
    ("largest_force_category", "largest_force_kinds"),
];

/// Rows of runs, stored by column.
#[derive(Debug, Default)]
pub(super) struct Rows {
    cells: Vec<Vec<Cell>>,
    height: usize,
}

impl Rows {
    /// Adds a row for each outcome of a run.
    pub fn add(&mut self, table_run: &TableRun) {
        self.cells.resize_with(columns().len(), Vec::new);
        let run = &table_run.detail;
        for (action, (noise, effects)) in run
            .actions
            .iter()
            .zip(table_run.noise.iter().zip(&table_run.effects))
        {
            let scene = ActionScene::of(run, action);
            for judgement in &action.judgements {
                let source = RowSource {
                    run,
                    action,
                    judgement,
                    scene: &scene,
                    noise,
                    effects,
                };
                for (cells, column) in self.cells.iter_mut().zip(columns()) {
                    cells.push((column.cell)(&source));
                }
                self.height += 1;
            }
        }
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Converts the rows to a data frame.
    ///
    /// # Errors
    /// The columns have different lengths.
    pub fn frame(mut self) -> Result<DataFrame, PolarsError> {
        self.cells.resize_with(columns().len(), Vec::new);
        let series = columns()
            .iter()
            .zip(self.cells)
            .map(|(column, cells)| series(column.name, column.kind, cells));
        DataFrame::new(self.height, series.collect())
    }
}

/// Converts cells to a column of a data frame. Cells of another type become missing.
pub(crate) fn series(name: &str, kind: ColumnKind, cells: Vec<Cell>) -> Series {
    let name = name.into();
    let cells = cells.into_iter();
    match kind {
        ColumnKind::Text => {
            let text = |cell| {
                if let Cell::Text(text) = cell {
                    text
                } else {
                    None
                }
            };
            Values::new(name, cells.map(text).collect::<Vec<Option<String>>>())
        }
        ColumnKind::Number => {
            let number = |cell| {
                if let Cell::Number(number) = cell {
                    number
                } else {
                    None
                }
            };
            Values::new(name, cells.map(number).collect::<Vec<Option<f64>>>())
        }
        ColumnKind::Count => {
            let count = |cell| {
                if let Cell::Count(count) = cell {
                    count
                } else {
                    None
                }
            };
            Values::new(name, cells.map(count).collect::<Vec<Option<i64>>>())
        }
        ColumnKind::Bool => {
            let bool = |cell| {
                if let Cell::Bool(bool) = cell {
                    bool
                } else {
                    None
                }
            };
            Values::new(name, cells.map(bool).collect::<Vec<Option<bool>>>())
        }
        ColumnKind::Image => {
            let bytes = |cell| {
                if let Cell::Bytes(bytes) = cell {
                    bytes
                } else {
                    None
                }
            };
            let files: Vec<Option<Vec<u8>>> = cells.map(bytes).collect();
            let files: Vec<Option<&[u8]>> = files.iter().map(Option::as_deref).collect();
            Values::new(name, files)
        }
    }
    .into()
}

/// Adds a column for each category column: local names of the category and its superclasses,
/// nearest first, joined by spaces.
pub(super) fn with_kinds(frame: &mut DataFrame, hierarchy: &Hierarchy) -> Result<(), PolarsError> {
    for (from, to) in KINDS {
        let mut known: BTreeMap<&str, String> = BTreeMap::new();
        let categories = frame.column(from)?.str()?.clone();
        let kinds: Vec<Option<String>> = categories
            .iter()
            .map(|category| {
                category.map(|category| {
                    known
                        .entry(category)
                        .or_insert_with(|| kinds_of(category, hierarchy))
                        .clone()
                })
            })
            .collect();
        frame.with_column(Values::new(to.into(), kinds).into())?;
    }
    Ok(())
}

/// Returns the names of the columns that [`with_kinds`] adds, the columns that they extend, and
/// their descriptions.
pub(super) fn kinds_columns() -> impl Iterator<Item = (&'static str, &'static Column, String)> {
    KINDS.into_iter().filter_map(|(from, to)| {
        let column = columns().iter().find(|column| column.name == from)?;
        Some((
            to,
            column,
            format!("local names of {from} and its superclasses, nearest first"),
        ))
    })
}

/// Returns the local names of a category and its superclasses, nearest first, joined by spaces.
pub(crate) fn kinds_of(category: &str, hierarchy: &Hierarchy) -> String {
    let above = hierarchy
        .get(category)
        .into_iter()
        .flatten()
        .map(String::as_str);
    std::iter::once(names::local(category))
        .chain(above)
        .collect::<Vec<&str>>()
        .join(" ")
}
