//! Reads plain values, and collects every fault with its place.

use std::cell::RefCell;
use std::fmt;

use actcheck_base::{Diagnostic, Diagnostics, Source, did_you_mean};

use crate::{Key, Value};

/// The faults of some values.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    found: RefCell<Diagnostics>,
}

/// A value with its place in the values that the caller gave.
#[derive(Clone, Copy)]
pub(crate) struct At<'v> {
    value: &'v Value,
    place: Place<'v>,
    faults: &'v Faults,
}

/// The way to a value from the outermost one.
#[derive(Clone, Copy)]
struct Place<'v> {
    above: Option<&'v Place<'v>>,
    step: Step<'v>,
}

#[derive(Clone, Copy)]
enum Step<'v> {
    Argument(&'v str),
    Key(&'v Key),
    Named(&'v str),
    Index(usize),
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(above) = self.above {
            above.fmt(f)?;
        }
        match self.step {
            Step::Argument(name) => f.write_str(name),
            Step::Named(name) => write!(f, "[{name:?}]"),
            Step::Key(Key::One(name)) => write!(f, "[{name:?}]"),
            Step::Key(Key::Pair([first, second])) => write!(f, "[{first:?}, {second:?}]"),
            Step::Index(idx) => write!(f, "[{idx}]"),
        }
    }
}

impl Faults {
    /// Returns an argument as the outermost value.
    pub(crate) fn argument<'v>(&'v self, name: &'v str, value: &'v Value) -> At<'v> {
        At {
            value,
            place: Place {
                above: None,
                step: Step::Argument(name),
            },
            faults: self,
        }
    }

    /// Adds a fault without a place.
    pub(crate) fn push(&self, fault: Diagnostic) {
        self.found.borrow_mut().push(fault);
    }

    /// Returns a value unless there are faults.
    pub(crate) fn or<T>(self, value: T) -> Result<T, Diagnostics> {
        self.found.into_inner().or(value)
    }
}

impl<'v> At<'v> {
    /// Adds a fault at this place.
    pub(crate) fn fault(&self, code: &'static str, message: &str, help: &str) {
        let mut fault =
            Diagnostic::error(code, message).in_source(&Source::new(self.place.to_string(), ""));
        if !help.is_empty() {
            fault = fault.help(help);
        }
        self.faults.push(fault);
    }

    /// Adds the fault that the value is of another kind.
    pub(crate) fn wrong(&self, wanted: &str) {
        let message = format!("it must be {wanted}, but is {}", self.value.kind());
        self.fault("J002", &message, "");
    }

    /// Whether the value is `None`: there is none.
    pub(crate) fn is_none(&self) -> bool {
        *self.value == Value::Null
    }

    /// Returns another value at the same place.
    pub(crate) fn with(&self, value: &'v Value) -> Self {
        Self { value, ..*self }
    }

