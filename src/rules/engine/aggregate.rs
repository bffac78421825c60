//! Aggregation: groups the matches of a body into rows of the head.

use std::cmp::Ordering;

use crate::builtins;
use crate::engine::meter::{Meter, Stop, Watch};
use crate::engine::plan::operand_value;
use crate::model::program::{AggregateKind, Aggregation, Operand, Rule};
use crate::model::universe::Universe;
use crate::model::values::{Number, decimal, double_term, is_beyond_64_bits, lexical};
use actcheck_base::{Term, TermId};

/// Returns the operands that an aggregation reads: the group, then each aggregate's input and
/// distinct variables.
pub(crate) fn projection(aggregation: &Aggregation) -> Vec<Operand> {
    let inputs = aggregation
        .aggregates
        .iter()
        .flat_map(|a| std::iter::once(&a.input).chain(&a.distinct));
    aggregation
        .group
        .iter()
        .chain(inputs)
        .map(|variable| Operand::Variable(*variable))
        .collect()
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

/// Returns the head rows of an aggregating rule. `matches`: rows of the projection, sorted and
/// distinct.
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

/// Returns the head row of one group, which consists of rows of the projection. Returns `None` if
/// the group is empty, if an aggregate has no value, or if the budget is spent.
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
        let value = combine(part.kind, inputs, watch)?;
        binding[part.output] = ids.id_of(value, watch)?;
        start = end;
    }
    for (variable, value) in &aggregation.after {
        watch.begin();
        let value = value.value(&binding, ids.universe(), watch)?.into_owned();
        binding[*variable] = ids.id_of(value, watch)?;
    }
    Some(
        rule.head
            .args
            .iter()
            .map(|arg| operand_value(*arg, &binding))
            .collect(),
    )
}

/// Computes the value of an aggregate, which does not depend on the order of the inputs. Returns
/// `None` if it needs numbers and no input is one, or if the evaluation must stop.
fn combine<'a>(
    kind: AggregateKind,
    inputs: impl Iterator<Item = &'a Term>,
    watch: &Watch,
) -> Option<Term> {
    match kind {
        AggregateKind::Count => Some(Term::Integer(i64::try_from(inputs.count()).ok()?)),
        AggregateKind::Min => numbers(inputs).min_by(by_size).cloned(),
        AggregateKind::Max => numbers(inputs).max_by(by_size).cloned(),
        AggregateKind::Sum => sum(inputs, watch),
    }
}

/// Returns the inputs that can be ordered by size.
fn numbers<'a>(inputs: impl Iterator<Item = &'a Term>) -> impl Iterator<Item = &'a Term> {
    inputs.filter(|term| Number::of(term).is_some_and(|number| !number.double().is_nan()))
}

/// Compares two numbers by their exact values, and equal values by their types.
fn by_size(a: &&Term, b: &&Term) -> Ordering {
    exactly(a, b).then_with(|| a.cmp(b))
}

/// Compares the exact values of two numbers.
fn exactly(a: &Term, b: &Term) -> Ordering {
    match (a, b) {
        (Term::Integer(a), Term::Integer(b)) => a.cmp(b),
        // Rounding keeps the order, so that only equal doubles need all digits.
        _ => builtins::compare(a, b)
            .filter(|order| order.is_ne())
            .unwrap_or_else(|| by_digits(&digits(a), &digits(b))),
    }
}

/// Returns all decimal digits of a number. An infinite one has none: it is equal to itself only.
fn digits(number: &Term) -> String {
    let text = match Number::of(number) {
        Some(Number::Integer(value)) => value.to_string(),
        _ if matches!(number, Term::Decimal(_)) => lexical(number),
        // The smallest double has 1074 decimal places.
        Some(number) => format!("{:.1074}", number.double()),
        None => String::new(),
    };
    decimal(&text).unwrap_or_default()
}

/// Compares two canonical decimals.
fn by_digits(a: &str, b: &str) -> Ordering {
    match (a.strip_prefix('-'), b.strip_prefix('-')) {
        (Some(a), Some(b)) => by_digits(b, a),
        (Some(_), None) => Ordering::Less,
        (None, Some(_)) => Ordering::Greater,
        (None, None) => {
            let parts = |text| -> (usize, &str, &str) {
                let (whole, fraction) = str::split_once(text, '.').unwrap_or((text, ""));
                (whole.len(), whole, fraction)
            };
            parts(a).cmp(&parts(b))
        }
    }
}

/// Doubles whose sum is beyond the largest double are scaled by this, and summed again.
const SCALE: f64 = 1.0 / (1u64 << 40) as f64;

