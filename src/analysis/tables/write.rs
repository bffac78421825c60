//! Export of the table: one file in Parquet or CSV, and a description of its columns.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use polars::prelude::{
    CsvWriter, DataFrame, NamedFrom as _, ParquetWriter, PolarsError, SerWriter as _,
    Series as Values,
};
use serde_json::{Value, json};

use crate::tables::columns::{ColumnKind, ColumnRole, columns};
use crate::tables::frames::{Rows, kinds_columns, with_kinds};
use crate::tables::mirror::{Mirror, read, unread, unwritten};
use crate::tables::{Hierarchy, OutcomeTable, TableFilter};
use actcheck_base::{Below, Diagnostics, NewFile};

/// Column that says whether a run counts in rates over the exported rows.
const COUNTS: &str = "counts";

/// Writes `outcomes.parquet` into a folder, creating it if needed, and its description beside it:
/// `FOLDER.schema.json`. Returns the files and the number of rows.
///
/// # Errors
/// `A001` if they can't be written, `A002` if the mirror can't be read.
pub fn export_parquet(
    mirror: &Mirror,
    filter: &TableFilter,
    hierarchy: &Hierarchy,
    folder: &Path,
) -> Result<(Vec<PathBuf>, usize), Diagnostics> {
    written(pending_parquet(mirror, filter, hierarchy, folder)?, folder)
}

/// Writes `outcomes.parquet` into a folder, creating it if needed, without giving it its name.
pub(crate) fn pending_parquet(
    mirror: &Mirror,
    filter: &TableFilter,
    hierarchy: &Hierarchy,
    folder: &Path,
) -> Result<Pending, Diagnostics> {
    export(folder, "outcomes.parquet", |file, writer| {
        let schema = empty(hierarchy).map_err(|error| unwritten(file, &error))?;
        let mut writer = ParquetWriter::new(writer)
            .batched(schema.schema())
            .map_err(|error| unwritten(file, &error))?;
        let rows = each(mirror, filter, hierarchy, |frame| {
            writer
                .write_batch(frame)
                .map_err(|error| unwritten(file, &error))
        })?;
        writer.finish().map_err(|error| unwritten(file, &error))?;
        Ok(rows)
    })
}

/// Writes `outcomes.csv` into a folder, creating it if needed, and its description beside it, as
/// [`export_parquet`]. Returns the files and the number of rows.
///
/// # Errors
/// As [`export_parquet`].
pub fn export_csv(
    mirror: &Mirror,
    filter: &TableFilter,
    hierarchy: &Hierarchy,
    folder: &Path,
) -> Result<(Vec<PathBuf>, usize), Diagnostics> {
    let pending = export(folder, "outcomes.csv", |file, writer| {
        let schema = empty(hierarchy).map_err(|error| unwritten(file, &error))?;
        let mut writer = CsvWriter::new(writer)
            .batched(schema.schema())
            .map_err(|error| unwritten(file, &error))?;
        let rows = each(mirror, filter, hierarchy, |frame| {
            writer
                .write_batch(frame)
                .map_err(|error| unwritten(file, &error))
        })?;
        writer.finish().map_err(|error| unwritten(file, &error))?;
        Ok(rows)
    })?;
    written(pending, folder)
}

/// A table that is complete but has no name yet.
pub(crate) struct Pending {
    table: (PathBuf, NewFile),
    rows: usize,
}

impl Pending {
    /// Gives the table its name. Returns its path and number of rows.
    pub(crate) fn finish_table(self) -> Result<(PathBuf, usize), Diagnostics> {
        let (table, file) = self.table;
        file.finish().map_err(|error| unwritten(&table, &error))?;
        Ok((table, self.rows))
    }
}

/// Gives a folder's only table its name, and describes it.
fn written(pending: Pending, folder: &Path) -> Result<(Vec<PathBuf>, usize), Diagnostics> {
    let (around, described) = description_of(folder);
    let text = new_text(
        &Below::new(around),
        &described,
        &format!("{:#}\n", schema()),
    )?;
    let (table, rows) = pending.finish_table()?;
    text.finish()
        .map_err(|error| unwritten(&described, &error))?;
    Ok((vec![table, described], rows))
}

