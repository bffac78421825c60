//! TOML values with their spans, independent of the parser's types.

use std::collections::{BTreeMap, BTreeSet};

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
    let mut helps = BTreeSet::new();
    for error in errors.iter().take(MOST_SYNTAX_ERRORS) {
        let span = error.span().unwrap_or(0..0);
        let help = syntax_help(&source.text, &span, error.message());
        // Errors with the same remedy have the same cause.
        if helps.insert(help.clone()) || help == SYNTAX {
            found.push(syntax_fault(source, span, error.message()).help(help));
        }
    }
    found.or(entries_of(root.get_ref()))
}

const SYNTAX: &str = "see https://toml.io for how tables, strings and lists are written";

fn syntax_fault(source: &Source, span: Span, message: &str) -> Diagnostic {
    let message = match (message, source.text.get(span.clone())) {
        ("duplicate key", Some(key)) => format!("`{key}` is defined twice"),
        _ => format!("this is not TOML: {message}"),
    };
    Diagnostic::error("C002", message).at(source, span)
}

/// The remedy for a syntax error, by its message and by common habits from other languages.
fn syntax_help(text: &str, span: &Span, message: &str) -> String {
    let start = text
        .get(..span.start)
        .unwrap_or(text)
        .rfind('\n')
        .map_or(0, |at| at + 1);
    let line = text[start..].lines().next().unwrap_or_default();
    // A quote or a bracket without its end is noticed further down.
    let is_open = |(_, line): &(usize, &str)| bare(line).matches('"').count() % 2 == 1;
    let open = text[..start].lines().enumerate().filter(is_open).last();
    let key = line
        .split(':')
        .next()
        .map(str::trim)
        .filter(|_| line.contains(':') && !line.contains('='));
    match (open, key) {
        _ if message == "duplicate key" => "keep one of them; a table is written once".to_owned(),
        _ if text.trim_start().starts_with('{') => {
            "this looks like JSON; in TOML, write `key = value` in lines, and `[table]` above the keys of a table"
                .to_owned()
        }
        (_, Some(key)) if key.chars().all(|c| c.is_alphanumeric() || "_- ".contains(c)) => {
            let key = if key.starts_with('-') { "key" } else { key };
            format!("this looks like YAML; in TOML, write `{key} = …`")
        }
        _ if line.contains("True") || line.contains("False") => "write `true` or `false`".to_owned(),
        (Some((idx, _)), _) => format!("a quotation mark in line {} has no end", idx + 1),
        _ => SYNTAX.to_owned(),
    }
}

/// A line without its comment, unless the comment sign is in a string.
fn bare(line: &str) -> &str {
    let comment = line
        .match_indices('#')
        .find(|(at, _)| line[..*at].matches('"').count().is_multiple_of(2));
    comment.map_or(line, |(at, _)| &line[..at])
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
        .map(|(key, value)| {
            (
                key.get_ref().to_string(),
                Entry {
                    key_span: key.span(),
                    value: located(value),
                },
            )
        })
        .collect()
}

fn located(value: &Spanned<DeValue<'_>>) -> Located<Value> {
    let span = value.span();
    let value = match value.get_ref() {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Integer(number) => {
            Value::Integer(i64::from_str_radix(number.as_str(), number.radix()).ok())
        }
        DeValue::Float(number) => Value::Float(number.as_str().parse().ok()),
        DeValue::Boolean(boolean) => Value::Boolean(*boolean),
        DeValue::Datetime(_) => Value::Datetime,
        DeValue::Array(list) => Value::Array(list.iter().map(located).collect()),
        DeValue::Table(table) => Value::Table(entries_of(table)),
    };
    Located { value, span }
}
