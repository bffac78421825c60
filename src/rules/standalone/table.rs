//! Reads rows of delimited text as terms.

use std::io::Read;

use crate::model::values::{Number, double_term, integer, is_beyond_64_bits, literal};
use actcheck_base::{Term, TermId, Terms, names};

/// How the fields of a column are parsed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ColumnKind {
    /// The type is inferred from the field.
    Any,
    /// The text as it is.
    String,
    /// Integers only.
    Int,
    /// Numbers only.
    Double,
    /// The column is skipped.
    Skip,
}

impl ColumnKind {
    pub(super) const NAMES: [&'static str; 5] = ["any", "string", "int", "double", "skip"];

    pub(super) fn from_word(word: &str) -> Option<Self> {
        [Self::Any, Self::String, Self::Int, Self::Double, Self::Skip]
            .into_iter()
            .zip(Self::NAMES)
            .find_map(|(kind, name)| (name == word).then_some(kind))
    }

    /// Parses a field. Returns `None` if the field does not match the column's type.
    fn term(self, field: &str) -> Option<Term> {
        match self {
            Self::Any => Some(any(field)),
            Self::String | Self::Skip => Some(Term::string(field)),
            Self::Int => integer(field),
            Self::Double => field.parse().ok().filter(|value: &f64| value.is_finite()).map(double_term),
        }
    }
}

/// Rows of a file that were skipped because they are invalid.
#[derive(Debug, Default)]
pub(super) struct LeftOut {
    pub(super) count: usize,
    /// The reason for the first one.
    pub(super) first: String,
}

impl LeftOut {
    pub(super) fn add(&mut self, reason: impl FnOnce() -> String) {
        if self.count == 0 {
            self.first = reason();
        }
        self.count += 1;
    }
}

/// Returns the delimiter byte between fields.
pub(super) fn delimiter_of(format: &str, option: Option<&str>) -> u8 {
    match (format, option) {
        (_, Some(text)) if text.len() == 1 => text.as_bytes()[0],
        ("tsv", _) => b'\t',
        _ => b',',
    }
}

/// Appends the rows of a table to `rows`. A row that does not match the columns is left out.
///
/// # Errors
/// The reason why the text can't be read.
#[expect(clippy::too_many_arguments, reason = "the options of one format; each is used once")]
pub(super) fn read_table(
    reader: impl Read,
    delimiter: u8,
    quoting: bool,
    headers: bool,
    columns: &[ColumnKind],
    limit: usize,
    terms: &mut Terms,
    rows: &mut Vec<TermId>,
) -> Result<LeftOut, String> {
    let mut left_out = LeftOut::default();
    let mut table = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .quoting(quoting)
        .has_headers(headers)
        .flexible(true)
        .from_reader(reader);
    for row in table.records().take(limit) {
        let row = match row {
            Ok(row) => row,
            Err(error) if error.is_io_error() => return Err(error.to_string()),
            Err(error) => {
                left_out.add(|| error.to_string());
                continue;
            }
        };
        if row.len() != columns.len() {
            left_out.add(|| format!("{} fields instead of {}", row.len(), columns.len()));
            continue;
        }
        let read: Option<Vec<Term>> = row
            .iter()
            .zip(columns)
            .filter(|(_, kind)| **kind != ColumnKind::Skip)
            .map(|(field, kind)| kind.term(field))
            .collect();
        match read {
            Some(read) => rows.extend(read.into_iter().map(|term| terms.intern(term))),
            None => left_out.add(|| format!("`{}`", row.iter().collect::<Vec<_>>().join(", "))),
        }
    }
    Ok(left_out)
}

/// Infers the term of a field: an IRI, a number, a literal, a name, or otherwise a string.
fn any(field: &str) -> Term {
    let field = field.trim();
    if let Some(iri) = field.strip_prefix('<').and_then(|rest| rest.strip_suffix('>')) {
        return Term::iri(iri);
    }
    if field.starts_with(|c: char| c.is_ascii_digit() || c == '+' || c == '-') {
        let number = literal(field, &format!("{}decimal", names::XSD));
        if Number::of(&number).is_some() || is_beyond_64_bits(&number) {
            return number;
        }
    }
    if field.starts_with('"')
        && let Some(end) = field.rfind('"').filter(|end| *end > 0)
    {
        let (text, rest) = (&field[1..end], &field[end + 1..]);
        if rest.is_empty() {
            return Term::string(text);
        }
        if let Some(tag) = rest.strip_prefix('@') {
            return Term::LangString(text.into(), tag.into());
        }
        if let Some(datatype) = rest.strip_prefix("^^<").and_then(|rest| rest.strip_suffix('>')) {
            return literal(text, datatype);
        }
    }
    // A field without spaces is a name or an IRI.
    if !field.is_empty() && !field.contains([' ', '\n', '>']) { Term::iri(field) } else { Term::string(field) }
}
