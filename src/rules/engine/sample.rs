//! Orders the atoms of a rule by the numbers of their matches, counted for a sample of bindings.
//!
//! An order is built from its start: a partial order is a set of atoms that have been read, with a
//! sample of the bindings that satisfy them. The cheapest partial order is extended first, so the
//! first complete one is the cheapest.

use std::collections::BTreeSet;

use crate::engine::access::{Access, Own};
use crate::engine::equal::{given, is_assigned, meeting, settle};
use crate::engine::evaluate::Layers;
use crate::engine::join::equal_range;
use crate::engine::lower::literal_variables;
use crate::engine::plan::{Parts, operand_value};
use crate::model::expression::{Variable, holds};
use crate::model::program::{Atom, Literal, Operand, Rule};
use crate::model::universe::Universe;
use crate::watch::Watch;
use actcheck_base::{Term, TermId};

/// Maximum number of atoms that are ordered by samples.
pub(crate) const SAMPLED_ATOMS: usize = 16;
/// Number of bindings in a sample.
const SAMPLE: usize = 256;
/// Number of bindings for which the search for one match is followed.
const ORIGINS: usize = 32;
/// Number of partial orders of equal length that are extended.
const BREADTH: usize = 24;
/// Number of rows for one key above which they are also looked up by a computed value.
const MANY_ROWS: f64 = 16.0;
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
    /// Bounds the tests of bindings.
    pub(crate) watch: &'s Watch,
    /// The variables that must keep all their values.
    pub(crate) outputs: &'s [bool],
}

/// One binding of a sample.
#[derive(Debug, Clone)]
struct Drawn {
    binding: Vec<TermId>,
    /// Number of bindings that it represents.
    weight: f64,
    /// The binding of the search that it belongs to, by its place in [`MatchSearch::origins`].
    origin: usize,
}

/// The atoms after those that bind the head's variables: the evaluation searches one match of them
/// for each binding.
#[derive(Debug, Clone, Default)]
struct MatchSearch {
    /// Cost of the atoms before. Unit: rows read.
    before: f64,
    /// For each binding before, the number of bindings that it represents, and the cost to find all
    /// its matches.
    origins: Vec<(f64, f64)>,
}

impl MatchSearch {
    /// Begins a search for each binding of a sample, which is reduced.
    fn begin(partial: &mut Partial) -> Self {
        partial.sample = thinned(std::mem::take(&mut partial.sample), ORIGINS);
        partial
            .sample
            .iter_mut()
            .enumerate()
            .for_each(|(place, drawn)| drawn.origin = place);
        Self {
            before: partial.cost,
            origins: partial
                .sample
                .iter()
                .map(|drawn| (drawn.weight, 0.0))
                .collect(),
        }
    }

    /// Returns the expected number of rows read until each search has found a match or has failed.
    fn cost(&self, sample: &[Drawn]) -> f64 {
        let mut matches = vec![0.0; self.origins.len()];
        sample
            .iter()
            .for_each(|drawn| matches[drawn.origin] += drawn.weight);
        let costs = self
            .origins
            .iter()
            .zip(matches)
            .map(|((weight, all), matches)| all / (1.0 + matches / weight));
        self.before + costs.sum::<f64>()
    }
}

/// A sample of the bindings that satisfy some atoms.
#[derive(Debug, Clone)]
struct Partial {
    atoms: Vec<usize>,
    bound: Vec<bool>,
    /// The conditions that are neither atoms nor still to be checked.
    tested: BTreeSet<usize>,
    sample: Vec<Drawn>,
    /// The atoms that are looked up by a computed value.
    keyed: BTreeSet<usize>,
    /// The search for one match, if it has begun.
    search: Option<MatchSearch>,
    /// Estimated number of bindings.
    count: f64,
    /// Estimated number of rows read.
    cost: f64,
}

