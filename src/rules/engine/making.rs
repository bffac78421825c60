//! New things (`!x` in heads): the restricted chase.
//!
//! In each stratum, all other rules are applied until there are no new tuples. Then the rules that
//! make new things take turns in the order of the text. A turn visits the matches that are new
//! since the rule's last turn, in the order of their values: if no known tuples satisfy all heads
//! of a match, it gets new things. This sees the things made earlier in the same turn. After a turn
//! that made something, all other rules are applied again.
//!
//! The order depends on values, not on ids or plans, so that the same facts always give the same
//! things.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use crate::check::stratify::Stratum;
use crate::engine::access::{Access, Own};
use crate::engine::evaluate::{Grown, Layers, Run, Stopped};
use crate::engine::join::equal_range;
use crate::engine::lower::scan;
use crate::engine::meter::{Meter, Stop, Watch};
use crate::engine::plan::{Column, Indexes, Op, Order, Part, Scan, operand_value};
use crate::engine::relation::Batch;
use crate::model::program::{Atom, Literal, Making, Operand, Rule};
use crate::model::universe::Universe;
use actcheck_base::{Term, TermId};

/// How the tuples that satisfy the heads of a match are found: one scan for each head.
#[derive(Debug, Clone)]
pub(crate) struct Search {
    steps: Vec<Scan>,
}

impl Search {
    /// Plans the search: heads with the most known arguments first.
    pub(crate) fn new(rule: &Rule, making: &Making, indexes: &mut Indexes) -> Self {
        let mut bound: Vec<bool> = (0..rule.variables.len())
            .map(|variable| !making.new.contains(&variable))
            .collect();
        let mut left: Vec<&Atom> = making.heads.iter().collect();
        let mut steps = Vec::new();
        while !left.is_empty() {
            let open = |atom: &Atom| {
                atom.args
                    .iter()
                    .filter(|arg| matches!(arg, Operand::Variable(v) if !bound[*v]))
                    .count()
            };
            let next = (0..left.len())
                .min_by_key(|at| (open(left[*at]), *at))
                .unwrap_or(0);
            if let Op::Scan(scan) = scan(left.remove(next), Part::All, &mut bound, indexes) {
                steps.push(scan);
            }
        }
        Self { steps }
    }

    /// Returns the scans.
    pub(crate) fn steps(&self) -> &[Scan] {
        &self.steps
    }
}

/// A rule that makes new things.
pub(crate) struct Maker {
    rule: usize,
    /// The place of its matches among the predicates of the stratum, if they grow.
    matches: Option<usize>,
    /// The matches since its last turn, as rows one after another.
    pending: Vec<TermId>,
}

/// The rules of a stratum that make new things, in the order of the text.
#[derive(Default)]
pub(crate) struct Makers {
    list: Vec<Maker>,
    /// The one whose turn it is.
    next: usize,
}

impl Makers {
    fn next(&mut self) -> &mut Maker {
        let at = self.next;
        self.next = (at + 1) % self.list.len();
        &mut self.list[at]
    }

    /// Adds the recent matches of each rule.
    pub(crate) fn add_matches(
        &mut self,
        active: &BTreeSet<usize>,
        grown: &Grown,
        watch: &Watch,
    ) -> Result<(), Stop> {
        for maker in &mut self.list {
            let Some(place) = maker.matches.filter(|place| active.contains(place)) else {
                continue;
            };
            let mut batches = Vec::new();
            grown[place].batches(Part::Recent, 0, &mut batches);
            for rows in &batches {
                watch.hold(size_of_val(&**rows))?;
                maker.pending.extend_from_slice(rows);
            }
        }
        Ok(())
    }
}

