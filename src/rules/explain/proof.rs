//! Builds proofs: a tuple, the rule instance that derives it, and its premises down to facts.

use std::cell::Cell;
use std::collections::BTreeSet;

use crate::engine::aggregate::{Known, group_head, projection};
use crate::engine::naive::unify;
use crate::engine::plan::operand_value;
use crate::explain::model::{Premise, Proof, Support};
use crate::explain::search::{Binding, ProofContext, reading_order};
use crate::model::program::{Literal, Making, PredicateId, Rule};
use actcheck_base::TermId;

/// Deeper proofs are cut, so that the tree stays small and readable.
const DEPTH_LIMIT: usize = 40;
/// Maximum number of matches shown for an aggregate.
const MATCHES_SHOWN: usize = 3;
/// An aggregate over more matches is not computed again for its proof.
const MATCHES_COUNTED: usize = 1_000_000;

/// Proves tuples; each derived tuple is expanded only once.
pub(super) struct Prover<'g, 'a> {
    context: &'g ProofContext<'a>,
    shown: BTreeSet<(PredicateId, Vec<TermId>)>,
    steps: Cell<usize>,
}

impl<'g, 'a> Prover<'g, 'a> {
    pub(super) fn new(context: &'g ProofContext<'a>) -> Self {
        Self {
            context,
            shown: BTreeSet::new(),
            steps: Cell::new(0),
        }
    }

    /// Builds the proof of a tuple that holds.
    pub(super) fn prove(&mut self, predicate: PredicateId, row: &[TermId], depth: usize) -> Proof {
        let statement = self.context.statement(predicate, row);
        if self.context.is_fact(predicate, row) {
            return Proof {
                statement,
                support: Support::Fact,
            };
        }
        if depth >= DEPTH_LIMIT {
            return Proof {
                statement,
                support: Support::Omitted,
            };
        }
        if !self.shown.insert((predicate, row.to_vec())) {
            return Proof {
                statement,
                support: Support::Cut,
            };
        }
        let round = self.context.round(predicate, row);
        let rules: Vec<&Rule> = self.context.rules_of(predicate).collect();
        for rule in rules {
            let Some(binding) = self.context.head_binding(rule, row) else {
                continue;
            };
            let support = match &rule.aggregation {
                Some(_) => self.aggregate(rule, row, depth),
                None => self
                    .instance(rule, binding, round)
                    .map(|binding| Support::Rule {
                        rule: self.context.rule_ref(rule),
                        premises: match &rule.making {
                            Some(making) => self.made(making, &binding, depth),
                            None => self.premises(rule, &binding, round, depth),
                        },
                    }),
            };
            if let Some(support) = support {
                return Proof { statement, support };
            }
        }
        // Another occurrence must not refer to this one.
        self.shown.remove(&(predicate, row.to_vec()));
        Proof {
            statement,
            support: Support::Omitted,
        }
    }

    /// Returns a binding that satisfies a rule's body using only premises of earlier rounds, or
    /// `None` if no binding does.
    fn instance(&self, rule: &Rule, mut binding: Binding, round: Option<u32>) -> Option<Binding> {
        let order = reading_order(rule, &binding);
        self.satisfy(rule, &order, &mut binding, round, &mut |_| true)
            .then_some(binding)
    }

    /// Enumerates the bindings that satisfy the conditions until `found` returns `true`.
    fn satisfy(
        &self,
        rule: &Rule,
        order: &[usize],
        binding: &mut Binding,
        round: Option<u32>,
        found: &mut dyn FnMut(&Binding) -> bool,
    ) -> bool {
        let Some((first, rest)) = order.split_first() else {
            return found(binding);
        };
        let literal = &rule.body[*first];
        let Literal::Positive(atom) = literal else {
            let before = binding.clone();
            if self.context.tested(literal, binding) == Some(true)
                && self.satisfy(rule, rest, binding, round, found)
            {
                return true;
            }
            *binding = before;
            return false;
        };
        for row in self.context.candidates(atom, binding) {
            if !self.context.may_go_on(&self.steps) {
                return false;
            }
            let before = binding.clone();
            if self.earlier(atom.predicate, row, round)
                && unify(atom, row, binding)
                && self.satisfy(rule, rest, binding, round, found)
            {
                return true;
            }
            *binding = before;
        }
        false
    }

