//! Reads rows of delimited text as facts.

use std::borrow::Cow;
use std::io::Read;

use crate::model::values::{Number, double_term, integer, is_beyond_64_bits, literal};
use crate::standalone::faults::Faults;
use crate::standalone::records::{Records, RowRead};
use crate::standalone::sink::ImportSink;
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

    const ALL: [Self; 5] = [Self::Any, Self::String, Self::Int, Self::Double, Self::Skip];

    pub(super) fn from_word(word: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .zip(Self::NAMES)
            .find_map(|(kind, name)| (name == word).then_some(kind))
    }

    /// Interns a field. Returns `None` if the field does not match the column's type.
    fn intern(self, field: &str, terms: &mut Terms) -> Option<TermId> {
        match self {
            Self::Any => Some(any(field, terms)),
            Self::String | Self::Skip => Some(terms.intern_string(field)),
            Self::Int => small_integer(field)
                .or_else(|| integer(field))
                .map(|term| terms.intern(term)),
            Self::Double => {
                let value = field.parse().ok().filter(|value: &f64| value.is_finite())?;
                Some(terms.intern(double_term(value)))
            }
        }
    }

    /// Returns a noun for the fields of the column.
    fn wanted(self) -> &'static str {
        match self {
            Self::Int => "an integer",
            Self::Double => "a number",
            _ => "text",
        }
    }
}

/// How the text of a table is divided.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub(super) delimiter: u8,
    pub(super) quoting: bool,
    /// Whether the first row is skipped.
    pub(super) headers: bool,
    pub(super) columns: Vec<ColumnKind>,
}

/// Reads the rows of a table, at most `limit`. A row that does not match the columns is a fault and
/// left out.
///
/// # Errors
/// Reading failed.
pub(super) fn read_table(
    reader: impl Read,
    layout: &Layout,
    limit: usize,
    sink: &mut ImportSink<'_>,
    faults: &mut Faults,
) -> std::io::Result<()> {
    let mut records = Records::new(reader, layout.delimiter, layout.quoting);
    let (mut count, mut skip) = (0, layout.headers);
    while count < limit {
        match records.next()? {
            RowRead::End => break,
            RowRead::Broken(place, why) => {
                faults.add_last(place, || why.to_owned());
                break;
            }
            RowRead::Row if skip => skip = false,
            RowRead::Row => {
                count += 1;
                sink.row(|terms, row| intern_row(&records, &layout.columns, terms, row, faults))?;
            }
        }
    }
    Ok(())
}

/// Appends the terms of a row to `row`. Returns `false` after a fault.
fn intern_row(
    records: &Records<impl Read>,
    columns: &[ColumnKind],
    terms: &mut Terms,
    row: &mut Vec<TermId>,
    faults: &mut Faults,
) -> bool {
    if records.len() != columns.len() {
        let beyond = if records.len() > columns.len() {
            columns.len()
        } else {
            0
        };
        let counted = |count| {
            if count == 1 {
                "1 field".to_owned()
            } else {
                format!("{count} fields")
            }
        };
        faults.add(records.place_of(beyond), || {
            format!("{} instead of {}", counted(records.len()), columns.len())
        });
        return false;
    }
    for (field, kind) in columns.iter().enumerate() {
        let text = match records.text(field) {
            Ok(text) => text,
            Err(_) => {
                faults.add(records.place_of(field), || {
                    "the field is not UTF-8 text".to_owned()
                });
                return false;
            }
        };
        if records.is_torn(field) {
            // The row is kept, as other programs read it.
            faults.add(records.place_of(field), || {
                format!("text follows the closing quote of `{}`", short(&text))
            });
        }
        if *kind == ColumnKind::Skip {
            continue;
        }
        match kind.intern(&text, terms) {
            Some(id) => row.push(id),
            None => {
                faults.add(records.place_of(field), || {
                    format!("`{}` is not {}", short(&text), kind.wanted())
                });
                return false;
            }
        }
    }
    true
}

/// Returns the beginning of a text.
fn short(text: &str) -> Cow<'_, str> {
    match text.char_indices().nth(60) {
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
        None => Cow::Borrowed(text),
    }
}

/// Converts an integer of few digits without an allocation.
fn small_integer(field: &str) -> Option<Term> {
    let digits = field.strip_prefix('-').unwrap_or(field);
    if digits.is_empty() || digits.len() > 18 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    field.parse().ok().map(Term::Integer)
}

/// Infers the term of a field: an IRI, a number as a rule's text has it, a literal, a name, or
/// otherwise a string.
fn any(field: &str, terms: &mut Terms) -> TermId {
    let field = field.trim();
    if let Some(iri) = field
        .strip_prefix('<')
        .and_then(|rest| rest.strip_suffix('>'))
    {
        return terms.intern_iri(iri);
    }
    if field.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
        && let Some(number) = number(field)
    {
        return terms.intern(number);
    }
    if field.starts_with('"')
        && let Some(end) = field.rfind('"').filter(|end| *end > 0)
    {
        let (text, rest) = (&field[1..end], &field[end + 1..]);
        if rest.is_empty() {
            return terms.intern_string(text);
        }
        if let Some(tag) = rest.strip_prefix('@') {
            return terms.intern(Term::LangString(text.into(), tag.into()));
        }
        if let Some(datatype) = rest
            .strip_prefix("^^<")
            .and_then(|rest| rest.strip_suffix('>'))
        {
            return terms.intern(literal(text, datatype));
        }
    }
    // A field without spaces is a name or an IRI.
    if !field.is_empty() && !field.contains([' ', '\n', '>']) {
        terms.intern_iri(field)
    } else {
        terms.intern_string(field)
    }
}

/// Converts a number: an integer, or a double as `1.5` and `1e-05` are in rules. A decimal that a
/// double would round is kept exactly. Returns `None` for any other text.
fn number(field: &str) -> Option<Term> {
    if let Some(small) = small_integer(field) {
        return Some(small);
    }
    let exact = literal(field, &format!("{}decimal", names::XSD));
    let is_number = Number::of(&exact).is_some() || is_beyond_64_bits(&exact);
    if is_number && !field.contains('.') {
        return Some(exact);
    }
    let proper = field
        .bytes()
        .all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
    let value = field
        .parse()
        .ok()
        .filter(|value: &f64| proper && value.is_finite())?;
    if is_number && literal(&value.to_string(), &format!("{}decimal", names::XSD)) != exact {
        return Some(exact);
    }
    Some(double_term(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_rules() {
        let decimal = |text: &str| Some(Term::Decimal(text.into()));
        assert_eq!(number("-7"), Some(Term::Integer(-7)));
        assert_eq!(number("+007"), Some(Term::Integer(7)));
        assert_eq!(number("1.5"), Some(Term::Double(1.5)));
        assert_eq!(number("2.0"), Some(Term::Double(2.0)));
        assert_eq!(number("1e-05"), Some(Term::Double(0.000_01)));
        assert_eq!(number(".5E2"), Some(Term::Double(50.0)));
        assert_eq!(number("-0.0"), Some(Term::Double(0.0)));
        assert_eq!(
            number("0.1000000000000000055"),
            decimal("0.1000000000000000055"),
            "a double would round it"
        );
        for name in [
            "-", "+", ".", "1e400", "1-2", "12:30", "1.2.3", "e5", "1e", "--1",
        ] {
            assert_eq!(number(name), None, "{name}");
        }
    }
}
