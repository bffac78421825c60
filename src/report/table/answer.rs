//! A query's answer as a table.

use serde_json::Value;

use crate::Table;
use actcheck_base::{Term, names};
use actcheck_history::QueryAnswer;

/// Converts an answer to a table: its rows, a single `true` or `false`, or its triples.
///
/// If `short` is `true`, IRIs are abbreviated with the known prefixes (for people); otherwise they are written in full
/// (for programs).
pub fn answer_table(answer: &QueryAnswer, short: bool) -> Table {
    match answer {
        QueryAnswer::Boolean(value) => Table { rows: vec![vec![Value::Bool(*value)]], ..Table::new(["answer"]) },
        QueryAnswer::Table { columns, rows } => Table {
            rows: rows.iter().map(|row| answer_cells(row.iter().map(Option::as_ref), short)).collect(),
            ..Table::new(columns)
        },
        QueryAnswer::Graph(triples) => Table {
            rows: triples.iter().map(|triple| answer_cells(triple.iter().map(Some), short)).collect(),
            ..Table::new(["subject", "predicate", "object"])
        },
    }
}

/// The cells of one row of an answer, as in [`answer_table`].
pub fn answer_cells<'a>(row: impl Iterator<Item = Option<&'a Term>>, short: bool) -> Vec<Value> {
    row.map(|cell| cell.map_or(Value::Null, |term| value(term, short))).collect()
}

fn value(term: &Term, short: bool) -> Value {
    match term {
        Term::Iri(iri) if short => names::shorten(iri).into(),
        Term::Iri(iri) => iri.as_ref().into(),
        Term::Blank(label) => format!("_:{label}").into(),
        Term::String(text) | Term::LangString(text, _) | Term::Literal(text, _) => text.as_ref().into(),
        Term::Integer(value) => (*value).into(),
        // Decimals stay text: converting them to `f64` would change their digits.
        Term::Decimal(text) => text.as_ref().into(),
        Term::Double(value) if value.is_finite() => (*value).into(),
        Term::Double(value) => value.to_string().into(),
        Term::Boolean(value) => (*value).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Page, TableFormat};

    #[test]
    fn people_get_short_iris_and_programs_full_ones() {
        let answer = QueryAnswer::Table {
            columns: vec!["run".into(), "n".into()],
            rows: vec![vec![Some(Term::iri("https://w3id.org/actcheck/run/k7f3-1")), None]],
        };
        assert_eq!(answer_table(&answer, true).render(TableFormat::Csv, Page::default()), "run,n\nrun:k7f3-1,\n");
        assert_eq!(
            answer_table(&answer, false).render(TableFormat::Csv, Page::default()),
            "run,n\nhttps://w3id.org/actcheck/run/k7f3-1,\n"
        );
    }
}
