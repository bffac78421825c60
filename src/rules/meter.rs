//! How much an evaluation may still do, and why it stopped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
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
    /// Somebody asked for it.
    Asked,
}

/// How long an evaluation may still go on when somebody has asked for its end. A pick's properties take about a
/// millisecond: runs in flight are judged whole, and what takes longer ends before anybody gets impatient.
const PATIENCE: Duration = Duration::from_millis(200);

/// Time and the wish of others, as an evaluation looks at them now and then.
#[derive(Debug)]
pub(crate) struct Watch {
    /// Nothing where the budget is too long for the clock.
    deadline: Option<Instant>,
    patience: Option<Instant>,
    asked: Arc<AtomicBool>,
}

impl Watch {
    /// Begins now.
    pub(crate) fn new(budget: &Budget) -> Self {
        let now = Instant::now();
        let time = Duration::try_from_secs_f64(budget.secs.max(0.0)).ok();
        Self {
            deadline: time.and_then(|time| now.checked_add(time)),
            patience: now.checked_add(PATIENCE),
            asked: Arc::clone(&budget.stop),
        }
    }

    /// Whether the evaluation may go on.
    pub(crate) fn look(&self) -> Result<(), Stop> {
        let now = Instant::now();
        let late = |moment: Option<Instant>| moment.is_some_and(|moment| now > moment);
        if self.asked.load(Ordering::Relaxed) && late(self.patience) {
            Err(Stop::Asked)
        } else if late(self.deadline) {
            Err(Stop::Time)
        } else {
            Ok(())
        }
    }
}

/// A budget while it is being spent. One meter serves everything that is evaluated for one property.
#[derive(Debug)]
pub(crate) struct Meter {
    budget: Budget,
    watch: Watch,
    tuples: usize,
    steps: u32,
}

/// Steps between two looks at the clock: some 0.1 ms.
const STEPS_PER_LOOK: u32 = 16_384;

impl Meter {
    pub(crate) fn new(budget: &Budget) -> Self {
        Self { budget: budget.clone(), watch: Watch::new(budget), tuples: 0, steps: 0 }
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
        self.watch.look()
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
        match stop {
            Stop::Tuples => RuleFault::BudgetSpent(format!("more than {} derived tuples{place}", self.budget.tuples)),
            Stop::Time => RuleFault::BudgetSpent(format!("more than {} s{place}", self.budget.secs)),
            Stop::Asked => RuleFault::Interrupted,
        }
    }
}
