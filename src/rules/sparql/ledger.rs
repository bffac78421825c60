//! Enforces the budget of a SPARQL evaluation by counting every term that the evaluator copies.
//!
//! The evaluator checks its cancellation token only when it reads statements, not while it builds
//! products, groups and sorted lists. All of these consist of copied terms, however. A copy that
//! exceeds the budget unwinds the stack up to [`Ledger::hold`], as rust-analyzer's database (salsa)
//! unwinds a cancelled query. This is not a panic: no hook runs, and no state of the evaluation is
//! used afterwards.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::engine::budget::Budget;
use crate::watch::{Deadline, Stop};
use actcheck_base::{Term, TextFunction, TextTooLong};

/// Terms copied between two checks of the clock: under 0.1 ms.
const COPIES_PER_CHECK: u32 = 1024;

/// Texts up to this length don't count, because the limit of terms bounds them. Unit: bytes.
const SHORT_TEXT: usize = 64;

/// A text may take this part of the memory: a function call has several.
const TEXT_SHARE: usize = 64;

thread_local! {
    /// Maximum length of a text in the evaluation of this thread. Unit: bytes.
    static LONGEST_TEXT: Cell<usize> = const { Cell::new(usize::MAX) };
    /// How much text `GROUP_CONCAT` may still append in the evaluation of this thread. Unit: bytes.
    static GROUP_TEXT_LEFT: Cell<usize> = const { Cell::new(usize::MAX) };
}

/// The terms and texts that a query holds, and its time limit.
#[derive(Debug)]
pub(crate) struct Ledger {
    deadline: Deadline,
    /// Maximum number of terms held at once.
    limit: usize,
    held: Cell<usize>,
    /// Maximum length of the texts held at once. Unit: bytes.
    most_bytes: usize,
    bytes: Cell<usize>,
    copies: Cell<u32>,
}

impl Ledger {
    /// Starts the clock. A query may hold as many terms at once as rules may derive tuples.
    pub(crate) fn new(budget: &Budget) -> Self {
        Self {
            deadline: Deadline::new(budget),
            limit: budget.tuples,
            held: Cell::new(0),
            most_bytes: budget.bytes,
            bytes: Cell::new(0),
            copies: Cell::new(0),
        }
    }

    /// Runs some work within the budget.
    ///
    /// # Errors
    /// The reason why the work was stopped.
    pub(crate) fn hold<T>(&self, work: impl FnOnce() -> T) -> Result<T, Stop> {
        LONGEST_TEXT.set(self.most_bytes / TEXT_SHARE);
        GROUP_TEXT_LEFT.set(self.most_bytes);
        // After an unwind, no state touched by the work is used.
        catch_unwind(AssertUnwindSafe(work)).map_err(|thrown| match thrown.downcast::<Stop>() {
            Ok(stop) => *stop,
            Err(other) => resume_unwind(other),
        })
    }

    /// Calls a function that makes a text, and unwinds if the text is too long.
    pub(crate) fn text(function: TextFunction, args: &[Term]) -> Option<Term> {
        function(args, LONGEST_TEXT.get())
            .unwrap_or_else(|TextTooLong| resume_unwind(Box::new(Stop::Bytes)))
    }

    /// Counts a text that is appended to another one, with a separator.
    pub(crate) fn append(length: usize) {
        match GROUP_TEXT_LEFT.get().checked_sub(length + 1) {
            Some(left) => GROUP_TEXT_LEFT.set(left),
            None => resume_unwind(Box::new(Stop::Bytes)),
        }
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

/// The length of a text that the query made, counted for as long as the text is held.
#[derive(Debug)]
pub(crate) struct Weight<'a> {
    ledger: &'a Ledger,
    bytes: usize,
}

impl<'a> Weight<'a> {
    /// Counts a text, or unwinds if the budget is exceeded.
    pub(crate) fn new(ledger: &'a Ledger, length: usize) -> Self {
        let bytes = if length > SHORT_TEXT { length } else { 0 };
        if ledger.bytes.get().saturating_add(bytes) > ledger.most_bytes {
            resume_unwind(Box::new(Stop::Bytes));
        }
        ledger.bytes.set(ledger.bytes.get() + bytes);
        Self { ledger, bytes }
    }
}

impl Drop for Weight<'_> {
    fn drop(&mut self) {
        self.ledger
            .bytes
            .set(self.ledger.bytes.get().saturating_sub(self.bytes));
    }
}
