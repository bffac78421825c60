//! Limits that are fitted to passing runs, and their false alarms in others.

use std::collections::{BTreeMap, BTreeSet};

use crate::{Interval, TwoByTwo, wilson};

/// Fewest values to which a limit is fitted.
const FEWEST: usize = 30;
/// Share of the distance from the median to the farthest value by which a limit is wider: the
/// farthest value of other runs is beyond that of these in half of all cases.
const SLACK: f64 = 0.1;
/// Greatest share of false alarms in held-out runs.
const MOST_FALSE: f64 = 0.01;
/// Fewest runs with a bad label that a limit must notice.
const FEWEST_CAUGHT: u64 = 3;
/// Level of the test that runs with a bad label are beyond the limit more often than others.
const LEVEL: f64 = 0.01;

/// A limit with its evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MinedLimit {
    /// The limit, rounded outwards to two digits.
    pub limit: f64,
    /// Number of values that it was fitted to.
    pub fitted: usize,
    /// The farthest of them.
    pub farthest: f64,
    /// Number of held-out passing runs with a value.
    pub held_out: u64,
    /// Number of those beyond the limit.
    pub false_alarms: u64,
}

/// The direction in which values are beyond a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    /// Values above it.
    Above,
    /// Values below it.
    Below,
    /// Values below it, which is always this number.
    BelowFixed,
}

impl MinedLimit {
    /// Fits a limit to two of three passing runs and tries it on the third ones, in the order of
    /// their ids. Returns `None` with too few values, or with values that a fixed limit does not
    /// separate.
    pub fn of(values: &BTreeMap<String, f64>, beyond: Beyond) -> Option<Self> {
        let part = |held_out: bool| {
            let some = values.values().enumerate();
            some.filter(move |(idx, _)| is_held_out(*idx) == held_out)
                .map(|(_, value)| *value)
        };
        let mut fitted: Vec<f64> = part(false).collect();
        if fitted.len() < FEWEST {
            return None;
        }
        fitted.sort_by(f64::total_cmp);
        let (least, median) = (fitted[0], fitted[fitted.len() / 2]);
        let most = fitted[fitted.len() - 1];
        let (farthest, limit) = match beyond {
            Beyond::Above => (most, rounded(most + SLACK * (most - median), true)),
            Beyond::Below => (least, rounded(least - SLACK * (median - least), false)),
            Beyond::BelowFixed => (least, 0.0),
        };
        if beyond == Beyond::BelowFixed && least <= SLACK * median {
            return None;
        }
        let found = Self {
            limit,
            fitted: fitted.len(),
            farthest,
            held_out: part(true).count() as u64,
            false_alarms: 0,
        };
        let false_alarms = part(true).filter(|value| found.is_beyond(*value, beyond));
        Some(Self {
            false_alarms: false_alarms.count() as u64,
            ..found
        })
    }

    /// Whether a value is beyond the limit.
    pub fn is_beyond(&self, value: f64, beyond: Beyond) -> bool {
        match beyond {
            Beyond::Above => value > self.limit,
            Beyond::Below => value < self.limit,
            Beyond::BelowFixed => value <= self.limit,
        }
    }

    /// Whether held-out runs agree: at most one of a hundred is beyond the limit.
    pub fn is_confirmed(&self) -> bool {
        self.held_out > 0 && self.false_alarms as f64 <= MOST_FALSE * self.held_out as f64
    }

    /// The share of false alarms with its 95 % interval.
    pub fn false_alarm_rate(&self) -> Option<Interval> {
        wilson(self.false_alarms, self.held_out)
    }

    /// Returns the ids of the runs that a limit is fitted to.
    pub fn fitted_runs(values: &BTreeMap<String, f64>) -> BTreeSet<&str> {
        let some = values.keys().enumerate();
        some.filter(|(idx, _)| !is_held_out(*idx))
            .map(|(_, run)| run.as_str())
            .collect()
    }