/// Sums numbers: the result is an integer if all are integers, otherwise a double. Integers are
/// summed exactly, and doubles in sorted order. Returns `None` if there are no numbers, or if one
/// is not finite. A sum that its type can't hold stops the evaluation.
fn sum<'a>(inputs: impl Iterator<Item = &'a Term>, watch: &Watch) -> Option<Term> {
    let (mut whole, mut parts, mut any) = (0i128, Vec::new(), false);
    for term in inputs {
        match Number::of(term) {
            Some(Number::Integer(value)) => whole += i128::from(value),
            Some(number) => parts.push(number.double()),
            None => continue,
        }
        any = true;
    }
    if !any || parts.iter().any(|part| !part.is_finite()) {
        return None;
    }
    if parts.is_empty() {
        let sum = i64::try_from(whole).map(Term::Integer);
        return sum
            .inspect_err(|_| watch.no_value(format!("the sum {whole} does not fit in 64 bits")))
            .ok();
    }
    parts.sort_by(f64::total_cmp);
    let mut total = parts.iter().sum::<f64>() + whole as f64;
    if !total.is_finite() {
        total = (parts.iter().map(|part| part * SCALE).sum::<f64>() + whole as f64 * SCALE) / SCALE;
    }
    if !total.is_finite() {
        watch.no_value("the sum is beyond the largest double".to_owned());
        return None;
    }
    Some(double_term(total))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::budget::Budget;
    use crate::model::values::literal;
    use actcheck_base::names;

    /// The value of an aggregate over all orders of its inputs.
    fn of(kind: AggregateKind, inputs: &[Term]) -> Result<Option<Term>, Stop> {
        let mut orders: Vec<Vec<&Term>> = vec![Vec::new()];
        for term in inputs {
            let mut longer = Vec::new();
            for order in &orders {
                longer.extend(
                    (0..=order.len()).map(|at| [&order[..at], &[term], &order[at..]].concat()),
                );
            }
            orders = longer;
        }
        let value = |order: Vec<&Term>| {
            let watch = Watch::new(&Budget::default());
            let value = combine(kind, order.into_iter(), &watch);
            watch.stopped().map(|()| value)
        };
        let mut values = orders.into_iter().map(value);
        let first = values.next().expect("there is one order at least");
        assert!(
            values.all(|value| value == first),
            "{kind:?} of {inputs:?} depends on the order"
        );
        first
    }

    #[test]
    fn aggregates_do_not_depend_on_the_order_of_their_inputs() {
        use AggregateKind::{Max, Min, Sum};
        let decimal = |text| literal(text, &format!("{}decimal", names::XSD));
        let (int, double) = (Term::Integer, Term::Double);
        let huge = i64::MAX;
        for (kind, inputs, value) in [
            (Sum, vec![int(huge), int(1), int(-2)], Some(int(huge - 1))),
            (
                Sum,
                vec![int(i64::MIN), int(-1), int(5), int(huge)],
                Some(int(3)),
            ),
            (
                Sum,
                vec![double(1.7e308), double(1.6e308), double(-1.7e308)],
                Some(double(1.6e308)),
            ),
            (
                Sum,
                vec![double(0.5), double(1e15), int(3), double(-1e15)],
                Some(double(3.5)),
            ),
            (Sum, vec![double(f64::INFINITY), int(1)], None),
            (Sum, vec![double(f64::NAN), int(1)], None),
            (Sum, vec![Term::string("a")], None),
            (
                Min,
                vec![int(1), double(1.0), decimal("1.5"), Term::string("a")],
                Some(int(1)),
            ),
            (
                Max,
                vec![int(1), double(1.0), double(f64::NAN)],
                Some(double(1.0)),
            ),
            (
                Max,
                vec![int(huge), double(9.3e18), int(huge - 1)],
                Some(double(9.3e18)),
            ),
            (
                Max,
                vec![int(huge), double(9.223372036854775e18), int(huge - 1)],
                Some(int(huge)),
            ),
            (
                Max,
                vec![int(huge), double(9_223_372_036_854_775_808.0)],
                Some(double(9_223_372_036_854_775_808.0)),
            ),
            (
                Min,
                vec![
                    decimal("0.1"),
                    double(0.1),
                    decimal("0.10000000000000000001"),
                ],
                Some(decimal("0.1")),
            ),
            (
                Max,
                vec![
                    decimal("0.1"),
                    double(0.1),
                    decimal("0.10000000000000000001"),
                ],
                Some(double(0.1)),
            ),
            (
                Min,
                vec![decimal("-0.5"), decimal("-0.50000000000000000001")],
                Some(decimal("-0.50000000000000000001")),
            ),
            (
                Max,
                vec![double(f64::INFINITY), int(1)],
                Some(double(f64::INFINITY)),
            ),
        ] {
            assert_eq!(of(kind, &inputs), Ok(value), "{kind:?} of {inputs:?}");
        }
    }

    #[test]
    fn a_sum_that_does_not_fit_stops_the_evaluation() {
        for inputs in [
            [Term::Integer(i64::MAX), Term::Integer(1)],
            [Term::Double(1.7e308), Term::Double(1.6e308)],
        ] {
            assert_eq!(
                of(AggregateKind::Sum, &inputs),
                Err(Stop::Value),
                "{inputs:?}"
            );
        }
    }
}
