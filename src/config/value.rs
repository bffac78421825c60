//! TOML values with their spans, independent of the parser's types.

use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use actcheck_base::{Diagnostic, Diagnostics, Source, Span};

/// Largest number of reported syntax errors; further ones usually follow from the first.
const MOST_SYNTAX_ERRORS: usize = 3;

/// A value with its span in the source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Its span.
    pub span: Span,
}

/// A key's span and its value.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) key_span: Span,
    pub(super) value: Located<Value>,
}

/// A TOML value.
#[derive(Debug)]
pub(super) enum Value {
    String(String),
    /// `None` if it does not fit into 64 bits.
    Integer(Option<i64>),
    /// `None` if it can't be parsed as an `f64`.
    Float(Option<f64>),
    Boolean(bool),
    Datetime,
    Array(Vec<Located<Value>>),
    Table(BTreeMap<String, Entry>),
}

/// Parses the entries of a text's root table.
///
/// # Errors
/// C002 for each syntax error.
pub(super) fn parse(source: &Source) -> Result<BTreeMap<String, Entry>, Diagnostics> {
    let (root, errors) = DeTable::parse_recoverable(&source.text);
    let mut found = Diagnostics::new();
    for error in errors.iter().take(MOST_SYNTAX_ERRORS) {
        let span = error.span().unwrap_or(0..0);
        found.push(
            Diagnostic::error("C002", format!("this is not TOML: {}", error.message()))
                .at(source, span)
                .help("see https://toml.io for how tables, strings and lists are written"),
        );
    }
    found.or(entries_of(root.get_ref()))
}

impl Value {
    /// Returns the kind of the value for messages.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::String(_) => "a string",
            Self::Integer(_) => "a whole number",
            Self::Float(_) => "a number",
            Self::Boolean(_) => "a boolean",
            Self::Datetime => "a date or time",
            Self::Array(_) => "a list",
            Self::Table(_) => "a table",
        }
    }
}

fn entries_of(table: &DeTable<'_>) -> BTreeMap<String, Entry> {
    table
        .iter()
        .map(|(key, value)| (key.get_ref().to_string(), Entry { key_span: key.span(), value: located(value) }))
        .collect()
}

fn located(value: &Spanned<DeValue<'_>>) -> Located<Value> {
    let span = value.span();
    let value = match value.get_ref() {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Integer(number) => Value::Integer(i64::from_str_radix(number.as_str(), number.radix()).ok()),
        DeValue::Float(number) => Value::Float(number.as_str().parse().ok()),
        DeValue::Boolean(boolean) => Value::Boolean(*boolean),
        DeValue::Datetime(_) => Value::Datetime,
        DeValue::Array(list) => Value::Array(list.iter().map(located).collect()),
        DeValue::Table(table) => Value::Table(entries_of(table)),
    };
    Located { value, span }
}