    /// Returns the number of runs with a bad label beyond the limit, if these are more than by
    /// chance. `good` are runs with good labels to which the limit was not fitted, whatever the
    /// verdicts about them are.
    pub fn caught(
        &self,
        bad: &BTreeMap<String, f64>,
        good: &BTreeMap<String, f64>,
        beyond: Beyond,
    ) -> Option<u64> {
        let beyond_in = |values: &BTreeMap<String, f64>| {
            let beyond = values
                .values()
                .filter(|value| self.is_beyond(**value, beyond));
            beyond.count() as u64
        };
        let (caught, alarms) = (beyond_in(bad), beyond_in(good));
        let table = TwoByTwo {
            failed_in: caught,
            passed_in: alarms,
            failed_out: bad.len() as u64 - caught,
            passed_out: good.len() as u64 - alarms,
        };
        (caught >= FEWEST_CAUGHT && table.fisher().greater <= LEVEL).then_some(caught)
    }
}

/// Whether a run is one of the third ones, to which limits are not fitted.
fn is_held_out(idx: usize) -> bool {
    idx % 3 == 2
}

/// Rounds to two digits, upwards or downwards.
fn rounded(value: f64, up: bool) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let step = libm::pow(10.0, libm::floor(libm::log10(value.abs())) - 1.0);
    let steps = value / step;
    let whole = if up { steps.ceil() } else { steps.floor() };
    // Through text: `13 * 0.01` is not 0.13.
    format!("{:.12}", whole * step).parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(of: impl Fn(usize) -> f64, n: usize) -> BTreeMap<String, f64> {
        (0..n).map(|idx| (format!("k-{idx:04}"), of(idx))).collect()
    }

    #[test]
    fn a_limit_is_rounded_outwards_and_confirmed_by_runs_that_it_was_not_fitted_to() {
        let found = MinedLimit::of(&values(|idx| (idx % 10) as f64 / 10.0, 300), Beyond::Above)
            .expect("there are enough");
        assert_eq!((found.limit, found.farthest), (0.94, 0.9));
        assert_eq!(
            (found.fitted, found.held_out, found.false_alarms),
            (200, 100, 0)
        );
        assert!(found.is_confirmed());
        let below = MinedLimit::of(&values(|idx| 1.0 + (idx % 10) as f64, 300), Beyond::Below);
        assert!(below.expect("there are enough").limit < 1.0);
        let wild = |idx: usize| if idx % 3 == 2 { 5.0 } else { 1.0 };
        let found = MinedLimit::of(&values(wild, 300), Beyond::Above).expect("there are enough");
        assert!(!found.is_confirmed(), "{found:?}");
        assert_eq!(MinedLimit::of(&values(|_| 1.0, 30), Beyond::Above), None);
    }

    #[test]
    fn an_order_is_a_limit_of_zero_that_all_runs_are_far_from() {
        let clear = values(|idx| 0.5 + (idx % 7) as f64 / 10.0, 300);
        let found = MinedLimit::of(&clear, Beyond::BelowFixed).expect("it is clear");
        assert_eq!(found.limit, 0.0);
        let reversed = values(|idx| idx as f64 - 3.0, 300);
        assert_eq!(MinedLimit::of(&reversed, Beyond::BelowFixed), None);
    }

    #[test]
    fn bad_labels_are_caught_only_beyond_chance() {
        let found = MinedLimit::of(&values(|idx| (idx % 10) as f64, 300), Beyond::Above)
            .expect("there are enough");
        let far = |n_far: usize| values(|idx| if idx < n_far { 20.0 } else { 3.0 }, 20);
        assert_eq!(found.caught(&far(8), &far(0), Beyond::Above), Some(8));
        assert_eq!(
            found.caught(&far(2), &far(0), Beyond::Above),
            None,
            "too few"
        );
        assert_eq!(
            found.caught(&far(8), &far(7), Beyond::Above),
            None,
            "good runs do the same"
        );
    }
}
