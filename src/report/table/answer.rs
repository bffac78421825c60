//! A query's answer as a table.

use serde_json::Value;

use crate::{Table, TableFormat};
use actcheck_base::{Term, names};
use actcheck_history::QueryAnswer;

/// Converts an answer to a table: its rows, a single `true` or `false`, or its triples.
///
/// In a table for people, IRIs are abbreviated with the known prefixes; programs get them in full.
/// In JSON, numbers of each datatype are numbers.
pub fn answer_table(answer: &QueryAnswer, format: TableFormat) -> Table {
    match answer {
        QueryAnswer::Boolean(value) => Table {
            rows: vec![vec![Value::Bool(*value)]],
            ..Table::new(["answer"])
        },
        QueryAnswer::Table { columns, rows } => Table {
            rows: rows
                .iter()
                .map(|row| answer_cells(row.iter().map(Option::as_ref), format))
                .collect(),
            ..Table::new(columns)
        },
        QueryAnswer::Graph(triples) => Table {
            rows: triples
                .iter()
                .map(|triple| answer_cells(triple.iter().map(Some), format))
                .collect(),
            ..Table::new(["subject", "predicate", "object"])
        },
    }
}

/// The cells of one row of an answer, as in [`answer_table`].
pub fn answer_cells<'a>(
    row: impl Iterator<Item = Option<&'a Term>>,
    format: TableFormat,
) -> Vec<Value> {
    row.map(|cell| cell.map_or(Value::Null, |term| value(term, format)))
        .collect()
}

/// Number of significant digits of numbers in tables for people.
const DIGITS: usize = 6;

/// A number with [`DIGITS`] significant digits at most.
fn rounded(value: f64) -> String {
    let text = value.to_string();
    if text.len() <= DIGITS || !value.is_finite() || value == 0.0 {
        return text;
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..9.0).contains(&magnitude) {
        return format!("{value:.*e}", DIGITS - 1);
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 10"
    )]
    let decimals = (DIGITS as f64 - 1.0 - magnitude).max(0.0) as usize;
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

fn value(term: &Term, format: TableFormat) -> Value {
    match term {
        Term::Iri(iri) if format == TableFormat::Table => names::shorten(iri).into(),
        Term::Iri(iri) => iri.as_ref().into(),
        Term::Blank(label) => format!("_:{label}").into(),
        Term::Double(value) if format == TableFormat::Table => rounded(*value).into(),
        Term::Decimal(text) if format == TableFormat::Table && text.len() > DIGITS => text
            .parse()
            .map_or_else(|_| text.as_ref().into(), |value: f64| rounded(value).into()),
        Term::Decimal(text) if format == TableFormat::Json => number(text),
        Term::Literal(text, datatype) if format == TableFormat::Json && is_number(datatype) => {
            number(text)
        }
        // Elsewhere they are text: converting them to `f64` could change their digits.
        Term::String(text)
        | Term::LangString(text, _)
        | Term::Literal(text, _)
        | Term::Decimal(text) => text.as_ref().into(),
        Term::Integer(value) => (*value).into(),
        Term::Double(value) if value.is_finite() => (*value).into(),
        Term::Double(value) => value.to_string().into(),
        Term::Boolean(value) => (*value).into(),
    }
}

/// Whether the values of a datatype are numbers: `xsd:decimal`, `xsd:float` and the types that are
/// derived from them.
fn is_number(datatype: &str) -> bool {
    const NUMBERS: [&str; 16] = [
        "decimal",
        "float",
        "double",
        "integer",
        "nonPositiveInteger",
        "negativeInteger",
        "long",
        "int",
        "short",
        "byte",
        "nonNegativeInteger",
        "unsignedLong",
        "unsignedInt",
        "unsignedShort",
        "unsignedByte",
        "positiveInteger",
    ];
    datatype
        .strip_prefix("http://www.w3.org/2001/XMLSchema#")
        .is_some_and(|name| NUMBERS.contains(&name))
}

/// A JSON number: the nearest one, if a text has more digits. Other texts, such as `INF`, stay
/// texts.
fn number(text: &str) -> Value {
    let written = text.strip_prefix('+').unwrap_or(text);
    let is_digit = |c: char| c.is_ascii_digit();
    // A decimal such as 3.0 is a whole number.
    let whole = match written.split_once('.') {
        Some((whole, rest)) if rest.chars().all(|c| c == '0') && whole.ends_with(is_digit) => whole,
        _ => written,
    };
    if let Ok(whole) = whole.parse::<i64>() {
        return whole.into();
    }
    if let Ok(whole) = whole.parse::<u64>() {
        return whole.into();
    }
    match written.parse::<f64>() {
        Ok(number) if number.is_finite() => number.into(),
        _ => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Page;

    #[test]
    fn people_get_short_iris_and_programs_full_ones() {
        let answer = QueryAnswer::Table {
            columns: vec!["run".into(), "n".into()],
            rows: vec![vec![
                Some(Term::iri("https://w3id.org/actcheck/run/k7f3-1")),
                None,
            ]],
        };
        assert_eq!(
            answer_table(&answer, TableFormat::Table).render(TableFormat::Csv, Page::default()),
            "run,n\nrun:k7f3-1,\n"
        );
        assert_eq!(
            answer_table(&answer, TableFormat::Csv).render(TableFormat::Csv, Page::default()),
            "run,n\nhttps://w3id.org/actcheck/run/k7f3-1,\n"
        );
    }

    /// Decimals and floats were texts, so that the average of integers was one too.
    #[test]
    fn numbers_of_each_datatype_are_numbers_in_json_and_keep_their_digits_in_csv() {
        let typed = |text: &str, name: &str| {
            Term::Literal(
                text.into(),
                format!("http://www.w3.org/2001/XMLSchema#{name}").into(),
            )
        };
        for (term, in_json, in_csv) in [
            (Term::Decimal("1".into()), "1", "1"),
            (Term::Decimal("+1.50".into()), "1.5", "+1.50"),
            (Term::Decimal("-3.0".into()), "-3", "-3.0"),
            (Term::Decimal(".5".into()), "0.5", ".5"),
            (
                Term::Decimal("0.12345678901234567890".into()),
                "0.12345678901234568",
                "0.12345678901234567890",
            ),
            (typed("0.1", "float"), "0.1", "0.1"),
            (typed("1e3", "float"), "1000.0", "1e3"),
            (typed("INF", "float"), "\"INF\"", "INF"),
            (
                typed("18446744073709551615", "unsignedLong"),
                "18446744073709551615",
                "18446744073709551615",
            ),
            (typed("7", "int"), "7", "7"),
            (typed("7", "gYear"), "\"7\"", "7"),
            (Term::string("7"), "\"7\"", "7"),
        ] {
            assert_eq!(value(&term, TableFormat::Json).to_string(), in_json);
            assert_eq!(value(&term, TableFormat::Csv).as_str(), Some(in_csv));
        }
    }
}
