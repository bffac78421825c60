//! Plans the evaluation of each rule: the order of its conditions and the indexes it needs.

use std::sync::Arc;

use crate::check::stratify::Stratum;
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Atom, Literal, Operand, PredicateId, Predicates, Rule};
use crate::syntax::Comparison;
use actcheck_base::TermId;

/// The columns of a predicate in the order of one index.
pub(crate) type Order = Vec<usize>;

/// The indexes of each predicate. The first one always has the columns in the order as written.
#[derive(Debug, Clone)]
pub(crate) struct Indexes {
    orders: Vec<Arc<Vec<Order>>>,
}

impl Indexes {
    /// Creates only the first index of every predicate.
    pub(crate) fn new(predicates: &Predicates) -> Self {
        Self { orders: predicates.list.iter().map(|p| Arc::new(vec![(0..p.width).collect()])).collect() }
    }

    /// Returns the column orders of one predicate.
    pub(crate) fn of(&self, predicate: PredicateId) -> &Arc<Vec<Order>> {
        &self.orders[predicate]
    }

    /// Finds or adds an index that begins with the given columns (in any order).
    fn beginning_with(&mut self, predicate: PredicateId, columns: &[usize]) -> usize {
        let orders = Arc::make_mut(&mut self.orders[predicate]);
        let begins = |order: &Order| order[..columns.len()].iter().all(|column| columns.contains(column));
        if let Some(found) = orders.iter().position(begins) {
            return found;
        }
        let width = orders[0].len();
        let mut order = columns.to_vec();
        order.extend((0..width).filter(|column| !columns.contains(column)));
        orders.push(order);
        orders.len() - 1
    }
}

/// Which tuples a condition reads from a predicate of its own stratum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Tuples of all rounds.
    All,
    /// Tuples of the rounds before the last.
    Old,
    /// Tuples of the last round.
    Recent,
}

/// How a column outside the key is matched.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Column {
    /// Binds the variable to the column's value.
    Bind(Variable),
    /// The value must equal the variable, which an earlier column of the same atom has bound.
    Same(Variable),
}

/// One step of a rule's evaluation.
#[derive(Debug, Clone)]
pub(crate) enum Op {
    /// Continues for each tuple that begins with the key.
    Scan {
        predicate: PredicateId,
        part: Part,
        index: usize,
        key: Vec<Operand>,
        /// Offsets in the index's order, with how to match each.
        columns: Vec<(usize, Column)>,
        /// None of the bound variables is read later, so one match is enough.
        once: bool,
    },
    /// Continues only if no tuple begins with the key.
    Absent {
        predicate: PredicateId,
        index: usize,
        key: Vec<Operand>,
    },
    Assign {
        variable: Variable,
        value: Expr,
    },
    Compare {
        op: Comparison,
        left: Expr,
        right: Expr,
    },
    Test {
        value: Expr,
    },
}

/// One way to evaluate a rule: over all tuples, or with one condition restricted to recent tuples.
#[derive(Debug, Clone)]
pub(crate) struct Variant {
    pub(crate) ops: Vec<Op>,
    /// Whether a condition is restricted to recent tuples.
    pub(crate) recent: bool,
}

/// A rule's variants.
#[derive(Debug, Clone)]
pub(crate) struct RulePlan {
    pub(crate) variants: Vec<Variant>,
}

/// Expected number of tuples of a predicate; `None` if unknown.
pub(crate) type Sizes<'a> = &'a dyn Fn(PredicateId) -> Option<usize>;

/// Plans a rule of a stratum.
pub(crate) fn plan_rule(rule: &Rule, stratum: &Stratum, indexes: &mut Indexes, sizes: Sizes<'_>) -> RulePlan {
    let own: Vec<usize> = rule
        .body
        .iter()
        .enumerate()
        .filter(|(_, literal)| {
            matches!(literal, Literal::Positive(atom)
                if stratum.recursive && stratum.predicates.binary_search(&atom.predicate).is_ok())
        })
        .map(|(idx, _)| idx)
        .collect();
    if own.is_empty() {
        let part = |_| Part::All;
        return RulePlan { variants: vec![Variant { ops: order(rule, None, &part, indexes, sizes), recent: false }] };
    }
    let variants = own
        .iter()
        .map(|delta| {
            // A pair of recent tuples is found only once: by the first of the two conditions.
            let part = |idx: usize| match idx.cmp(delta) {
                std::cmp::Ordering::Equal => Part::Recent,
                std::cmp::Ordering::Less if own.contains(&idx) => Part::Old,
                _ => Part::All,
            };
            Variant { ops: order(rule, Some(*delta), &part, indexes, sizes), recent: true }
        })
        .collect();
    RulePlan { variants }
}

/// Orders the conditions greedily: tests as early as possible, then the atom with the fewest expected matches.
fn order(
    rule: &Rule,
    first: Option<usize>,
    part: &dyn Fn(usize) -> Part,
    indexes: &mut Indexes,
    sizes: Sizes<'_>,
) -> Vec<Op> {
    let mut bound = vec![false; rule.variables.len()];
    let mut left: Vec<usize> = (0..rule.body.len()).collect();
    let mut ops = Vec::new();
    let mut next = first;
    while !left.is_empty() {
        let chosen = next
            .take()
            .or_else(|| left.iter().copied().find(|idx| tests(&rule.body[*idx], &bound)))
            .or_else(|| best_atom(rule, &left, &bound, sizes))
            .unwrap_or(left[0]);
        left.retain(|idx| *idx != chosen);
        ops.push(step(&rule.body[chosen], part(chosen), &mut bound, indexes));
    }
    mark_once(rule, &mut ops);
    ops
}

