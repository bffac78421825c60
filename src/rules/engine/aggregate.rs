//! Aggregation: groups the matches of a body into rows of the head.

use std::collections::{BTreeMap, BTreeSet};

use crate::builtins;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::operand_value;
use crate::model::expression::Variable;
use crate::model::program::{AggregateKind, Aggregation, Operand, Rule};
use crate::model::universe::Universe;
use crate::model::values::{Number, double_term, is_beyond_64_bits};
use actcheck_base::{Term, TermId};

/// Returns the operands that an aggregation reads: the group, then each aggregate's input and distinct variables.
pub(crate) fn projection(aggregation: &Aggregation) -> Vec<Operand> {
    let inputs = aggregation.aggregates.iter().flat_map(|a| std::iter::once(&a.input).chain(&a.distinct));
    aggregation.group.iter().chain(inputs).map(|variable| Operand::Variable(*variable)).collect()
}

/// Returns the head rows of an aggregating rule. `matches`: rows of the projection.
pub(crate) fn aggregate(
    rule: &Rule,
    aggregation: &Aggregation,
    matches: &[TermId],
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<Vec<TermId>, Stop> {
    let width = projection(aggregation).len();
    let keys = aggregation.group.len();
    let mut groups: BTreeMap<&[TermId], Vec<&[TermId]>> = BTreeMap::new();
    for row in matches.chunks_exact(width.max(1)) {
        meter.step()?;
        groups.entry(&row[..keys]).or_default().push(&row[keys..]);
    }
    let mut out = Vec::new();
    let mut binding = vec![0; rule.variables.len()];
    for (key, rows) in groups {
        meter.step()?;
        bind(&mut binding, &aggregation.group, key);
        if fill(aggregation, &rows, &mut binding, universe).is_some() {
            out.extend(rule.head.args.iter().map(|arg| operand_value(*arg, &binding)));
        }
    }
    Ok(out)
}

fn bind(binding: &mut [TermId], variables: &[Variable], values: &[TermId]) {
    for (variable, value) in variables.iter().zip(values) {
        binding[*variable] = *value;
    }
}

/// Computes the aggregates of a group and the variables that depend on them. Returns `None` if one has no value.
fn fill(
    aggregation: &Aggregation,
    rows: &[&[TermId]],
    binding: &mut [TermId],
    universe: &mut Universe<'_>,
) -> Option<()> {
    let mut start = 0;
    for part in &aggregation.aggregates {
        let end = start + 1 + part.distinct.len();
        let distinct: BTreeSet<&[TermId]> = rows.iter().map(|row| &row[start..end]).collect();
        let inputs = distinct.iter().map(|row| universe.term(row[0]));
        // Integers beyond 64 bits can't be computed with, and must not be skipped like non-numbers.
        if part.kind != AggregateKind::Count && inputs.clone().any(is_beyond_64_bits) {
            return None;
        }
        let value = combine(part.kind, inputs)?;
        binding[part.output] = universe.intern(value);
        start = end;
    }
    for (variable, value) in &aggregation.after {
        let value = value.value(binding, universe)?.into_owned();
        binding[*variable] = universe.intern(value);
    }
    Some(())
}

/// Computes the value of an aggregate. Returns `None` if it needs numbers and no input is one.
fn combine<'a>(kind: AggregateKind, inputs: impl Iterator<Item = &'a Term>) -> Option<Term> {
    match kind {
        AggregateKind::Count => Some(Term::Integer(i64::try_from(inputs.count()).ok()?)),
        AggregateKind::Min => extreme(inputs, std::cmp::Ordering::is_lt),
        AggregateKind::Max => extreme(inputs, std::cmp::Ordering::is_gt),
        AggregateKind::Sum => sum(inputs),
    }
}

fn extreme<'a>(inputs: impl Iterator<Item = &'a Term>, better: fn(std::cmp::Ordering) -> bool) -> Option<Term> {
    let mut best: Option<&Term> = None;
    for term in inputs.filter(|term| Number::of(term).is_some()) {
        if best.is_none_or(|best| builtins::compare(term, best).is_some_and(better)) {
            best = Some(term);
        }
    }
    best.cloned()
}

/// Sums numbers: the result is an integer if all are integers, otherwise a double. Doubles are added in sorted order,
/// so that the sum does not depend on the order of the tuples. Returns `None` if there are no numbers or the sum
/// overflows.
fn sum<'a>(inputs: impl Iterator<Item = &'a Term>) -> Option<Term> {
    let (mut whole, mut parts, mut any) = (0i64, Vec::new(), false);
    for term in inputs {
        match Number::of(term) {
            Some(Number::Integer(value)) => whole = whole.checked_add(value)?,
            Some(number) => parts.push(number.double()),
            None => continue,
        }
        any = true;
    }
    if parts.is_empty() {
        return any.then_some(Term::Integer(whole));
    }
    parts.sort_by(f64::total_cmp);
    let total = parts.iter().sum::<f64>() + whole as f64;
    total.is_finite().then(|| double_term(total))
}
