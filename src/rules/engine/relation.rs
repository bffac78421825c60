//! Tuples of one predicate as datafrog relations of any width, in every column order that the rules use.

use std::cell::Ref;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use datafrog::{Iteration, Relation, Variable};

use crate::engine::plan::{Order, Part};
use actcheck_base::TermId;

/// Tuples that no longer change. Rows are stored one after another, sorted by the index's column order.
pub(crate) trait Finished: Send + Sync {
    /// Returns the rows in the order of an index. The index is built on first use.
    fn index(&self, index: usize) -> &[TermId];
}

/// Tuples of a predicate whose rules are still being evaluated.
pub(crate) trait Growing {
    /// Adds rows, which take effect in the next round. Returns their number without duplicates among them.
    fn insert(&self, rows: Vec<TermId>) -> usize;
    /// Begins a round: new tuples added since the last round become recent. Returns `false` if there are none.
    fn changed(&mut self) -> bool;
    /// Returns the number of recent tuples.
    fn recent_len(&self) -> usize;
    /// Returns whether the rows are kept in the order of an index.
    fn has_index(&self, index: usize) -> bool;
    /// Keeps the rows also in the order of an index. `orders`: the column orders of all indexes.
    fn add_index(&mut self, index: usize, orders: &Arc<Vec<Order>>);
    /// Appends the rows of a part in the order of an index, as sorted batches.
    fn batches<'a>(&'a self, part: Part, index: usize, found: &mut Vec<Batch<'a>>);
    /// Converts to finished tuples at the fixpoint.
    fn complete(self: Box<Self>) -> Box<dyn Finished>;
}

/// A sorted run of rows.
pub(crate) enum Batch<'a> {
    /// Rows of finished tuples.
    Plain(&'a [TermId]),
    /// Rows of growing tuples.
    Held(Ref<'a, [TermId]>),
    /// Rows of an index that one evaluation has added.
    Shared(Arc<[TermId]>),
}

impl Deref for Batch<'_> {
    type Target = [TermId];

    fn deref(&self) -> &[TermId] {
        match self {
            Self::Plain(rows) => rows,
            Self::Held(rows) => rows,
            Self::Shared(rows) => rows,
        }
    }
}

struct FinishedOf<const W: usize> {
    orders: Arc<Vec<Order>>,
    indexes: Vec<OnceLock<Relation<[TermId; W]>>>,
}

impl<const W: usize> FinishedOf<W> {
    fn new(relation: Relation<[TermId; W]>, orders: Arc<Vec<Order>>) -> Self {
        let mut indexes: Vec<OnceLock<Relation<[TermId; W]>>> = Vec::with_capacity(orders.len());
        indexes.push(OnceLock::from(relation));
        indexes.resize_with(orders.len(), OnceLock::new);
        Self { orders, indexes }
    }

    fn primary(&self) -> &[[TermId; W]] {
        self.indexes[0].get().map_or(&[], |relation| relation)
    }
}

impl<const W: usize> Finished for FinishedOf<W> {
    fn index(&self, index: usize) -> &[TermId] {
        let relation = self.indexes[index].get_or_init(|| permuted(self.primary(), &self.orders[index]));
        relation.elements.as_flattened()
    }
}

/// One column order of growing tuples: a datafrog variable with its own iteration, so that all orders of a
/// predicate advance from round to round together.
struct Grown<const W: usize> {
    iteration: Iteration,
    variable: Variable<[TermId; W]>,
}

impl<const W: usize> Grown<W> {
    fn new(distinct: bool) -> Self {
        let mut iteration = Iteration::new();
        // A permutation of distinct rows needs no deduplication.
        let variable = if distinct { iteration.variable("") } else { iteration.variable_indistinct("") };
        Self { iteration, variable }
    }
}

struct GrowingOf<const W: usize> {
    orders: Arc<Vec<Order>>,
    indexes: Vec<Option<Grown<W>>>,
    primary: Grown<W>,
}

impl<const W: usize> GrowingOf<W> {
    /// `wanted`: the indexes that the stratum's rules read while the tuples grow.
    fn new(orders: Arc<Vec<Order>>, wanted: &[bool]) -> Self {
        let indexes = wanted.iter().map(|wanted| wanted.then(|| Grown::new(false))).collect();
        Self { orders, indexes, primary: Grown::new(true) }
    }
}

impl<const W: usize> Growing for GrowingOf<W> {
    fn insert(&self, rows: Vec<TermId>) -> usize {
        let relation = relation_of::<W>(rows);
        let count = relation.len();
        self.primary.variable.insert(relation);
        count
    }

    fn changed(&mut self) -> bool {
        let changed = self.primary.iteration.changed();
        for (index, grown) in self.indexes.iter_mut().enumerate().skip(1) {
            if let Some(grown) = grown {
                let recent = self.primary.variable.recent.borrow();
                grown.variable.insert(permuted(&recent, &self.orders[index]));
                grown.iteration.changed();
            }
        }
        changed
    }

    fn recent_len(&self) -> usize {
        self.primary.variable.recent.borrow().len()
    }

