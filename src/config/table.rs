//! TOML tables with spans: validates every value that is read and reports every unknown key.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::ops::{RangeBounds, RangeInclusive};

use crate::value::{self, Entry, Located, Value};
use crate::words::{example, in_words};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, did_you_mean, nearest};

/// A table that is being read.
///
/// Getters remove a key and return its value. They return `None` if the key is missing, and also
/// record a fault if its value is invalid. [`Table::finish`] reports the keys that remain.
#[derive(Debug)]
pub struct Table {
    source: Source,
    /// Dotted path from the root, empty for the root.
    path: String,
    /// Span of its header or braces.
    span: Span,
    entries: BTreeMap<String, Entry>,
    /// Keys that were requested, whether present or not.
    known: BTreeSet<String>,
    /// Keys that are usual but missing.
    unused: Vec<String>,
    /// Required keys that are missing, each with its fault.
    missing: Vec<(String, Diagnostic)>,
    found: Diagnostics,
}

/// Key of the action's name in a table that is an action of a test.
const ACTION: &str = "action";

/// An action of a test as written, with the values of designators.
#[derive(Debug)]
pub(crate) struct WrittenStep {
    pub(crate) action: Located<String>,
    pub(crate) values: BTreeMap<String, Located<String>>,
}

impl Table {
    /// Parses the root table of a text.
    ///
    /// # Errors
    /// C002 for each syntax error.
    pub fn parse(source: &Source) -> Result<Self, Diagnostics> {
        Ok(Self::new(
            source,
            String::new(),
            0..0,
            value::parse(source)?,
        ))
    }

    fn new(source: &Source, path: String, span: Span, entries: BTreeMap<String, Entry>) -> Self {
        Self {
            source: source.clone(),
            path,
            span,
            entries,
            known: BTreeSet::new(),
            unused: Vec::new(),
            missing: Vec::new(),
            found: Diagnostics::new(),
        }
    }

    /// The text that the table is part of.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Span of the table's header or braces.
    pub fn span(&self) -> Span {
        self.span.clone()
    }

    /// Returns the span of a key, or `None` if it is missing or was already taken.
    pub fn key_span(&self, key: &str) -> Option<Span> {
        self.entries.get(key).map(|entry| entry.key_span.clone())
    }

    /// Returns the keys that were not taken yet, sorted.
    pub fn keys(&self) -> Vec<String> {
        self.entries.keys().cloned().collect()
    }

    /// Whether a key is present and was not taken yet.
    pub fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Whether a key that was not taken yet holds a list.
    pub fn is_list(&self, key: &str) -> bool {
        self.entries
            .get(key)
            .is_some_and(|entry| matches!(entry.value.value, Value::Array(_)))
    }

    /// Whether a key that was not taken yet holds a number.
    pub fn is_number(&self, key: &str) -> bool {
        self.entries
            .get(key)
            .is_some_and(|entry| matches!(entry.value.value, Value::Integer(_) | Value::Float(_)))
    }

    /// Returns the keys that were not taken yet, sorted.
    pub fn untaken_keys(&self) -> Vec<String> {
        self.entries.keys().cloned().collect()
    }

    /// Returns the only key of an untaken sub-table; `None` unless it has one key, with a list of
    /// strings.
    pub fn only_list_of(&self, table: &str) -> Option<String> {
        let Value::Table(entries) = &self.entries.get(table)?.value.value else {
            return None;
        };
        let mut entries = entries.iter();
        match (entries.next(), entries.next()) {
            (
                Some((
                    key,
                    Entry {
                        value:
                            Located {
                                value: Value::Array(list),
                                ..
                            },
                        ..
                    },
                )),
                None,
            ) => list
                .iter()
                .all(|element| matches!(element.value, Value::String(_)))
                .then(|| key.clone()),
            _ => None,
        }
    }

    /// Returns the keys of tables that were not taken yet, sorted.
    pub fn untaken_tables(&self) -> Vec<String> {
        let is_table = |entry: &Entry| matches!(entry.value.value, Value::Table(_));
        self.entries
            .iter()
            .filter(|(_, entry)| is_table(entry))
            .map(|(key, _)| key.clone())
            .collect()
    }

