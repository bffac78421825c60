//! Aggregation: groups the matches of a body into rows of the head.

use crate::builtins;
use crate::engine::meter::{Meter, Stop, Watch};
use crate::engine::plan::operand_value;
use crate::model::program::{AggregateKind, Aggregation, Operand, Rule};
use crate::model::universe::Universe;
use crate::model::values::{Number, double_term, is_beyond_64_bits};
use actcheck_base::{Term, TermId};

/// Returns the operands that an aggregation reads: the group, then each aggregate's input and distinct variables.
pub(crate) fn projection(aggregation: &Aggregation) -> Vec<Operand> {
    let inputs = aggregation.aggregates.iter().flat_map(|a| std::iter::once(&a.input).chain(&a.distinct));
    aggregation.group.iter().chain(inputs).map(|variable| Operand::Variable(*variable)).collect()
}

/// Gives ids to computed values.
pub(crate) trait Ids<'t> {
    /// Returns the terms.
    fn universe(&self) -> &Universe<'t>;
    /// Returns the id of a value, or `None` if it has none.
    fn id_of(&mut self, term: Term, watch: &Watch) -> Option<TermId>;
}

impl<'t> Ids<'t> for Universe<'t> {
    fn universe(&self) -> &Universe<'t> {
        self
    }

    /// Adds the value if it is new. Returns `None` if the memory budget is spent.
    fn id_of(&mut self, term: Term, watch: &Watch) -> Option<TermId> {
        self.create(term, watch).ok()
    }
}

/// Terms to which no value is added.
pub(crate) struct Known<'u, 't>(pub(crate) &'u Universe<'t>);

impl<'t> Ids<'t> for Known<'_, 't> {
    fn universe(&self) -> &Universe<'t> {
        self.0
    }

    fn id_of(&mut self, term: Term, _: &Watch) -> Option<TermId> {
        self.0.id(&term)
    }
}

/// Returns the head rows of an aggregating rule. `matches`: rows of the projection, sorted and distinct.
pub(crate) fn aggregate(
    rule: &Rule,
    aggregation: &Aggregation,
    matches: &[TermId],
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<Vec<TermId>, Stop> {
    let width = projection(aggregation).len().max(1);
    let keys = aggregation.group.len();
    let rows: Vec<&[TermId]> = matches.chunks_exact(width).collect();
    let mut out = Vec::new();
    for group in rows.chunk_by(|a, b| a[..keys] == b[..keys]) {
        for _ in group {
            meter.step()?;
        }
        match group_head(rule, aggregation, group, universe, &meter.watch) {
            Some(head) => out.extend(head),
            None => meter.watch.stopped()?,
        }
    }
    Ok(out)
}

/// Returns the head row of one group, which consists of rows of the projection. Returns `None` if the group is empty, if
/// an aggregate has no value, or if the budget is spent.
pub(crate) fn group_head<'t>(
    rule: &Rule,
    aggregation: &Aggregation,
    group: &[&[TermId]],
    ids: &mut impl Ids<'t>,
    watch: &Watch,
) -> Option<Vec<TermId>> {
    let mut binding = vec![0; rule.variables.len()];
    for (variable, value) in aggregation.group.iter().zip(*group.first()?) {
        binding[*variable] = *value;
    }
    let mut start = aggregation.group.len();
    for part in &aggregation.aggregates {
        let end = start + 1 + part.distinct.len();
        watch.work(group.len() * size_of::<TermId>())?;
        let mut distinct: Vec<&[TermId]> = group.iter().map(|row| &row[start..end]).collect();
        distinct.sort_unstable();
        distinct.dedup();
        let inputs = distinct.iter().map(|row| ids.universe().term(row[0]));
        // Integers beyond 64 bits can't be computed with, and must not be skipped like non-numbers.
        if part.kind != AggregateKind::Count && inputs.clone().any(is_beyond_64_bits) {
            return None;
        }
        let value = combine(part.kind, inputs)?;
        binding[part.output] = ids.id_of(value, watch)?;
        start = end;
    }
    for (variable, value) in &aggregation.after {
        watch.begin();
        let value = value.value(&binding, ids.universe(), watch)?.into_owned();
        binding[*variable] = ids.id_of(value, watch)?;
    }
    Some(rule.head.args.iter().map(|arg| operand_value(*arg, &binding)).collect())
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
