//! Orders the atoms of a rule by the numbers of their matches, counted for a sample of bindings.
//!
//! An order is built from its start: a partial order is a set of atoms that have been read, with a sample of the
//! bindings that satisfy them. The cheapest partial order is extended first, so the first complete one is the cheapest.

use std::collections::BTreeSet;

use crate::engine::access::{Access, Own};
use crate::engine::evaluate::Layers;
use crate::engine::join::equal_range;
use crate::engine::lower::literal_variables;
use crate::engine::plan::{Parts, operand_value};
use crate::model::expression::{Variable, holds};
use crate::model::program::{Atom, Literal, Operand, Rule};
use crate::model::universe::Universe;
use actcheck_base::{Term, TermId};

/// Maximum number of atoms that are ordered by samples.
pub(crate) const SAMPLED_ATOMS: usize = 16;
/// Number of bindings in a sample.
const SAMPLE: usize = 256;
/// Number of partial orders of equal length that are extended.
const BREADTH: usize = 24;
/// Cost of looking up a key. Unit: rows read.
const LOOKUP: f64 = 0.25;

/// Where the rows of a rule's atoms come from.
pub(crate) struct Sampler<'s, 'a, 'b> {
    pub(crate) rule: &'s Rule,
    pub(crate) parts: &'s Parts,
    pub(crate) access: &'s mut Access<'a>,
    pub(crate) layers: &'b Layers<'b>,
    pub(crate) own: Option<Own<'b>>,
    pub(crate) universe: &'s Universe<'s>,
    /// The variables that must keep all their values.
    pub(crate) outputs: &'s [bool],
}

/// A sample of the bindings that satisfy some atoms.
#[derive(Debug, Clone)]
struct Partial {
    atoms: Vec<usize>,
    bound: Vec<bool>,
    /// The conditions that are neither atoms nor still to be checked.
    tested: BTreeSet<usize>,
    /// Each with the number of bindings that it stands for.
    sample: Vec<(Vec<TermId>, f64)>,
    /// Estimated number of bindings.
    count: f64,
    /// Estimated number of rows read.
    cost: f64,
}

