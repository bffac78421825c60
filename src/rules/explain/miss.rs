//! Explains why a goal does not hold: the closest rule, the conditions it satisfied, and the one
//! that failed.

use std::cell::Cell;

use crate::engine::naive::unify;
use crate::explain::model::{Failure, Miss};
use crate::explain::proof::{Prover, keep_group};
use crate::explain::search::{Binding, ProofContext, reading_order};
use crate::model::expression::Expr;
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
    /// The head that matches the goal. A rule that makes new things has several heads.
    head: &'a Atom,
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
    /// Returns the closest attempt to derive a pattern: a predicate with some arguments known.
    /// Returns `None` if no rule has a matching head, or if the search was stopped before the first
    /// attempt.
    pub(super) fn miss(
        &self,
        predicate: PredicateId,
        known: &[Option<TermId>],
        depth: usize,
    ) -> Option<Miss> {
        let rules: Vec<&'a Rule> = self.rules_of(predicate).collect();
        let steps = Cell::new(0);
        let mut best: Option<Attempt<'a>> = None;
        for rule in rules {
            let Some(mut binding) = open_binding(&rule.head, known, rule.variables.len()) else {
                continue;
            };
            if let Some(aggregation) = &rule.aggregation {
                keep_group(&mut binding, &aggregation.group);
            }
            let head = &rule.head;
            let rule = match &rule.making {
                Some(making) => {
                    making
                        .new
                        .iter()
                        .for_each(|variable| binding[*variable] = None);
                    self.rules_of(making.matches).next().unwrap_or(rule)
                }
                None => rule,
            };
            if let Some(attempt) = self.attempt(rule, head, binding, &steps)
                && best.as_ref().is_none_or(|best| attempt.better_than(best))
            {
                best = Some(attempt);
            }
        }
        best.map(|attempt| self.build_miss(&attempt, known, depth))
    }

    /// Evaluates a rule and returns the attempt that satisfied the largest fraction of its
    /// conditions. Returns `None` if the search was stopped before the first attempt.
    fn attempt(
        &self,
        rule: &'a Rule,
        head: &'a Atom,
        mut binding: Binding,
        steps: &Cell<usize>,
    ) -> Option<Attempt<'a>> {
        let order = reading_order(rule, &binding);
        let mut best: Option<Attempt<'a>> = None;
        self.follow(
            rule,
            &order,
            0,
            &mut binding,
            steps,
            &mut |depth, binding, distance| {
                let attempt = Attempt {
                    rule,
                    head,
                    order: order.clone(),
                    depth,
                    binding: binding.clone(),
                    distance,
                };
                if best.as_ref().is_none_or(|best| attempt.better_than(best)) {
                    best = Some(attempt);
                }
            },
        );
        best
    }

    /// Calls `stopped` for every dead end with the number of satisfied conditions, the binding, and
    /// the distance of a failed comparison. The dead end of an aggregating rule may be that its
    /// aggregate has another value, and that of a rule with new things that it made others, or none
    /// because known tuples satisfy its heads.
    fn follow(
        &self,
        rule: &Rule,
        order: &[usize],
        depth: usize,
        binding: &mut Binding,
        steps: &Cell<usize>,
        stopped: &mut dyn FnMut(usize, &Binding, Option<f64>),
    ) {
        if !self.may_go_on(steps) {
            return;
        }
        let Some(idx) = order.get(depth) else {
            if rule.aggregation.is_some() || rule.making.is_some() {
                stopped(depth, binding, None);
            }
            return;
        };
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

    /// Returns the absolute difference of the two sides of a numeric comparison, or of a computed
    /// number and the required one. Returns `None` for another condition.
    fn distance(&self, literal: &Literal, binding: &Binding) -> Option<f64> {
        let side = |expr| Number::of(&self.value(expr, binding)?).map(Number::double);
        match literal {
            Literal::Compare { left, right, .. } => Some((side(left)? - side(right)?).abs()),
            Literal::Assign {
                variable, value, ..
            } => {
                let wanted = Number::of(self.universe.term(binding[*variable]?))?.double();
                Some((side(value)? - wanted).abs())
            }
            Literal::Test {
                value: Expr::Timed(timed),
                ..
            } => {
                let robustness = Expr::Timed(Box::new(timed.robustness()));
                side(&robustness).map(f64::abs)
            }
            _ => None,
        }
    }

    fn build_miss(&self, attempt: &Attempt<'a>, known: &[Option<TermId>], depth: usize) -> Miss {
        let rule = attempt.rule;
        let shown = |idx: &usize| self.literal(rule, &rule.body[*idx], &attempt.binding);
        let open = open_binding(attempt.head, known, rule.variables.len()).unwrap_or_default();
        let goal = self.pattern(attempt.head, &open, &rule.variables);
        let (failed, failure) = match attempt.order.get(attempt.depth).map(|idx| &rule.body[*idx]) {
            Some(literal) => (
                self.unsatisfied(rule, literal, &attempt.binding),
                self.failure(literal, &attempt.binding, depth),
            ),
            None if rule.making.is_some() => {
                let nearest = self.nearest(attempt.head.predicate, known);
                let failed =
                    "a new thing for this: the rule made others, or known tuples satisfy its heads"
                        .to_owned();
                (
                    failed,
                    Failure::NoMatch {
                        nearest,
                        because: None,
                    },
                )
            }
            None => (
                format!("a group whose aggregate is {goal}"),
                self.other_aggregates(rule, &open),
            ),
        };
        let satisfied = attempt
            .order
            .iter()
            .take(attempt.depth)
            .map(shown)
            .collect();
        Miss {
            goal,
            rule: Some(self.rule_ref(rule)),
            satisfied,
            failed,
            failure,
        }
    }

    /// Returns the tuples of the group that an aggregating rule derives instead of the goal.
    fn other_aggregates(&self, rule: &Rule, open: &Binding) -> Failure {
        let mut group = open.clone();
        if let Some(aggregation) = &rule.aggregation {
            keep_group(&mut group, &aggregation.group);
        }
        let of_group = self
            .rows(rule.head.predicate)
            .filter(|row| unify(&rule.head, row, &mut group.clone()));
        let nearest = of_group
            .take(NEAREST_SHOWN)
            .map(|row| self.statement(rule.head.predicate, row))
            .collect();
        Failure::NoMatch {
            nearest,
            because: None,
        }
    }

    /// Describes a pattern that no rule has a matching head for.
    pub(super) fn underivable(&self, predicate: PredicateId, known: &[Option<TermId>]) -> Miss {
        let args = known
            .iter()
            .map(|id| id.map_or(Operand::Any, Operand::Constant))
            .collect();
        let goal = self.pattern(
            &Atom {
                predicate,
                args,
                span: 0..0,
            },
            &Vec::new(),
            &[],
        );
        let failure = Failure::NoMatch {
            nearest: self.nearest(predicate, known),
            because: None,
        };
        Miss {
            failed: goal.clone(),
            goal,
            rule: None,
            satisfied: Vec::new(),
            failure,
        }
    }

    fn failure(&self, literal: &Literal, binding: &Binding, depth: usize) -> Failure {
        match literal {
            Literal::Positive(atom) => self.no_match(atom, binding, depth),
            Literal::Negative(atom) => match self.blocking(atom, binding) {
                Some(row) => {
                    Failure::Blocked(Box::new(Prover::new(self).prove(atom.predicate, row, 0)))
                }
                None => Failure::NoValue,
            },
            Literal::Compare { left, right, .. } => {
                match (self.value(left, binding), self.value(right, binding)) {
                    (Some(_), Some(_)) => Failure::Comparison {
                        distance: self.distance(literal, binding),
                    },
                    _ => Failure::NoValue,
                }
            }
            Literal::Assign {
                variable, value, ..
            } => match (binding[*variable], self.value(value, binding)) {
                (Some(_), Some(_)) => Failure::Comparison {
                    distance: self.distance(literal, binding),
                },
                _ => Failure::NoValue,
            },
            Literal::Test {
                value: Expr::Timed(_),
                ..
            } => Failure::Comparison {
                distance: self.distance(literal, binding),
            },
            Literal::Test { .. } => Failure::NoValue,
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
        let because = if depth < DEPTH_LIMIT {
            self.miss(atom.predicate, &known, depth + 1).map(Box::new)
        } else {
            None
        };
        Failure::NoMatch {
            nearest: self.nearest(atom.predicate, &known),
            because,
        }
    }

    /// Returns the tuples that agree with a pattern in the most arguments.
    fn nearest(&self, predicate: PredicateId, known: &[Option<TermId>]) -> Vec<String> {
        let mut near: Vec<(usize, &[TermId])> = self
            .rows(predicate)
            .map(|row| {
                (
                    known
                        .iter()
                        .zip(row)
                        .filter(|(known, value)| known.is_some_and(|k| k == **value))
                        .count(),
                    row,
                )
            })
            .filter(|(agreeing, _)| *agreeing > 0)
            .collect();
        near.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.1.cmp(b.1)));
        near.into_iter()
            .take(NEAREST_SHOWN)
            .map(|(_, row)| self.statement(predicate, row))
            .collect()
    }
}

/// Binds a rule's variables to the known arguments of its head. Returns `None` if an argument does
/// not match.
fn open_binding(head: &Atom, known: &[Option<TermId>], variables: usize) -> Option<Binding> {
    let mut binding = vec![None; variables];
    for (arg, value) in head.args.iter().zip(known) {
        let Some(value) = value else { continue };
        match arg {
            Operand::Constant(id) if id != value => return None,
            Operand::Variable(variable) if *binding[*variable].get_or_insert(*value) != *value => {
                return None;
            }
            _ => {}
        }
    }
    Some(binding)
}
