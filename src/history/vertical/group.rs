//! Aggregates over counted rows.

use std::collections::BTreeSet;

use oxigraph::model::{Literal, Variable};
use spargebra::algebra::{AggregateExpression, AggregateFunction, Expression, GraphPattern};

use crate::vertical::need::{Asked, Mode, Need, Rewritten};
use crate::vertical::reduce::Kind;
use crate::vertical::rewrite::Rewriter;
use crate::vertical::stop::{Stop, unfit};
use crate::vertical::walk::used;

impl Rewriter<'_> {
    pub(super) fn group(
        &mut self,
        inner: GraphPattern,
        variables: Vec<Variable>,
        aggregates: Vec<(Variable, AggregateExpression)>,
    ) -> Result<Rewritten, Stop> {
        let needs_rows = |aggregate: &AggregateExpression| {
            let AggregateExpression::FunctionCall { name, distinct: false, .. } = aggregate else { return false };
            matches!(name, AggregateFunction::GroupConcat { .. } | AggregateFunction::Custom(_))
        };
        let mode = match aggregates.iter().any(|(_, aggregate)| needs_rows(aggregate)) {
            true => Mode::Bag,
            false => Mode::Counted,
        };
        let mut need = Need::of(variables.iter().cloned().collect::<BTreeSet<_>>(), mode);
        for (id, (_, aggregate)) in aggregates.iter().enumerate() {
            match aggregate {
                AggregateExpression::CountSolutions { distinct: false } => {}
                AggregateExpression::CountSolutions { distinct: true } => return unfit("`COUNT(DISTINCT *)`"),
                AggregateExpression::FunctionCall { name, expr, distinct } => {
                    let kind = match name {
                        _ if *distinct || mode == Mode::Bag => None,
                        AggregateFunction::Count => Some(Kind::Count),
                        AggregateFunction::Sum | AggregateFunction::Avg => Some(Kind::Sum),
                        AggregateFunction::Min => Some(Kind::Least),
                        AggregateFunction::Max => Some(Kind::Greatest),
                        _ => None,
                    };
                    match kind {
                        Some(kind) => need.asked.push(Asked { id, kind, expression: expr.clone() }),
                        None => need.exact.extend(used(expr)),
                    }
                }
            }
        }
        let inner = self.rewrite(inner, &need)?;
        let (mut all, mut means) = (Vec::new(), Vec::new());
        for (id, (variable, aggregate)) in aggregates.into_iter().enumerate() {
            let AggregateExpression::FunctionCall { name: AggregateFunction::Avg, distinct: false, .. } = &aggregate
            else {
                all.push((variable, counted(id, aggregate, &inner)));
                continue;
            };
            if inner.counts.is_empty() && inner.taken.is_empty() {
                all.push((variable, aggregate));
                continue;
            }
            // A mean is a sum divided by the number of rows.
            let (total, number) = (self.fresh(), self.fresh());
            all.push((total.clone(), counted(id, aggregate, &inner)));
            let rows = AggregateExpression::CountSolutions { distinct: false };
            all.push((number.clone(), counted(usize::MAX, rows, &inner)));
            means.push((variable, total, number));
        }
        let mut pattern = GraphPattern::Group { inner: Box::new(inner.pattern.clone()), variables, aggregates: all };
        for (variable, total, number) in means {
            let [total, number] = [total, number].map(Expression::Variable);
            let zero = || Box::new(Expression::Literal(Literal::from(0)));
            let expression = Expression::If(
                Box::new(Expression::Equal(Box::new(number.clone()), zero())),
                zero(),
                Box::new(Expression::Divide(Box::new(total), Box::new(number))),
            );
            pattern = GraphPattern::Extend { inner: Box::new(pattern), variable, expression };
        }
        Ok(Rewritten::plain(pattern))
    }
}

/// The number of equal rows of the tables, except of one.
fn number(inner: &Rewritten, except: Option<&Variable>) -> Option<Expression> {
    let one = || Expression::Literal(Literal::from(1));
    let counts = inner.counts.iter().filter(|count| Some(*count) != except);
    let counts = counts.map(|count| Expression::Coalesce(vec![Expression::Variable(count.clone()), one()]));
    counts.reduce(|one, other| Expression::Multiply(Box::new(one), Box::new(other)))
}

fn times(expression: Expression, number: Option<Expression>) -> Expression {
    match number {
        Some(number) => Expression::Multiply(Box::new(expression), Box::new(number)),
        None => expression,
    }
}

/// An aggregate of counted rows. A mean becomes its sum.
fn counted(id: usize, aggregate: AggregateExpression, inner: &Rewritten) -> AggregateExpression {
    let zero = || Expression::Literal(Literal::from(0));
    let sum = |expr| AggregateExpression::FunctionCall { name: AggregateFunction::Sum, expr, distinct: false };
    match aggregate {
        AggregateExpression::CountSolutions { distinct: false } => match number(inner, None) {
            Some(number) => sum(number),
            None => aggregate,
        },
        AggregateExpression::FunctionCall { name, expr, distinct: false } => {
            let taken = inner.taken.get(&id);
            let value = match taken {
                Some(taken) => Expression::Variable(taken.result.clone()),
                None => expr,
            };
            let others = number(inner, taken.and_then(|taken| taken.own.as_ref()));
            match (&name, taken) {
                (AggregateFunction::Count, Some(_)) => sum(Expression::Coalesce(vec![times(value, others), zero()])),
                (AggregateFunction::Count, None) => match others {
                    Some(others) => {
                        // An error if there is no value.
                        let is_there = Expression::SameTerm(Box::new(value.clone()), Box::new(value));
                        let once = Expression::If(Box::new(is_there), Box::new(others), Box::new(zero()));
                        sum(Expression::Coalesce(vec![once, zero()]))
                    }
                    None => AggregateExpression::FunctionCall { name, expr: value, distinct: false },
                },
                (AggregateFunction::Sum | AggregateFunction::Avg, _) => sum(times(value, others)),
                _ => AggregateExpression::FunctionCall { name, expr: value, distinct: false },
            }
        }
        other => other,
    }
}
