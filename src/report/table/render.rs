//! Flat tables that are printed as text, CSV or JSON.

use serde_json::{Map, Value};

use crate::text::ruled;

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
}

impl Table {
    /// Creates a table without rows.
    pub fn new<S: Into<String>>(columns: impl IntoIterator<Item = S>) -> Self {
        Self { columns: columns.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Renders the table, with a trailing newline.
    pub fn render(&self, format: TableFormat) -> String {
        match format {
            TableFormat::Table => self.text(),
            TableFormat::Csv => self.csv(),
            TableFormat::Json => self.json(),
        }
    }

    fn text(&self) -> String {
        let mut table = ruled();
        table.set_header(&self.columns);
        for row in &self.rows {
            table.add_row(row.iter().map(plain));
        }
        format!("{table}\n")
    }

    fn csv(&self) -> String {
        let mut writer = csv::WriterBuilder::new().from_writer(Vec::new());
        let rows =
            std::iter::once(self.columns.clone()).chain(self.rows.iter().map(|row| row.iter().map(plain).collect()));
        for row in rows {
            writer.write_record(&row).expect("writing to memory does not fail, and every row has all columns");
        }
        let bytes = writer.into_inner().expect("writing to memory does not fail");
        String::from_utf8(bytes).expect("only text was written")
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

/// Formats a cell as text: strings without quotes, `null` as an empty string.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
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
        table.rows.push(vec!["k-2".into(), 1.0.into(), "a, \"b\"".into()]);
        assert_eq!(table.render(TableFormat::Csv), "run,score,note\nk-1,0.8,\nk-2,1.0,\"a, \"\"b\"\"\"\n");
        assert!(table.render(TableFormat::Json).contains("\"note\": null"));
        assert!(table.render(TableFormat::Table).contains("k-1"));
    }
}
