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
        let has = |is: fn(&AggregateFunction) -> bool| {
            aggregates.iter().any(|(_, aggregate)| match aggregate {
                AggregateExpression::FunctionCall {
                    name,
                    distinct: false,
                    ..
                } => is(name),
                _ => false,
            })
        };
        if has(|name| matches!(name, AggregateFunction::Custom(_))) {
            return self
                .grouped(inner, variables, aggregates, Mode::Bag)
                .map(|(grouped, _)| grouped);
        }
        if !has(|name| matches!(name, AggregateFunction::GroupConcat { .. })) {
            return self
                .grouped(inner, variables, aggregates, Mode::Counted)
                .map(|(grouped, _)| grouped);
        }
        // Lists of texts can't be repeated by a number: if they are not made by one table, the rows
        // are needed.
        match self.grouped(
            inner.clone(),
            variables.clone(),
            aggregates.clone(),
            Mode::Counted,
        )? {
            (grouped, true) => Ok(grouped),
            (_, false) => self
                .grouped(inner, variables, aggregates, Mode::Bag)
                .map(|(grouped, _)| grouped),
        }
    }

    /// The group, and whether lists of texts are right.
    fn grouped(
        &mut self,
        inner: GraphPattern,
        variables: Vec<Variable>,
        aggregates: Vec<(Variable, AggregateExpression)>,
        mode: Mode,
    ) -> Result<(Rewritten, bool), Stop> {
        let mut need = Need::of(variables.iter().cloned().collect::<BTreeSet<_>>(), mode);
        for (id, (_, aggregate)) in aggregates.iter().enumerate() {
            match aggregate {
                AggregateExpression::CountSolutions { distinct: false } => {}
                AggregateExpression::CountSolutions { distinct: true } => {
                    return unfit("`COUNT(DISTINCT *)`");
                }
                AggregateExpression::FunctionCall {
                    name,
                    expr,
                    distinct,
                } => {
                    let kind = match name {
                        _ if *distinct || mode == Mode::Bag => None,
                        AggregateFunction::Count => Some(Kind::Count),
                        AggregateFunction::Sum | AggregateFunction::Avg => Some(Kind::Sum),
                        AggregateFunction::Min => Some(Kind::Least),
                        AggregateFunction::Max => Some(Kind::Greatest),
                        AggregateFunction::GroupConcat { separator } => {
                            Some(Kind::Joined(separator.as_deref().unwrap_or(" ").into()))
                        }
                        _ => None,
                    };
                    match kind {
                        Some(kind) => {
                            let expression = if kind == Kind::Count {
                                if_bound(expr)
                            } else {
                                expr.clone()
                            };
                            need.asked.push(Asked {
                                id,
                                kind,
                                expression,
                            });
                        }
                        None => need.exact.extend(used(expr)),
                    }
                }
            }
        }
        let inner = self.rewrite(inner, &need)?;
        let is_right = aggregates
            .iter()
            .enumerate()
            .all(|(id, (_, aggregate))| match aggregate {
                AggregateExpression::FunctionCall {
                    name: AggregateFunction::GroupConcat { .. },
                    distinct: false,
                    ..
                } => {
                    let own = inner.taken.get(&id).and_then(|taken| taken.own.as_ref());
                    mode == Mode::Bag
                        || inner.taken.contains_key(&id) && number(&inner, own).is_none()
                }
                _ => true,
            });
        if let Some(rows) = alone(&inner, &variables, &aggregates) {
            return Ok((Rewritten::plain(rows), true));
        }
        let (mut all, mut means) = (Vec::new(), Vec::new());
        for (id, (variable, aggregate)) in aggregates.into_iter().enumerate() {
            let AggregateExpression::FunctionCall {
                name: AggregateFunction::Avg,
                distinct: false,
                ..
            } = &aggregate
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
        let mut pattern = GraphPattern::Group {
            inner: Box::new(inner.pattern.clone()),
            variables,
            aggregates: all,
        };
        for (variable, total, number) in means {
            let [total, number] = [total, number].map(Expression::Variable);
            let zero = || Box::new(Expression::Literal(Literal::from(0)));
            let expression = Expression::If(
                Box::new(Expression::Equal(Box::new(number.clone()), zero())),
                zero(),
                Box::new(Expression::Divide(Box::new(total), Box::new(number))),
            );
            pattern = GraphPattern::Extend {
                inner: Box::new(pattern),
                variable,
                expression,
            };
        }
        Ok((Rewritten::plain(pattern), is_right))
    }
}

