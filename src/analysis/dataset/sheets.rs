//! The tables of a dataset while they are being written.

use std::path::{Path, PathBuf};

use crate::dataset::columns::TableSpec;
use crate::dataset::sheet::Sheet;
use crate::tables::Cell;
use actcheck_base::Diagnostics;

/// Some of the dataset's tables.
pub(super) struct Sheets {
    sheets: Vec<(&'static str, Sheet)>,
}

impl Sheets {
    /// Creates empty tables in a folder.
    pub(super) fn begin(tables: &[&TableSpec], folder: &Path) -> Result<Self, Diagnostics> {
        let begin = |table: &&TableSpec| Ok((table.file, Sheet::begin(**table, folder)?));
        Ok(Self {
            sheets: tables
                .iter()
                .map(begin)
                .collect::<Result<_, Diagnostics>>()?,
        })
    }

    /// Adds a row to a table, if it is one of these. Cells are in the order of the columns.
    pub(super) fn push(&mut self, table: &TableSpec, row: impl IntoIterator<Item = Cell>) {
        if let Some((_, sheet)) = self.sheets.iter_mut().find(|(file, _)| *file == table.file) {
            sheet.push(row);
        }
    }

    /// Writes the pending rows of tables that have many.
    pub(super) fn make_room(&mut self) -> Result<(), Diagnostics> {
        self.sheets
            .iter_mut()
            .try_for_each(|(_, sheet)| sheet.make_room())
    }

    /// Writes the pending rows and the ends of the tables, which do not have their names yet.
    pub(super) fn complete(&mut self) -> Result<(), Diagnostics> {
        self.sheets
            .iter_mut()
            .try_for_each(|(_, sheet)| sheet.complete())
    }

    /// Gives the complete tables their names. Returns their paths and numbers of rows, in order.
    pub(super) fn finish(self) -> Result<Vec<(PathBuf, usize)>, Diagnostics> {
        self.sheets
            .into_iter()
            .map(|(_, sheet)| sheet.finish())
            .collect()
    }
}