/// Returns whether a condition only tests or computes, and all its inputs are bound.
fn tests(literal: &Literal, bound: &[bool]) -> bool {
    !matches!(literal, Literal::Positive(_)) && literal.needs().iter().all(|v| bound[*v])
}

/// Returns the atom with the fewest expected matches, the first one of equals. Returns `None` if no atom is left.
fn best_atom(rule: &Rule, left: &[usize], bound: &[bool], sizes: Sizes<'_>) -> Option<usize> {
    let expected = |atom: &Atom| {
        // Unknown sizes count as 1000 tuples. A constant or bound variable is assumed to keep one tuple of ten.
        let size = sizes(atom.predicate).unwrap_or(1000) as f64;
        let fixed = atom
            .args
            .iter()
            .filter(|arg| match arg {
                Operand::Constant(_) => true,
                Operand::Variable(v) => bound[*v],
                Operand::Any => false,
            })
            .count();
        if fixed == atom.args.len() { 0.0 } else { size / 10f64.powi(i32::try_from(fixed).unwrap_or(9)) }
    };
    let mut best: Option<(f64, usize)> = None;
    for idx in left {
        if let Literal::Positive(atom) = &rule.body[*idx] {
            let cost = expected(atom);
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, *idx));
            }
        }
    }
    best.map(|(_, idx)| idx)
}

fn step(literal: &Literal, part: Part, bound: &mut [bool], indexes: &mut Indexes) -> Op {
    match literal {
        Literal::Positive(atom) => scan(atom, part, bound, indexes),
        Literal::Negative(atom) => {
            let (index, key) = lookup(atom, bound, indexes);
            Op::Absent { predicate: atom.predicate, index, key }
        }
        Literal::Assign { variable, value, .. } => {
            bound[*variable] = true;
            Op::Assign { variable: *variable, value: value.clone() }
        }
        Literal::Compare { op, left, right, .. } => Op::Compare { op: *op, left: left.clone(), right: right.clone() },
        Literal::Test { value, .. } => Op::Test { value: value.clone() },
    }
}

/// Returns the index whose order begins with the fixed columns of an atom, and the key in that order.
fn lookup(atom: &Atom, bound: &[bool], indexes: &mut Indexes) -> (usize, Vec<Operand>) {
    let fixed: Vec<usize> = (0..atom.args.len())
        .filter(|column| match atom.args[*column] {
            Operand::Constant(_) => true,
            Operand::Variable(v) => bound[v],
            Operand::Any => false,
        })
        .collect();
    let index = indexes.beginning_with(atom.predicate, &fixed);
    let order = &indexes.of(atom.predicate)[index];
    let key = order[..fixed.len()].iter().map(|column| atom.args[*column]).collect();
    (index, key)
}

fn scan(atom: &Atom, part: Part, bound: &mut [bool], indexes: &mut Indexes) -> Op {
    let (index, key) = lookup(atom, bound, indexes);
    let order = &indexes.of(atom.predicate)[index];
    let mut columns = Vec::new();
    for (offset, column) in order.iter().enumerate().skip(key.len()) {
        if let Operand::Variable(variable) = atom.args[*column] {
            if bound[variable] {
                columns.push((offset, Column::Same(variable)));
            } else {
                bound[variable] = true;
                columns.push((offset, Column::Bind(variable)));
            }
        }
    }
    Op::Scan { predicate: atom.predicate, part, index, key, columns, once: false }
}

/// Marks the scans that need only one match because their variables are not read afterwards.
fn mark_once(rule: &Rule, ops: &mut [Op]) {
    let mut read = vec![false; rule.variables.len()];
    let mut mark = |variables: &[Variable]| variables.iter().for_each(|v| read[*v] = true);
    match &rule.aggregation {
        // This also holds for aggregates, because they use distinct values.
        Some(aggregation) => {
            mark(&aggregation.group);
            aggregation.aggregates.iter().for_each(|a| {
                mark(&a.distinct);
                mark(&[a.input]);
            });
        }
        None => mark(&operand_variables(&rule.head.args)),
    }
    for op in ops.iter_mut().rev() {
        let mut used = Vec::new();
        match op {
            Op::Scan { key, columns, once, .. } => {
                *once = columns.iter().all(|(_, column)| matches!(column, Column::Bind(v) if !read[*v]));
                if *once {
                    columns.clear();
                }
                used.extend(operand_variables(key));
                used.extend(columns.iter().filter_map(|(_, column)| match column {
                    Column::Same(v) => Some(*v),
                    Column::Bind(_) => None,
                }));
            }
            Op::Absent { key, .. } => used.extend(operand_variables(key)),
            Op::Assign { value, .. } | Op::Test { value } => value.variables(&mut used),
            Op::Compare { left, right, .. } => {
                left.variables(&mut used);
                right.variables(&mut used);
            }
        }
        used.into_iter().for_each(|v| read[v] = true);
    }
}

fn operand_variables(args: &[Operand]) -> Vec<Variable> {
    args.iter()
        .filter_map(|arg| match arg {
            Operand::Variable(v) => Some(*v),
            _ => None,
        })
        .collect()
}

/// Returns the value of an operand under a binding. [`Operand::Any`] is never part of a key or a head.
pub(crate) fn operand_value(operand: Operand, binding: &[TermId]) -> TermId {
    match operand {
        Operand::Constant(id) => id,
        Operand::Variable(variable) => binding[variable],
        Operand::Any => TermId::MAX,
    }
}
