//! Tuples of one predicate as datafrog relations of any width, in every column order that the rules
//! use.

use std::cell::{Ref, RefCell};
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use datafrog::{Iteration, Relation, Variable};

use crate::engine::plan::{Order, Part};
use crate::model::program::MAX_ARITY;
use actcheck_base::TermId;

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

/// Tuples that no longer change. Rows are stored one after another, sorted by the index's column
/// order.
pub(crate) trait Finished: Send + Sync {
    /// Returns the rows in the order of an index. The index is built on first use.
    fn index(&self, index: usize) -> &[TermId];
    /// Returns the rows in the order of the first index.
    fn into_rows(self: Box<Self>) -> Vec<TermId>;
}

/// Tuples of a predicate whose rules are still being evaluated.
pub(crate) trait Growing {
    /// Adds rows, which take effect in the next round. Returns the number of new ones.
    fn insert(&self, rows: &mut Vec<TermId>) -> usize;
    /// Returns the length of the rows added in this round. Unit: terms.
    fn added(&self) -> usize;
    /// Begins a round: new tuples added since the last round become recent. Returns `false` if
    /// there are none.
    fn changed(&mut self) -> bool;
    /// Returns whether the rows are kept in the order of an index.
    fn has_index(&self, index: usize) -> bool;
    /// Keeps the rows also in the order of an index. `orders`: the column orders of all indexes.
    /// Returns the number of rows.
    fn add_index(&mut self, index: usize, orders: &Arc<Vec<Order>>) -> usize;
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
        let relation =
            self.indexes[index].get_or_init(|| permuted(self.primary(), &self.orders[index]));
        relation.elements.as_flattened()
    }

    fn into_rows(self: Box<Self>) -> Vec<TermId> {
        let first = self
            .indexes
            .into_iter()
            .next()
            .and_then(OnceLock::into_inner);
        first.map_or(Vec::new(), |relation| relation.elements.into_flattened())
    }
}

/// One column order of growing tuples: a datafrog variable with its own iteration, so that all
/// orders of a predicate advance from round to round together.
struct GrowingOrder<const W: usize> {
    iteration: Iteration,
    variable: Variable<[TermId; W]>,
}

impl<const W: usize> GrowingOrder<W> {
    fn new() -> Self {
        let mut iteration = Iteration::new();
        // Only new rows are inserted, so that no duplicates have to be removed.
        let variable = iteration.variable_indistinct("");
        Self {
            iteration,
            variable,
        }
    }
}

struct GrowingOf<const W: usize> {
    orders: Arc<Vec<Order>>,
    indexes: Vec<Option<GrowingOrder<W>>>,
    primary: GrowingOrder<W>,
    /// New rows of this round, sorted.
    added: RefCell<Vec<TermId>>,
}

impl<const W: usize> GrowingOf<W> {
    /// `wanted`: the indexes that the stratum's rules read while the tuples grow.
    fn new(orders: Arc<Vec<Order>>, wanted: &[bool]) -> Self {
        let indexes = wanted
            .iter()
            .map(|wanted| wanted.then(GrowingOrder::new))
            .collect();
        Self {
            orders,
            indexes,
            primary: GrowingOrder::new(),
            added: RefCell::default(),
        }
    }
}

impl<const W: usize> Growing for GrowingOf<W> {
    fn insert(&self, rows: &mut Vec<TermId>) -> usize {
        sort_rows(W, rows);
        for batch in self.primary.variable.stable.borrow().iter() {
            remove_known::<W>(rows, batch);
        }
        remove_known::<W>(rows, &self.primary.variable.recent.borrow());
        let mut added = self.added.borrow_mut();
        let before = added.len();
        merge_rows(W, &mut added, rows);
        rows.clear();
        (added.len() - before) / W
    }

    fn added(&self) -> usize {
        self.added.borrow().len()
    }

    fn changed(&mut self) -> bool {
        let added = self.added.take();
        if !added.is_empty() {
            self.primary.variable.insert(Relation {
                elements: added.as_chunks::<W>().0.to_vec(),
            });
        }
        drop(added);
        let changed = self.primary.iteration.changed();
        for (index, grown) in self.indexes.iter_mut().enumerate().skip(1) {
            if let Some(grown) = grown {
                let recent = self.primary.variable.recent.borrow();
                grown
                    .variable
                    .insert(permuted(&recent, &self.orders[index]));
                grown.iteration.changed();
            }
        }
        changed
    }

    fn has_index(&self, index: usize) -> bool {
        index == 0 || self.indexes.get(index).is_some_and(Option::is_some)
    }

    fn add_index(&mut self, index: usize, orders: &Arc<Vec<Order>>) -> usize {
        self.orders = Arc::clone(orders);
        let mut grown = GrowingOrder::new();
        let order = &orders[index];
        let mut count = 0;
        for batch in self.primary.variable.stable.borrow().iter() {
            count += batch.len();
            grown.variable.insert(permuted(batch, order));
        }
        // All rows become recent, then stable.
        grown.iteration.changed();
        let recent = self.primary.variable.recent.borrow();
        grown.variable.insert(permuted(&recent, order));
        grown.iteration.changed();
        self.indexes
            .resize_with(self.indexes.len().max(index + 1), || None);
        self.indexes[index] = Some(grown);
        count + recent.len()
    }