impl Sampler<'_, '_, '_> {
    /// Returns the order of a group's atoms that reads the fewest rows, the estimated number of
    /// these rows, and the atoms that have many rows for each key, so that a computed value should
    /// be part of it.
    pub(crate) fn order(
        &mut self,
        group: &[usize],
        first: Option<usize>,
    ) -> (Vec<usize>, f64, BTreeSet<usize>) {
        let atoms: Vec<usize> = group
            .iter()
            .copied()
            .filter(|idx| matches!(self.rule.body[*idx], Literal::Positive(_)))
            .collect();
        let nothing = vec![0; self.rule.variables.len()];
        let mut start = Partial {
            atoms: Vec::new(),
            bound: vec![false; self.rule.variables.len()],
            tested: BTreeSet::new(),
            sample: vec![Drawn {
                binding: nothing,
                weight: 1.0,
                origin: 0,
            }],
            keyed: BTreeSet::new(),
            search: None,
            count: 1.0,
            cost: 0.0,
        };
        self.settle(&mut start, group);
        let mut open = vec![start];
        let mut closed: BTreeSet<Vec<usize>> = BTreeSet::new();
        let mut extended = vec![0; atoms.len() + 1];
        while let Some(place) = cheapest(&open) {
            let partial = open.swap_remove(place);
            if partial.atoms.len() == atoms.len() {
                return (partial.atoms, partial.cost, partial.keyed);
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
        (atoms, f64::INFINITY, BTreeSet::new())
    }

    fn extended(&mut self, partial: &Partial, idx: usize, group: &[usize]) -> Partial {
        let mut next = partial.clone();
        next.atoms.push(idx);
        let Literal::Positive(atom) = &self.rule.body[idx] else {
            return next;
        };
        let fixed: Vec<usize> = (0..atom.args.len())
            .filter(|column| is_fixed(atom.args[*column], &next.bound))
            .collect();
        for arg in &atom.args {
            if let Operand::Variable(variable) = arg {
                next.bound[*variable] = true;
            }
        }
        let open = group
            .iter()
            .copied()
            .filter(|idx| !partial.tested.contains(idx));
        // With the assigned variables, which have no values in a sample.
        let mut known = partial.bound.clone();
        settle(self.rule, group, &mut known);
        let meets = !partial.atoms.is_empty() && meeting(self.rule, open, atom, &known).is_some();
        let one_match = !self.reads_new(partial, &next, group);
        if next.search.is_none()
            && !partial.sample.is_empty()
            && self.outputs_are_bound(partial, group)
        {
            next.search = Some(MatchSearch::begin(&mut next));
        }
        let mut search = next.search.take();
        let mut count = |drawn: &Drawn, rows_read: f64| {
            if let Some(search) = &mut search {
                let rows_read = if meets { rows_read.min(1.0) } else { rows_read };
                search.origins[drawn.origin].1 += drawn.weight * (rows_read + LOOKUP);
            }
        };
        let mut rows_read = match self.matches(
            &next,
            &partial.bound,
            idx,
            atom,
            &fixed,
            one_match,
            &mut count,
        ) {
            Some((rows_read, sample)) => {
                next.count = sample.iter().map(|drawn| drawn.weight).sum();
                next.sample = thinned(sample, SAMPLE);
                rows_read
            }
            None => {
                let rows_read = self.expected(partial, idx, atom, &fixed);
                next.count = if one_match {
                    rows_read.min(partial.count)
                } else {
                    rows_read
                };
                next.sample.clear();
                rows_read
            }
        };
        if !next.sample.is_empty() {
            self.test(&mut next, group);
        }
        self.settle(&mut next, group);
        let is_free = fixed
            .iter()
            .all(|column| matches!(atom.args[*column], Operand::Constant(_)));
        if meets && (is_free || rows_read > partial.count * MANY_ROWS) {
            next.keyed.insert(idx);
            rows_read = rows_read.min(next.count);
        }
        next.cost = match &search {
            Some(search) if !partial.sample.is_empty() => {
                search.cost(&next.sample).max(partial.cost)
            }
            _ => partial.cost + rows_read + partial.count * LOOKUP,
        };
        next.search = search;
        if next.sample.is_empty() && !partial.sample.is_empty() {
            // No binding of the sample has a match, but others may have.
            next.count = rows_read
                .max(partial.count)
                .min(next.count.max(partial.count))
                / (2 * SAMPLE) as f64;
        }
        next
    }

    /// Returns whether all variables of a group that the head reads are bound.
    fn outputs_are_bound(&self, partial: &Partial, group: &[usize]) -> bool {
        let mut read = group
            .iter()
            .flat_map(|idx| literal_variables(&self.rule.body[*idx]));
        read.all(|variable| {
            partial.bound[variable] || !self.outputs.get(variable).copied().unwrap_or(false)
        })
    }

    /// Returns whether a later condition, or the head, reads a variable that an atom has bound.
    fn reads_new(&self, before: &Partial, after: &Partial, group: &[usize]) -> bool {
        let new: Vec<Variable> = (0..after.bound.len())
            .filter(|v| after.bound[*v] && !before.bound[*v])
            .collect();
        let later = group
            .iter()
            .filter(|idx| !after.atoms.contains(idx) && !after.tested.contains(idx));
        let read: Vec<Variable> = later
            .flat_map(|idx| literal_variables(&self.rule.body[*idx]))
            .collect();
        new.iter()
            .any(|v| self.outputs.get(*v).copied().unwrap_or(false) || read.contains(v))
    }

    /// Looks up an atom for each binding of a sample. Returns the number of rows read and the
    /// extended bindings; `None` without an index for the lookup. `known`: the variables bound
    /// before. `count_rows` gets the rows read for each binding.
    #[expect(clippy::too_many_arguments, reason = "the parts of one look-up")]
    fn matches(
        &mut self,
        partial: &Partial,
        known: &[bool],
        idx: usize,
        atom: &Atom,
        fixed: &[usize],
        one_match: bool,
        count_rows: &mut dyn FnMut(&Drawn, f64),
    ) -> Option<(f64, Vec<Drawn>)> {
        if partial.sample.is_empty() {
            return None;
        }
        let index = self
            .access
            .index_at_hand(atom.predicate, fixed, self.layers, self.own)?;
        let batches = self.access.batches(
            atom.predicate,
            self.parts.of(idx),
            index,
            self.layers,
            self.own,
        );
        let order = &self.access.indexes.of(atom.predicate)[index];
        let width = order.len();
        let most = (4 * SAMPLE).div_ceil(partial.sample.len());
        let (mut rows_read, mut found) = (0.0, Vec::new());
        for drawn in &partial.sample {
            let Drawn {
                binding,
                weight,
                origin,
            } = drawn;
            let key: Vec<TermId> = order[..fixed.len()]
                .iter()
                .map(|column| operand_value(atom.args[*column], binding))
                .collect();
            let ranges: Vec<&[TermId]> = batches
                .iter()
                .map(|rows| &rows[equal_range(rows, width, &key)])
                .collect();
            let count = ranges.iter().map(|rows| rows.len() / width).sum::<usize>();
            let taken = if one_match {
                count.min(1)
            } else {
                count.min(most)
            };
            let read = if one_match { count.min(1) } else { count } as f64;
            count_rows(drawn, read);
            rows_read += weight * read;
            for place in 0..taken {
                let mut at = (place * count + count / 2) / taken;
                let row = ranges.iter().find_map(|rows| {
                    let row = rows.get(at * width..(at + 1) * width);
                    at = at.saturating_sub(rows.len() / width);
                    row
                });
                let mut binding = binding.clone();
                if row.is_some_and(|row| bind(atom, order, fixed.len(), row, known, &mut binding)) {
                    let share = if one_match {
                        1.0
                    } else {
                        count as f64 / taken as f64
                    };
                    found.push(Drawn {
                        binding,
                        weight: weight * share,
                        origin: *origin,
                    });
                }
            }
        }
        Some((rows_read, found))
    }

    /// Returns the expected number of rows read, if values were spread evenly.
    fn expected(&mut self, partial: &Partial, idx: usize, atom: &Atom, fixed: &[usize]) -> f64 {
        let batches =
            self.access
                .batches(atom.predicate, self.parts.of(idx), 0, self.layers, self.own);
        let rows: usize = batches.iter().map(|rows| rows.len()).sum();
        let mut each = rows as f64 / self.access.predicates.get(atom.predicate).width as f64;
        for column in fixed {
            each /= self
                .access
                .distinct(atom.predicate, *column, self.layers, self.own);
        }
        partial.count * each
    }

    /// Binds the variables to which equalities give values.
    fn settle(&self, partial: &mut Partial, group: &[usize]) {
        let found = |partial: &Partial| {
            let open = group
                .iter()
                .copied()
                .filter(|idx| !partial.tested.contains(idx));
            // Assigned variables occur in no atom.
            let given =
                |idx: usize| given(&self.rule.body[idx], &partial.bound).map(|found| (idx, found));
            open.filter_map(given)
                .find(|(_, (variable, _))| !is_assigned(self.rule, *variable))
        };
        let is_sampled = !partial.sample.is_empty();
        while let Some((idx, (variable, value))) = found(partial) {
            partial.sample.retain_mut(|Drawn { binding, .. }| {
                self.watch.begin();
                let value = value.value(binding, self.universe, self.watch);
                let id = value.and_then(|value| self.universe.id(&value));
                binding[variable] = id.unwrap_or_default();
                id.is_some()
            });
            partial.bound[variable] = true;
            partial.tested.insert(idx);
        }
        if is_sampled {
            partial.count = partial.sample.iter().map(|drawn| drawn.weight).sum();
        }
    }

    /// Checks the comparisons whose variables are bound by now.
    fn test(&self, partial: &mut Partial, group: &[usize]) {
        for idx in group {
            let literal = &self.rule.body[*idx];
            if partial.tested.contains(idx) || !literal.needs().iter().all(|v| partial.bound[*v]) {
                continue;
            }
            match literal {
                Literal::Compare {
                    op, left, right, ..
                } => partial.sample.retain(|Drawn { binding, .. }| {
                    self.watch.begin();
                    let left = left.value(binding, self.universe, self.watch);
                    match (left, right.value(binding, self.universe, self.watch)) {
                        (Some(left), Some(right)) => holds(*op, &left, &right),
                        _ => false,
                    }
                }),
                Literal::Test { value, .. } => {
                    partial.sample.retain(|Drawn { binding, .. }| {
                        self.watch.begin();
                        value
                            .value(binding, self.universe, self.watch)
                            .is_some_and(|value| *value == Term::Boolean(true))
                    })
                }
                // Assigned variables occur in no atom, and the share of absent tuples is left open.
                _ => continue,
            }
            partial.tested.insert(*idx);
        }
        partial.count = partial.sample.iter().map(|drawn| drawn.weight).sum();
    }
}

fn cheapest(open: &[Partial]) -> Option<usize> {
    (0..open.len()).min_by(|a, b| {
        open[*a]
            .cost
            .total_cmp(&open[*b].cost)
            .then(open[*a].atoms.cmp(&open[*b].atoms))
    })
}

fn is_fixed(arg: Operand, bound: &[bool]) -> bool {
    match arg {
        Operand::Constant(_) => true,
        Operand::Variable(variable) => bound[variable],
        Operand::Any => false,
    }
}

/// Binds the variables of an atom to a row. Returns `false` if one of them occurs twice with
/// different values.
fn bind(
    atom: &Atom,
    order: &[usize],
    from: usize,
    row: &[TermId],
    known: &[bool],
    binding: &mut [TermId],
) -> bool {
    let mut new: Vec<Variable> = Vec::new();
    for (offset, column) in order.iter().enumerate().skip(from) {
        let Operand::Variable(variable) = atom.args[*column] else {
            continue;
        };
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

/// Reduces a sample to a size: every binding is kept as often as its weight demands.
fn thinned(sample: Vec<Drawn>, size: usize) -> Vec<Drawn> {
    if sample.len() <= size {
        return sample;
    }
    let step = sample.iter().map(|drawn| drawn.weight).sum::<f64>() / size as f64;
    let (mut kept, mut sum, mut next) = (Vec::with_capacity(size), 0.0, step / 2.0);
    for drawn in sample {
        sum += drawn.weight;
        while next < sum && kept.len() < size {
            kept.push(Drawn {
                weight: step,
                ..drawn.clone()
            });
            next += step;
        }
    }
    kept
}
