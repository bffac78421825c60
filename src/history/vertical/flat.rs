//! A group of patterns as lists: joined patterns, optional ones, and conditions.

use std::collections::BTreeSet;

use oxigraph::model::Variable;
use spargebra::algebra::{Expression, GraphPattern};
use spargebra::term::TriplePattern;

use crate::vertical::leaf::{conjuncts, variables};
use crate::vertical::walk::{bound, used};

/// A group of patterns.
#[derive(Debug, Default)]
pub(super) struct Flat {
    pub triples: Vec<TriplePattern>,
    /// Conditions on the values of the triples.
    pub conditions: Vec<Expression>,
    /// Optional parts with their conditions, which apply after all joins.
    pub optionals: Vec<(GraphPattern, Option<Expression>)>,
    /// Patterns of other kinds.
    pub others: Vec<GraphPattern>,
    /// Conditions that apply last.
    pub late: Vec<Expression>,
}

impl Flat {
    /// Flattens a pattern of joins, conditions and optional parts.
    pub(super) fn of(pattern: GraphPattern) -> Self {
        match pattern {
            GraphPattern::Bgp { patterns } => Self {
                triples: patterns,
                ..Self::default()
            },
            GraphPattern::Join { left, right } => {
                let (left, right) = (Self::joinable(*left), Self::joinable(*right));
                let is_free = |one: &Self, other: &Self| {
                    let [one, other] = [one.optional_variables(), other.all_variables()];
                    one.is_disjoint(&other)
                };
                if is_free(&left.0, &right.0) && is_free(&right.0, &left.0) {
                    return left.0.joined(right.0);
                }
                // An optional part is evaluated before the join.
                Self {
                    others: vec![left.1, right.1],
                    ..Self::default()
                }
            }
            GraphPattern::Filter { expr, inner } => {
                let mut all = Vec::new();
                conjuncts(expr, &mut all);
                let (mut flat, all) = match *inner {
                    GraphPattern::Extend {
                        inner,
                        variable,
                        expression,
                    } => {
                        // Conditions that do not use the new value may come first, so that fewer
                        // values are needed later.
                        let (before, after): (Vec<_>, Vec<_>) = all
                            .into_iter()
                            .partition(|condition| !used(condition).contains(&variable));
                        let inner = Box::new(filtered(*inner, before));
                        let extend = GraphPattern::Extend {
                            inner,
                            variable,
                            expression,
                        };
                        (
                            Self {
                                others: vec![extend],
                                ..Self::default()
                            },
                            after,
                        )
                    }
                    inner => (Self::of(inner), all),
                };
                let known = variables(&flat.triples);
                for condition in all {
                    let is_early = !has_pattern(&condition) && used(&condition).is_subset(&known);
                    if is_early {
                        &mut flat.conditions
                    } else {
                        &mut flat.late
                    }
                    .push(condition);
                }
                flat
            }
            GraphPattern::LeftJoin {
                left,
                right,
                expression,
            } => {
                let mut flat = Self::of(*left);
                if !flat.late.is_empty() {
                    return Self {
                        others: vec![GraphPattern::LeftJoin {
                            left: Box::new(flat.pattern()),
                            right,
                            expression,
                        }],
                        ..Self::default()
                    };
                }
                flat.optionals.push((*right, expression));
                flat
            }
            other => Self {
                others: vec![other],
                ..Self::default()
            },
        }
    }

    /// Flattens a side of a join. Its last conditions apply before the join, so they keep it as it
    /// is.
    fn joinable(pattern: GraphPattern) -> (Self, GraphPattern) {
        let flat = Self::of(pattern.clone());
        if flat.late.is_empty() {
            return (flat, pattern);
        }
        (
            Self {
                others: vec![pattern.clone()],
                ..Self::default()
            },
            pattern,
        )
    }

    fn joined(mut self, other: Self) -> Self {
        self.triples.extend(other.triples);
        self.conditions.extend(other.conditions);
        self.optionals.extend(other.optionals);
        self.others.extend(other.others);
        self
    }

    /// The variables that only its optional parts bind.
    fn optional_variables(&self) -> BTreeSet<Variable> {
        let mut own: BTreeSet<Variable> = self
            .optionals
            .iter()
            .flat_map(|(pattern, _)| bound(pattern))
            .collect();
        let others = self
            .others
            .iter()
            .flat_map(bound)
            .chain(variables(&self.triples));
        for variable in others {
            own.remove(&variable);
        }
        own
    }

    fn all_variables(&self) -> BTreeSet<Variable> {
        let patterns = self
            .others
            .iter()
            .chain(self.optionals.iter().map(|(pattern, _)| pattern));
        patterns
            .flat_map(bound)
            .chain(variables(&self.triples))
            .collect()
    }

    /// The same as one pattern.
    fn pattern(self) -> GraphPattern {
        let mut pattern = GraphPattern::Bgp {
            patterns: self.triples,
        };
        for other in self.others {
            pattern = GraphPattern::Join {
                left: Box::new(pattern),
                right: Box::new(other),
            };
        }
        pattern = filtered(pattern, self.conditions);
        for (right, expression) in self.optionals {
            pattern = GraphPattern::LeftJoin {
                left: Box::new(pattern),
                right: Box::new(right),
                expression,
            };
        }
        filtered(pattern, self.late)
    }
}

/// A pattern with conditions.
pub(super) fn filtered(pattern: GraphPattern, conditions: Vec<Expression>) -> GraphPattern {
    let all = conditions
        .into_iter()
        .reduce(|one, other| Expression::And(Box::new(one), Box::new(other)));
    match all {
        Some(expr) => GraphPattern::Filter {
            expr,
            inner: Box::new(pattern),
        },
        None => pattern,
    }
}

fn has_pattern(expression: &Expression) -> bool {
    let mut found = false;
    crate::vertical::walk::walk_expression(
        expression,
        &mut |_| {
            found = true;
            false
        },
        &mut |_| {},
    );
    found
}
