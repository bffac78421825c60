//! Flat tables that are printed as text, CSV or JSON.

use std::num::NonZero;
use std::thread;

use serde_json::{Map, Value};

use crate::text::{Page, align, fit, ruled, stacked};
use actcheck_base::printable;

/// Tables with more rows are long.
const LONG: usize = 8192;

/// Output format of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TableFormat {
    /// Aligned columns for people.
    #[default]
    Table,
    /// Comma-separated values with a header line (RFC 4180, but lines end in `\n`).
    Csv,
    /// A JSON array of objects.
    Json,
}

/// A table with named columns. A cell without a value is `null` in JSON and empty elsewhere.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Rows, each with one value per column.
    pub rows: Vec<Vec<Value>>,
    /// Columns that a narrow terminal leaves out, the least important one first.
    pub expendable: Vec<&'static str>,
}

impl Table {
    /// Creates a table without rows.
    pub fn new<S: Into<String>>(columns: impl IntoIterator<Item = S>) -> Self {
        Self {
            columns: columns.into_iter().map(Into::into).collect(),
            ..Self::default()
        }
    }

    /// Sets the columns that a narrow terminal leaves out, the least important one first.
    #[must_use]
    pub fn with_expendable(self, expendable: impl IntoIterator<Item = &'static str>) -> Self {
        Self {
            expendable: expendable.into_iter().collect(),
            ..self
        }
    }

    /// Renders the table, with a trailing newline. Only text depends on the page.
    pub fn render(&self, format: TableFormat, page: Page) -> String {
        match format {
            TableFormat::Table => self.text(page),
            TableFormat::Csv => self.csv(),
            TableFormat::Json => self.json(),
        }
    }

    /// Aligned columns, or one line for each value if they are too wide for the terminal.
    fn text(&self, page: Page) -> String {
        if page.width.is_none() && self.rows.len() > LONG {
            return page.set(&self.long_text());
        }
        let mut table = ruled();
        table.set_header(&self.columns);
        for row in &self.rows {
            table.add_row(row.iter().map(plain));
        }
        page.set(&match fit(&mut table, page, &self.expendable) {
            Some(hidden) if hidden.is_empty() => format!("{table}\n"),
            Some(hidden) => {
                let hidden = hidden.join(", ");
                format!("{table}\n (not shown at this width: {hidden}; `--format csv` has all columns)\n")
            }
            None => stacked(&self.texts()),
        })
    }

    /// Aligned columns of a table that has many rows, and needs to fit no terminal. All processors
    /// format it.
    fn long_text(&self) -> String {
        let threads = thread::available_parallelism().map_or(1, NonZero::get);
        let blocks = self.rows.chunks(self.rows.len().div_ceil(threads).max(1));
        let mut tables = in_threads(blocks, |rows| {
            let mut table = ruled();
            table.add_rows(rows.iter().map(|row| row.iter().map(plain)));
            table
        });
        if let Some(first) = tables.first_mut() {
            first.set_header(&self.columns);
        }
        align(&mut tables);
        in_threads(tables.iter(), |table| format!("{table}\n")).concat()
    }

    /// The texts of each column, the header first.
    fn texts(&self) -> Vec<Vec<String>> {
        let column = |(idx, name): (usize, &String)| {
            std::iter::once(name.clone())
                .chain(self.rows.iter().map(|row| plain(&row[idx])))
                .collect()
        };
        self.columns.iter().enumerate().map(column).collect()
    }

    fn csv(&self) -> String {
        csv_lines(std::iter::once(self.columns.clone())) + &self.csv_rows()
    }

    /// The rows as comma-separated values, without the header line.
    pub fn csv_rows(&self) -> String {
        csv_lines(self.rows.iter().map(|row| row.iter().map(plain).collect()))
    }

    fn json(&self) -> String {
        format!("{:#}\n", self.objects())
    }

    /// Returns a JSON array with one object per row.
    pub(crate) fn objects(&self) -> Value {
        let object = |row: &Vec<Value>| {
            let pairs = self.columns.iter().cloned().zip(row.iter().cloned());
            Value::Object(pairs.collect::<Map<String, Value>>())
        };
        Value::Array(self.rows.iter().map(object).collect())
    }
}

/// A table that is written in parts, so that only one part is in memory. As text, each part is a
/// table of its own.
#[derive(Debug)]
pub struct TableParts {
    columns: Vec<String>,
    format: TableFormat,
    page: Page,
    /// Whether a part was written.
    has_begun: bool,
}

impl TableParts {
    /// Begins a table.
    pub fn new<S: Into<String>>(
        columns: impl IntoIterator<Item = S>,
        format: TableFormat,
        page: Page,
    ) -> Self {
        Self {
            columns: columns.into_iter().map(Into::into).collect(),
            format,
            page,
            has_begun: false,
        }
    }