    /// Returns whether a tuple was derived before a round.
    fn earlier(&self, predicate: PredicateId, row: &[TermId], round: Option<u32>) -> bool {
        match (round, self.context.round(predicate, row)) {
            (Some(limit), Some(round)) => round < limit,
            _ => true,
        }
    }

    fn premises(
        &mut self,
        rule: &Rule,
        binding: &Binding,
        round: Option<u32>,
        depth: usize,
    ) -> Vec<Premise> {
        let mut premises = Vec::new();
        // Textual order.
        let mut order: Vec<&Literal> = rule.body.iter().collect();
        order.sort_by_key(|literal| literal.span().start);
        for literal in order {
            premises.push(match literal {
                Literal::Positive(atom) => {
                    let row = self.context.candidates(atom, binding).find(|row| {
                        self.earlier(atom.predicate, row, round)
                            && unify(atom, row, &mut binding.clone())
                    });
                    match row {
                        Some(row) => Premise::Proof(self.prove(atom.predicate, row, depth + 1)),
                        None => Premise::Computed(self.context.literal(rule, literal, binding)),
                    }
                }
                Literal::Negative(atom) => {
                    Premise::Absent(self.context.negated(rule, atom, binding))
                }
                _ => Premise::Computed(self.context.literal(rule, literal, binding)),
            });
        }
        premises
    }

    /// Returns the conditions of a rule under which it made new things, and these things.
    fn made(&mut self, making: &Making, binding: &Binding, depth: usize) -> Vec<Premise> {
        let Some(rule) = self.context.rules_of(making.matches).next() else {
            return Vec::new();
        };
        let mut known = binding.clone();
        making
            .new
            .iter()
            .for_each(|variable| known[*variable] = None);
        let values: Vec<TermId> = known.iter().map(|id| id.unwrap_or(0)).collect();
        let row: Vec<TermId> = rule
            .head
            .args
            .iter()
            .map(|arg| operand_value(*arg, &values))
            .collect();
        let round = self.context.round(making.matches, &row);
        let mut premises = match self.instance(rule, known, round) {
            Some(binding) => self.premises(rule, &binding, round, depth),
            None => Vec::new(),
        };
        for variable in &making.new {
            if let Some(id) = binding[*variable] {
                let (name, thing) = (&rule.variables[*variable], self.context.term(id));
                premises.push(Premise::Computed(format!(
                    "{name} is {thing}, a new thing, which the rule made"
                )));
            }
        }
        premises
    }

    /// Returns the matches of the group from which an aggregating rule derived a head row. Returns
    /// `None` if the group yields another row, or if it has too many matches to compute it again.
    fn aggregate(&mut self, rule: &Rule, row: &[TermId], depth: usize) -> Option<Support> {
        let aggregation = rule.aggregation.as_ref()?;
        let mut binding = self.context.head_binding(rule, row)?;
        keep_group(&mut binding, &aggregation.group);
        let order = reading_order(rule, &binding);
        let operands = projection(aggregation);
        let (mut count, mut first, mut rows) = (0, Vec::new(), Vec::new());
        let cut = self.satisfy(rule, &order, &mut binding, None, &mut |binding| {
            count += 1;
            if first.len() < MATCHES_SHOWN {
                first.push(binding.clone());
            }
            let values: Vec<TermId> = binding.iter().map(|id| id.unwrap_or(0)).collect();
            rows.push(
                operands
                    .iter()
                    .map(|operand| operand_value(*operand, &values))
                    .collect::<Vec<_>>(),
            );
            count >= MATCHES_COUNTED
        });
        if cut || self.context.exhausted.get() {
            return None;
        }
        let rows: Vec<&[TermId]> = rows.iter().map(Vec::as_slice).collect();
        let found = group_head(
            rule,
            aggregation,
            &rows,
            &mut Known(self.context.universe),
            self.context.watch,
        );
        if found.as_deref() != Some(row) {
            return None;
        }
        let premises = first
            .iter()
            .flat_map(|binding| self.premises(rule, binding, None, depth))
            .collect();
        Some(Support::Aggregate {
            rule: self.context.rule_ref(rule),
            matches: count,
            premises,
        })
    }
}

/// Unbinds every variable of an aggregating rule that does not identify the group.
pub(super) fn keep_group(binding: &mut Binding, group: &[usize]) {
    for (variable, slot) in binding.iter_mut().enumerate() {
        if !group.contains(&variable) {
            *slot = None;
        }
    }
}
