//! A table that is filled row by row and written in batches.

use std::fs::File;
use std::path::{Path, PathBuf};

use polars::io::parquet::write::BatchedWriter;
use polars::prelude::{DataFrame, ParquetWriter, PolarsError};

use crate::dataset::columns::TableSpec;
use crate::tables::{Cell, series, unwritten};
use actcheck_base::{Below, Diagnostics, NewFile};

/// Approximate maximum number of rows in memory.
const ROWS_AT_ONCE: usize = 100_000;

/// Writer of one table of a dataset.
pub(super) struct Sheet {
    spec: TableSpec,
    path: PathBuf,
    file: NewFile,
    writer: BatchedWriter<File>,
    cells: Vec<Vec<Cell>>,
    waiting: usize,
    /// Number of rows so far.
    pub(super) rows: usize,
}

impl Sheet {
    /// Creates an empty table in a folder.
    pub(super) fn begin(spec: TableSpec, folder: &Path) -> Result<Self, Diagnostics> {
        let path = folder.join(spec.file);
        let cells: Vec<Vec<Cell>> = spec.columns.iter().map(|_| Vec::new()).collect();
        let open = || -> Result<(NewFile, BatchedWriter<File>), PolarsError> {
            let (empty, file) = (
                frame(&spec, cells.clone(), 0)?,
                Below::new(folder).new_file(&path)?,
            );
            let writer = ParquetWriter::new(file.writer()?).batched(empty.schema())?;
            Ok((file, writer))
        };
        let (file, writer) = open().map_err(|error| unwritten(&path, &error))?;
        Ok(Self {
            spec,
            path,
            file,
            writer,
            cells,
            waiting: 0,
            rows: 0,
        })
    }

    /// Adds a row. Cells are in the order of the columns.
    pub(super) fn push(&mut self, row: impl IntoIterator<Item = Cell>) {
        for (cells, cell) in self.cells.iter_mut().zip(row) {
            cells.push(cell);
        }
        (self.waiting, self.rows) = (self.waiting + 1, self.rows + 1);
    }

    /// Writes the pending rows if there are many.
    pub(super) fn make_room(&mut self) -> Result<(), Diagnostics> {
        if self.waiting >= ROWS_AT_ONCE {
            self.flush()
        } else {
            Ok(())
        }
    }

    /// Writes the pending rows and the end of the table, which does not have its name yet.
    pub(super) fn complete(&mut self) -> Result<(), Diagnostics> {
        self.flush()?;
        self.writer
            .finish()
            .map(drop)
            .map_err(|error| unwritten(&self.path, &error))
    }

    /// Gives the complete table its name. Returns its path and number of rows.
    pub(super) fn finish(self) -> Result<(PathBuf, usize), Diagnostics> {
        self.file
            .finish()
            .map_err(|error| unwritten(&self.path, &error))?;
        Ok((self.path, self.rows))
    }

    fn flush(&mut self) -> Result<(), Diagnostics> {
        let height = std::mem::take(&mut self.waiting);
        if height == 0 {
            return Ok(());
        }
        let cells = self.cells.iter_mut().map(std::mem::take).collect();
        let written =
            frame(&self.spec, cells, height).and_then(|frame| self.writer.write_batch(&frame));
        written.map_err(|error| unwritten(&self.path, &error))
    }
}

fn frame(spec: &TableSpec, cells: Vec<Vec<Cell>>, height: usize) -> Result<DataFrame, PolarsError> {
    let columns = spec
        .columns
        .iter()
        .zip(cells)
        .map(|(column, cells)| series(column.name, column.kind, cells));
    DataFrame::new(height, columns.collect())
}
