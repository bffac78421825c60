//! Evaluates one variant of a rule: finds all bindings that satisfy its conditions by lookups in
//! sorted rows.

use std::borrow::Cow;

use crate::engine::collect::Sink;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Column, Op, Rival, Scan, operand_value};
use crate::engine::relation::Batch;
use crate::model::expression::holds;
use crate::model::program::{MAX_ARITY, Operand};
use crate::model::universe::Universe;
use actcheck_base::{Term, TermId};

/// Why a join ended before its end.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Halt {
    /// The evaluation must stop.
    Stop(Stop),
    /// The join read more rows than expected: another order may be better.
    Replan,
}

impl From<Stop> for Halt {
    fn from(stop: Stop) -> Self {
        Self::Stop(stop)
    }
}

/// The evaluation of one variant.
pub(crate) struct Join<'a, 'u, 't> {
    pub(crate) ops: &'a [Op],
    /// Sorted rows for each step; empty for steps that read none.
    pub(crate) batches: &'a [Vec<Batch<'a>>],
    /// Number of columns that each step reads.
    pub(crate) widths: &'a [usize],
    pub(crate) binding: Vec<TermId>,
    pub(crate) universe: &'u mut Universe<'t>,
    pub(crate) meter: &'u mut Meter,
    pub(crate) sink: &'u mut Sink,
    /// Number of rows that may be read before the join halts to be planned again.
    pub(crate) rows_left: u64,
    /// Called when the sink is full.
    pub(crate) flush: &'u mut dyn FnMut(&mut Sink, &Meter) -> Result<(), Stop>,
}

/// Number of rows that are read rather than compared with the number of other rows.
const FEW_ROWS: usize = 16;

