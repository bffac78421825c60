//! Holds a SPARQL evaluation to its budget: every term that the evaluator copies is entered here.
//!
//! The evaluator forms products, groups and sorted lists inside itself and asks nobody whether it may go on; its
//! cancellation is looked at only where statements are read. But whatever it forms is made of copied terms. The copy that
//! finds the budget spent unwinds the stack up to [`Ledger::hold`], as rust-analyzer's database (salsa) unwinds a query
//! that is cancelled. That is no panic: no hook runs, and nothing of the evaluation is looked at afterwards.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::rules::findings::Budget;
use crate::rules::meter::{Stop, Watch};

/// Terms copied between two looks at the clock: under 0.1 ms.
const COPIES_PER_LOOK: u32 = 1024;

/// What a query has in its hands, and how long it may go on.
#[derive(Debug)]
pub(crate) struct Ledger {
    watch: Watch,
    /// Terms that may be held at once.
    limit: usize,
    held: Cell<usize>,
    copies: Cell<u32>,
}

impl Ledger {
    /// Time begins now. A query may hold as many terms at once as rules may derive tuples.
    pub(crate) fn new(budget: &Budget) -> Self {
        Self { watch: Watch::new(budget), limit: budget.tuples, held: Cell::new(0), copies: Cell::new(0) }
    }

    /// Does some work over this ledger's entries, as far as the budget goes.
    ///
    /// # Errors
    /// Why it ended before its end.
    pub(crate) fn hold<T>(&self, work: impl FnOnce() -> T) -> Result<T, Stop> {
        // Nothing that the work has touched is used after it was given up.
        catch_unwind(AssertUnwindSafe(work)).map_err(|thrown| match thrown.downcast::<Stop>() {
            Ok(stop) => *stop,
            Err(other) => resume_unwind(other),
        })
    }

    /// Looks at the clock; gives up where time is over.
    pub(crate) fn look(&self) {
        if let Err(stop) = self.watch.look() {
            resume_unwind(Box::new(stop));
        }
    }
}

/// The entry of one term in the ledger, for as long as the term is held.
#[derive(Debug)]
pub(crate) struct Entry<'a>(&'a Ledger);

impl<'a> Entry<'a> {
    /// Enters a term, or gives the work up.
    pub(crate) fn new(ledger: &'a Ledger) -> Self {
        ledger.copies.set(ledger.copies.get() + 1);
        if ledger.copies.get() >= COPIES_PER_LOOK {
            ledger.copies.set(0);
            ledger.look();
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
