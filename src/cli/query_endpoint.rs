//! `actcheck query --endpoint`

use serde_json::Value;

use crate::options::QueryFormat;
use crate::query::{QueryArgs, turtle_line, turtle_prefixes, unanswered};
use crate::{output, remote, stop};
use actcheck_base::{Diagnostic, Diagnostics, Source, Term, names};
use actcheck_history::{ForeignAnswer, check_query, without_counts};
use actcheck_remote::{Address, ask};
use actcheck_report::{TableFormat, TableParts, answer_cells};

/// Largest part of an answer in memory: this number of rows, or this length of their texts in
/// bytes.
const MOST_ROWS: usize = 10_000;
const MOST_TEXT: usize = 16 << 20;

/// Sends a query to an endpoint, and prints its answer while it arrives. Returns the exit code.
pub fn query(args: &QueryArgs, url: &str, text: &Source) -> Result<u8, Diagnostics> {
    let address = Address::parse(url)?;
    stop::interruptible(|flag| {
        let client = remote::client(flag)?;
        let answer = ask(&client, &address, &standard(text), || check_query(text))?;
        print(
            args.format,
            text,
            ForeignAnswer::read(&answer.media_type, answer.body)?,
        )?;
        Ok(0)
    })
}

/// The query without our extensions: prefixes are declared, and our function is defined. Lines keep
/// their numbers.
fn standard(text: &Source) -> String {
    let prefixes = names::PREFIXES
        .iter()
        .map(|(prefix, namespace)| format!("PREFIX {prefix}: <{namespace}> "));
    prefixes.collect::<String>() + &without_counts(&text.text)
}

fn print(format: QueryFormat, text: &Source, answer: ForeignAnswer) -> Result<(), Diagnostics> {
    let of_cells = match format {
        QueryFormat::Text => TableFormat::Table,
        QueryFormat::Csv => TableFormat::Csv,
        QueryFormat::Json | QueryFormat::Turtle => TableFormat::Json,
    };
    let is_empty = match answer {
        ForeignAnswer::Boolean(value) => {
            print_rows(
                format,
                vec!["answer".to_owned()],
                std::iter::once(Ok(vec![Value::Bool(value)])),
            )?;
            !value
        }
        ForeignAnswer::Table { columns, rows } => print_rows(
            format,
            columns,
            rows.map(|row| Ok(answer_cells(row?.iter().map(Option::as_ref), of_cells))),
        )?,
        ForeignAnswer::Graph(triples) if format == QueryFormat::Turtle => print_turtle(triples)?,
        ForeignAnswer::Graph(triples) => {
            let columns = ["subject", "predicate", "object"].map(str::to_owned).into();
            print_rows(
                format,
                columns,
                triples.map(|triple| Ok(answer_cells(triple?.iter().map(Some), of_cells))),
            )?
        }
    };
    if is_empty {
        unanswered(text)?;
    }
    Ok(())
}

/// Prints a table in parts. Returns whether it has no rows.
fn print_rows(
    format: QueryFormat,
    columns: Vec<String>,
    rows: impl Iterator<Item = Result<Vec<Value>, Diagnostics>>,
) -> Result<bool, Diagnostics> {
    let format = match format {
        QueryFormat::Text => TableFormat::Table,
        QueryFormat::Csv => TableFormat::Csv,
        QueryFormat::Json => TableFormat::Json,
        QueryFormat::Turtle => {
            return Err(Diagnostic::error(
                "X004",
                "this query's answer is a table, but Turtle is for graphs",
            )
            .help("use CONSTRUCT or DESCRIBE, or `--format text`, `csv` or `json`")
            .into());
        }
    };
    let mut parts = TableParts::new(columns, format, output::page());
    let (mut part, mut length, mut is_empty) = (Vec::new(), 0, true);
    for row in rows {
        let row = match row {
            Ok(row) => row,
            Err(faults) => {
                // Rows that came before the fault are printed.
                output::print(&parts.part(part));
                return Err(faults);
            }
        };
        is_empty = false;
        length += row
            .iter()
            .map(|cell| cell.as_str().map_or(8, str::len))
            .sum::<usize>();
        part.push(row);
        if part.len() >= MOST_ROWS || length >= MOST_TEXT {
            output::print(&parts.part(std::mem::take(&mut part)));
            length = 0;
        }
    }
    if !part.is_empty() {
        output::print(&parts.part(part));
    }
    output::print(&parts.end());
    Ok(is_empty)
}

/// Prints a graph in Turtle. Returns whether it is empty.
fn print_turtle(
    triples: impl Iterator<Item = Result<[Term; 3], Diagnostics>>,
) -> Result<bool, Diagnostics> {
    let (mut text, mut is_empty) = (turtle_prefixes(), true);
    for triple in triples {
        text.push_str(&turtle_line(&triple?));
        is_empty = false;
        if text.len() >= MOST_TEXT {
            output::print(&std::mem::take(&mut text));
        }
    }
    output::print(&text);
    Ok(is_empty)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_for_other_stores_needs_no_extension_and_keeps_its_lines() {
        let query = "# A comment\nSELECT ?run {\n ?run a act:Run FILTER(act:counts(?run))\n}";
        let standard = standard(&Source::new("query", query));
        assert!(
            standard.starts_with("PREFIX act: <http://actions#> PREFIX w: "),
            "{standard}"
        );
        assert_eq!(standard.lines().count(), query.lines().count());
        assert!(!standard.contains("act:counts"));
    }
}
