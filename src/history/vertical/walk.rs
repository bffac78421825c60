//! The parts of a query: patterns, expressions, and variables.

use std::collections::BTreeSet;

use oxigraph::model::Variable;
use spargebra::algebra::{AggregateExpression, Expression, GraphPattern, OrderExpression};
use spargebra::term::{NamedNodePattern, TermPattern};

use crate::light::parts;

/// Calls `on_pattern` with a pattern and the patterns in it, also those in its expressions, and
/// `on_expression` with all expressions. `on_pattern` returns whether to go on with the parts of
/// its pattern.
pub(super) fn walk<'p>(
    pattern: &'p GraphPattern,
    on_pattern: &mut dyn FnMut(&'p GraphPattern) -> bool,
    on_expression: &mut dyn FnMut(&'p Expression),
) {
    use GraphPattern as G;
    if !on_pattern(pattern) {
        return;
    }
    match pattern {
        G::Join { left, right } | G::Union { left, right } | G::Minus { left, right } => {
            walk(left, on_pattern, on_expression);
            walk(right, on_pattern, on_expression);
        }
        G::LeftJoin {
            left,
            right,
            expression,
        } => {
            walk(left, on_pattern, on_expression);
            walk(right, on_pattern, on_expression);
            expression
                .iter()
                .for_each(|expression| walk_expression(expression, on_pattern, on_expression));
        }
        G::Filter { expr, inner }
        | G::Extend {
            inner,
            expression: expr,
            ..
        } => {
            walk(inner, on_pattern, on_expression);
            walk_expression(expr, on_pattern, on_expression);
        }
        G::OrderBy { inner, expression } => {
            walk(inner, on_pattern, on_expression);
            for OrderExpression::Asc(key) | OrderExpression::Desc(key) in expression {
                walk_expression(key, on_pattern, on_expression);
            }
        }
        G::Group {
            inner, aggregates, ..
        } => {
            walk(inner, on_pattern, on_expression);
            for (_, aggregate) in aggregates {
                if let AggregateExpression::FunctionCall { expr, .. } = aggregate {
                    walk_expression(expr, on_pattern, on_expression);
                }
            }
        }
        G::Graph { inner, .. }
        | G::Project { inner, .. }
        | G::Distinct { inner }
        | G::Reduced { inner }
        | G::Slice { inner, .. }
        | G::Service { inner, .. } => walk(inner, on_pattern, on_expression),
        _ => {}
    }
}

/// As [`walk`], for an expression.
pub(super) fn walk_expression<'p>(
    expression: &'p Expression,
    on_pattern: &mut dyn FnMut(&'p GraphPattern) -> bool,
    on_expression: &mut dyn FnMut(&'p Expression),
) {
    on_expression(expression);
    parts(expression)
        .into_iter()
        .for_each(|part| walk_expression(part, on_pattern, on_expression));
    if let Expression::Exists(pattern) = expression {
        walk(pattern, on_pattern, on_expression);
    }
}

/// The variables that an expression uses, also in patterns.
pub(super) fn used(expression: &Expression) -> BTreeSet<Variable> {
    // Two functions add to it.
    let all = std::cell::RefCell::new(BTreeSet::new());
    walk_expression(
        expression,
        &mut |pattern| {
            all.borrow_mut().extend(mentioned(pattern));
            true
        },
        &mut |part| {
            if let Expression::Variable(variable) | Expression::Bound(variable) = part {
                all.borrow_mut().insert(variable.clone());
            }
        },
    );
    all.into_inner()
}

/// The variables that a pattern itself names, without its parts.
fn mentioned(pattern: &GraphPattern) -> BTreeSet<Variable> {
    let of = |term: &TermPattern| match term {
        TermPattern::Variable(variable) => Some(variable.clone()),
        _ => None,
    };
    let named = |name: &NamedNodePattern| match name {
        NamedNodePattern::Variable(variable) => Some(variable.clone()),
        NamedNodePattern::NamedNode(_) => None,
    };
    match pattern {
        GraphPattern::Bgp { patterns } => patterns
            .iter()
            .flat_map(|triple| {
                [
                    of(&triple.subject),
                    named(&triple.predicate),
                    of(&triple.object),
                ]
            })
            .flatten()
            .collect(),
        GraphPattern::Path {
            subject, object, ..
        } => [of(subject), of(object)].into_iter().flatten().collect(),
        GraphPattern::Graph { name, .. } => named(name).into_iter().collect(),
        GraphPattern::Extend { variable, .. } => BTreeSet::from([variable.clone()]),
        GraphPattern::Values { variables, .. }
        | GraphPattern::Group { variables, .. }
        | GraphPattern::Project { variables, .. } => variables.iter().cloned().collect(),
        _ => BTreeSet::new(),
    }
}

/// The variables that a pattern can bind.
pub(super) fn bound(pattern: &GraphPattern) -> BTreeSet<Variable> {
    let mut all = BTreeSet::new();
    pattern.on_in_scope_variable(|variable| {
        all.insert(variable.clone());
    });
    all
}
