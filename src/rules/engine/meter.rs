//! Enforces the budget of an evaluation.

use crate::engine::budget::Budget;
use crate::model::program::Rule;
pub(crate) use crate::watch::{Stop, Watch};
use actcheck_base::RuleFault;

/// Tracks how much of a budget is spent. One meter covers everything that is evaluated for one
/// property.
#[derive(Debug)]
pub(crate) struct Meter {
    budget: Budget,
    pub(crate) watch: Watch,
    tuples: usize,
    new_things: usize,
    steps: u32,
}

/// Steps between two checks of the clock: about 0.1 ms.
const STEPS_PER_CHECK: u32 = 16_384;

impl Meter {
    pub(crate) fn new(budget: &Budget) -> Self {
        Self {
            budget: budget.clone(),
            watch: Watch::new(budget),
            tuples: 0,
            new_things: 0,
            steps: 0,
        }
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
        self.watch.check()
    }

    /// Counts newly derived tuples.
    pub(crate) fn derived(&mut self, count: usize) -> Result<(), Stop> {
        self.tuples = self.tuples.saturating_add(count);
        self.room_for(0)
    }

    /// Returns an error if fewer than `count` more tuples may be derived.
    pub(crate) fn room_for(&self, count: usize) -> Result<(), Stop> {
        if self.tuples.saturating_add(count) > self.budget.tuples {
            Err(Stop::Tuples)
        } else {
            Ok(())
        }
    }

    /// Counts a new thing of a rule that may make them without end.
    pub(crate) fn made(&mut self) -> Result<(), Stop> {
        self.new_things += 1;
        if self.new_things > self.budget.new_things {
            Err(Stop::NewThings)
        } else {
            Ok(())
        }
    }

    /// Ends the count; the explanation of the result uses the time and memory that are left.
    pub(crate) fn into_watch(self) -> Watch {
        self.watch
    }

    /// Returns the fault that reports why the evaluation stopped, and in which rule.
    pub(crate) fn fault(&self, stop: Stop, rule: Option<&Rule>) -> RuleFault {
        let place = rule.map_or(String::new(), |rule| match &rule.origin.name {
            Some(name) => format!(" in rule {name:?} at {}", rule.origin.place()),
            None => format!(" in the rule at {}", rule.origin.place()),
        });
        match stop {
            Stop::Tuples => RuleFault::BudgetSpent(format!(
                "more than {} derived tuples{place}",
                self.budget.tuples
            )),
            Stop::NewThings => {
                let most = self.budget.new_things;
                RuleFault::BudgetSpent(format!(
                    "more than {most} {NEW_THINGS}{place}, which makes further ones for them; add a condition that they \
                     don't satisfy"
                ))
            }
            Stop::Bytes => RuleFault::BudgetSpent(format!(
                "more than {} of memory{place}",
                mebibytes(self.budget.bytes)
            )),
            Stop::Time => {
                RuleFault::BudgetSpent(format!("more than {} s{place}", self.budget.secs))
            }
            Stop::Requested => RuleFault::Interrupted,
            Stop::Value => RuleFault::Value(format!("{}{place}", self.watch.value_text())),
        }
    }
}

/// The noun for the things of rules with `!x` in their heads, in messages.
const NEW_THINGS: &str = "new things (`!x`)";

/// Formats an amount of memory.
pub(crate) fn mebibytes(bytes: usize) -> String {
    const MEBIBYTE: usize = 1 << 20;
    if bytes < MEBIBYTE {
        format!("{bytes} bytes")
    } else {
        format!("{} MiB", bytes / MEBIBYTE)
    }
}
