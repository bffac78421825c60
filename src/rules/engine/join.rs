//! Evaluates one variant of a rule: finds all bindings that satisfy its conditions by lookups in sorted rows.

use std::borrow::Cow;

use crate::engine::collect::Sink;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Column, Op, operand_value};
use crate::engine::relation::Batch;
use crate::model::expression::holds;
use crate::model::program::{MAX_ARITY, Operand};
use crate::model::universe::Universe;
use actcheck_base::{Term, TermId};

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
    /// Called when the sink is full.
    pub(crate) flush: &'u mut dyn FnMut(&mut Sink, &Meter) -> Result<(), Stop>,
}

impl Join<'_, '_, '_> {
    /// Runs the steps from `at` on, for every binding that satisfies them.
    pub(crate) fn run(&mut self, at: usize) -> Result<(), Stop> {
        let ops = self.ops;
        match ops.get(at) {
            None => self.emit(),
            Some(Op::Scan { key, columns, once, .. }) => self.scan(at, key, columns, *once),
            Some(Op::Absent { key, .. }) => {
                let (values, length) = self.key(key);
                let width = self.widths[at];
                let found = self.batches[at].iter().any(|rows| {
                    let start = lower_bound(rows, width, &values[..length]);
                    rows.get(start..start + width).is_some_and(|row| row[..length] == values[..length])
                });
                if found { Ok(()) } else { self.run(at + 1) }
            }
            Some(Op::Assign { variable, value }) => {
                let watch = &self.meter.watch;
                watch.begin();
                let Some(term) = value.value(&self.binding, self.universe, watch).map(Cow::into_owned) else {
                    return watch.stopped();
                };
                self.binding[*variable] = self.universe.create(term, watch)?;
                self.run(at + 1)
            }
            Some(Op::Compare { op, left, right }) => {
                let watch = &self.meter.watch;
                watch.begin();
                let left = left.value(&self.binding, self.universe, watch);
                let right = right.value(&self.binding, self.universe, watch);
                let found = left.zip(right).map(|(left, right)| holds(*op, &left, &right));
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
    fn go_on(&mut self, at: usize, holds: Option<bool>) -> Result<(), Stop> {
        match holds {
            Some(true) => self.run(at + 1),
            Some(false) => Ok(()),
            None => self.meter.watch.stopped(),
        }
    }

    fn key(&self, key: &[Operand]) -> ([TermId; MAX_ARITY], usize) {
        let mut values = [0; MAX_ARITY];
        for (slot, operand) in values.iter_mut().zip(key) {
            *slot = operand_value(*operand, &self.binding);
        }
        (values, key.len())
    }

    fn scan(&mut self, at: usize, key: &[Operand], columns: &[(usize, Column)], once: bool) -> Result<(), Stop> {
        let (values, length) = self.key(key);
        let key = &values[..length];
        let width = self.widths[at];
        let batches = self.batches;
        for rows in &batches[at] {
            let start = if length == 0 { 0 } else { lower_bound(rows, width, key) };
            for row in rows[start..].chunks_exact(width) {
                if row[..length] != *key {
                    break;
                }
                self.meter.step()?;
                if self.bind(row, columns) {
                    self.run(at + 1)?;
                    if once {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
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

    fn emit(&mut self) -> Result<(), Stop> {
        for operand in &self.sink.operands {
            self.sink.rows.push(operand_value(*operand, &self.binding));
        }
        if self.sink.rows.len() >= self.sink.limit { (self.flush)(self.sink, self.meter) } else { Ok(()) }
    }
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
