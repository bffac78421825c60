//! The table in memory, with interned texts, as the analyses read it.

use std::collections::BTreeMap;
use std::sync::mpsc::sync_channel;
use std::thread::available_parallelism;

use polars::prelude::{BooleanChunked, DataFrame, DataType, NewChunkedArray as _, PolarsError};
use rustc_hash::FxHashMap;

use crate::Sampling;
use crate::tables::columns::{ColumnKind, columns};
use crate::tables::mirror::{Mirror, TableFile, read, unread};
use actcheck_base::Diagnostics;

/// Number of files from which threads read them: starting them takes as long as reading a few.
const MANY: usize = 8;
/// Number of files that each thread reads ahead.
const AHEAD: usize = 4;

/// Selects rows of the table. The default is all rows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TableFilter {
    /// Only rows of these campaigns.
    pub campaigns: Option<Vec<String>>,
    /// Only rows of runs that began at this time or later (RFC 3339, in UTC).
    pub since: Option<String>,
}

impl TableFilter {
    pub(crate) fn takes_campaign(&self, campaign: &str) -> bool {
        self.campaigns
            .as_ref()
            .is_none_or(|wanted| wanted.iter().any(|wanted| wanted == campaign))
    }

    /// Returns the selected rows.
    pub(super) fn rows_of(&self, frame: DataFrame) -> Result<DataFrame, PolarsError> {
        let Some(since) = &self.since else {
            return Ok(frame);
        };
        // All times are in UTC with the same number of digits, so that they sort as text.
        let late: Vec<bool> = frame
            .column("started")?
            .str()?
            .iter()
            .map(|started| started.is_some_and(|it| it >= since.as_str()))
            .collect();
        frame.filter(&BooleanChunked::from_slice("late".into(), &late))
    }
}

/// A column of deduplicated texts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TextColumn {
    /// For each row, the index of its text in `texts`, or `None` if missing.
    pub of_row: Vec<Option<u32>>,
    /// The distinct texts, in the order of first occurrence.
    pub texts: Vec<String>,
}

impl TextColumn {
    /// Returns the text of a row, or `None` if it is missing.
    pub fn get(&self, row: usize) -> Option<&str> {
        self.of_row
            .get(row)
            .copied()
            .flatten()
            .and_then(|of| self.texts.get(of as usize))
            .map(String::as_str)
    }
}

/// Rows of the table with some of its columns. Counts and Booleans (0 and 1) are numbers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OutcomeTable {
    rows: usize,
    texts: BTreeMap<&'static str, TextColumn>,
    numbers: BTreeMap<&'static str, Vec<f64>>,
    /// How the number of runs was decided: which intervals of rates are valid.
    pub sampling: Sampling,
}

impl OutcomeTable {
    /// Reads some columns of a mirror.
    ///
    /// # Errors
    /// `A002` if a file can't be read.
    pub fn read(
        mirror: &Mirror,
        filter: &TableFilter,
        wanted: &[&str],
    ) -> Result<Self, Diagnostics> {
        let files = mirror
            .files()
            .iter()
            .filter(|file| filter.takes_campaign(&file.campaign));
        Self::read_files(&files.collect::<Vec<_>>(), filter, wanted)
    }

    /// Reads some columns of a sample: of files at equal distances, so that all times and campaigns
    /// have their share of the rows. The sample has about `most_rows` rows, and is the same each
    /// time.
    ///
    /// # Errors
    /// `A002` if a file can't be read.
    pub fn read_sample(
        mirror: &Mirror,
        filter: &TableFilter,
        wanted: &[&str],
        most_rows: usize,
    ) -> Result<Self, Diagnostics> {
        let all = mirror.rows(filter);
        let mut before = 0;
        let files = mirror
            .files()
            .iter()
            .filter(|file| filter.takes_campaign(&file.campaign))
            .filter(|file| {
                // Files have different sizes: one is taken whenever the rows before its end reach
                // the next part of all rows.
                let part = |rows: usize| {
                    rows as u128 * most_rows as u128
                        / (all.max(1) as u128 * file.rows.max(1) as u128)
                };
                let taken = part(before + file.rows) > part(before);
                before += file.rows;
                taken
            });
        Self::read_files(&files.collect::<Vec<_>>(), filter, wanted)
    }

