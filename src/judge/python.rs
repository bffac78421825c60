//! The module `actcheck._judge` of the Python package, which adds types and documentation.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use actcheck_base::Diagnostics;
use pyo3::exceptions::{PyRecursionError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyFrozenSet, PyInt, PyList, PySet, PyString, PyTuple};

use crate::{Call, Key, OwnRule, Value};

/// Values are nested at most this deep: a body's shape has a depth of 6.
const DEEPEST: usize = 16;

#[pymodule]
mod _judge {
    #[pymodule_export]
    use super::{PyJudge, PyMonitor, PyVerdict};
}

/// The rules of an ontology.
#[pyclass(frozen, name = "Judge", module = "actcheck._judge")]
struct PyJudge {
    judge: crate::Judge,
}

/// Judges an action after every step.
#[pyclass(frozen, name = "Monitor", module = "actcheck._judge")]
struct PyMonitor {
    monitor: Mutex<crate::Monitor>,
}

/// The outcomes of one action.
#[pyclass(frozen, name = "Verdict", module = "actcheck._judge")]
struct PyVerdict {
    verdict: crate::Verdict,
}

/// A judgement: property, outcome, margin, witness, missing facts, whether it held before, whether it
/// passed vacuously, and the digest of its rules.
type Row = (
    String,
    &'static str,
    Option<f64>,
    String,
    Vec<String>,
    Option<bool>,
    Option<bool>,
    String,
);

#[pymethods]
impl PyJudge {
    #[new]
    fn new(
        py: Python<'_>,
        ontology: Option<PathBuf>,
        rules: Vec<(String, String)>,
    ) -> PyResult<Self> {
        let rules: Vec<OwnRule> = rules
            .into_iter()
            .map(|(name, text)| OwnRule { name, text })
            .collect();
        let judge = py.detach(|| crate::Judge::new(ontology.as_deref(), &rules));
        let judge = judge.map_err(|faults| raised(py, &faults))?;
        Ok(Self { judge })
    }

    fn judge(
        &self,
        py: Python<'_>,
        action: &str,
        before: &Bound<'_, PyAny>,
        after: &Bound<'_, PyAny>,
        during: &Bound<'_, PyAny>,
        parameters: &Bound<'_, PyAny>,
    ) -> PyResult<PyVerdict> {
        let (before, after) = (value_of(before, 0)?, value_of(after, 0)?);
        let (during, parameters) = (value_of(during, 0)?, value_of(parameters, 0)?);
        let judged = py.detach(|| {
            self.judge.judge(&Call {
                action,
                before: &before,
                after: &after,
                during: &during,
                parameters: &parameters,
            })
        });
        let verdict = judged.map_err(|faults| raised(py, &faults))?;
        Ok(PyVerdict { verdict })
    }

    fn monitor(
        &self,
        py: Python<'_>,
        action: &str,
        before: &Bound<'_, PyAny>,
        parameters: &Bound<'_, PyAny>,
    ) -> PyResult<PyMonitor> {
        let (before, parameters) = (value_of(before, 0)?, value_of(parameters, 0)?);
        let monitor = py.detach(|| self.judge.monitor(action, &before, &parameters));
        let monitor = Mutex::new(monitor.map_err(|faults| raised(py, &faults))?);
        Ok(PyMonitor { monitor })
    }

    fn actions(&self) -> Vec<&str> {
        self.judge.actions().collect()
    }

    fn properties(&self, py: Python<'_>, action: &str) -> PyResult<Vec<String>> {
        let properties = self.judge.properties(action);
        properties.map_err(|faults| raised(py, &faults))
    }

    fn warnings(&self) -> Vec<String> {
        let warnings = self.judge.warnings().iter();
        warnings
            .map(|warning| match warning.place() {
                Some(place) => format!("{} {place}: {warning}", warning.code),
                None => format!("{}: {warning}", warning.code),
            })
            .collect()
    }
}

#[pymethods]
impl PyMonitor {
    fn step(
        &self,
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        seconds: f64,
        report: Option<(bool, String)>,
    ) -> PyResult<PyVerdict> {
        let state = value_of(state, 0)?;
        let judged = py.detach(|| {
            let report = report.as_ref().map(|(ok, message)| (*ok, message.as_str()));
            let mut monitor = self.monitor.lock().unwrap_or_else(PoisonError::into_inner);
            monitor.step(&state, seconds, report)
        });
        let verdict = judged.map_err(|faults| raised(py, &faults))?;
        Ok(PyVerdict { verdict })
    }
}

