//! Explains why a goal does not hold: the closest rule, the conditions it satisfied, and the one that failed.

use std::cell::Cell;

use crate::engine::naive::unify;
use crate::explain::model::{Failure, Miss};
use crate::explain::proof::Prover;
use crate::explain::search::{Binding, ProofContext, STEP_LIMIT, reading_order};
use crate::model::program::{Atom, Literal, Operand, PredicateId, Rule};
use crate::model::values::Number;
use actcheck_base::TermId;

/// Maximum nesting depth of misses.
const DEPTH_LIMIT: usize = 5;
/// Maximum number of nearest facts shown.
const NEAREST_SHOWN: usize = 3;

/// The progress of one rule towards the goal.
struct Attempt<'a> {
    rule: &'a Rule,
    /// Indices of its conditions in evaluation order.
    order: Vec<usize>,
    /// Number of conditions satisfied.
    depth: usize,
    /// The binding at that point.
    binding: Binding,
    /// Difference between the two sides of the failed comparison.
    distance: Option<f64>,
}

impl Attempt<'_> {
    /// Returns the fraction of the conditions that were satisfied.
    fn share(&self) -> f64 {
        self.depth as f64 / self.order.len().max(1) as f64
    }

    fn better_than(&self, other: &Self) -> bool {
        let distance = |attempt: &Self| attempt.distance.unwrap_or(f64::INFINITY);
        match self.share().total_cmp(&other.share()) {
            std::cmp::Ordering::Equal => distance(self) < distance(other),
            order => order.is_gt(),
        }
    }
}

impl<'a> ProofContext<'a> {
    /// Returns the closest attempt to derive a pattern: a predicate with some arguments known. Returns `None` if no
    /// rule derives it.
    pub(super) fn miss(&self, predicate: PredicateId, known: &[Option<TermId>], depth: usize) -> Option<Miss> {
        let rules: Vec<&'a Rule> = self.rules_of(predicate).collect();
        let steps = Cell::new(0);
        let mut best: Option<Attempt<'a>> = None;
        for rule in rules {
            let Some(binding) = open_binding(&rule.head, known, rule.variables.len()) else { continue };
            let attempt = self.attempt(rule, binding, &steps);
            if best.as_ref().is_none_or(|best| attempt.better_than(best)) {
                best = Some(attempt);
            }
        }
        best.map(|attempt| self.build_miss(&attempt, known, depth))
    }

