//! The time and memory that an evaluation may still use, shared by joins, built-ins and
//! explanations.

use std::cell::{Cell, OnceCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::engine::budget::Budget;

/// Why an evaluation stopped before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    /// Too many derived tuples.
    Tuples,
    /// Too much memory.
    Bytes,
    /// Too many new things.
    NewThings,
    /// The time limit was exceeded.
    Time,
    /// The caller requested a stop.
    Requested,
    /// A value that a rule reads does not exist: a quantity over time was not recorded, or a sum is
    /// too large. The watch has the text.
    Value,
}

/// Minimum running time before a requested stop takes effect. The properties of a pick take about a
/// millisecond, so runs in progress are judged completely, and longer evaluations still stop
/// quickly.
const STOP_GRACE_PERIOD: Duration = Duration::from_millis(200);

/// The time limit and stop request of an evaluation, checked from time to time.
#[derive(Debug, Clone)]
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

/// Text that built-ins process between two checks of the clock: under a millisecond. Unit: bytes.
const WORK_PER_CHECK: usize = 1 << 18;

/// Accounts for the memory of rows and texts, and checks the clock inside built-ins.
///
/// A built-in that is refused memory or time has no value; [`Watch::stopped`] then returns the
/// reason.
#[derive(Debug)]
pub(crate) struct Watch {
    deadline: Deadline,
    /// Maximum memory. Unit: bytes.
    limit: usize,
    /// Memory of rows and created terms. Unit: bytes.
    held: Cell<usize>,
    /// Texts made by the current expression. Unit: bytes.
    made: Cell<usize>,
    /// Text processed since the last check of the clock. Unit: bytes.
    work: Cell<usize>,
    stop: Cell<Option<Stop>>,
    missing: OnceCell<String>,
    /// Whether the right sides of `implies` that a property needs count as false.
    fails_consequents: bool,
}

impl Watch {
    /// Starts the clock.
    pub(crate) fn new(budget: &Budget) -> Self {
        Self {
            deadline: Deadline::new(budget),
            limit: budget.bytes,
            held: Cell::new(0),
            made: Cell::new(0),
            work: Cell::new(0),
            stop: Cell::new(None),
            missing: OnceCell::new(),
            fails_consequents: false,
        }
    }

    /// Lets the right sides of `implies` that a property needs count as false.
    pub(crate) fn fail_consequents(&mut self) {
        self.fails_consequents = true;
    }

    /// Returns whether the right sides of `implies` that a property needs count as false.
    pub(crate) fn fails_consequents(&self) -> bool {
        self.fails_consequents
    }

    /// Returns a watch with the same deadline and the memory that is left. Its limits don't stop
    /// the evaluation.
    pub(crate) fn trial(&self) -> Self {
        Self {
            deadline: self.deadline.clone(),
            limit: self.left(),
            held: Cell::new(0),
            made: Cell::new(0),
            work: Cell::new(0),
            stop: Cell::new(None),
            missing: OnceCell::new(),
            fails_consequents: self.fails_consequents,
        }
    }

    /// Checks the clock and the stop request.
    pub(crate) fn check(&self) -> Result<(), Stop> {
        self.deadline
            .check()
            .inspect_err(|stop| self.stop.set(Some(*stop)))
    }

    /// Returns the reason if a built-in or an allocation was refused.
    pub(crate) fn stopped(&self) -> Result<(), Stop> {
        self.stop.get().map_or(Ok(()), Err)
    }

    /// Stops the evaluation because a value does not exist, such as a quantity that was not
    /// recorded.
    pub(crate) fn no_value(&self, text: String) {
        self.missing.get_or_init(|| text);
        self.stop.set(Some(Stop::Value));
    }

    /// Returns which value does not exist.
    pub(crate) fn value_text(&self) -> &str {
        self.missing
            .get()
            .map_or("a value does not exist", String::as_str)
    }

    /// Accounts for memory until it is released.
    pub(crate) fn hold(&self, bytes: usize) -> Result<(), Stop> {
        self.held.set(self.held.get().saturating_add(bytes));
        self.room(0)
    }

    /// Accounts for the end of some memory.
    pub(crate) fn release(&self, bytes: usize) {
        self.held.set(self.held.get().saturating_sub(bytes));
    }

    /// Returns how much memory is left. Unit: bytes.
    pub(crate) fn left(&self) -> usize {
        self.limit.saturating_sub(self.held.get())
    }

    /// Returns an error if the memory budget has fewer bytes left than required.
    pub(crate) fn room(&self, bytes: usize) -> Result<(), Stop> {
        if self.held.get().saturating_add(bytes) <= self.limit {
            return Ok(());
        }
        self.stop.set(Some(Stop::Bytes));
        Err(Stop::Bytes)
    }

    /// Begins an expression: the texts of the previous one are dropped or held.
    pub(crate) fn begin(&self) {
        self.made.set(0);
    }

    /// Accounts for the text that a built-in will create. Returns `None` if the time or memory
    /// budget is spent.
    pub(crate) fn make(&self, bytes: usize) -> Option<()> {
        self.made.set(self.made.get().saturating_add(bytes));
        self.room(self.made.get()).ok()?;
        self.work(bytes)
    }

    /// Accounts for the text that a built-in processes. Returns `None` if the time budget is spent.
    pub(crate) fn work(&self, bytes: usize) -> Option<()> {
        self.work.set(self.work.get().saturating_add(bytes));
        if self.work.get() < WORK_PER_CHECK {
            return Some(());
        }
        self.work.set(0);
        self.check().ok()
    }
}
