//! Turns an order of a rule's atoms into steps.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::engine::equal::{Keyed, given, is_assigned, meeting};
use crate::engine::plan::{Column, Indexes, Op, Part, Parts, Rival, Scan};
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Atom, Literal, Operand, PredicateId, Rule};
use crate::syntax::Comparison;

/// Returns which variables the head or its aggregates read.
pub(crate) fn outputs(rule: &Rule) -> Vec<bool> {
    let mut read = vec![false; rule.variables.len()];
    match &rule.aggregation {
        // One match of the other variables is enough for aggregates too, because they use distinct
        // values.
        Some(aggregation) => {
            let inputs = aggregation
                .aggregates
                .iter()
                .flat_map(|a| a.distinct.iter().chain([&a.input]));
            aggregation
                .group
                .iter()
                .chain(inputs)
                .for_each(|v| read[*v] = true);
        }
        None => operand_variables(&rule.head.args)
            .into_iter()
            .for_each(|v| read[v] = true),
    }
    read
}

/// Returns the variables of a condition.
pub(crate) fn literal_variables(literal: &Literal) -> Vec<Variable> {
    let mut found = literal.needs();
    match literal {
        Literal::Positive(atom) => found.extend(operand_variables(&atom.args)),
        Literal::Assign { variable, .. } => found.push(*variable),
        _ => {}
    }
    found
}

/// Splits the conditions into groups without common variables, in the order of their first
/// conditions.
pub(crate) fn groups(rule: &Rule) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Vec<usize>, Vec<Variable>)> = Vec::new();
    for (idx, literal) in rule.body.iter().enumerate() {
        let (mut members, mut variables) = (Vec::new(), literal_variables(literal));
        let (joined, others): (Vec<_>, Vec<_>) = groups
            .into_iter()
            .partition(|(_, known)| known.iter().any(|v| variables.contains(v)));
        groups = others;
        for (more, known) in joined {
            members.extend(more);
            variables.extend(known);
        }
        members.push(idx);
        members.sort_unstable();
        variables.sort_unstable();
        variables.dedup();
        groups.push((members, variables));
    }
    let mut groups: Vec<Vec<usize>> = groups.into_iter().map(|(members, _)| members).collect();
    groups.sort_unstable();
    groups
}

/// Turns an order of atoms into steps, with each test as early as possible. `measured`: see
/// [`plan_variant`](crate::engine::plan::plan_variant). `may_meet` is set if atoms could be looked
/// up by a computed value as well.
pub(crate) fn lower(
    rule: &Rule,
    group: &[usize],
    atoms: &[usize],
    parts: &Parts,
    indexes: &mut Indexes,
    measured: Option<&BTreeSet<usize>>,
    may_meet: &mut bool,
) -> Vec<Op> {
    let mut bound = vec![false; rule.variables.len()];
    let mut tests: Vec<usize> = group
        .iter()
        .copied()
        .filter(|idx| !matches!(rule.body[*idx], Literal::Positive(_)))
        .collect();
    // Variables with a value that no atom has confirmed yet.
    let mut expected: Vec<Variable> = Vec::new();
    let mut ops = Vec::new();
    let mut atoms = atoms.iter().copied();
    // With a delta, its rows come before tests without variables.
    let mut next = parts
        .delta
        .filter(|delta| group.contains(delta))
        .and_then(|_| atoms.next());
    loop {
        let ready = |idx: &usize| {
            let needs = rule.body[*idx].needs();
            // A formula over time may lack values for things that no tuple names.
            needs
                .iter()
                .all(|v| bound[*v] && !(expected.contains(v) && is_timed(&rule.body[*idx])))
        };
        let chosen = next.take().or_else(|| tests.iter().copied().find(ready));
        if chosen.is_none()
            && let Some((idx, (variable, value))) = tests
                .iter()
                .find_map(|idx| Some((*idx, given(&rule.body[*idx], &bound)?)))
        {
            tests.retain(|test| *test != idx);
            bound[variable] = true;
            expected.push(variable);
            // No tuple has an assigned value.
            let is_assigned = is_assigned(rule, variable);
            ops.push(if is_assigned {
                Op::Assign { variable, value }
            } else {
                Op::Equate { variable, value }
            });
            continue;
        }
        let Some(chosen) = chosen
            .or_else(|| atoms.next())
            .or_else(|| tests.first().copied())
        else {
            return ops;
        };
        tests.retain(|idx| *idx != chosen);
        if let Literal::Positive(atom) = &rule.body[chosen] {
            expected.retain(|variable| !atom.args.contains(&Operand::Variable(*variable)));
        }
        if let Literal::Positive(atom) = &rule.body[chosen]
            && bound.contains(&true)
            && let Some(meeting) = meeting(rule, tests.iter().copied(), atom, &bound)
        {
            let is_free = operand_variables(&atom.args)
                .iter()
                .all(|variable| !bound[*variable]);
            if is_free || measured.is_some_and(|many| many.contains(&chosen)) {
                tests.retain(|idx| *idx != meeting.idx);
                let slot = rule.variables.len() + meeting.idx;
                let (keyed, key, columns) = Keyed::new(atom, &meeting, slot, &mut bound);
                ops.push(Op::Equate {
                    variable: slot,
                    value: meeting.known,
                });
                let part = parts.of(chosen);
                let scan = Scan {
                    keyed: Some(Arc::new(keyed)),
                    ..Scan::new(atom.predicate, part, 0, key, columns)
                };
                ops.push(Op::Scan(scan));
                continue;
            }
            *may_meet |= measured.is_none();
        }
        ops.push(step(
            &rule.body[chosen],
            parts.of(chosen),
            &mut bound,
            indexes,
        ));
    }
}

