//! Backward search: evaluates rules from their heads over finished tuples.

use std::cell::{Cell, RefCell};

use crate::engine::evaluate::{Planned, Rounds, Tables};
use crate::engine::meter::Watch;
use crate::engine::naive::unify;
use crate::engine::plan::Indexes;
use crate::engine::relation::finished;
use crate::model::expression::holds;
use crate::model::program::{Atom, Literal, Operand, PredicateId, Predicates, Rule};
use crate::model::universe::Universe;
use crate::temporal::Evidence;
use actcheck_base::{Term, TermId};

/// Values of a rule's variables; `None` if unbound.
pub(super) type Binding = Vec<Option<TermId>>;

/// The rules and tuples that an explanation is built from.
pub(crate) struct ProofContext<'a> {
    pub(crate) predicates: &'a Predicates,
    /// Every rule that was evaluated.
    pub(crate) rules: Vec<&'a Rule>,
    /// Finished tuples; the nearest layer first.
    pub(crate) layers: Vec<&'a Tables>,
    /// Given tuples, without derived ones.
    pub(crate) facts: Vec<&'a Tables>,
    pub(crate) rounds: &'a Rounds,
    pub(crate) universe: &'a Universe<'a>,
    /// The time and memory left for the explanation.
    pub(crate) watch: &'a Watch,
    /// Whether a search was stopped at its limit.
    pub(crate) exhausted: Cell<bool>,
    /// The evidence for the formulas that were shown so far.
    pub(crate) deciding: RefCell<Vec<Evidence>>,
}

/// Returns the facts written in the programs or read by their imports, without derived tuples.
pub(super) fn stated_facts(
    programs: &[&Planned],
    predicates: &Predicates,
    indexes: &Indexes,
) -> Tables {
    let mut facts = Tables::default();
    for (predicate, rows) in programs.iter().flat_map(|planned| &planned.facts) {
        let width = predicates.get(*predicate).width;
        facts.set(
            *predicate,
            finished(width, rows, indexes.of(*predicate).clone()),
        );
    }
    facts
}

/// Maximum number of rows read for one explanation, so that it stays fast enough for interactive
/// use.
const STEP_LIMIT: usize = 20_000_000;
/// Steps between two checks of the clock.
const STEPS_PER_CHECK: usize = 4096;

impl<'a> ProofContext<'a> {
    /// Counts a step of a search. Returns `false` if the search must stop.
    pub(super) fn may_go_on(&self, steps: &Cell<usize>) -> bool {
        steps.set(steps.get() + 1);
        let checked = !steps.get().is_multiple_of(STEPS_PER_CHECK) || self.watch.check().is_ok();
        if steps.get() > STEP_LIMIT || !checked {
            self.exhausted.set(true);
        }
        !self.exhausted.get()
    }

    /// Returns all tuples of a predicate.
    pub(super) fn rows(
        &self,
        predicate: PredicateId,
    ) -> impl Iterator<Item = &'a [TermId]> + use<'a> {
        let width = self.predicates.get(predicate).width;
        let table = self.layers.iter().find_map(|tables| tables.get(predicate));
        table
            .map_or(&[][..], |table| table.index(0))
            .chunks_exact(width)
    }

    /// Returns the tuples that may match an atom under a binding; uses binary search if the first
    /// argument is known.
    pub(super) fn candidates(
        &self,
        atom: &Atom,
        binding: &Binding,
    ) -> impl Iterator<Item = &'a [TermId]> + use<'a> {
        let width = self.predicates.get(atom.predicate).width;
        let table = self
            .layers
            .iter()
            .find_map(|tables| tables.get(atom.predicate));
        let rows = table.map_or(&[][..], |table| table.index(0));
        let first = match atom.args.first() {
            Some(Operand::Constant(id)) => Some(*id),
            Some(Operand::Variable(variable)) => binding[*variable],
            _ => None,
        };
        let (start, end) = match first {
            Some(id) => {
                let count = rows.len() / width;
                let before = |limit: &dyn Fn(TermId) -> bool| {
                    partition(count, |idx| limit(rows[idx * width]))
                };
                (before(&|value| value < id), before(&|value| value <= id))
            }
            None => (0, rows.len() / width),
        };
        rows[start * width..end * width].chunks_exact(width)
    }

    /// Returns whether a tuple is a given fact.
    pub(super) fn is_fact(&self, predicate: PredicateId, row: &[TermId]) -> bool {
        let width = self.predicates.get(predicate).width;
        self.facts
            .iter()
            .filter_map(|tables| tables.get(predicate))
            .any(|table| {
                let rows = table.index(0);
                let start = partition(rows.len() / width, |idx| {
                    &rows[idx * width..(idx + 1) * width] < row
                });
                rows.get(start * width..(start + 1) * width) == Some(row)
            })
    }