    fn has_index(&self, index: usize) -> bool {
        index == 0 || self.indexes.get(index).is_some_and(Option::is_some)
    }

    fn add_index(&mut self, index: usize, orders: &Arc<Vec<Order>>) {
        self.orders = Arc::clone(orders);
        let mut grown = Grown::new(false);
        let order = &orders[index];
        for batch in self.primary.variable.stable.borrow().iter() {
            grown.variable.insert(permuted(batch, order));
        }
        // All rows become recent, then stable.
        grown.iteration.changed();
        grown.variable.insert(permuted(&self.primary.variable.recent.borrow(), order));
        grown.iteration.changed();
        self.indexes.resize_with(self.indexes.len().max(index + 1), || None);
        self.indexes[index] = Some(grown);
    }

    fn batches<'a>(&'a self, part: Part, index: usize, found: &mut Vec<Batch<'a>>) {
        let variable = match self.indexes.get(index) {
            Some(Some(grown)) if index > 0 => &grown.variable,
            _ => &self.primary.variable,
        };
        if part != Part::Recent {
            let stable = variable.stable.borrow();
            for idx in 0..stable.len() {
                found.push(Batch::Held(Ref::map(Ref::clone(&stable), |s| s[idx].elements.as_flattened())));
            }
        }
        if part != Part::Old {
            found.push(Batch::Held(Ref::map(variable.recent.borrow(), |recent| recent.elements.as_flattened())));
        }
    }

    fn complete(self: Box<Self>) -> Box<dyn Finished> {
        let Self { orders, indexes, primary } = *self;
        drop(indexes);
        Box::new(FinishedOf::new(primary.variable.complete(), orders))
    }
}

/// Permutes the columns of rows and sorts the result.
fn permuted<const W: usize>(rows: &[[TermId; W]], order: &[usize]) -> Relation<[TermId; W]> {
    let mut out: Vec<[TermId; W]> = rows.iter().map(|row| std::array::from_fn(|column| row[order[column]])).collect();
    sort(&mut out);
    Relation { elements: out }
}

fn permuted_rows_of<const W: usize>(rows: &[TermId], order: &[usize]) -> Arc<[TermId]> {
    permuted::<W>(rows.as_chunks::<W>().0, order).elements.as_flattened().into()
}

fn relation_of<const W: usize>(rows: Vec<TermId>) -> Relation<[TermId; W]> {
    let mut rows = rows.as_chunks::<W>().0.to_vec();
    sort(&mut rows);
    rows.dedup();
    Relation { elements: rows }
}

/// Sorts rows. Two or three columns are compared as one number, which is much faster than column by column.
fn sort<const W: usize>(rows: &mut [[TermId; W]]) {
    match W {
        2 => rows.sort_unstable_by_key(|row| (u64::from(row[0]) << 32) | u64::from(row[1])),
        3 => rows
            .sort_unstable_by_key(|row| (u128::from(row[0]) << 64) | (u128::from(row[1]) << 32) | u128::from(row[2])),
        _ => rows.sort_unstable(),
    }
}

/// Calls a function with the width of a predicate as a const generic.
macro_rules! with_width {
    ($width:expr, $call:ident ( $($arg:expr),* )) => {
        match $width {
            0 | 1 => $call::<1>($($arg),*),
            2 => $call::<2>($($arg),*),
            3 => $call::<3>($($arg),*),
            4 => $call::<4>($($arg),*),
            5 => $call::<5>($($arg),*),
            6 => $call::<6>($($arg),*),
            7 => $call::<7>($($arg),*),
            8 => $call::<8>($($arg),*),
            9 => $call::<9>($($arg),*),
            10 => $call::<10>($($arg),*),
            11 => $call::<11>($($arg),*),
            12 => $call::<12>($($arg),*),
            13 => $call::<13>($($arg),*),
            14 => $call::<14>($($arg),*),
            15 => $call::<15>($($arg),*),
            _ => $call::<16>($($arg),*),
        }
    };
}

fn boxed_finished<const W: usize>(rows: Vec<TermId>, orders: Arc<Vec<Order>>) -> Box<dyn Finished> {
    Box::new(FinishedOf::<W>::new(relation_of(rows), orders))
}

fn boxed_growing<const W: usize>(orders: Arc<Vec<Order>>, wanted: &[bool]) -> Box<dyn Growing> {
    Box::new(GrowingOf::<W>::new(orders, wanted))
}

/// Creates finished tuples from rows in any order.
pub(crate) fn finished(width: usize, rows: Vec<TermId>, orders: Arc<Vec<Order>>) -> Box<dyn Finished> {
    with_width!(width, boxed_finished(rows, orders))
}

/// Creates an empty set of growing tuples.
pub(crate) fn growing(width: usize, orders: Arc<Vec<Order>>, wanted: &[bool]) -> Box<dyn Growing> {
    with_width!(width, boxed_growing(orders, wanted))
}

/// Permutes the columns of rows and sorts the result.
pub(crate) fn permuted_rows(width: usize, rows: &[TermId], order: &[usize]) -> Arc<[TermId]> {
    with_width!(width, permuted_rows_of(rows, order))
}