/// Returns whether a formula over time is part of a condition.
fn is_timed(literal: &Literal) -> bool {
    match literal {
        Literal::Positive(_) | Literal::Negative(_) => false,
        Literal::Assign { value, .. } | Literal::Test { value, .. } => value.is_timed(),
        Literal::Compare { left, right, .. } => left.is_timed() || right.is_timed(),
    }
}

fn step(literal: &Literal, part: Part, bound: &mut [bool], indexes: &mut Indexes) -> Op {
    match literal {
        Literal::Positive(atom) => scan(atom, part, bound, indexes),
        Literal::Negative(atom) => {
            let (index, key) = lookup(atom, bound, indexes);
            Op::Absent {
                predicate: atom.predicate,
                index,
                key,
            }
        }
        // An equality may have given the variable its value.
        Literal::Assign {
            variable, value, ..
        } if bound[*variable] => Op::Compare {
            op: Comparison::Equal,
            left: Expr::Variable(*variable),
            right: value.clone(),
        },
        Literal::Assign {
            variable, value, ..
        } => {
            bound[*variable] = true;
            Op::Assign {
                variable: *variable,
                value: value.clone(),
            }
        }
        Literal::Compare {
            op, left, right, ..
        } => Op::Compare {
            op: *op,
            left: left.clone(),
            right: right.clone(),
        },
        Literal::Test { value, .. } => Op::Test {
            value: value.clone(),
        },
    }
}

/// Returns the index whose order begins with the fixed columns of an atom, and the key in that
/// order.
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
    let key = order[..fixed.len()]
        .iter()
        .map(|column| atom.args[*column])
        .collect();
    (index, key)
}

pub(crate) fn scan(atom: &Atom, part: Part, bound: &mut [bool], indexes: &mut Indexes) -> Op {
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
    Op::Scan(Scan::new(atom.predicate, part, index, key, columns))
}

impl Scan {
    fn new(
        predicate: PredicateId,
        part: Part,
        index: usize,
        key: Vec<Operand>,
        columns: Vec<(usize, Column)>,
    ) -> Self {
        let rivals = Vec::new();
        Self {
            predicate,
            part,
            index,
            key,
            columns,
            once: false,
            exists: false,
            settled: 0,
            rivals,
            keyed: None,
        }
    }
}