    /// Reports every missing key of the list (C005).
    pub fn require(&mut self, keys: &[&str]) {
        for key in keys {
            self.known.insert((*key).to_owned());
            if !self.entries.contains_key(*key) {
                let message = format!("{} is missing", self.name(key));
                let help = format!("add `{key} = …`{}", self.place_in_words());
                let fault = Diagnostic::error("C005", message)
                    .at(&self.source, self.span.clone())
                    .help(help);
                self.missing.push(((*key).to_owned(), fault));
            }
        }
    }

    /// Names keys that most tables of this kind have: an unknown key resembles one of these rather
    /// than a rare one.
    pub fn expect(&mut self, keys: &[&str]) {
        let missing = keys.iter().filter(|key| !self.entries.contains_key(**key));
        self.unused.extend(missing.map(|key| (*key).to_owned()));
    }

    /// Takes keys without reading them, because another fault decides about them.
    pub(crate) fn ignore(&mut self, keys: &[&str]) {
        keys.iter().for_each(|key| drop(self.take(key)));
    }

    /// Records a fault of this table's text.
    pub fn fault(
        &mut self,
        code: &'static str,
        span: Span,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.found.push(
            Diagnostic::error(code, message)
                .at(&self.source, span)
                .help(help),
        );
    }

    /// Records the faults of a table within this one.
    pub fn note(&mut self, faults: Diagnostics) {
        self.found.extend(faults);
    }

    /// Moves the faults to `diagnostics`, with a C003 for each unknown key. A required key that is
    /// missing because it is misspelt is one fault.
    pub fn finish(mut self, diagnostics: &mut Diagnostics) {
        for (key, entry) in std::mem::take(&mut self.entries) {
            let kind = if matches!(entry.value.value, Value::Table(_)) {
                "table"
            } else {
                "key"
            };
            let mut message = format!("unknown {kind} {}", self.name(&key));
            let missing =
                nearest(&key, self.missing.iter().map(|(key, _)| key.as_str())).map(str::to_owned);
            let help = match missing {
                Some(missing) => {
                    message.push_str(&format!(", and {} is missing", self.name(&missing)));
                    self.missing.retain(|(key, _)| *key != missing);
                    format!("did you mean `{missing}`?")
                }
                None => match nearest(&key, self.unused.iter().map(String::as_str)) {
                    Some(usual) => format!("did you mean `{usual}`?"),
                    None => did_you_mean(&key, self.known.iter().map(String::as_str)),
                },
            };
            self.fault("C003", entry.key_span, message, help);
        }
        self.missing
            .into_iter()
            .for_each(|(_, fault)| diagnostics.push(fault));
        diagnostics.extend(self.found);
    }

    /// Takes a string that is not empty.
    pub fn string(&mut self, key: &str) -> Option<Located<String>> {
        let value = self.take(key)?;
        self.text_of(key, "a string", value)
    }

    /// Takes a list of non-empty strings. The list may be empty: see [`Table::non_empty_strings`].
    pub fn strings(&mut self, key: &str) -> Option<Vec<Located<String>>> {
        let list = self.list(key, "a list of strings")?;
        Some(
            list.into_iter()
                .filter_map(|value| self.text_of(key, "a list of strings", value))
                .collect(),
        )
    }

    /// Takes a string, or a list of at least one string. Empty if the key is missing or wrong.
    pub fn string_or_strings(&mut self, key: &str) -> Vec<Located<String>> {
        match self.entries.get(key).map(|entry| &entry.value.value) {
            Some(Value::Array(_)) => self.non_empty_strings(key).unwrap_or_default(),
            _ => self.string(key).into_iter().collect(),
        }
    }

    /// Takes a list of at least one string.
    pub fn non_empty_strings(&mut self, key: &str) -> Option<Vec<Located<String>>> {
        let span = self.entries.get(key).map(|entry| entry.value.span.clone());
        let before = self.found.len();
        let list = self.strings(key)?;
        if list.is_empty() && self.found.len() == before {
            self.fault(
                "C007",
                span?,
                format!("{} is an empty list", self.name(key)),
                "name at least one",
            );
        }
        (!list.is_empty()).then_some(list)
    }