    /// Evaluates a rule and returns the attempt that satisfied the largest fraction of its conditions.
    fn attempt(&self, rule: &'a Rule, binding: Binding, steps: &Cell<usize>) -> Attempt<'a> {
        let order = reading_order(rule, &binding);
        let mut best = Attempt { rule, order: order.clone(), depth: 0, binding: binding.clone(), distance: None };
        let mut first = true;
        self.follow(rule, &order, 0, &mut binding.clone(), steps, &mut |depth, binding, distance| {
            let attempt = Attempt { rule, order: order.clone(), depth, binding: binding.clone(), distance };
            if first || attempt.better_than(&best) {
                best = attempt;
                first = false;
            }
        });
        best
    }

    /// Calls `stopped` for every dead end with the number of satisfied conditions, the binding, and the distance of a
    /// failed comparison.
    fn follow(
        &self,
        rule: &Rule,
        order: &[usize],
        depth: usize,
        binding: &mut Binding,
        steps: &Cell<usize>,
        stopped: &mut dyn FnMut(usize, &Binding, Option<f64>),
    ) {
        steps.set(steps.get() + 1);
        let Some(idx) = order.get(depth).filter(|_| steps.get() < STEP_LIMIT) else { return };
        let literal = &rule.body[*idx];
        let before = binding.clone();
        let Literal::Positive(atom) = literal else {
            if self.tested(literal, binding) == Some(true) {
                self.follow(rule, order, depth + 1, binding, steps, stopped);
            } else {
                stopped(depth, &before, self.distance(literal, &before));
            }
            *binding = before;
            return;
        };
        let mut any = false;
        for row in self.candidates(atom, binding) {
            if unify(atom, row, binding) {
                any = true;
                self.follow(rule, order, depth + 1, binding, steps, stopped);
            }
            binding.clone_from(&before);
        }
        if !any {
            stopped(depth, &before, None);
        }
    }

    /// Returns the absolute difference of the two sides of a numeric comparison, or `None` for another condition.
    fn distance(&self, literal: &Literal, binding: &Binding) -> Option<f64> {
        let Literal::Compare { left, right, .. } = literal else { return None };
        let side = |expr| Number::of(&self.value(expr, binding)?).map(Number::double);
        Some((side(left)? - side(right)?).abs())
    }

    fn build_miss(&self, attempt: &Attempt<'a>, known: &[Option<TermId>], depth: usize) -> Miss {
        let rule = attempt.rule;
        let shown = |idx: &usize| self.literal(rule, &rule.body[*idx], &attempt.binding);
        let open = open_binding(&rule.head, known, rule.variables.len()).unwrap_or_default();
        let failed = attempt.order.get(attempt.depth);
        Miss {
            goal: self.pattern(&rule.head, &open),
            rule: Some(self.rule_ref(rule)),
            satisfied: attempt.order.iter().take(attempt.depth).map(shown).collect(),
            failed: failed.map_or(String::new(), shown),
            failure: failed.map_or(Failure::NoValue, |idx| self.failure(&rule.body[*idx], &attempt.binding, depth)),
        }
    }

    fn failure(&self, literal: &Literal, binding: &Binding, depth: usize) -> Failure {
        match literal {
            Literal::Positive(atom) => self.no_match(atom, binding, depth),
            Literal::Negative(atom) => match self.blocking(atom, binding) {
                Some(row) => Failure::Blocked(Box::new(Prover::new(self).prove(atom.predicate, row, 0))),
                None => Failure::NoValue,
            },
            Literal::Compare { left, right, .. } => match (self.value(left, binding), self.value(right, binding)) {
                (Some(_), Some(_)) => Failure::Comparison { distance: self.distance(literal, binding) },
                _ => Failure::NoValue,
            },
            Literal::Assign { .. } | Literal::Test { .. } => Failure::NoValue,
        }
    }

    fn no_match(&self, atom: &Atom, binding: &Binding, depth: usize) -> Failure {
        let known: Vec<Option<TermId>> = atom
            .args
            .iter()
            .map(|arg| match arg {
                Operand::Constant(id) => Some(*id),
                Operand::Variable(variable) => binding[*variable],
                Operand::Any => None,
            })
            .collect();
        let because =
            if depth < DEPTH_LIMIT { self.miss(atom.predicate, &known, depth + 1).map(Box::new) } else { None };
        let mut near: Vec<(usize, &[TermId])> = self
            .rows(atom.predicate)
            .map(|row| {
                (known.iter().zip(row).filter(|(known, value)| known.is_some_and(|k| k == **value)).count(), row)
            })
            .filter(|(agreeing, _)| *agreeing > 0)
            .collect();
        near.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.1.cmp(b.1)));
        let nearest =
            near.into_iter().take(NEAREST_SHOWN).map(|(_, row)| self.statement(atom.predicate, row)).collect();
        Failure::NoMatch { nearest, because }
    }
}

/// Binds a rule's variables to the known arguments of its head. Returns `None` if an argument does not match.
fn open_binding(head: &Atom, known: &[Option<TermId>], variables: usize) -> Option<Binding> {
    let mut binding = vec![None; variables];
    for (arg, value) in head.args.iter().zip(known) {
        let Some(value) = value else { continue };
        match arg {
            Operand::Constant(id) if id != value => return None,
            Operand::Variable(variable) if *binding[*variable].get_or_insert(*value) != *value => return None,
            _ => {}
        }
    }
    Some(binding)
}
