//! Collects rows in portions, without duplicates and within the memory budget.

use crate::engine::meter::{Stop, Watch};
use crate::engine::relation::{merge_rows, sort_rows};
use crate::model::program::Operand;
use actcheck_base::TermId;

/// Minimum length of a sink before it is emptied. Unit: terms of 4 bytes (1 MiB).
const LEAST_SINK: usize = 1 << 18;

/// Collects the rows that a rule derives, duplicates included.
#[derive(Debug, Default)]
pub(crate) struct Sink {
    /// The operands that form a row.
    pub(crate) operands: Vec<Operand>,
    /// Rows, one after another.
    pub(crate) rows: Vec<TermId>,
    /// Length at which the sink is emptied. Unit: terms.
    pub(crate) limit: usize,
}

impl Sink {
    pub(crate) fn new(operands: Vec<Operand>) -> Self {
        Self {
            operands,
            rows: Vec::new(),
            limit: LEAST_SINK,
        }
    }

    /// Sets the next limit: in proportion to the collected rows, so that merging takes amortised
    /// constant time for a row, and small if memory is short. `collected`: terms.
    pub(crate) fn adapt(&mut self, collected: usize, watch: &Watch) {
        let eighth = watch.left() / 8;
        let most = (eighth / size_of::<TermId>()).max(LEAST_SINK);
        self.limit = (collected / 2).clamp(LEAST_SINK, most);
    }
}

/// Sorted rows without duplicates.
#[derive(Debug)]
pub(crate) struct Distinct {
    width: usize,
    rows: Vec<TermId>,
    /// Memory of one row. Unit: bytes.
    row_bytes: usize,
    /// Number of rows at the beginning.
    known: usize,
}

impl Distinct {
    /// `rows`: sorted, without duplicates, and accounted for. `copies`: how often a row is stored
    /// later.
    pub(crate) fn new(width: usize, rows: Vec<TermId>, copies: usize) -> Self {
        let known = rows.len() / width;
        Self {
            width,
            rows,
            row_bytes: bytes_of_row(width, copies),
            known,
        }
    }

    /// Adds the rows of a sink and empties it.
    pub(crate) fn add(&mut self, sink: &mut Sink, watch: &Watch) -> Result<(), Stop> {
        let before = self.rows.len();
        sort_rows(self.width, &mut sink.rows);
        merge_rows(self.width, &mut self.rows, &sink.rows);
        sink.rows.clear();
        sink.adapt(self.rows.len(), watch);
        watch.hold((self.rows.len() - before) / self.width * self.row_bytes)
    }

    /// Returns the number of rows added.
    pub(crate) fn new_rows(&self) -> usize {
        self.rows.len() / self.width - self.known
    }

    /// Returns the memory of the rows added. Unit: bytes.
    pub(crate) fn new_bytes(&self) -> usize {
        self.new_rows() * self.row_bytes
    }

    /// Returns the rows, sorted.
    pub(crate) fn rows(&self) -> &[TermId] {
        &self.rows
    }

    /// Returns the rows, sorted.
    pub(crate) fn into_rows(self) -> Vec<TermId> {
        self.rows
    }
}

/// Returns the memory of a row that is stored `copies` times, with the copy of a sort or merge.
/// Unit: bytes.
pub(crate) fn bytes_of_row(width: usize, copies: usize) -> usize {
    width * size_of::<TermId>() * (copies + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::budget::Budget;

    #[test]
    fn only_new_rows_are_counted() {
        let watch = Watch::new(&Budget::default());
        // One width with a const generic, and one beyond.
        for width in [2, 17] {
            let row = |first: TermId| std::iter::once(first).chain((1..width as TermId).map(|_| 7));
            let mut distinct = Distinct::new(width, row(5).collect(), 1);
            let mut sink = Sink::new(Vec::new());
            for _ in 0..3 {
                sink.rows.extend([9, 5, 1, 9].into_iter().flat_map(row));
                distinct.add(&mut sink, &watch).expect("there is room");
            }
            assert_eq!(distinct.new_rows(), 2);
            assert_eq!(
                distinct.into_rows(),
                [1, 5, 9].into_iter().flat_map(row).collect::<Vec<_>>()
            );
        }
    }

    #[test]
    fn rows_beyond_the_memory_are_refused() {
        let watch = Watch::new(&Budget {
            bytes: 1000,
            ..Budget::default()
        });
        let mut distinct = Distinct::new(1, Vec::new(), 1);
        let mut sink = Sink::new(Vec::new());
        sink.rows.extend(0..100);
        assert_eq!(distinct.add(&mut sink, &watch), Ok(()));
        sink.rows.extend(50..150);
        assert_eq!(distinct.add(&mut sink, &watch), Err(Stop::Bytes));
        assert_eq!(watch.stopped(), Err(Stop::Bytes));
    }
}