    /// Returns the value.
    pub(crate) fn value(&self) -> &'v Value {
        self.value
    }

    /// Returns the entries of a mapping whose keys are among the known ones. Other keys are faults.
    pub(crate) fn table(&'v self, known: &[&str]) -> Table<'v> {
        let Value::Map(entries) = self.value else {
            self.wrong(&format!("a mapping with keys such as `{}`", known[0]));
            return Table {
                at: self,
                entries: &[],
            };
        };
        for (key, _) in entries {
            let name = match key {
                Key::One(name) if known.contains(&name.as_str()) => continue,
                Key::One(name) => name.clone(),
                Key::Pair(pair) => pair.join(", "),
            };
            self.fault(
                "J001",
                &format!("unknown key `{name}`"),
                &did_you_mean(&name, known.iter().copied()),
            );
        }
        Table { at: self, entries }
    }

    /// Returns the entries of a mapping with names of the caller as keys, with these.
    pub(crate) fn named(&'v self, of: &str) -> Vec<(&'v str, At<'v>)> {
        self.entries(of)
            .into_iter()
            .filter_map(|(key, at)| match key {
                Key::One(name) => Some((name.as_str(), at)),
                Key::Pair(_) => {
                    at.fault("J002", "a key must be one name", "");
                    None
                }
            })
            .collect()
    }

    /// Returns the entries of a mapping with any keys, with these.
    pub(crate) fn entries(&'v self, of: &str) -> Vec<(&'v Key, At<'v>)> {
        match self.value {
            Value::Map(entries) => entries
                .iter()
                .map(|(key, value)| (key, self.below(Step::Key(key), value)))
                .collect(),
            _ => {
                self.wrong(&format!("a mapping of {of}"));
                Vec::new()
            }
        }
    }

    /// Returns the elements of a list.
    pub(crate) fn list(&'v self, of: &str) -> Vec<At<'v>> {
        match self.value {
            Value::List(values) => values
                .iter()
                .enumerate()
                .map(|(idx, value)| self.below(Step::Index(idx), value))
                .collect(),
            _ => {
                self.wrong(&format!("a list of {of}"));
                Vec::new()
            }
        }
    }

    fn below(&'v self, step: Step<'v>, value: &'v Value) -> At<'v> {
        At {
            value,
            place: Place {
                above: Some(&self.place),
                step,
            },
            faults: self.faults,
        }
    }

    /// Returns a finite number.
    pub(crate) fn number(&self) -> Option<f64> {
        match self.value {
            Value::Number(number) => self.finite(*number),
            _ => {
                self.wrong("a number");
                None
            }
        }
    }

    /// Returns a finite number that is not negative.
    pub(crate) fn amount(&self) -> Option<f64> {
        let number = self.number()?;
        if number < 0.0 {
            self.fault("J002", &format!("{number} must not be negative"), "");
            return None;
        }
        Some(number)
    }

    /// Returns a limit: a number, which may be infinite, or `unlimited` for `None`.
    pub(crate) fn limit(&self, unlimited: f64) -> Option<f64> {
        match self.value {
            Value::Null => Some(unlimited),
            Value::Number(number) if !number.is_nan() => Some(*number),
            _ => self.number(),
        }
    }

    fn finite(&self, number: f64) -> Option<f64> {
        if number.is_finite() {
            return Some(number);
        }
        let help = "the simulation may have diverged; leave the episode out";
        self.fault("J003", &format!("{number} is not a finite number"), help);
        None
    }

    /// Returns a list of finite numbers of any length.
    pub(crate) fn numbers(&self, wanted: &str) -> Option<&'v [f64]> {
        let numbers: &[f64] = match self.value {
            Value::Numbers(numbers) => numbers,
            Value::List(values) if values.is_empty() => &[],
            _ => {
                self.wrong(wanted);
                return None;
            }
        };
        if let Some((idx, number)) = (numbers.iter().enumerate()).find(|(_, it)| !it.is_finite()) {
            let help = "the simulation may have diverged; leave the episode out";
            let message = format!("number {idx}, {number}, is not a finite number");
            self.fault("J003", &message, help);
            return None;
        }
        Some(numbers)
    }

    /// Returns a fixed number of finite numbers.
    pub(crate) fn vector<const N: usize>(&self) -> Option<[f64; N]> {
        let wanted = format!("{N} numbers");
        let numbers = self.numbers(&wanted)?;
        let vector = numbers.try_into().ok();
        if vector.is_none() {
            self.wrong(&wanted);
        }
        vector
    }

    /// Returns a unit quaternion x, y, z, w. Others of about this length are divided by it.
    pub(crate) fn rotation(&self) -> Option<[f64; 4]> {
        let quaternion: [f64; 4] = self.vector()?;
        let square: f64 = quaternion.iter().map(|part| part * part).sum();
        // A quaternion in 32 bits.
        if (square - 1.0).abs() <= 1e-5 {
            return Some(quaternion);
        }
        if (square - 1.0).abs() > 0.02 {
            let message = format!(
                "a rotation is a quaternion x, y, z, w of length 1, but this one has length {:.3}",
                square.sqrt()
            );
            self.fault("J002", &message, "");
            return None;
        }
        let length = square.sqrt();
        Some(quaternion.map(|part| part / length))
    }

    /// Returns a truth value.
    pub(crate) fn truth(&self) -> Option<bool> {
        match self.value {
            Value::Bool(truth) => Some(*truth),
            _ => {
                self.wrong("True or False");
                None
            }
        }
    }

    /// Returns a text.
    pub(crate) fn text(&self) -> Option<&'v str> {
        match self.value {
            Value::Text(text) => Some(text),
            _ => {
                self.wrong("a text");
                None
            }
        }
    }

    /// Returns a list of texts, sorted and without duplicates.
    pub(crate) fn names(&'v self) -> Option<Vec<String>> {
        let values = self.list("names");
        if !matches!(self.value, Value::List(_)) {
            return None;
        }
        let mut names = Vec::with_capacity(values.len());
        for value in &values {
            names.push(value.text()?.to_owned());
        }
        names.sort();
        names.dedup();
        Some(names)
    }

    /// Returns a pair of names, sorted.
    pub(crate) fn pair(&'v self) -> Option<[String; 2]> {
        let values = self.list("two names");
        let [first, second] = values.as_slice() else {
            if matches!(self.value, Value::List(_)) {
                self.wrong("two names");
            }
            return None;
        };
        let mut pair = [first.text()?.to_owned(), second.text()?.to_owned()];
        pair.sort();
        Some(pair)
    }
}