/// The description of a folder's only table, and its folder. It is beside the table's folder:
/// pandas and polars take each file of a folder for a part of one table.
fn description_of(folder: &Path) -> (PathBuf, PathBuf) {
    // `.` and `..` have names, too.
    let named = if folder.file_name().is_some() {
        Some(folder.to_path_buf())
    } else {
        folder.canonicalize().ok()
    };
    let parts = named
        .as_deref()
        .and_then(|folder| Some((folder.parent()?, folder.file_name()?)));
    match parts {
        Some((around, name)) => {
            let mut name = name.to_os_string();
            name.push(".schema.json");
            (around.to_path_buf(), around.join(name))
        }
        None => (folder.to_path_buf(), folder.join("schema.json")),
    }
}

fn export(
    folder: &Path,
    name: &str,
    write: impl FnOnce(&Path, File) -> Result<usize, Diagnostics>,
) -> Result<Pending, Diagnostics> {
    let below = Below::new(folder);
    below
        .create_folder(folder)
        .map_err(|error| unwritten(folder, &error))?;
    let table = folder.join(name);
    let file = below
        .new_file(&table)
        .map_err(|error| unwritten(&table, &error))?;
    let writer = file.writer().map_err(|error| unwritten(&table, &error))?;
    let rows = write(&table, writer)?;
    Ok(Pending {
        table: (table, file),
        rows,
    })
}

/// Writes a text without giving the file its name.
pub(crate) fn new_text(below: &Below, path: &Path, text: &str) -> Result<NewFile, Diagnostics> {
    let write = || -> std::io::Result<NewFile> {
        let file = below.new_file(path)?;
        file.writer()?.write_all(text.as_bytes())?;
        Ok(file)
    };
    write().map_err(|error| unwritten(path, &error))
}

/// Returns the description of every column.
pub(crate) fn schema() -> Value {
    let mut described: Vec<Value> = columns().iter().map(|column| json!(column)).collect();
    described.extend(kinds_columns().map(|(name, of, description)| {
        json!({
            "name": name, "type": ColumnKind::Text, "unit": "", "parameter": of.parameter, "role": of.role,
            "description": description,
        })
    }));
    described.push(json!({
        "name": COUNTS, "type": ColumnKind::Bool, "unit": "", "parameter": false, "role": ColumnRole::Record,
        "description": "whether the run counts in rates over all rows: false if a later run is bit-identical",
    }));
    json!({ "rows": "one for each run, action and property", "columns": described })
}

/// Returns a table with all columns and no rows.
fn empty(hierarchy: &Hierarchy) -> Result<DataFrame, PolarsError> {
    let mut frame = Rows::default().frame()?;
    with_kinds(&mut frame, hierarchy)?;
    with_counts(&mut frame, &BTreeSet::new())?;
    Ok(frame)
}

/// The ids of the selected runs that count in rates.
fn counted_runs(mirror: &Mirror, filter: &TableFilter) -> Result<BTreeSet<String>, Diagnostics> {
    let table = OutcomeTable::read(mirror, filter, &["run", "trace_hash"])?;
    let runs = table.text("run").texts.iter().zip(table.counted_runs());
    Ok(runs
        .filter(|(_, counts)| *counts)
        .map(|(run, _)| run.clone())
        .collect())
}

/// Adds the column [`COUNTS`].
fn with_counts(frame: &mut DataFrame, counted: &BTreeSet<String>) -> Result<(), PolarsError> {
    let runs = frame.column("run")?.str()?;
    let counts: Vec<Option<bool>> = runs
        .iter()
        .map(|run| run.map(|run| counted.contains(run)))
        .collect();
    frame.with_column(Values::new(COUNTS.into(), counts).into())?;
    Ok(())
}

/// Passes the selected rows to `take`, file by file. Returns their number.
fn each(
    mirror: &Mirror,
    filter: &TableFilter,
    hierarchy: &Hierarchy,
    mut take: impl FnMut(&DataFrame) -> Result<(), Diagnostics>,
) -> Result<usize, Diagnostics> {
    let mut rows = 0;
    let counted = counted_runs(mirror, filter)?;
    for file in mirror
        .files()
        .iter()
        .filter(|file| filter.takes_campaign(&file.campaign))
    {
        let file = &file.path;
        let read = || -> Result<DataFrame, PolarsError> {
            let mut frame = filter.rows_of(read(file, None)?)?;
            with_kinds(&mut frame, hierarchy)?;
            with_counts(&mut frame, &counted)?;
            frame.rechunk_mut();
            Ok(frame)
        };
        let frame = read().map_err(|error| unread(file, &error))?;
        rows += frame.height();
        if frame.height() > 0 {
            take(&frame)?;
        }
    }
    Ok(rows)
}