    /// Returns the round of a tuple, or `None` if its stratum is not recursive.
    pub(super) fn round(&self, predicate: PredicateId, row: &[TermId]) -> Option<u32> {
        self.rounds.of(predicate, row)
    }

    /// Returns the rules that derive a predicate.
    pub(super) fn rules_of(&self, predicate: PredicateId) -> impl Iterator<Item = &'a Rule> + '_ {
        self.rules
            .iter()
            .copied()
            .filter(move |rule| rule.head.predicate == predicate)
    }

    /// Returns the binding under which a rule's head equals a tuple, or `None` if they don't match.
    pub(super) fn head_binding(&self, rule: &Rule, row: &[TermId]) -> Option<Binding> {
        let mut binding = vec![None; rule.variables.len()];
        unify(&rule.head, row, &mut binding).then_some(binding)
    }

    /// Returns whether a condition other than a positive atom holds; an assignment binds its
    /// variable. Returns `None` if a value is missing.
    pub(super) fn tested(&self, literal: &Literal, binding: &mut Binding) -> Option<bool> {
        match literal {
            Literal::Positive(_) => None,
            Literal::Negative(atom) => Some(self.blocking(atom, binding).is_none()),
            Literal::Assign {
                variable, value, ..
            } => {
                let value = self.value(value, binding)?;
                // A value without an id occurs in no derived tuple.
                let id = self.universe.id(&value);
                match (binding[*variable], id) {
                    (Some(known), Some(id)) => Some(known == id),
                    (None, Some(id)) => {
                        binding[*variable] = Some(id);
                        Some(true)
                    }
                    (_, None) => Some(false),
                }
            }
            Literal::Compare {
                op, left, right, ..
            } => {
                let (left, right) = (self.value(left, binding)?, self.value(right, binding)?);
                Some(holds(*op, &left, &right))
            }
            Literal::Test { value, .. } => Some(self.value(value, binding)? == Term::Boolean(true)),
        }
    }

    /// Returns a tuple that matches a negated atom, or `None` if the negation holds.
    pub(super) fn blocking(&self, atom: &Atom, binding: &Binding) -> Option<&'a [TermId]> {
        self.candidates(atom, binding)
            .find(|row| unify(atom, row, &mut binding.clone()))
    }
}

/// Binary search: returns the first of `count` indices for which `holds` is `false`. `holds` must
/// be monotone.
fn partition(count: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = low.midpoint(high);
        if holds(middle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

/// Returns the evaluation order of a rule's conditions: atoms in textual order, others once their
/// inputs are bound.
pub(super) fn reading_order(rule: &Rule, known: &Binding) -> Vec<usize> {
    let mut bound: Vec<bool> = known.iter().map(Option::is_some).collect();
    let mut left: Vec<usize> = (0..rule.body.len()).collect();
    let mut order = Vec::new();
    while !left.is_empty() {
        let ready = left.iter().copied().find(|idx| {
            let literal = &rule.body[*idx];
            !matches!(literal, Literal::Positive(_)) && literal.needs().iter().all(|v| bound[*v])
        });
        let chosen = ready
            .or_else(|| next_atom(rule, &left, &bound))
            .unwrap_or(left[0]);
        left.retain(|idx| *idx != chosen);
        match &rule.body[chosen] {
            Literal::Positive(atom) => {
                for arg in &atom.args {
                    if let Operand::Variable(v) = arg {
                        bound[*v] = true;
                    }
                }
            }
            Literal::Assign { variable, .. } => bound[*variable] = true,
            _ => {}
        }
        order.push(chosen);
    }
    order
}

/// Returns a fully bound atom, which is only a test; otherwise the first atom that shares a bound
/// variable, to keep the textual order, which is easier to follow; otherwise the first atom.
/// Returns `None` if no atom is left.
fn next_atom(rule: &Rule, left: &[usize], bound: &[bool]) -> Option<usize> {
    let mut best: Option<(usize, usize)> = None;
    for idx in left.iter().copied() {
        let Literal::Positive(atom) = &rule.body[idx] else {
            continue;
        };
        let is_open = |arg: &Operand| match arg {
            Operand::Variable(v) => !bound[*v],
            Operand::Constant(_) => false,
            Operand::Any => true,
        };
        if !atom.args.iter().any(is_open) {
            return Some(idx);
        }
        let connected = atom
            .args
            .iter()
            .any(|arg| matches!(arg, Operand::Variable(v) if bound[*v]));
        let rank = usize::from(!connected && bound.contains(&true));
        if best.is_none_or(|(least, _)| rank < least) {
            best = Some((rank, idx));
        }
    }
    best.map(|(_, idx)| idx)
}
