//! Rules looked at backwards, over finished tuples.

use crate::base::{Term, TermId};
use crate::rules::evaluate::{Rounds, Tables};
use crate::rules::expression::holds;
use crate::rules::naive::unify;
use crate::rules::program::{Atom, Literal, Operand, PredicateId, Predicates, Rule};
use crate::rules::universe::Universe;

/// What is known of a rule's variables.
pub(super) type Binding = Vec<Option<TermId>>;

/// Everything that an explanation stands on.
pub(crate) struct Ground<'a> {
    pub(crate) predicates: &'a Predicates,
    /// Every rule that took part.
    pub(crate) rules: Vec<&'a Rule>,
    /// Finished tuples; the nearest layer first.
    pub(crate) layers: Vec<&'a Tables>,
    /// Tuples that were given, not derived.
    pub(crate) facts: Vec<&'a Tables>,
    pub(crate) rounds: &'a Rounds,
    pub(crate) universe: &'a Universe<'a>,
}

/// Rows looked at for one explanation; more would keep a person waiting.
pub(super) const STEP_LIMIT: usize = 20_000_000;

impl<'a> Ground<'a> {
    /// All tuples of a predicate.
    pub(super) fn rows(&self, predicate: PredicateId) -> impl Iterator<Item = &'a [TermId]> + use<'a> {
        let width = self.predicates.get(predicate).width;
        let table = self.layers.iter().find_map(|tables| tables.get(predicate));
        table.map_or(&[][..], |table| table.index(0)).chunks_exact(width)
    }

    /// Tuples that an atom matches under a binding; by binary search where its first argument is known.
    pub(super) fn candidates(&self, atom: &Atom, binding: &Binding) -> impl Iterator<Item = &'a [TermId]> + use<'a> {
        let width = self.predicates.get(atom.predicate).width;
        let table = self.layers.iter().find_map(|tables| tables.get(atom.predicate));
        let rows = table.map_or(&[][..], |table| table.index(0));
        let first = match atom.args.first() {
            Some(Operand::Constant(id)) => Some(*id),
            Some(Operand::Variable(variable)) => binding[*variable],
            _ => None,
        };
        let (start, end) = match first {
            Some(id) => {
                let count = rows.len() / width;
                let before = |limit: &dyn Fn(TermId) -> bool| partition(count, |idx| limit(rows[idx * width]));
                (before(&|value| value < id), before(&|value| value <= id))
            }
            None => (0, rows.len() / width),
        };
        rows[start * width..end * width].chunks_exact(width)
    }

    /// Whether a tuple was given.
    pub(super) fn is_fact(&self, predicate: PredicateId, row: &[TermId]) -> bool {
        let width = self.predicates.get(predicate).width;
        self.facts.iter().filter_map(|tables| tables.get(predicate)).any(|table| {
            let rows = table.index(0);
            let start = partition(rows.len() / width, |idx| &rows[idx * width..(idx + 1) * width] < row);
            rows.get(start * width..(start + 1) * width) == Some(row)
        })
    }

    /// The round of a tuple of a recursive stratum.
    pub(super) fn round(&self, predicate: PredicateId, row: &[TermId]) -> Option<u32> {
        self.rounds.of(predicate, row)
    }

    /// Rules that derive a predicate.
    pub(super) fn rules_of(&self, predicate: PredicateId) -> impl Iterator<Item = &'a Rule> + '_ {
        self.rules.iter().copied().filter(move |rule| rule.head.predicate == predicate)
    }

    /// The binding under which a rule's head is a tuple; nothing where it can't be.
    pub(super) fn head_binding(&self, rule: &Rule, row: &[TermId]) -> Option<Binding> {
        let mut binding = vec![None; rule.variables.len()];
        unify(&rule.head, row, &mut binding).then_some(binding)
    }

    /// Whether a condition that is no positive atom holds; it may bind a variable. `None`: a value is missing.
    pub(super) fn tested(&self, literal: &Literal, binding: &mut Binding) -> Option<bool> {
        match literal {
            Literal::Positive(_) => None,
            Literal::Negative(atom) => Some(self.blocking(atom, binding).is_none()),
            Literal::Assign { variable, value, .. } => {
                let value = self.value(value, binding)?;
                // A value that is nowhere else has no number; then nothing that was derived can have it.
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
            Literal::Compare { op, left, right, .. } => {
                let (left, right) = (self.value(left, binding)?, self.value(right, binding)?);
                Some(holds(*op, &left, &right))
            }
            Literal::Test { value, .. } => Some(self.value(value, binding)? == Term::Boolean(true)),
        }
    }

    /// A tuple that keeps a negated atom from holding.
    pub(super) fn blocking(&self, atom: &Atom, binding: &Binding) -> Option<&'a [TermId]> {
        self.candidates(atom, binding).find(|row| unify(atom, row, &mut binding.clone()))
    }
}

/// How many of the first `count` places satisfy a condition that holds up to some place and not behind it.
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

/// Conditions of a rule in an order to look at them: atoms as written, everything else as soon as it can be.
pub(super) fn reading_order(rule: &Rule, known: &Binding) -> Vec<usize> {
    let mut bound: Vec<bool> = known.iter().map(Option::is_some).collect();
    let mut left: Vec<usize> = (0..rule.body.len()).collect();
    let mut order = Vec::new();
    while !left.is_empty() {
        let ready = left.iter().copied().find(|idx| {
            let literal = &rule.body[*idx];
            !matches!(literal, Literal::Positive(_)) && literal.needs().iter().all(|v| bound[*v])
        });
        let chosen = ready.or_else(|| next_atom(rule, &left, &bound)).unwrap_or(left[0]);
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

/// An atom that is fully known, which only tests; otherwise the first that shares a variable with what is known, because the
/// order of the text tells a story; otherwise the first.
fn next_atom(rule: &Rule, left: &[usize], bound: &[bool]) -> Option<usize> {
    let mut best: Option<(usize, usize)> = None;
    for idx in left.iter().copied() {
        let Literal::Positive(atom) = &rule.body[idx] else { continue };
        let is_open = |arg: &Operand| match arg {
            Operand::Variable(v) => !bound[*v],
            Operand::Constant(_) => false,
            Operand::Any => true,
        };
        if !atom.args.iter().any(is_open) {
            return Some(idx);
        }
        let connected = atom.args.iter().any(|arg| matches!(arg, Operand::Variable(v) if bound[*v]));
        let rank = usize::from(!connected && bound.contains(&true));
        if best.is_none_or(|(least, _)| rank < least) {
            best = Some((rank, idx));
        }
    }
    best.map(|(_, idx)| idx)
}