    fn batches<'a>(&'a self, part: Part, index: usize, found: &mut Vec<Batch<'a>>) {
        let variable = match self.indexes.get(index) {
            Some(Some(grown)) if index > 0 => &grown.variable,
            _ => &self.primary.variable,
        };
        if part != Part::Recent {
            let stable = variable.stable.borrow();
            for idx in 0..stable.len() {
                found.push(Batch::Held(Ref::map(Ref::clone(&stable), |s| {
                    s[idx].elements.as_flattened()
                })));
            }
        }
        if part != Part::Old {
            found.push(Batch::Held(Ref::map(variable.recent.borrow(), |recent| {
                recent.elements.as_flattened()
            })));
        }
    }

    fn complete(self: Box<Self>) -> Box<dyn Finished> {
        let Self {
            orders,
            indexes,
            primary,
            added,
        } = *self;
        drop((indexes, added));
        Box::new(FinishedOf::new(primary.variable.complete(), orders))
    }
}

/// Permutes the columns of rows and sorts the result.
fn permuted<const W: usize>(rows: &[[TermId; W]], order: &[usize]) -> Relation<[TermId; W]> {
    let mut out: Vec<[TermId; W]> = rows
        .iter()
        .map(|row| std::array::from_fn(|column| row[order[column]]))
        .collect();
    sort(&mut out);
    Relation { elements: out }
}

/// Sorts rows and removes duplicates.
pub(crate) fn sort_rows(width: usize, rows: &mut Vec<TermId>) {
    if width > MAX_ARITY {
        let mut list: Vec<&[TermId]> = rows.chunks_exact(width).collect();
        list.sort_unstable();
        list.dedup();
        *rows = list.concat();
    } else {
        with_width!(width, sort_in_place(rows));
    }
}

fn sort_in_place<const W: usize>(rows: &mut Vec<TermId>) {
    let list = rows.as_chunks_mut::<W>().0;
    sort(list);
    let mut kept = 0;
    for idx in 0..list.len() {
        if kept == 0 || list[kept - 1] != list[idx] {
            list[kept] = list[idx];
            kept += 1;
        }
    }
    rows.truncate(kept * W);
}

/// Adds sorted rows without duplicates to others of the same kind.
pub(crate) fn merge_rows(width: usize, rows: &mut Vec<TermId>, more: &[TermId]) {
    if more.is_empty() {
        return;
    }
    if rows.is_empty() || rows[rows.len() - width..] < more[..width] {
        rows.extend_from_slice(more);
        return;
    }
    if width > MAX_ARITY {
        rows.extend_from_slice(more);
        return sort_rows(width, rows);
    }
    *rows = with_width!(width, merged(rows, more));
}

fn merged<const W: usize>(rows: &[TermId], more: &[TermId]) -> Vec<TermId> {
    let mut merged = Vec::with_capacity(rows.len() + more.len());
    let (mut left, mut right) = (rows.as_chunks::<W>().0, more.as_chunks::<W>().0);
    while let ([first, others @ ..], [second, rest @ ..]) = (left, right) {
        let order = first.cmp(second);
        merged.extend_from_slice(if order.is_gt() { second } else { first });
        left = if order.is_gt() { left } else { others };
        right = if order.is_lt() { right } else { rest };
    }
    merged.extend_from_slice(left.as_flattened());
    merged.extend_from_slice(right.as_flattened());
    merged
}

/// Removes the sorted rows that are among sorted known ones.
fn remove_known<const W: usize>(rows: &mut Vec<TermId>, known: &[[TermId; W]]) {
    let (mut rest, mut kept) = (known, 0);
    for start in (0..rows.len()).step_by(W) {
        let Ok(row) = <[TermId; W]>::try_from(&rows[start..start + W]) else {
            break;
        };
        rest = skip_less(rest, &row);
        if rest.first() != Some(&row) {
            rows.copy_within(start..start + W, kept);
            kept += W;
        }
    }
    rows.truncate(kept);
}

/// Skips the sorted rows that are less than a given one, by steps of doubling length and then by
/// halves.
fn skip_less<'r, const W: usize>(
    mut rows: &'r [[TermId; W]],
    row: &[TermId; W],
) -> &'r [[TermId; W]] {
    if rows.first().is_none_or(|first| first >= row) {
        return rows;
    }
    let mut step = 1;
    while step < rows.len() && rows[step] < *row {
        rows = &rows[step..];
        step *= 2;
    }
    let within = &rows[..rows.len().min(step + 1)];
    &rows[within.partition_point(|other| other < row)..]
}

fn permuted_rows_of<const W: usize>(rows: &[TermId], order: &[usize]) -> Arc<[TermId]> {
    permuted::<W>(rows.as_chunks::<W>().0, order)
        .elements
        .as_flattened()
        .into()
}

fn relation_of<const W: usize>(rows: &[TermId]) -> Relation<[TermId; W]> {
    let mut rows = rows.as_chunks::<W>().0.to_vec();
    sort(&mut rows);
    rows.dedup();
    Relation { elements: rows }
}

/// Sorts rows. Two or three columns are compared as one number, which is much faster than column by
/// column.
fn sort<const W: usize>(rows: &mut [[TermId; W]]) {
    match W {
        2 => rows.sort_unstable_by_key(|row| (u64::from(row[0]) << 32) | u64::from(row[1])),
        3 => rows.sort_unstable_by_key(|row| {
            (u128::from(row[0]) << 64) | (u128::from(row[1]) << 32) | u128::from(row[2])
        }),
        _ => rows.sort_unstable(),
    }
}

fn boxed_finished<const W: usize>(rows: &[TermId], orders: Arc<Vec<Order>>) -> Box<dyn Finished> {
    Box::new(FinishedOf::<W>::new(relation_of(rows), orders))
}

fn boxed_growing<const W: usize>(orders: Arc<Vec<Order>>, wanted: &[bool]) -> Box<dyn Growing> {
    Box::new(GrowingOf::<W>::new(orders, wanted))
}

/// Creates finished tuples from rows in any order.
pub(crate) fn finished(
    width: usize,
    rows: &[TermId],
    orders: Arc<Vec<Order>>,
) -> Box<dyn Finished> {
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
