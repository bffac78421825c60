//! How much an evaluation may still do, and why it stopped.

use std::time::{Duration, Instant};

use crate::rules::findings::{Budget, RuleFault};
use crate::rules::program::Rule;

/// Why an evaluation stopped before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    /// Too many tuples.
    Tuples,
    /// Too long.
    Time,
}

/// A budget while it is being spent. One meter serves everything that is evaluated for one property.
#[derive(Debug)]
pub(crate) struct Meter {
    budget: Budget,
    deadline: Option<Instant>,
    tuples: usize,
    steps: u32,
}

/// Steps between two looks at the clock: some 0.1 ms.
const STEPS_PER_LOOK: u32 = 16_384;

impl Meter {
    pub(crate) fn new(budget: &Budget) -> Self {
        // A budget too long for the clock is none.
        let deadline =
            Duration::try_from_secs_f64(budget.secs.max(0.0)).ok().and_then(|time| Instant::now().checked_add(time));
        Self { budget: *budget, deadline, tuples: 0, steps: 0 }
    }

    /// One more row was looked at.
    pub(crate) fn step(&mut self) -> Result<(), Stop> {
        self.steps += 1;
        if self.steps < STEPS_PER_LOOK {
            return Ok(());
        }
        self.steps = 0;
        self.look()
    }

    /// Looks at the clock.
    pub(crate) fn look(&self) -> Result<(), Stop> {
        match self.deadline {
            Some(deadline) if Instant::now() > deadline => Err(Stop::Time),
            _ => Ok(()),
        }
    }

    /// So many new tuples were derived.
    pub(crate) fn derived(&mut self, count: usize) -> Result<(), Stop> {
        self.tuples = self.tuples.saturating_add(count);
        if self.tuples > self.budget.tuples { Err(Stop::Tuples) } else { Ok(()) }
    }

    /// How many tuples may still be derived.
    pub(crate) fn tuples_left(&self) -> usize {
        self.budget.tuples.saturating_sub(self.tuples)
    }

    /// The fault that tells a user where the evaluation stopped.
    pub(crate) fn fault(&self, stop: Stop, rule: Option<&Rule>) -> RuleFault {
        let place = rule.map_or(String::new(), |rule| match &rule.origin.name {
            Some(name) => format!(" in rule {name:?} at {}", rule.origin.place()),
            None => format!(" in the rule at {}", rule.origin.place()),
        });
        RuleFault::BudgetSpent(match stop {
            Stop::Tuples => format!("more than {} derived tuples{place}", self.budget.tuples),
            Stop::Time => format!("more than {} s{place}", self.budget.secs),
        })
    }
}