    fn read_files(
        files: &[&TableFile],
        filter: &TableFilter,
        wanted: &[&str],
    ) -> Result<Self, Diagnostics> {
        let mut table = Self::default();
        let mut names: Vec<&str> = wanted.to_vec();
        if filter.since.is_some() && !names.contains(&"started") {
            names.push("started");
        }
        for column in columns()
            .iter()
            .filter(|column| names.contains(&column.name))
        {
            match column.kind {
                ColumnKind::Text => drop(table.texts.insert(column.name, TextColumn::default())),
                _ => drop(table.numbers.insert(column.name, Vec::new())),
            }
        }
        let mut known: BTreeMap<&'static str, FxHashMap<String, u32>> = BTreeMap::new();
        let frame = |file: &TableFile| {
            read(&file.path, Some(&names)).and_then(|frame| filter.rows_of(frame))
        };
        let threads = available_parallelism().map_or(1, usize::from);
        if files.len() < MANY || threads == 1 {
            for file in files {
                frame(file)
                    .and_then(|frame| table.append(&frame, &mut known))
                    .map_err(|error| unread(&file.path, &error))?;
            }
            return Ok(table);
        }
        // Each thread reads every n-th file, ahead of the rows that are added here.
        std::thread::scope(|scope| {
            let frame = &frame;
            let frames = (0..threads).map(|thread| {
                let (sender, receiver) = sync_channel(AHEAD);
                scope.spawn(move || {
                    let own = files.iter().skip(thread).step_by(threads);
                    // Without a receiver, no further file is needed.
                    own.map(|file| frame(file))
                        .try_for_each(|frame| sender.send(frame).map_err(drop))
                });
                receiver
            });
            let frames: Vec<_> = frames.collect();
            for (at, file) in files.iter().enumerate() {
                // A thread without a further frame has panicked, which the scope reports.
                let Ok(frame) = frames[at % threads].recv() else {
                    break;
                };
                frame
                    .and_then(|frame| table.append(&frame, &mut known))
                    .map_err(|error| unread(&file.path, &error))?;
            }
            Ok(table)
        })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows
    }

    /// Whether the table has no rows.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Returns a text column, or an empty column if it was not read.
    pub fn text(&self, name: &str) -> &TextColumn {
        static NONE: TextColumn = TextColumn {
            of_row: Vec::new(),
            texts: Vec::new(),
        };
        self.texts.get(name).unwrap_or(&NONE)
    }

    /// Returns a numeric column, with NaN for missing values, or an empty slice if it was not read.
    pub fn number(&self, name: &str) -> &[f64] {
        self.numbers.get(name).map_or(&[], Vec::as_slice)
    }

    /// Returns, for each run (an index into the texts of the column `run`), whether it counts in
    /// rates: of runs with bit-identical traces only the newest does, because the others add no
    /// evidence. Needs the columns `run` and `trace_hash`.
    pub fn counted_runs(&self) -> Vec<bool> {
        let (runs, hashes) = (self.text("run"), self.text("trace_hash"));
        let mut newest: Vec<Option<u32>> = vec![None; hashes.texts.len()];
        for (run, hash) in runs.of_row.iter().zip(&hashes.of_row) {
            if let (Some(run), Some(hash)) = (run, hash) {
                newest[*hash as usize] = Some(*run);
            }
        }
        let mut counted = vec![true; runs.texts.len()];
        for (run, hash) in runs.of_row.iter().zip(&hashes.of_row) {
            if let (Some(run), Some(hash)) = (run, hash) {
                // A run without a hash (broken before its first state) is never a duplicate.
                let hash = *hash as usize;
                counted[*run as usize] =
                    hashes.texts[hash].is_empty() || newest[hash] == Some(*run);
            }
        }
        counted
    }

    fn append(
        &mut self,
        frame: &DataFrame,
        known: &mut BTreeMap<&'static str, FxHashMap<String, u32>>,
    ) -> Result<(), PolarsError> {
        for (name, column) in &mut self.texts {
            let known = known.entry(name).or_default();
            // Rows of a run are contiguous: most texts equal that of the previous row.
            let mut before: Option<(&str, u32)> = None;
            for text in frame.column(name)?.str()?.iter() {
                let place = text.map(|text| match before {
                    Some((last, place)) if last == text => place,
                    _ => {
                        let place = place_of(text, known, &mut column.texts);
                        before = Some((text, place));
                        place
                    }
                });
                column.of_row.push(place);
            }
        }
        for (name, column) in &mut self.numbers {
            let numbers = frame.column(name)?.cast(&DataType::Float64)?;
            column.extend(
                numbers
                    .f64()?
                    .iter()
                    .map(|number| number.unwrap_or(f64::NAN)),
            );
        }
        self.rows += frame.height();
        Ok(())
    }
}

/// Returns the index of a text, adding it if it is new.
fn place_of(text: &str, known: &mut FxHashMap<String, u32>, texts: &mut Vec<String>) -> u32 {
    if let Some(place) = known.get(text) {
        return *place;
    }
    let place = u32::try_from(texts.len()).unwrap_or(u32::MAX);
    known.insert(text.to_owned(), place);
    texts.push(text.to_owned());
    place
}