impl Run<'_, '_, '_> {
    /// Returns the rules of a stratum that make new things, with the matches that are complete.
    pub(crate) fn makers(&self, stratum: &Stratum, layers: &Layers<'_>) -> Result<Makers, Stop> {
        let rules = stratum
            .rules
            .iter()
            .filter(|rule| self.planned.rules[**rule].makes().is_some());
        let mut makers = Makers::default();
        for rule in rules {
            let Some(matches) = self.planned.rules[*rule]
                .body
                .iter()
                .find_map(Literal::atom)
            else {
                continue;
            };
            let place = stratum.predicates.binary_search(&matches.predicate).ok();
            let pending = if place.is_some() {
                Vec::new()
            } else {
                layers.rows(matches.predicate).to_vec()
            };
            self.meter.watch.hold(size_of_val(pending.as_slice()))?;
            makers.list.push(Maker {
                rule: *rule,
                matches: place,
                pending,
            });
        }
        Ok(makers)
    }

    /// Lets the rules that make new things take turns, until one of them makes some. Returns the
    /// place of their predicate. `new`: number of new tuples in this round.
    pub(crate) fn turn(
        &mut self,
        makers: &mut Makers,
        stratum: &Stratum,
        layers: &Layers<'_>,
        grown: &Grown,
        new: &mut usize,
    ) -> Result<Option<usize>, Stopped> {
        let planned = self.planned;
        for _ in 0..makers.list.len() {
            let Maker {
                rule: idx, pending, ..
            } = makers.next();
            let (idx, pending) = (*idx, std::mem::take(pending));
            let rule = &planned.rules[idx];
            let (Some(making), Some(search)) = (rule.makes(), &planned.searches[idx]) else {
                continue;
            };
            let Ok(place) = stratum.predicates.binary_search(&making.made) else {
                continue;
            };
            let stopped = |stop| Stopped {
                stop,
                rule: Some(idx),
            };
            let turn = Turn::new(
                rule,
                making,
                search,
                &mut self.access,
                layers,
                Own { stratum, grown },
            );
            let limit = planned.endless.contains(&making.made);
            let mut rows = turn
                .run(&pending, limit, self.universe, self.meter)
                .map_err(stopped)?;
            self.meter.watch.release(size_of_val(pending.as_slice()));
            let count = grown[place].insert(&mut rows);
            if count > 0 {
                *new += count;
                self.meter
                    .watch
                    .hold(count * self.row_bytes(making.made))
                    .map_err(stopped)?;
                self.meter.room_for(*new).map_err(stopped)?;
                return Ok(Some(place));
            }
        }
        Ok(None)
    }
}

/// One turn of a rule that makes new things.
pub(crate) struct Turn<'a, 'b> {
    rule: &'a Rule,
    making: &'a Making,
    steps: &'a [Scan],
    /// The known tuples that each step reads.
    batches: Vec<Vec<Batch<'b>>>,
    /// The columns of each step's rows.
    orders: Vec<Order>,
    /// The tuples of this turn that each step reads, in its order.
    added: Vec<BTreeSet<Vec<TermId>>>,
}

impl<'a, 'b> Turn<'a, 'b> {
    pub(crate) fn new(
        rule: &'a Rule,
        making: &'a Making,
        search: &'a Search,
        access: &mut Access<'_>,
        layers: &'b Layers<'_>,
        own: Own<'b>,
    ) -> Self {
        let batches = search
            .steps
            .iter()
            .map(|step| access.batches(step.predicate, Part::All, step.index, layers, Some(own)))
            .collect();
        let orders = search
            .steps
            .iter()
            .map(|step| access.indexes.of(step.predicate)[step.index].clone())
            .collect();
        let added = vec![BTreeSet::new(); search.steps.len()];
        Self {
            rule,
            making,
            steps: &search.steps,
            batches,
            orders,
            added,
        }
    }

