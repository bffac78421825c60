//! The course of an action: quantities over time, sampled at a fixed rate.

use std::collections::BTreeMap;

use crate::Steps;

/// A recorded quantity: its IRI, the thing's IRI, and for quantities of two things the IRI of the
/// second, else an empty string.
pub type SignalKey = [String; 3];

/// Samples of one quantity.
#[derive(Debug, Clone, PartialEq)]
pub enum Signal {
    /// The same value at all times.
    Constant(f64),
    /// One value for each sample.
    Values(Vec<f64>),
    /// One value for each sample, as a number of steps of which `per_unit` make one unit.
    Steps {
        /// Number of steps in one unit.
        per_unit: u32,
        /// The samples.
        steps: Steps,
    },
}

impl Signal {
    /// Returns the samples. Values after the last recorded one repeat it.
    pub fn values(&self, count: usize) -> Vec<f64> {
        let mut values: Vec<f64> = match self {
            Self::Constant(value) => vec![*value],
            Self::Values(values) => values.clone(),
            Self::Steps { per_unit, steps } => {
                let per_unit = f64::from((*per_unit).max(1));
                steps
                    .iter()
                    .map(|steps| f64::from(*steps) / per_unit)
                    .collect()
            }
        };
        let last = values.last().copied().unwrap_or(f64::NAN);
        values.resize(count, last);
        values
    }
}

/// A convex solid of a thing: every point within a distance of the convex hull of some points.
/// Frame: the thing's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Solid {
    /// Unit: metres.
    pub points: Vec<[f64; 3]>,
    /// The distance. Unit: metres.
    pub radius: f64,
}

/// Quantities of one action over time. The first sample is the initial state.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Course {
    /// Time between two samples. Unit: seconds.
    pub period_secs: f64,
    /// Number of samples.
    pub count: usize,
    /// Names of the action's phases with their start times in order. Unit: seconds.
    pub phases: Vec<(String, f64)>,
    signals: BTreeMap<SignalKey, Signal>,
    solids: BTreeMap<String, Vec<Solid>>,
}

impl Course {
    /// Creates a course without quantities.
    pub fn new(period_secs: f64, count: usize) -> Self {
        Self {
            period_secs,
            count,
            ..Self::default()
        }
    }

    /// Sets the samples of a quantity. The order of the two things of a pair doesn't matter.
    pub fn set(&mut self, [quantity, first, second]: SignalKey, signal: Signal) {
        let key = if second.is_empty() || first <= second {
            [quantity, first, second]
        } else {
            [quantity, second, first]
        };
        self.signals.insert(key, signal);
    }

    /// Returns the samples of a quantity; `None` if it was not recorded.
    pub fn get(&self, quantity: &str, first: &str, second: &str) -> Option<&Signal> {
        let (first, second) = if second.is_empty() || first <= second {
            (first, second)
        } else {
            (second, first)
        };
        self.signals
            .get(&[quantity, first, second].map(str::to_owned))
    }

    /// Sets the solids of a thing, for distances between surfaces.
    pub fn set_solids(&mut self, thing: String, solids: Vec<Solid>) {
        self.solids.insert(thing, solids);
    }

    /// Returns the solids of a thing; `None` if they are not known.
    pub fn solids(&self, thing: &str) -> Option<&[Solid]> {
        self.solids.get(thing).map(Vec::as_slice)
    }

    /// Returns all recorded quantities, sorted.
    pub fn signals(&self) -> impl Iterator<Item = (&SignalKey, &Signal)> {
        self.signals.iter()
    }

    /// Returns the recorded things and pairs of a quantity, sorted.
    pub fn of<'a>(&'a self, quantity: &'a str) -> impl Iterator<Item = (&'a [String], &'a Signal)> {
        let start = [quantity.to_owned(), String::new(), String::new()];
        self.signals
            .range(start..)
            .take_while(move |(key, _)| key[0] == quantity)
            .map(|(key, value)| (&key[1..], value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_found_in_both_orders_and_things_of_a_quantity_are_listed() {
        let mut course = Course::new(0.5, 3);
        let key = |parts: [&str; 3]| parts.map(str::to_owned);
        course.set(
            key(["force", "b", "a"]),
            Signal::Steps {
                per_unit: 10,
                steps: vec![1, 2].into(),
            },
        );
        course.set(key(["z", "a", ""]), Signal::Constant(4.0));
        assert_eq!(course.get("force", "a", "b"), course.get("force", "b", "a"));
        assert_eq!(
            course.get("force", "a", "b").map(|signal| signal.values(3)),
            Some(vec![0.1, 0.2, 0.2])
        );
        assert_eq!(
            course
                .of("force")
                .map(|(things, _)| things.to_vec())
                .collect::<Vec<_>>(),
            [["a", "b"]]
        );
        assert_eq!(course.get("x", "a", ""), None);
    }
}