impl Join<'_, '_, '_> {
    /// Runs the steps from `at` on, for every binding that satisfies them. Returns whether there
    /// was one.
    pub(crate) fn run(&mut self, at: usize) -> Result<bool, Halt> {
        let ops = self.ops;
        match ops.get(at) {
            None => self.emit(),
            Some(Op::Scan(scan)) if !scan.rivals.is_empty() => self.meet(at, scan),
            Some(Op::Scan(scan)) => self.scan(at, scan),
            Some(Op::Absent { key, .. }) => {
                let (values, length) = self.key(key);
                let width = self.widths[at];
                let found = self.batches[at].iter().any(|rows| {
                    let start = lower_bound(rows, width, &values[..length]);
                    rows.get(start..start + width)
                        .is_some_and(|row| row[..length] == values[..length])
                });
                if found { Ok(false) } else { self.run(at + 1) }
            }
            Some(Op::Assign { variable, value }) => {
                let watch = &self.meter.watch;
                watch.begin();
                let Some(term) = value
                    .value(&self.binding, self.universe, watch)
                    .map(Cow::into_owned)
                else {
                    watch.stopped()?;
                    return Ok(false);
                };
                self.binding[*variable] = self.universe.create(term, watch)?;
                self.run(at + 1)
            }
            Some(Op::Equate { variable, value }) => {
                let watch = &self.meter.watch;
                watch.begin();
                let Some(term) = value.value(&self.binding, self.universe, watch) else {
                    watch.stopped()?;
                    return Ok(false);
                };
                match self.universe.id(&term) {
                    Some(id) => {
                        self.binding[*variable] = id;
                        self.run(at + 1)
                    }
                    // No tuple has it.
                    None => Ok(false),
                }
            }
            Some(Op::Compare { op, left, right }) => {
                let watch = &self.meter.watch;
                watch.begin();
                let left = left.value(&self.binding, self.universe, watch);
                let right = right.value(&self.binding, self.universe, watch);
                let found = left
                    .zip(right)
                    .map(|(left, right)| holds(*op, &left, &right));
                self.go_on(at, found)
            }
            Some(Op::Test { value }) => {
                let watch = &self.meter.watch;
                watch.begin();
                let value = value.value(&self.binding, self.universe, watch);
                let found = value.map(|value| *value == Term::Boolean(true));
                self.go_on(at, found)
            }
        }
    }

    /// Runs the next step if a condition holds. `None`: it has no value, or the budget is spent.
    fn go_on(&mut self, at: usize, holds: Option<bool>) -> Result<bool, Halt> {
        match holds {
            Some(true) => self.run(at + 1),
            Some(false) => Ok(false),
            None => {
                self.meter.watch.stopped()?;
                Ok(false)
            }
        }
    }

    fn key(&self, key: &[Operand]) -> ([TermId; MAX_ARITY], usize) {
        let mut values = [0; MAX_ARITY];
        for (slot, operand) in values.iter_mut().zip(key) {
            *slot = operand_value(*operand, &self.binding);
        }
        (values, key.len())
    }

    fn scan(&mut self, at: usize, scan: &Scan) -> Result<bool, Halt> {
        let (values, length) = self.key(&scan.key);
        let key = &values[..length];
        let width = self.widths[at];
        let batches = self.batches;
        let mut any = false;
        for rows in &batches[at] {
            let start = if length == 0 {
                0
            } else {
                lower_bound(rows, width, key)
            };
            let mut settled: &[TermId] = &[];
            for row in rows[start..].chunks_exact(width) {
                if row[..length] != *key {
                    break;
                }
                self.read()?;
                if !settled.is_empty() && row[..settled.len()] == *settled {
                    continue;
                }
                if self.bind(row, &scan.columns) {
                    let found = self.run(at + 1)?;
                    any |= found;
                    if scan.once || (found && scan.exists) {
                        return Ok(found);
                    }
                    if found && scan.settled < width {
                        settled = &row[..scan.settled];
                    }
                }
            }
        }
        Ok(any)
    }

    /// Counts one row read.
    fn read(&mut self) -> Result<(), Halt> {
        self.rows_left = self.rows_left.checked_sub(1).ok_or(Halt::Replan)?;
        Ok(self.meter.step()?)
    }

    /// Like a scan, but if a later check has fewer rows that fit, reads these and looks them up in
    /// the scan's rows.
    fn meet(&mut self, at: usize, scan: &Scan) -> Result<bool, Halt> {
        let (values, length) = self.key(&scan.key);
        let key = &values[..length];
        if !self.has_many(at, key) {
            return self.scan(at, scan);
        }
        let mut fewest = self.matches(at, key, usize::MAX);
        let mut chosen: Option<(&Rival, usize)> = None;
        for rival in &scan.rivals {
            let (values, length) = self.key(&rival.key);
            let count = self.matches(rival.at, &values[..length], fewest);
            if count < fewest {
                (fewest, chosen) = (count, Some((rival, length)));
            }
        }
        let Some((rival, prefix)) = chosen else {
            return self.scan(at, scan);
        };
        let (rival_values, _) = self.key(&rival.key);
        let [(_, Column::Bind(variable))] = scan.columns.as_slice() else {
            return self.scan(at, scan);
        };
        let (batches, width) = (self.batches, self.widths[rival.at]);
        let mut any = false;
        for rows in &batches[rival.at] {
            let start = lower_bound(rows, width, &rival_values[..prefix]);
            let mut last = None;
            for row in rows[start..].chunks_exact(width) {
                if row[..prefix] != rival_values[..prefix] {
                    break;
                }
                self.read()?;
                let value = row[prefix];
                if last.replace(value) == Some(value) {
                    continue;
                }
                let mut wanted = values;
                wanted[length] = value;
                if self.matches(at, &wanted[..=length], 1) == 0 {
                    continue;
                }
                self.binding[*variable] = value;
                let found = self.run(at + 1)?;
                any |= found;
                if found && scan.exists {
                    return Ok(true);
                }
            }
        }
        Ok(any)
    }

    /// Returns whether a batch has more than a few rows that begin with a key.
    fn has_many(&self, at: usize, key: &[TermId]) -> bool {
        let width = self.widths[at];
        self.batches[at].iter().any(|rows| {
            let last = lower_bound(rows, width, key) + FEW_ROWS * width;
            rows.get(last..last + key.len())
                .is_some_and(|row| row == key)
        })
    }

    /// Counts the rows of a step that begin with a key, up to a limit.
    fn matches(&self, at: usize, key: &[TermId], limit: usize) -> usize {
        let width = self.widths[at];
        let mut count = 0;
        for rows in &self.batches[at] {
            count += equal_range(rows, width, key).len() / width;
            if count >= limit {
                break;
            }
        }
        count
    }

    fn bind(&mut self, row: &[TermId], columns: &[(usize, Column)]) -> bool {
        for (offset, column) in columns {
            match column {
                Column::Bind(variable) => self.binding[*variable] = row[*offset],
                Column::Same(variable) if self.binding[*variable] != row[*offset] => return false,
                Column::Same(_) => {}
            }
        }
        true
    }

    fn emit(&mut self) -> Result<bool, Halt> {
        for operand in &self.sink.operands {
            self.sink.rows.push(operand_value(*operand, &self.binding));
        }
        if self.sink.rows.len() >= self.sink.limit {
            (self.flush)(self.sink, self.meter)?;
        }
        Ok(true)
    }
}

/// Returns the place of the rows that begin with a key. Unit: terms, not rows.
pub(crate) fn equal_range(rows: &[TermId], width: usize, key: &[TermId]) -> std::ops::Range<usize> {
    if key.is_empty() {
        return 0..rows.len();
    }
    let start = lower_bound(rows, width, key);
    let equal = |row: usize| {
        let at = start + row * width;
        rows.get(at..at + key.len()).is_some_and(|row| row == key)
    };
    // Doubling steps, because most ranges are short.
    let mut high = 1;
    while equal(high - 1) {
        high *= 2;
    }
    let mut low = high / 2;
    high = (high - 1).min((rows.len() - start) / width);
    while low < high {
        let middle = low.midpoint(high);
        if equal(middle) {
            low = middle + 1
        } else {
            high = middle
        }
    }
    start..start + low * width
}

/// Returns the start of the first row that is not less than a key. Unit: terms, not rows.
fn lower_bound(rows: &[TermId], width: usize, key: &[TermId]) -> usize {
    let (mut low, mut high) = (0, rows.len() / width);
    if let [first] = key {
        while low < high {
            let middle = low.midpoint(high);
            if rows[middle * width] < *first {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        return low * width;
    }
    while low < high {
        let middle = low.midpoint(high);
        if rows[middle * width..middle * width + key.len()] < *key {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low * width
}
