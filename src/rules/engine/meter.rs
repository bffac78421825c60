//! Enforces the budget of an evaluation.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::engine::budget::Budget;
use crate::model::program::Rule;
use actcheck_base::RuleFault;

/// Why an evaluation stopped before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    /// Too many derived tuples.
    Tuples,
    /// The time limit was exceeded.
    Time,
    /// The caller requested a stop.
    Requested,
}

/// Minimum running time before a requested stop takes effect. The properties of a pick take about a millisecond, so
/// runs in progress are judged completely, and longer evaluations still stop quickly.
const STOP_GRACE_PERIOD: Duration = Duration::from_millis(200);

/// The time limit and stop request of an evaluation, checked from time to time.
#[derive(Debug)]
pub(crate) struct Deadline {
    /// `None` if the time limit is beyond the range of the clock.
    end: Option<Instant>,
    grace_end: Option<Instant>,
    stop_requested: Arc<AtomicBool>,
}

impl Deadline {
    /// Starts the clock.
    pub(crate) fn new(budget: &Budget) -> Self {
        let now = Instant::now();
        let time = Duration::try_from_secs_f64(budget.secs.max(0.0)).ok();
        Self {
            end: time.and_then(|time| now.checked_add(time)),
            grace_end: now.checked_add(STOP_GRACE_PERIOD),
            stop_requested: Arc::clone(&budget.stop),
        }
    }

    /// Returns an error if the evaluation must stop.
    pub(crate) fn check(&self) -> Result<(), Stop> {
        let now = Instant::now();
        let late = |moment: Option<Instant>| moment.is_some_and(|moment| now > moment);
        if self.stop_requested.load(Ordering::Relaxed) && late(self.grace_end) {
            Err(Stop::Requested)
        } else if late(self.end) {
            Err(Stop::Time)
        } else {
            Ok(())
        }
    }
}

/// Tracks how much of a budget is spent. One meter covers everything that is evaluated for one property.
#[derive(Debug)]
pub(crate) struct Meter {
    budget: Budget,
    deadline: Deadline,
    tuples: usize,
    steps: u32,
}

/// Steps between two checks of the clock: about 0.1 ms.
const STEPS_PER_CHECK: u32 = 16_384;

impl Meter {
    pub(crate) fn new(budget: &Budget) -> Self {
        Self { budget: budget.clone(), deadline: Deadline::new(budget), tuples: 0, steps: 0 }
    }

    /// Counts one row read.
    pub(crate) fn step(&mut self) -> Result<(), Stop> {
        self.steps += 1;
        if self.steps < STEPS_PER_CHECK {
            return Ok(());
        }
        self.steps = 0;
        self.check()
    }

    /// Checks the clock and the stop request.
    pub(crate) fn check(&self) -> Result<(), Stop> {
        self.deadline.check()
    }

    /// Counts newly derived tuples.
    pub(crate) fn derived(&mut self, count: usize) -> Result<(), Stop> {
        self.tuples = self.tuples.saturating_add(count);
        if self.tuples > self.budget.tuples { Err(Stop::Tuples) } else { Ok(()) }
    }

    /// Returns how many more tuples may be derived.
    pub(crate) fn tuples_left(&self) -> usize {
        self.budget.tuples.saturating_sub(self.tuples)
    }

    /// Returns the fault that reports why the evaluation stopped, and in which rule.
    pub(crate) fn fault(&self, stop: Stop, rule: Option<&Rule>) -> RuleFault {
        let place = rule.map_or(String::new(), |rule| match &rule.origin.name {
            Some(name) => format!(" in rule {name:?} at {}", rule.origin.place()),
            None => format!(" in the rule at {}", rule.origin.place()),
        });
        match stop {
            Stop::Tuples => RuleFault::BudgetSpent(format!("more than {} derived tuples{place}", self.budget.tuples)),
            Stop::Time => RuleFault::BudgetSpent(format!("more than {} s{place}", self.budget.secs)),
            Stop::Requested => RuleFault::Interrupted,
        }
    }
}