/// Marks the scans that need only one match.
pub(crate) fn mark(rule: &Rule, outputs: &[bool], ops: &mut [Op]) {
    let mut unbound: Vec<Variable> = (0..outputs.len()).filter(|v| outputs[*v]).collect();
    for op in ops.iter_mut() {
        match op {
            Op::Scan(scan) => {
                scan.exists = unbound.is_empty();
                let binds = |v: &Variable| {
                    scan.columns
                        .iter()
                        .find(|(_, c)| matches!(c, Column::Bind(bound) if bound == v))
                        .map(|(at, _)| at + 1)
                };
                let columns: Option<Vec<usize>> = unbound.iter().map(binds).collect();
                scan.settled = columns
                    .and_then(|columns| columns.into_iter().max())
                    .unwrap_or(0);
                unbound.retain(|v| binds(v).is_none());
            }
            Op::Assign { variable, .. } | Op::Equate { variable, .. } => {
                unbound.retain(|v| v != variable)
            }
            _ => {}
        }
    }
    let mut read = outputs.to_vec();
    // With a slot for the known value of each equality.
    read.resize(rule.variables.len() + rule.body.len(), false);
    for op in ops.iter_mut().rev() {
        let mut used = Vec::new();
        match op {
            Op::Scan(Scan {
                key, columns, once, ..
            }) => {
                *once = columns
                    .iter()
                    .all(|(_, column)| matches!(column, Column::Bind(v) if !read[*v]));
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
            Op::Assign { value, .. } | Op::Equate { value, .. } | Op::Test { value } => {
                value.variables(&mut used)
            }
            Op::Compare { left, right, .. } => {
                left.variables(&mut used);
                right.variables(&mut used);
            }
        }
        used.into_iter().for_each(|v| read[v] = true);
    }
}

/// Finds the checks directly after a scan that fix the value it binds: `e(?y, ?z), e(?x, ?z)` with
/// `?x` and `?y` bound.
pub(crate) fn add_rivals(ops: &mut [Op], indexes: &mut Indexes, add: bool) {
    for at in 0..ops.len() {
        let (before, after) = ops.split_at_mut(at + 1);
        let Op::Scan(scan) = &mut before[at] else {
            continue;
        };
        let [(offset, Column::Bind(value))] = scan.columns.as_slice() else {
            continue;
        };
        if *offset != scan.key.len() || scan.keyed.is_some() {
            continue;
        }
        let mut later = Vec::new();
        for (place, op) in after.iter_mut().enumerate() {
            let check = match op {
                Op::Scan(check) if check.keyed.is_none() => check,
                Op::Scan(_) => break,
                Op::Equate { variable, .. } => {
                    later.push(Operand::Variable(*variable));
                    continue;
                }
                _ => continue,
            };
            if check.key.iter().any(|operand| later.contains(operand)) {
                break;
            }
            if !check.columns.is_empty() || !check.key.contains(&Operand::Variable(*value)) {
                break;
            }
            let order = &indexes.of(check.predicate)[check.index];
            let (last, prefix): (Vec<_>, Vec<_>) = check
                .key
                .iter()
                .copied()
                .zip(order.clone())
                .partition(|(o, _)| *o == Operand::Variable(*value));
            let [(_, column)] = last.as_slice() else {
                continue;
            };
            // All rows of the check are rarely fewer than those of the scan.
            if prefix.is_empty() {
                continue;
            }
            let columns: Vec<usize> = prefix.iter().map(|(_, column)| *column).collect();
            let Some(index) = indexes.followed_by(check.predicate, &columns, *column, add) else {
                continue;
            };
            let order = &indexes.of(check.predicate)[index];
            let by_column = |column: &usize| {
                prefix
                    .iter()
                    .find(|(_, c)| c == column)
                    .map(|(operand, _)| *operand)
            };
            let key: Vec<Operand> = order[..columns.len()]
                .iter()
                .filter_map(by_column)
                .collect();
            check.key = key
                .iter()
                .copied()
                .chain([Operand::Variable(*value)])
                .collect();
            check.index = index;
            scan.rivals.push(Rival {
                at: at + 1 + place,
                key,
            });
        }
    }
}

pub(crate) fn operand_variables(args: &[Operand]) -> Vec<Variable> {
    args.iter()
        .filter_map(|arg| match arg {
            Operand::Variable(v) => Some(*v),
            _ => None,
        })
        .collect()
}