/// A value if a variable has one, even if it is a blank node, whose value no table has. Other
/// expressions stay as they are.
fn if_bound(expression: &Expression) -> Expression {
    let Expression::Variable(variable) = expression else {
        return expression.clone();
    };
    let one = Expression::Literal(Literal::from(1));
    Expression::If(
        Box::new(Expression::Bound(variable.clone())),
        Box::new(one),
        Box::new(expression.clone()),
    )
}

/// The groups, if each has one row and that has its aggregates: grouping half a million rows takes
/// seconds.
fn alone(
    inner: &Rewritten,
    variables: &[Variable],
    aggregates: &[(Variable, AggregateExpression)],
) -> Option<GraphPattern> {
    let is_apart =
        |distinct: &Vec<Variable>| distinct.iter().all(|variable| variables.contains(variable));
    // Without variables, no rows are one group, too.
    if variables.is_empty() || !inner.distinct.as_ref().is_some_and(is_apart) {
        return None;
    }
    let mut pattern = inner.pattern.clone();
    for (id, (variable, aggregate)) in aggregates.iter().enumerate() {
        let expression = match aggregate {
            AggregateExpression::CountSolutions { distinct: false } => number(inner, None)?,
            AggregateExpression::FunctionCall {
                name,
                distinct: false,
                ..
            } => {
                let taken = inner.taken.get(&id)?;
                let result = Expression::Variable(taken.result.clone());
                if number(inner, taken.own.as_ref()).is_some() {
                    return None;
                }
                match name {
                    AggregateFunction::Avg => {
                        Expression::Divide(Box::new(result), Box::new(number(inner, None)?))
                    }
                    _ => result,
                }
            }
            _ => return None,
        };
        pattern = GraphPattern::Extend {
            inner: Box::new(pattern),
            variable: variable.clone(),
            expression,
        };
    }
    let results = aggregates.iter().map(|(variable, _)| variable);
    let variables = variables.iter().chain(results).cloned().collect();
    Some(GraphPattern::Project {
        inner: Box::new(pattern),
        variables,
    })
}

/// The number of equal rows of the tables, except of one.
fn number(inner: &Rewritten, except: Option<&Variable>) -> Option<Expression> {
    let one = || Expression::Literal(Literal::from(1));
    let counts = inner.counts.iter().filter(|count| Some(*count) != except);
    let counts =
        counts.map(|count| Expression::Coalesce(vec![Expression::Variable(count.clone()), one()]));
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
    let sum = |expr| AggregateExpression::FunctionCall {
        name: AggregateFunction::Sum,
        expr,
        distinct: false,
    };
    match aggregate {
        AggregateExpression::CountSolutions { distinct: false } => match number(inner, None) {
            Some(number) => sum(number),
            None => aggregate,
        },
        AggregateExpression::FunctionCall {
            name,
            expr,
            distinct: false,
        } => {
            let taken = inner.taken.get(&id);
            let value = match taken {
                Some(taken) => Expression::Variable(taken.result.clone()),
                None => expr,
            };
            let others = number(inner, taken.and_then(|taken| taken.own.as_ref()));
            match (&name, taken) {
                (AggregateFunction::Count, Some(_)) => {
                    sum(Expression::Coalesce(vec![times(value, others), zero()]))
                }
                (AggregateFunction::Count, None) => match others {
                    Some(others) => {
                        // An error if there is no value.
                        let is_there =
                            Expression::SameTerm(Box::new(value.clone()), Box::new(value));
                        let once =
                            Expression::If(Box::new(is_there), Box::new(others), Box::new(zero()));
                        sum(Expression::Coalesce(vec![once, zero()]))
                    }
                    None => AggregateExpression::FunctionCall {
                        name,
                        expr: value,
                        distinct: false,
                    },
                },
                (AggregateFunction::Sum | AggregateFunction::Avg, _) => sum(times(value, others)),
                _ => AggregateExpression::FunctionCall {
                    name,
                    expr: value,
                    distinct: false,
                },
            }
        }
        other => other,
    }
}