    /// Takes a list of at least one test: a list of at least one action.
    pub(crate) fn lists_of_steps(&mut self, key: &str) -> Option<Vec<Vec<WrittenStep>>> {
        let expected = "a list of lists of strings";
        let place = self.entries.get(key).map(|entry| entry.value.span.clone());
        let outer = self.list(key, expected)?;
        if outer.is_empty() {
            self.fault(
                "C007",
                place?,
                format!("{} is an empty list", self.name(key)),
                example(key, expected),
            );
        }
        let mut lists = Vec::new();
        for Located { value, span } in outer {
            match value {
                Value::Array(inner) if inner.is_empty() => {
                    self.fault(
                        "C007",
                        span,
                        format!("an empty list in {}", self.name(key)),
                        "name at least one",
                    );
                }
                Value::Array(inner) => {
                    lists.push(
                        inner
                            .into_iter()
                            .filter_map(|value| self.step_of(key, expected, value))
                            .collect(),
                    );
                }
                other => self.wrong(key, expected, &Located { value: other, span }),
            }
        }
        Some(lists)
    }

    /// Returns an action of a test: its name, or a table with its name as `action` and with values
    /// of designators.
    fn step_of(
        &mut self,
        key: &str,
        expected: &str,
        Located { value, span }: Located<Value>,
    ) -> Option<WrittenStep> {
        let Value::Table(mut entries) = value else {
            let action = self.text_of(key, expected, Located { value, span })?;
            return Some(WrittenStep {
                action,
                values: BTreeMap::new(),
            });
        };
        let Some(action) = entries.remove(ACTION) else {
            let message = format!("`{ACTION}` is missing in a table of {}", self.name(key));
            self.fault(
                "C005",
                span,
                message,
                "name the action: `{ action = \"Pick\", pickObject = \"other\" }`",
            );
            return None;
        };
        let action = self.text_of(key, expected, action.value)?;
        let mut values = BTreeMap::new();
        for (name, entry) in entries {
            values.insert(name, self.text_of(key, expected, entry.value)?);
        }
        Some(WrittenStep { action, values })
    }

    /// Takes an integer within bounds.
    pub fn integer(&mut self, key: &str, bounds: RangeInclusive<i64>) -> Option<i64> {
        let value = self.take(key)?;
        self.integer_of(key, &value, &bounds)
    }

    /// Takes two integers `[least, most]` within bounds, the first not above the second.
    pub fn integer_range(&mut self, key: &str, bounds: RangeInclusive<i64>) -> Option<(i64, i64)> {
        let expected = "a range of whole numbers `[least, most]`";
        let span = self.entries.get(key).map(|entry| entry.value.span.clone());
        let list = self.list(key, expected)?;
        let [least, most] = list.as_slice() else {
            self.wrong_length(key, span?, expected, list.len());
            return None;
        };
        let (least, most) = (
            self.integer_of(key, least, &bounds),
            self.integer_of(key, most, &bounds),
        );
        self.in_order(key, span?, least?, most?)
    }

    /// Takes a finite number within bounds.
    pub fn number(&mut self, key: &str, bounds: impl RangeBounds<f64>) -> Option<f64> {
        let value = self.take(key)?;
        self.number_of(key, &value, &bounds)
    }

    /// Takes exactly `N` finite numbers, each within bounds.
    pub fn numbers<const N: usize>(
        &mut self,
        key: &str,
        bounds: impl RangeBounds<f64>,
    ) -> Option<[f64; N]> {
        let span = self.entries.get(key).map(|entry| entry.value.span.clone());
        let list = self.number_list(key, bounds)?;
        let length = list.len();
        match <[f64; N]>::try_from(list) {
            Ok(numbers) => Some(numbers),
            Err(_) => {
                self.wrong_length(key, span?, &format!("a list of {N} numbers"), length);
                None
            }
        }
    }

    /// Takes a list of finite numbers, each within bounds.
    pub fn number_list(&mut self, key: &str, bounds: impl RangeBounds<f64>) -> Option<Vec<f64>> {
        let list = self.list(key, "a list of numbers")?;
        let numbers: Vec<Option<f64>> = list
            .iter()
            .map(|value| self.number_of(key, value, &bounds))
            .collect();
        numbers.into_iter().collect()
    }