    /// Returns the values of all matches that lack the heads, each with its new things, as rows one
    /// after another.
    ///
    /// `matches`: rows of the rule's matches. `limit`: whether the number of new things is limited.
    pub(crate) fn run(
        mut self,
        matches: &[TermId],
        limit: bool,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<Vec<TermId>, Stop> {
        let Some(atom) = self.rule.body.iter().find_map(Literal::atom) else {
            return Ok(Vec::new());
        };
        let mut rows: Vec<&[TermId]> = matches.chunks_exact(atom.args.len().max(1)).collect();
        sort_by_value(&mut rows, universe);
        let mut binding = vec![0; self.rule.variables.len()];
        let mut made = Vec::new();
        for row in rows {
            bind(atom, row, &mut binding);
            if self.is_satisfied(0, &mut binding, meter)? {
                continue;
            }
            for variable in &self.making.new {
                binding[*variable] = universe.new_thing(&meter.watch)?;
                if limit {
                    meter.made()?;
                }
            }
            made.extend(
                self.rule
                    .head
                    .args
                    .iter()
                    .map(|arg| operand_value(*arg, &binding)),
            );
            meter.watch.room(size_of_val(made.as_slice()))?;
            self.add(&binding);
        }
        Ok(made)
    }

    /// Adds the heads of a match to the tuples of this turn.
    fn add(&mut self, binding: &[TermId]) {
        for head in &self.making.heads {
            for ((step, order), added) in self.steps.iter().zip(&self.orders).zip(&mut self.added) {
                if step.predicate == head.predicate {
                    added.insert(
                        order
                            .iter()
                            .map(|column| operand_value(head.args[*column], binding))
                            .collect(),
                    );
                }
            }
        }
    }

    /// Returns whether known tuples satisfy the heads from a step on.
    fn is_satisfied(
        &self,
        at: usize,
        binding: &mut Vec<TermId>,
        meter: &mut Meter,
    ) -> Result<bool, Stop> {
        let Some(step) = self.steps.get(at) else {
            return Ok(true);
        };
        let key: Vec<TermId> = step
            .key
            .iter()
            .map(|operand| operand_value(*operand, binding))
            .collect();
        let width = self.orders[at].len();
        for rows in &self.batches[at] {
            for row in rows[equal_range(rows, width, &key)].chunks_exact(width) {
                meter.step()?;
                if fits(step, row, binding) && self.is_satisfied(at + 1, binding, meter)? {
                    return Ok(true);
                }
            }
        }
        for row in self.added[at]
            .range(key.clone()..)
            .take_while(|row| row.starts_with(&key))
        {
            meter.step()?;
            if fits(step, row, binding) && self.is_satisfied(at + 1, binding, meter)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Matches the columns outside the key, and binds their variables.
fn fits(step: &Scan, row: &[TermId], binding: &mut [TermId]) -> bool {
    step.columns.iter().all(|(offset, column)| match column {
        Column::Bind(variable) => {
            binding[*variable] = row[*offset];
            true
        }
        Column::Same(variable) => binding[*variable] == row[*offset],
    })
}

/// Binds the variables of an atom to the values of a row.
fn bind(atom: &Atom, row: &[TermId], binding: &mut [TermId]) {
    for (arg, value) in atom.args.iter().zip(row) {
        if let Operand::Variable(variable) = arg {
            binding[*variable] = *value;
        }
    }
}

/// Sorts rows by their values: new things in the order in which they were made.
pub(crate) fn sort_by_value(rows: &mut [&[TermId]], universe: &Universe<'_>) {
    rows.sort_by(|a, b| {
        let pairs = a.iter().zip(*b).filter(|(a, b)| a != b);
        let mut orders = pairs.map(|(a, b)| by_value(universe.term(*a), universe.term(*b)));
        orders
            .find(|order| order.is_ne())
            .unwrap_or(Ordering::Equal)
    });
}

fn by_value(a: &Term, b: &Term) -> Ordering {
    match (a, b) {
        (Term::Blank(a), Term::Blank(b)) => a.len().cmp(&b.len()).then_with(|| a.cmp(b)),
        _ => a.cmp(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Terms;

    #[test]
    fn new_things_are_visited_in_the_order_in_which_they_were_made() {
        let nothing = Terms::new();
        let mut universe = Universe::new(&nothing, None);
        let labels = ["10", "9", "2"].map(|label| universe.intern(Term::Blank(label.into())));
        let rows: Vec<Vec<TermId>> = labels.iter().map(|id| vec![*id, 0]).collect();
        let mut rows: Vec<&[TermId]> = rows.iter().map(Vec::as_slice).collect();
        sort_by_value(&mut rows, &universe);
        let sorted: Vec<String> = rows
            .iter()
            .map(|row| universe.term(row[0]).to_string())
            .collect();
        assert_eq!(sorted, ["_:2", "_:9", "_:10"]);
    }
}
