//! Enforces the budget of a SPARQL evaluation by counting every term that the evaluator copies.
//!
//! The evaluator checks its cancellation token only when it reads statements, not while it builds products, groups and
//! sorted lists. All of these consist of copied terms, however. A copy that exceeds the budget unwinds the stack up to
//! [`Ledger::hold`], as rust-analyzer's database (salsa) unwinds a cancelled query. This is not a panic: no hook runs,
//! and no state of the evaluation is used afterwards.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::engine::budget::Budget;
use crate::engine::meter::{Deadline, Stop};

/// Terms copied between two checks of the clock: under 0.1 ms.
const COPIES_PER_CHECK: u32 = 1024;

/// The number of terms that a query holds, and its time limit.
#[derive(Debug)]
pub(crate) struct Ledger {
    deadline: Deadline,
    /// Maximum number of terms held at once.
    limit: usize,
    held: Cell<usize>,
    copies: Cell<u32>,
}

impl Ledger {
    /// Starts the clock. A query may hold as many terms at once as rules may derive tuples.
    pub(crate) fn new(budget: &Budget) -> Self {
        Self { deadline: Deadline::new(budget), limit: budget.tuples, held: Cell::new(0), copies: Cell::new(0) }
    }

    /// Runs some work within the budget.
    ///
    /// # Errors
    /// The reason why the work was stopped.
    pub(crate) fn hold<T>(&self, work: impl FnOnce() -> T) -> Result<T, Stop> {
        // After an unwind, no state touched by the work is used.
        catch_unwind(AssertUnwindSafe(work)).map_err(|thrown| match thrown.downcast::<Stop>() {
            Ok(stop) => *stop,
            Err(other) => resume_unwind(other),
        })
    }

    /// Checks the clock and unwinds if the time is over.
    pub(crate) fn check(&self) {
        if let Err(stop) = self.deadline.check() {
            resume_unwind(Box::new(stop));
        }
    }
}

/// Counts one term in the ledger for as long as the term is held.
#[derive(Debug)]
pub(crate) struct Entry<'a>(&'a Ledger);

impl<'a> Entry<'a> {
    /// Counts a term, or unwinds if the budget is exceeded.
    pub(crate) fn new(ledger: &'a Ledger) -> Self {
        ledger.copies.set(ledger.copies.get() + 1);
        if ledger.copies.get() >= COPIES_PER_CHECK {
            ledger.copies.set(0);
            ledger.check();
        }
        if ledger.held.get() >= ledger.limit {
            resume_unwind(Box::new(Stop::Tuples));
        }
        ledger.held.set(ledger.held.get() + 1);
        Self(ledger)
    }
}

impl Clone for Entry<'_> {
    fn clone(&self) -> Self {
        Self::new(self.0)
    }
}

impl Drop for Entry<'_> {
    fn drop(&mut self) {
        self.0.held.set(self.0.held.get().saturating_sub(1));
    }
}