    /// Takes two finite numbers `[low, high]` within bounds, the first not above the second.
    pub fn range(&mut self, key: &str, bounds: impl RangeBounds<f64>) -> Option<(f64, f64)> {
        let expected = "a range of numbers `[low, high]`";
        let span = self.entries.get(key).map(|entry| entry.value.span.clone());
        let list = self.list(key, expected)?;
        let [low, high] = list.as_slice() else {
            self.wrong_length(key, span?, expected, list.len());
            return None;
        };
        let (low, high) = (
            self.number_of(key, low, &bounds),
            self.number_of(key, high, &bounds),
        );
        self.in_order(key, span?, low?, high?)
    }

    /// Takes `true` or `false`.
    pub fn boolean(&mut self, key: &str) -> Option<bool> {
        let value = self.take(key)?;
        if let Value::Boolean(boolean) = value.value {
            return Some(boolean);
        }
        self.wrong(key, "`true` or `false`", &value);
        None
    }

    /// Takes a table, on which the caller must call [`Table::finish`].
    pub fn table(&mut self, key: &str) -> Option<Table> {
        let key_span = self.key_span(key);
        let value = self.take(key)?;
        match value.value {
            Value::Table(entries) => Some(Self::new(
                &self.source,
                self.path_of(key),
                key_span?,
                entries,
            )),
            other => {
                self.wrong(
                    key,
                    "a table",
                    &Located {
                        value: other,
                        span: value.span,
                    },
                );
                None
            }
        }
    }

    /// Takes a list of tables (`[[key]]`), on each of which the caller must call [`Table::finish`];
    /// empty if the key is missing.
    pub fn tables(&mut self, key: &str) -> Vec<Table> {
        let expected = "a list of tables";
        let mut tables = Vec::new();
        for Located { value, span } in self.list(key, expected).unwrap_or_default() {
            match value {
                Value::Table(entries) => {
                    let path = format!("{}[{}]", self.path_of(key), tables.len() + 1);
                    tables.push(Self::new(&self.source, path, span, entries));
                }
                other => self.wrong(key, expected, &Located { value: other, span }),
            }
        }
        tables
    }

    fn take(&mut self, key: &str) -> Option<Located<Value>> {
        self.known.insert(key.to_owned());
        self.entries.remove(key).map(|entry| entry.value)
    }

    fn list(&mut self, key: &str, expected: &str) -> Option<Vec<Located<Value>>> {
        let value = self.take(key)?;
        match value.value {
            Value::Array(list) => Some(list),
            other => {
                self.wrong(
                    key,
                    expected,
                    &Located {
                        value: other,
                        span: value.span,
                    },
                );
                None
            }
        }
    }

    /// Returns the text of a value. `expected` describes the value or the list that contains it.
    fn text_of(
        &mut self,
        key: &str,
        expected: &str,
        value: Located<Value>,
    ) -> Option<Located<String>> {
        match value.value {
            Value::String(text) if text.trim().is_empty() => {
                self.fault(
                    "C006",
                    value.span,
                    format!("an empty string in {}", self.name(key)),
                    "write a name",
                );
                None
            }
            Value::String(text) => Some(Located {
                value: text,
                span: value.span,
            }),
            other => {
                self.wrong(
                    key,
                    expected,
                    &Located {
                        value: other,
                        span: value.span,
                    },
                );
                None
            }
        }
    }

    fn integer_of(
        &mut self,
        key: &str,
        value: &Located<Value>,
        bounds: &RangeInclusive<i64>,
    ) -> Option<i64> {
        let expected = in_words("a whole number", bounds, &i64::MAX);
        match &value.value {
            Value::Integer(Some(number)) if bounds.contains(number) => Some(*number),
            Value::Integer(number) => {
                let found = number.map_or_else(
                    || "is too large".to_owned(),
                    |number| format!("is {number}"),
                );
                let message = format!("{} {found}", self.name(key));
                self.fault(
                    "C006",
                    value.span.clone(),
                    message,
                    format!("it must be {expected}"),
                );
                None
            }
            _ => {
                self.wrong(key, &expected, value);
                None
            }
        }
    }

    fn number_of(
        &mut self,
        key: &str,
        value: &Located<Value>,
        bounds: &impl RangeBounds<f64>,
    ) -> Option<f64> {
        let expected = in_words("a number", bounds, &f64::INFINITY);
        let number = match &value.value {
            Value::Float(number) => *number,
            Value::Integer(number) => number.map(|number| number as f64),
            _ => {
                self.wrong(key, &expected, value);
                return None;
            }
        };
        match number.filter(|number| number.is_finite() && bounds.contains(number)) {
            Some(number) => Some(number),
            None => {
                let found = self
                    .source
                    .text
                    .get(value.span.clone())
                    .unwrap_or("out of range")
                    .to_owned();
                let message = format!("{} is {found}", self.name(key));
                self.fault(
                    "C006",
                    value.span.clone(),
                    message,
                    format!("it must be {expected}"),
                );
                None
            }
        }
    }

