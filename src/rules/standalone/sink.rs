//! Where imports put their rows, within the limits of time and memory.

use crate::standalone::input::Limits;
use actcheck_base::{TermId, Terms};

/// Rows between two checks of the limits.
const ROWS_PER_CHECK: u32 = 4096;

/// The rows of one predicate.
pub(super) struct ImportSink<'a> {
    pub(super) terms: &'a mut Terms,
    pub(super) rows: &'a mut Vec<TermId>,
    pub(super) limits: &'a Limits<'a>,
    /// Memory of the other predicates' facts. Unit: bytes.
    pub(super) other_bytes: usize,
    /// Rows since the last check.
    pub(super) unchecked: u32,
}

impl ImportSink<'_> {
    /// Adds the row that `intern` appends to its argument. If `intern` returns `false`, there is
    /// none.
    ///
    /// # Errors
    /// A limit was reached.
    pub(super) fn row(
        &mut self,
        intern: impl FnOnce(&mut Terms, &mut Vec<TermId>) -> bool,
    ) -> std::io::Result<()> {
        let before = self.rows.len();
        if !intern(self.terms, self.rows) {
            self.rows.truncate(before);
        }
        self.limits.settle();
        self.unchecked += 1;
        if self.unchecked < ROWS_PER_CHECK {
            Ok(())
        } else {
            self.check()
        }
    }

    /// Checks the limits.
    ///
    /// # Errors
    /// A limit was reached.
    pub(super) fn check(&mut self) -> std::io::Result<()> {
        self.unchecked = 0;
        self.limits.settle();
        self.limits.check_with(
            self.other_bytes + self.terms.bytes() + self.rows.len() * size_of::<TermId>(),
        )
    }
}