impl Sampler<'_, '_, '_> {
    /// Returns the order of a group's atoms that reads the fewest rows, and the estimated number of these rows.
    pub(crate) fn order(&mut self, group: &[usize], first: Option<usize>) -> (Vec<usize>, f64) {
        let atoms: Vec<usize> =
            group.iter().copied().filter(|idx| matches!(self.rule.body[*idx], Literal::Positive(_))).collect();
        let nothing = vec![0; self.rule.variables.len()];
        let mut open = vec![Partial {
            atoms: Vec::new(),
            bound: vec![false; self.rule.variables.len()],
            tested: BTreeSet::new(),
            sample: vec![(nothing, 1.0)],
            count: 1.0,
            cost: 0.0,
        }];
        let mut closed: BTreeSet<Vec<usize>> = BTreeSet::new();
        let mut extended = vec![0; atoms.len() + 1];
        while let Some(place) = cheapest(&open) {
            let partial = open.swap_remove(place);
            if partial.atoms.len() == atoms.len() {
                return (partial.atoms, partial.cost);
            }
            let mut set = partial.atoms.clone();
            set.sort_unstable();
            let length = set.len();
            if extended[length] == BREADTH || !closed.insert(set) {
                continue;
            }
            extended[length] += 1;
            let next = first.filter(|_| length == 0);
            for atom in atoms.iter().filter(|idx| !partial.atoms.contains(idx)) {
                if next.is_none_or(|first| first == *atom) {
                    open.push(self.extended(&partial, *atom, group));
                }
            }
        }
        (atoms, f64::INFINITY)
    }

    fn extended(&mut self, partial: &Partial, idx: usize, group: &[usize]) -> Partial {
        let mut next = partial.clone();
        next.atoms.push(idx);
        let Literal::Positive(atom) = &self.rule.body[idx] else { return next };
        let fixed: Vec<usize> =
            (0..atom.args.len()).filter(|column| is_fixed(atom.args[*column], &next.bound)).collect();
        for arg in &atom.args {
            if let Operand::Variable(variable) = arg {
                next.bound[*variable] = true;
            }
        }
        let one_match = !self.reads_new(partial, &next, group);
        let rows_read = match self.matches(partial, idx, atom, &fixed, one_match) {
            Some((rows_read, sample)) => {
                next.count = sample.iter().map(|(_, weight)| weight).sum();
                next.sample = thinned(sample);
                rows_read
            }
            None => {
                let rows_read = self.expected(partial, idx, atom, &fixed);
                next.count = if one_match { rows_read.min(partial.count) } else { rows_read };
                next.sample.clear();
                rows_read
            }
        };
        next.cost += rows_read + partial.count * LOOKUP;
        let outputs_known = self.outputs.iter().zip(&partial.bound).all(|(output, bound)| *bound || !output);
        if outputs_known && next.count > partial.count {
            // One match is enough, so later atoms are looked up once for each.
            let share = partial.count / next.count;
            next.sample.iter_mut().for_each(|(_, weight)| *weight *= share);
            next.count = partial.count;
        }
        if !next.sample.is_empty() {
            self.test(&mut next, group);
        }
        if next.sample.is_empty() && !partial.sample.is_empty() {
            // No binding of the sample has a match, but others may have.
            next.count = rows_read.max(partial.count).min(next.count.max(partial.count)) / (2 * SAMPLE) as f64;
        }
        next
    }

    /// Returns whether a later condition, or the head, reads a variable that an atom has bound.
    fn reads_new(&self, before: &Partial, after: &Partial, group: &[usize]) -> bool {
        let new: Vec<Variable> = (0..after.bound.len()).filter(|v| after.bound[*v] && !before.bound[*v]).collect();
        let later = group.iter().filter(|idx| !after.atoms.contains(idx) && !after.tested.contains(idx));
        let read: Vec<Variable> = later.flat_map(|idx| literal_variables(&self.rule.body[*idx])).collect();
        new.iter().any(|v| self.outputs.get(*v).copied().unwrap_or(false) || read.contains(v))
    }

    /// Looks up an atom for each binding of a sample. Returns the number of rows read and the extended bindings, or
    /// `None` if there is no index for it.
    fn matches(
        &mut self,
        partial: &Partial,
        idx: usize,
        atom: &Atom,
        fixed: &[usize],
        one_match: bool,
    ) -> Option<(f64, Vec<(Vec<TermId>, f64)>)> {
        if partial.sample.is_empty() {
            return None;
        }
        let index = self.access.index_at_hand(atom.predicate, fixed, self.layers, self.own)?;
        let batches = self.access.batches(atom.predicate, self.parts.of(idx), index, self.layers, self.own);
        let order = &self.access.indexes.of(atom.predicate)[index];
        let width = order.len();
        let most = (4 * SAMPLE).div_ceil(partial.sample.len());
        let (mut rows_read, mut found) = (0.0, Vec::new());
        for (binding, weight) in &partial.sample {
            let key: Vec<TermId> =
                order[..fixed.len()].iter().map(|column| operand_value(atom.args[*column], binding)).collect();
            let ranges: Vec<&[TermId]> = batches.iter().map(|rows| &rows[equal_range(rows, width, &key)]).collect();
            let count = ranges.iter().map(|rows| rows.len() / width).sum::<usize>();
            let taken = if one_match { count.min(1) } else { count.min(most) };
            rows_read += weight * if one_match { count.min(1) } else { count } as f64;
            for place in 0..taken {
                let mut at = (place * count + count / 2) / taken;
                let row = ranges.iter().find_map(|rows| {
                    let row = rows.get(at * width..(at + 1) * width);
                    at = at.saturating_sub(rows.len() / width);
                    row
                });
                let mut binding = binding.clone();
                if row.is_some_and(|row| bind(atom, order, fixed.len(), row, &partial.bound, &mut binding)) {
                    let share = if one_match { 1.0 } else { count as f64 / taken as f64 };
                    found.push((binding, weight * share));
                }
            }
        }
        Some((rows_read, found))
    }

    /// Returns the expected number of rows read, if values were spread evenly.
    fn expected(&mut self, partial: &Partial, idx: usize, atom: &Atom, fixed: &[usize]) -> f64 {
        let batches = self.access.batches(atom.predicate, self.parts.of(idx), 0, self.layers, self.own);
        let rows: usize = batches.iter().map(|rows| rows.len()).sum();
        let mut each = rows as f64 / self.access.predicates.get(atom.predicate).width as f64;
        for column in fixed {
            each /= self.access.distinct(atom.predicate, *column, self.layers, self.own);
        }
        partial.count * each
    }

    /// Checks the comparisons whose variables are bound by now.
    fn test(&self, partial: &mut Partial, group: &[usize]) {
        for idx in group {
            let literal = &self.rule.body[*idx];
            if partial.tested.contains(idx) || !literal.needs().iter().all(|v| partial.bound[*v]) {
                continue;
            }
            match literal {
                Literal::Compare { op, left, right, .. } => partial.sample.retain(|(binding, _)| {
                    match (left.value(binding, self.universe), right.value(binding, self.universe)) {
                        (Some(left), Some(right)) => holds(*op, &left, &right),
                        _ => false,
                    }
                }),
                Literal::Test { value, .. } => partial.sample.retain(|(binding, _)| {
                    value.value(binding, self.universe).is_some_and(|value| *value == Term::Boolean(true))
                }),
                // Assigned variables occur in no atom, and the share of absent tuples is left open.
                _ => continue,
            }
            partial.tested.insert(*idx);
        }
        partial.count = partial.sample.iter().map(|(_, weight)| weight).sum();
    }
}

fn cheapest(open: &[Partial]) -> Option<usize> {
    (0..open.len()).min_by(|a, b| open[*a].cost.total_cmp(&open[*b].cost).then(open[*a].atoms.cmp(&open[*b].atoms)))
}

fn is_fixed(arg: Operand, bound: &[bool]) -> bool {
    match arg {
        Operand::Constant(_) => true,
        Operand::Variable(variable) => bound[variable],
        Operand::Any => false,
    }
}

/// Binds the variables of an atom to a row. Returns `false` if one of them occurs twice with different values.
fn bind(atom: &Atom, order: &[usize], from: usize, row: &[TermId], known: &[bool], binding: &mut [TermId]) -> bool {
    let mut new: Vec<Variable> = Vec::new();
    for (offset, column) in order.iter().enumerate().skip(from) {
        let Operand::Variable(variable) = atom.args[*column] else { continue };
        if known[variable] || new.contains(&variable) {
            if binding[variable] != row[offset] {
                return false;
            }
        } else {
            binding[variable] = row[offset];
            new.push(variable);
        }
    }
    true
}

/// Reduces a sample to its size: every binding is kept as often as its weight demands.
fn thinned(sample: Vec<(Vec<TermId>, f64)>) -> Vec<(Vec<TermId>, f64)> {
    if sample.len() <= SAMPLE {
        return sample;
    }
    let step = sample.iter().map(|(_, weight)| weight).sum::<f64>() / SAMPLE as f64;
    let (mut kept, mut sum, mut next) = (Vec::with_capacity(SAMPLE), 0.0, step / 2.0);
    for (binding, weight) in sample {
        sum += weight;
        while next < sum && kept.len() < SAMPLE {
            kept.push((binding.clone(), step));
            next += step;
        }
    }
    kept
}