    fn in_order<T: PartialOrd + Display>(
        &mut self,
        key: &str,
        span: Span,
        low: T,
        high: T,
    ) -> Option<(T, T)> {
        if low <= high {
            return Some((low, high));
        }
        let message = format!("the range {} begins above its end", self.name(key));
        self.fault(
            "C009",
            span,
            message,
            format!("write the smaller number first: `[{high}, {low}]`"),
        );
        None
    }

    fn wrong(&mut self, key: &str, expected: &str, value: &Located<Value>) {
        let message = format!(
            "{} must be {expected}, but this is {}",
            self.name(key),
            value.value.kind()
        );
        self.fault("C004", value.span.clone(), message, example(key, expected));
    }

    fn wrong_length(&mut self, key: &str, span: Span, expected: &str, length: usize) {
        let message = format!(
            "{} must be {expected}, but this list has {length}",
            self.name(key)
        );
        self.fault("C004", span, message, example(key, expected));
    }

    /// Returns a key's full path for messages.
    fn name(&self, key: &str) -> String {
        format!("`{}`", self.path_of(key))
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn place_in_words(&self) -> String {
        if self.path.is_empty() {
            " at the top of the file".to_owned()
        } else {
            format!(" to [{}]", self.path)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Bound;

    use super::*;

    fn faults(text: &str, read: impl FnOnce(&mut Table)) -> Vec<String> {
        let source = Source::new("t.toml", text);
        let mut found = Diagnostics::new();
        match Table::parse(&source) {
            Ok(mut table) => {
                read(&mut table);
                table.finish(&mut found);
            }
            Err(diagnostics) => found = diagnostics,
        }
        found
            .iter()
            .map(|d| format!("{} {}: {d}", d.code, d.place().unwrap_or_default()))
            .collect()
    }

    #[test]
    fn values_have_their_spans() {
        let text = "name = \"glass\"\nsize = [1, 2.5, 3]\n[part]\nround = true\n";
        let found = faults(text, |table| {
            table.require(&["name", "size"]);
            assert_eq!(
                table.string("name").map(|name| (name.value, name.span)),
                Some(("glass".to_owned(), 7..14))
            );
            assert_eq!(table.numbers("size", 0.0..), Some([1.0, 2.5, 3.0]));
            let mut part = table.table("part").expect("the table exists");
            assert_eq!(part.boolean("round"), Some(true));
            let mut none = Diagnostics::new();
            part.finish(&mut none);
            assert!(none.is_empty());
        });
        assert_eq!(found, [""; 0]);
    }

    #[test]
    fn each_fault_is_reported_with_its_place() {
        let text = "count = -1\nmass = \"x\"\nrange = [3, 1]\nfrction = 1\nbig = 99999999999999999999\nlist = []\n";
        let found = faults(text, |table| {
            table.require(&["friction"]);
            table.integer("count", 0..=i64::MAX);
            table.number("mass", (Bound::Excluded(0.0), Bound::Unbounded));
            table.range("range", ..);
            table.integer("big", 0..=10);
            table.non_empty_strings("list");
        });
        assert_eq!(
            found,
            [
                "C006 t.toml:1:9: `count` is -1",
                "C004 t.toml:2:8: `mass` must be a number above 0, but this is a string",
                "C009 t.toml:3:9: the range `range` begins above its end",
                "C006 t.toml:5:7: `big` is too large",
                "C007 t.toml:6:8: `list` is an empty list",
                "C003 t.toml:4:1: unknown key `frction`, and `friction` is missing",
            ]
        );
    }

    #[test]
    fn syntax_errors_have_their_places() {
        let found = faults("a = \nb = [1,\n", |_| {});
        assert!(found.len() >= 2, "{found:?}");
        assert!(
            found.iter().all(|fault| fault.starts_with("C002 t.toml:")),
            "{found:?}"
        );
    }
}