/// The entries of a mapping with known keys.
pub(crate) struct Table<'v> {
    at: &'v At<'v>,
    entries: &'v [(Key, Value)],
}

impl<'v> Table<'v> {
    /// Returns the value of a key, or `None` if it is not given.
    pub(crate) fn get(&self, key: &'v str) -> Option<At<'v>> {
        self.entries
            .iter()
            .find(|(name, _)| matches!(name, Key::One(name) if name == key))
            .map(|(_, value)| self.at.below(Step::Named(key), value))
    }

    /// Returns the value of a key; that it is not given is a fault.
    pub(crate) fn required(&self, key: &'v str) -> Option<At<'v>> {
        let found = self.get(key);
        if found.is_none() && matches!(self.at.value, Value::Map(_)) {
            self.at.fault("J004", &format!("`{key}` is missing"), "");
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(read: impl FnOnce(&At<'_>)) -> String {
        let value = Value::map([
            ("position", [0.0, f64::NAN, 0.0].into()),
            ("rotation", [0.0, 0.0, 2.0, 0.0].into()),
            ("positon", 1.0.into()),
        ]);
        let faults = Faults::default();
        let at = faults.argument("before", &value);
        read(&at);
        faults
            .or(())
            .map_or_else(|found| found.to_string(), |()| String::new())
    }

    #[test]
    fn a_fault_names_its_place_and_the_nearest_key() {
        let found = faults(|at| {
            let table = at.table(&["position", "rotation"]);
            assert_eq!(table.get("position").and_then(|at| at.vector::<3>()), None);
            assert_eq!(table.get("rotation").and_then(|at| at.rotation()), None);
            assert!(table.required("mass").is_none());
        });
        let expected = "J001 before: unknown key `positon`\n  help: did you mean `position`?\n\
            J003 before[\"position\"]: number 1, NaN, is not a finite number\n  \
            help: the simulation may have diverged; leave the episode out\n\
            J002 before[\"rotation\"]: a rotation is a quaternion x, y, z, w of length 1, but this one has length 2.000\n\
            J004 before: `mass` is missing\n";
        assert_eq!(found, expected);
    }

    #[test]
    fn a_wrong_kind_is_named() {
        let found = faults(|at| {
            at.number();
            at.list("bodies");
        });
        assert_eq!(
            found,
            "J002 before: it must be a number, but is a mapping\n\
             J002 before: it must be a list of bodies, but is a mapping\n"
        );
    }
}
