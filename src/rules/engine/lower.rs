//! Turns an order of a rule's atoms into steps.

use crate::engine::plan::{Column, Indexes, Op, Part, Parts, Rival, Scan};
use crate::model::expression::Variable;
use crate::model::program::{Atom, Literal, Operand, Rule};

/// Returns which variables the head or its aggregates read.
pub(crate) fn outputs(rule: &Rule) -> Vec<bool> {
    let mut read = vec![false; rule.variables.len()];
    match &rule.aggregation {
        // One match of the other variables is enough for aggregates too, because they use distinct values.
        Some(aggregation) => {
            let inputs = aggregation.aggregates.iter().flat_map(|a| a.distinct.iter().chain([&a.input]));
            aggregation.group.iter().chain(inputs).for_each(|v| read[*v] = true);
        }
        None => operand_variables(&rule.head.args).into_iter().for_each(|v| read[v] = true),
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

/// Splits the conditions into groups without common variables, in the order of their first conditions.
pub(crate) fn groups(rule: &Rule) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Vec<usize>, Vec<Variable>)> = Vec::new();
    for (idx, literal) in rule.body.iter().enumerate() {
        let (mut members, mut variables) = (Vec::new(), literal_variables(literal));
        let (joined, others): (Vec<_>, Vec<_>) =
            groups.into_iter().partition(|(_, known)| known.iter().any(|v| variables.contains(v)));
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

/// Turns an order of atoms into steps, with each test as early as possible.
pub(crate) fn lower(rule: &Rule, group: &[usize], atoms: &[usize], parts: &Parts, indexes: &mut Indexes) -> Vec<Op> {
    let mut bound = vec![false; rule.variables.len()];
    let mut tests: Vec<usize> =
        group.iter().copied().filter(|idx| !matches!(rule.body[*idx], Literal::Positive(_))).collect();
    let mut ops = Vec::new();
    let mut atoms = atoms.iter().copied();
    // With a delta, its rows come before tests without variables.
    let mut next = parts.delta.filter(|delta| group.contains(delta)).and_then(|_| atoms.next());
    loop {
        let ready = |idx: &usize| rule.body[*idx].needs().iter().all(|v| bound[*v]);
        let chosen = next.take().or_else(|| tests.iter().copied().find(ready)).or_else(|| atoms.next());
        let Some(chosen) = chosen.or_else(|| tests.first().copied()) else { return ops };
        tests.retain(|idx| *idx != chosen);
        ops.push(step(&rule.body[chosen], parts.of(chosen), &mut bound, indexes));
    }
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
    Op::Scan(Scan {
        predicate: atom.predicate,
        part,
        index,
        key,
        columns,
        once: false,
        exists: false,
        settled: 0,
        rivals: Vec::new(),
    })
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
                scan.settled = columns.and_then(|columns| columns.into_iter().max()).unwrap_or(0);
                unbound.retain(|v| binds(v).is_none());
            }
            Op::Assign { variable, .. } => unbound.retain(|v| v != variable),
            _ => {}
        }
    }
    let mut read = outputs.to_vec();
    read.resize(rule.variables.len(), false);
    for op in ops.iter_mut().rev() {
        let mut used = Vec::new();
        match op {
            Op::Scan(Scan { key, columns, once, .. }) => {
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

/// Finds the checks directly after a scan that fix the value it binds: `e(?y, ?z), e(?x, ?z)` with `?x` and `?y` bound.
pub(crate) fn add_rivals(ops: &mut [Op], indexes: &mut Indexes, add: bool) {
    for at in 0..ops.len() {
        let (before, after) = ops.split_at_mut(at + 1);
        let Op::Scan(scan) = &mut before[at] else { continue };
        let [(offset, Column::Bind(value))] = scan.columns.as_slice() else { continue };
        if *offset != scan.key.len() {
            continue;
        }
        for (place, op) in after.iter_mut().enumerate() {
            let Op::Scan(check) = op else { continue };
            if !check.columns.is_empty() || !check.key.contains(&Operand::Variable(*value)) {
                break;
            }
            let order = &indexes.of(check.predicate)[check.index];
            let (last, prefix): (Vec<_>, Vec<_>) =
                check.key.iter().copied().zip(order.clone()).partition(|(o, _)| *o == Operand::Variable(*value));
            let [(_, column)] = last.as_slice() else { continue };
            // All rows of the check are rarely fewer than those of the scan.
            if prefix.is_empty() {
                continue;
            }
            let columns: Vec<usize> = prefix.iter().map(|(_, column)| *column).collect();
            let Some(index) = indexes.followed_by(check.predicate, &columns, *column, add) else { continue };
            let order = &indexes.of(check.predicate)[index];
            let by_column = |column: &usize| prefix.iter().find(|(_, c)| c == column).map(|(operand, _)| *operand);
            let key: Vec<Operand> = order[..columns.len()].iter().filter_map(by_column).collect();
            check.key = key.iter().copied().chain([Operand::Variable(*value)]).collect();
            check.index = index;
            scan.rivals.push(Rival { at: at + 1 + place, key });
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
