//! The table in memory, as analysis reads it: texts by number, numbers as they are.

use std::collections::BTreeMap;

use polars::prelude::{BooleanChunked, DataFrame, DataType, NewChunkedArray as _, PolarsError};

use crate::analysis::tables::columns::{ColumnKind, columns};
use crate::analysis::tables::mirror::{Mirror, read, unread};
use crate::base::Diagnostics;

/// Which rows are asked for; the default is all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TableFilter {
    /// Only those of these campaigns.
    pub campaigns: Option<Vec<String>>,
    /// Only those of runs that began at this moment or later (RFC 3339, in UTC).
    pub since: Option<String>,
}

impl TableFilter {
    pub(in crate::analysis) fn takes_campaign(&self, campaign: &str) -> bool {
        self.campaigns.as_ref().is_none_or(|wanted| wanted.iter().any(|wanted| wanted == campaign))
    }

    /// The rows that it lets through.
    pub(super) fn rows_of(&self, frame: DataFrame) -> Result<DataFrame, PolarsError> {
        let Some(since) = &self.since else { return Ok(frame) };
        // All are written in UTC with as many digits, so that their order is that of their texts.
        let late: Vec<bool> = frame
            .column("started")?
            .str()?
            .iter()
            .map(|started| started.is_some_and(|it| it >= since.as_str()))
            .collect();
        frame.filter(&BooleanChunked::from_slice("late".into(), &late))
    }
}

/// A column of texts: each different one once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TextColumn {
    /// For each row the place of its text in `texts`; nothing where it has none.
    pub of_row: Vec<Option<u32>>,
    /// The texts, in the order in which they were met.
    pub texts: Vec<String>,
}

impl TextColumn {
    /// The text of a row.
    pub fn get(&self, row: usize) -> Option<&str> {
        self.of_row.get(row).copied().flatten().and_then(|of| self.texts.get(of as usize)).map(String::as_str)
    }
}

/// Rows of the table with some of its columns. Counts are numbers, and so are truths: 0 and 1.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OutcomeTable {
    rows: usize,
    texts: BTreeMap<&'static str, TextColumn>,
    numbers: BTreeMap<&'static str, Vec<f64>>,
}

impl OutcomeTable {
    /// Reads some columns of a mirror.
    ///
    /// # Errors
    /// `A002` a file can't be read.
    pub fn read(mirror: &Mirror, filter: &TableFilter, wanted: &[&str]) -> Result<Self, Diagnostics> {
        let mut table = Self::default();
        let mut names: Vec<&str> = wanted.to_vec();
        if filter.since.is_some() && !names.contains(&"started") {
            names.push("started");
        }
        for column in columns().iter().filter(|column| names.contains(&column.name)) {
            match column.kind {
                ColumnKind::Text => drop(table.texts.insert(column.name, TextColumn::default())),
                _ => drop(table.numbers.insert(column.name, Vec::new())),
            }
        }
        let mut known: BTreeMap<&'static str, BTreeMap<String, u32>> = BTreeMap::new();
        for (_, file) in mirror.files().filter(|(campaign, _)| filter.takes_campaign(campaign)) {
            let rows = read(file, Some(&names)).and_then(|frame| filter.rows_of(frame));
            rows.and_then(|frame| table.append(&frame, &mut known)).map_err(|error| unread(file, &error))?;
        }
        Ok(table)
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.rows
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// A column of texts that was asked for; without rows for any other.
    pub fn text(&self, name: &str) -> &TextColumn {
        static NONE: TextColumn = TextColumn { of_row: Vec::new(), texts: Vec::new() };
        self.texts.get(name).unwrap_or(&NONE)
    }

    /// A column of numbers that was asked for, NaN where there is none; empty for any other.
    pub fn number(&self, name: &str) -> &[f64] {
        self.numbers.get(name).map_or(&[], Vec::as_slice)
    }

    fn append(
        &mut self,
        frame: &DataFrame,
        known: &mut BTreeMap<&'static str, BTreeMap<String, u32>>,
    ) -> Result<(), PolarsError> {
        for (name, column) in &mut self.texts {
            let known = known.entry(name).or_default();
            // Rows of one run stand together: most texts are those of the row before.
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
            column.extend(numbers.f64()?.iter().map(|number| number.unwrap_or(f64::NAN)));
        }
        self.rows += frame.height();
        Ok(())
    }
}

/// The place of a text, which is added where it is new.
fn place_of(text: &str, known: &mut BTreeMap<String, u32>, texts: &mut Vec<String>) -> u32 {
    if let Some(place) = known.get(text) {
        return *place;
    }
    let place = u32::try_from(texts.len()).unwrap_or(u32::MAX);
    known.insert(text.to_owned(), place);
    texts.push(text.to_owned());
    place
}