#[pymethods]
impl PyVerdict {
    fn rows(&self) -> Vec<Row> {
        let judgements = self.verdict.judgements().iter();
        judgements
            .map(|judgement| {
                let missing = self.verdict.missing(&judgement.property);
                let missing = missing.unwrap_or_default().into_iter().map(str::to_owned);
                (
                    judgement.property.clone(),
                    judgement.outcome.word(),
                    judgement.margin,
                    judgement.witness.clone(),
                    missing.collect(),
                    judgement.held_before,
                    judgement.vacuous,
                    judgement.rule_digest.clone(),
                )
            })
            .collect()
    }

    fn passed(&self) -> bool {
        self.verdict.passed()
    }

    fn score(&self) -> f64 {
        self.verdict.score()
    }

    fn why(&self, py: Python<'_>, property: &str) -> PyResult<String> {
        let explained = py.detach(|| self.verdict.why(property));
        explained.map_err(|faults| raised(py, &faults))
    }

    fn why_not(&self, py: Python<'_>, property: &str, statement: &str) -> PyResult<String> {
        let explained = py.detach(|| self.verdict.why_not(property, statement));
        explained.map_err(|faults| raised(py, &faults))
    }
}

/// Returns `actcheck.JudgeError` with all faults.
fn raised(py: Python<'_>, faults: &Diagnostics) -> PyErr {
    let rows: Vec<(&str, String, Option<String>, Option<String>)> = faults
        .iter()
        .map(|fault| {
            let (message, place) = (fault.message.clone(), fault.place());
            (fault.code, message, place, fault.help.clone())
        })
        .collect();
    let error = py
        .import("actcheck.faults")
        .and_then(|module| module.getattr("JudgeError"))
        .and_then(|class| class.call1((rows,)));
    error.map_or_else(|error| error, PyErr::from_value)
}

/// Converts a Python value. Arrays are anything with a method `tolist`, as numpy's and torch's have.
fn value_of(object: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if depth > DEEPEST {
        let message = format!("values are nested at most {DEEPEST} deep");
        return Err(PyRecursionError::new_err(message));
    }
    if object.is_none() {
        return Ok(Value::Null);
    }
    if let Ok(truth) = object.cast::<PyBool>() {
        return Ok(Value::Bool(truth.is_true()));
    }
    if let Ok(number) = object.cast::<PyFloat>() {
        return Ok(Value::Number(number.value()));
    }
    if object.is_instance_of::<PyInt>() {
        return Ok(Value::Number(object.extract()?));
    }
    if let Ok(text) = object.cast::<PyString>() {
        return Ok(Value::Text(text.to_str()?.to_owned()));
    }
    if let Ok(entries) = object.cast::<PyDict>() {
        let mut map = Vec::with_capacity(entries.len());
        for (key, value) in entries.iter() {
            map.push((key_of(&key)?, value_of(&value, depth + 1)?));
        }
        return Ok(Value::Map(map));
    }
    if let Ok(list) = object.cast::<PyList>() {
        return list_of(list.iter(), list.len(), depth);
    }
    if let Ok(tuple) = object.cast::<PyTuple>() {
        return list_of(tuple.iter(), tuple.len(), depth);
    }
    if let Ok(set) = object.cast::<PySet>() {
        return list_of(set.iter(), set.len(), depth);
    }
    if let Ok(set) = object.cast::<PyFrozenSet>() {
        return list_of(set.iter(), set.len(), depth);
    }
    if let Ok(plain) = object.call_method0("tolist") {
        return value_of(&plain, depth + 1);
    }
    let kind = object.get_type().name()?.to_string();
    let message = format!(
        "a `{kind}` is not a plain value: give None, truth values, numbers, texts, arrays, lists and dictionaries"
    );
    Err(PyTypeError::new_err(message))
}

/// Converts the elements of a list.
fn list_of<'py>(
    elements: impl Iterator<Item = Bound<'py, PyAny>>,
    len: usize,
    depth: usize,
) -> PyResult<Value> {
    let mut numbers = Vec::with_capacity(len);
    let mut values = Vec::new();
    for element in elements {
        match element.cast::<PyFloat>() {
            Ok(number) if values.is_empty() => numbers.push(number.value()),
            _ => match value_of(&element, depth + 1)? {
                Value::Number(number) if values.is_empty() => numbers.push(number),
                value => {
                    values.extend(numbers.drain(..).map(Value::Number));
                    values.push(value);
                }
            },
        }
    }
    Ok(if numbers.is_empty() {
        Value::List(values)
    } else {
        Value::Numbers(numbers)
    })
}

fn key_of(key: &Bound<'_, PyAny>) -> PyResult<Key> {
    if let Ok(text) = key.cast::<PyString>() {
        return Ok(Key::One(text.to_str()?.to_owned()));
    }
    if let Ok(pair) = key.extract::<(String, String)>() {
        return Ok(Key::Pair([pair.0, pair.1]));
    }
    let message = "a key must be a text, or a pair of texts for a quantity of two bodies";
    Err(PyTypeError::new_err(message))
}