    /// Renders the next rows. The parts and the end together are [`Table::render`] of all rows,
    /// except for text.
    pub fn part(&mut self, rows: Vec<Vec<Value>>) -> String {
        if rows.is_empty() && self.format == TableFormat::Json {
            return String::new();
        }
        let is_first = !std::mem::replace(&mut self.has_begun, true);
        let table = Table {
            rows,
            ..Table::new(&self.columns)
        };
        let text = table.render(self.format, self.page);
        match self.format {
            TableFormat::Table => text,
            TableFormat::Csv if is_first => text,
            TableFormat::Csv => table.csv_rows(),
            TableFormat::Json => {
                let objects = text
                    .strip_prefix("[\n")
                    .and_then(|text| text.strip_suffix("\n]\n"))
                    .unwrap_or_default();
                format!("{}{objects}", if is_first { "[\n" } else { ",\n" })
            }
        }
    }

    /// Renders the end.
    pub fn end(&mut self) -> String {
        match (self.format, self.has_begun) {
            (TableFormat::Json, true) => "\n]\n".to_owned(),
            (_, true) => String::new(),
            (TableFormat::Json, false) => "[]\n".to_owned(),
            (_, false) => self.part(Vec::new()),
        }
    }
}

/// Converts items, each in a thread of its own, in order.
fn in_threads<T: Send, U: Send>(
    items: impl Iterator<Item = T>,
    convert: impl Fn(T) -> U + Sync,
) -> Vec<U> {
    let convert = &convert;
    thread::scope(|scope| {
        let begun: Vec<_> = items
            .map(|item| scope.spawn(move || convert(item)))
            .collect();
        begun
            .into_iter()
            .map(|thread| {
                thread
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect()
    })
}

fn csv_lines(rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut writer = csv::WriterBuilder::new().from_writer(Vec::new());
    for row in rows {
        writer
            .write_record(&row)
            .expect("writing to memory does not fail, and every row has all columns");
    }
    let bytes = writer
        .into_inner()
        .expect("writing to memory does not fail");
    String::from_utf8(bytes).expect("only text was written")
}

/// Formats a cell as text: strings without quotes, `null` as an empty string.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => printable(text).into_owned(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_written_in_three_formats() {
        let mut table = Table::new(["run", "score", "note"]);
        table.rows.push(vec!["k-1".into(), 0.8.into(), Value::Null]);
        table
            .rows
            .push(vec!["k-2".into(), 1.0.into(), "a, \"b\"".into()]);
        assert_eq!(
            table.render(TableFormat::Csv, Page::default()),
            "run,score,note\nk-1,0.8,\nk-2,1.0,\"a, \"\"b\"\"\"\n"
        );
        assert!(
            table
                .render(TableFormat::Json, Page::default())
                .contains("\"note\": null")
        );
        assert!(
            table
                .render(TableFormat::Table, Page::default())
                .contains("k-1")
        );
    }

    #[test]
    fn parts_are_together_the_whole_table() {
        let rows: Vec<Vec<Value>> = (0..5)
            .map(|row| vec![row.into(), format!("a\n{row}").into()])
            .collect();
        for format in [TableFormat::Csv, TableFormat::Json] {
            for count in [0, 1, 2, 5] {
                let table = Table {
                    rows: rows[..count].to_vec(),
                    ..Table::new(["n", "text"])
                };
                for size in [1, 2, 3, 5] {
                    let mut parts = TableParts::new(["n", "text"], format, Page::default());
                    let mut text: String = table
                        .rows
                        .chunks(size)
                        .map(|rows| parts.part(rows.to_vec()))
                        .collect();
                    text += &parts.end();
                    assert_eq!(
                        text,
                        table.render(format, Page::default()),
                        "{count} rows in parts of {size}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_long_table_is_aligned_as_a_whole() {
        let mut table = Table::new(["n", "a wide title"]);
        table.rows.extend(
            (0..3 * LONG / 2)
                .map(|row| vec![row.into(), "é".repeat(row % 7 + row / LONG * 9).into()]),
        );
        let mut whole = ruled();
        whole.set_header(&table.columns);
        whole.add_rows(table.rows.iter().map(|row| row.iter().map(plain)));
        assert_eq!(table.text(Page::default()), format!("{whole}\n"));
    }

    #[test]
    fn a_table_that_is_too_wide_is_stacked() {
        let mut table = Table::new(["iri", "count"]).with_expendable(["count"]);
        table
            .rows
            .push(vec!["https://example.org/a/long/name".into(), 1.into()]);
        table.rows.push(vec!["b".into(), 2.into()]);
        let wide =
            " iri     https://example.org/a/long/name\n count   1\n\n iri     b\n count   2\n";
        let text = |width: usize| {
            table.text(Page {
                width: Some(width),
                colour: false,
            })
        };
        assert_eq!(text(22), wide);
        assert!(
            text(35).contains("not shown at this width: count;"),
            "{}",
            text(35)
        );
        assert!(!table.text(Page::default()).contains("not shown"));
    }
}
