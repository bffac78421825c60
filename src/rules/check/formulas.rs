//! Warns of formulas that say nothing: conditions that always or never hold, and intervals without
//! a moment.

use std::collections::BTreeMap;

use crate::check::left::Left;
use crate::model::expression::Expr;
use crate::model::program::{Literal, Rule};
use crate::syntax::Comparison;
use crate::temporal::{CheckedFormula, Quantity};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, names};

/// Samples of a course per second.
const SAMPLES_PER_SEC: f64 = 60.0;
/// Rounding of a bound that does not move it to another sample. Unit: samples.
const ROUNDING: f64 = 1e-6;

/// Quantities of the world vocabulary that are never negative.
const NEVER_NEGATIVE: [&str; 14] = [
    "tilt",
    "speed",
    "angularSpeed",
    "acceleration",
    "acceleration2d",
    "jerk",
    "displacement",
    "pathLength",
    "distance",
    "distance2d",
    "gap",
    "relativeSpeed",
    "contactForce",
    "time",
];

/// The interval of a temporal operator, for a comparison with the action's time limit.
#[derive(Debug, Clone)]
pub(crate) struct Bound {
    source: Source,
    span: Span,
    from_secs: f64,
    to_secs: f64,
}

impl Bound {
    /// Returns the intervals of all formulas in some rules. Those that reach to the end of the
    /// action are left out.
    pub(crate) fn all_of(rules: &[Rule]) -> Vec<Self> {
        let mut found = Vec::new();
        for rule in rules {
            for formula in formulas(rule) {
                formula.visit(&mut |part| {
                    if let CheckedFormula::Temporal { from, to, span, .. } = part
                        && (*from > 0.0 || to.is_finite())
                    {
                        let (source, span) = (rule.origin.source.clone(), span.clone());
                        found.push(Self {
                            source,
                            span,
                            from_secs: *from,
                            to_secs: *to,
                        });
                    }
                });
            }
        }
        found
    }

    /// Returns the warning `R055` if the interval reaches beyond the time limit of actions. Unit:
    /// seconds.
    pub(crate) fn beyond(&self, limit_secs: f64) -> Option<Diagnostic> {
        let (message, help) = if self.from_secs > limit_secs {
            (
                "the interval begins after the end of every action",
                "write an earlier interval",
            )
        } else if self.to_secs.is_finite() && self.to_secs > limit_secs {
            (
                "the interval ends after the end of every action",
                "leave it out: without one, an operator reaches to the end",
            )
        } else {
            return None;
        };
        let help = format!("an action takes at most {limit_secs} s (`action_secs`); {help}");
        Some(
            Diagnostic::warning("R055", message)
                .at(&self.source, self.span.clone())
                .help(help),
        )
    }
}

/// Reports conditions that always or never hold, and intervals without a moment, in the formulas of
/// some rules.
pub(crate) fn check(rules: &[Rule], diagnostics: &mut Diagnostics) {
    for rule in rules {
        for formula in formulas(rule) {
            formula.visit(&mut |part| {
                if let Some(found) = fault_of(part) {
                    let (diagnostic, span) = found;
                    diagnostics.push(diagnostic.at(&rule.origin.source, span));
                }
            });
        }
    }
}

/// Returns the formulas of a rule's conditions.
pub(crate) fn formulas(rule: &Rule) -> impl Iterator<Item = &CheckedFormula> {
    rule.body.iter().flat_map(|literal| match literal {
        Literal::Test {
            value: Expr::Timed(timed),
            ..
        } => timed.formulas(),
        _ => &[],
    })
}

/// Returns the formulas of a rule's conditions, to be changed.
pub(crate) fn formulas_mut(rule: &mut Rule) -> impl Iterator<Item = &mut CheckedFormula> {
    rule.body.iter_mut().flat_map(|literal| match literal {
        Literal::Test {
            value: Expr::Timed(timed),
            ..
        } => timed.formulas_mut(),
        _ => &mut [],
    })
}

/// Returns the fault of a formula itself, without those of its parts.
fn fault_of(formula: &CheckedFormula) -> Option<(Diagnostic, Span)> {
    match formula {
        CheckedFormula::Compare { span, .. } => {
            let holds = constant(formula)?;
            let help = "compare it with another number, or leave the condition out";
            Some((
                verdict(holds, ", whatever the action does").help(help),
                span.clone(),
            ))
        }
        CheckedFormula::And(parts) => {
            let span = exclusive(parts)?;
            let help = "write `or` if one of them is enough; `eventually(a) and eventually(b)` looks at two moments";
            Some((
                verdict(false, ": the conditions exclude each other at every moment").help(help),
                span,
            ))
        }
        CheckedFormula::Or(parts) => {
            let opposites: Vec<CheckedFormula> = parts
                .iter()
                .map(|part| CheckedFormula::Not(Box::new(part.clone())))
                .collect();
            let span = exclusive(&opposites)?;
            let help = "write `and` if both must hold";
            Some((
                verdict(true, ": at every moment, one of the conditions holds").help(help),
                span,
            ))
        }
        CheckedFormula::Temporal { from, to, span, .. } => {
            let first = (from * SAMPLES_PER_SEC - ROUNDING).ceil();
            let last = (to * SAMPLES_PER_SEC + ROUNDING).floor();
            let help = "a course has 60 samples a second: write an interval that includes one of them, such as `[0, 0.1]`";
            let message = "the interval contains no sample";
            (last < first).then(|| {
                (
                    Diagnostic::warning("R055", message).help(help),
                    span.clone(),
                )
            })
        }
        CheckedFormula::Truth { .. }
        | CheckedFormula::Not(_)
        | CheckedFormula::Consequent { .. } => None,
    }
}

fn verdict(holds: bool, why: &str) -> Diagnostic {
    let message = if holds {
        format!("this always holds{why}")
    } else {
        format!("this can never hold{why}")
    };
    Diagnostic::warning("R054", message)
}

/// Returns whether a comparison has the same outcome at every moment of every action.
fn constant(formula: &CheckedFormula) -> Option<bool> {
    let mut left = Left::default();
    let (quantity, op, number) = compared(formula)?;
    if let Quantity::Recorded { iri, .. } = quantity
        && iri
            .strip_prefix(names::W)
            .is_some_and(|local| NEVER_NEGATIVE.contains(&local))
    {
        left.keep(Comparison::GreaterEqual, 0.0);
    }
    let mut other = left.clone();
    left.keep(op, number);
    other.keep(opposite(op), number);
    match (left.is_empty(), other.is_empty()) {
        (true, false) => Some(false),
        (false, true) => Some(true),
        _ => None,
    }
}

/// Returns the quantity, operator and number of a comparison with a number.
fn compared(formula: &CheckedFormula) -> Option<(&Quantity, Comparison, f64)> {
    match formula {
        CheckedFormula::Compare {
            left: Quantity::Number(_),
            right: Quantity::Number(_),
            ..
        } => None,
        CheckedFormula::Compare {
            op,
            left,
            right: Quantity::Number(number),
            ..
        } => Some((left, *op, *number)),
        CheckedFormula::Compare {
            op,
            left: Quantity::Number(number),
            right,
            ..
        } => Some((right, op.turned(), *number)),
        _ => None,
    }
}

/// Returns the place of a condition that excludes others of the same moment.
fn exclusive(parts: &[CheckedFormula]) -> Option<Span> {
    let mut left: BTreeMap<String, Left> = BTreeMap::new();
    let mut flat = Vec::new();
    parts
        .iter()
        .for_each(|part| conjuncts(part, false, &mut flat));
    for (part, negated) in flat {
        let (key, op, number, span) = match part {
            CheckedFormula::Truth { quantity, span } => (quantity, Comparison::Equal, 1.0, span),
            CheckedFormula::Compare { span, .. } => {
                let (quantity, op, number) = compared(part)?;
                (quantity, op, number, span)
            }
            _ => continue,
        };
        let known = left.entry(format!("{key:?}")).or_default();
        known.keep(if negated { opposite(op) } else { op }, number);
        if known.is_empty() {
            return Some(span.clone());
        }
    }
    None
}

/// Appends the comparisons and truths that must all hold for a formula, each with whether it is
/// negated.
fn conjuncts<'f>(
    formula: &'f CheckedFormula,
    negated: bool,
    found: &mut Vec<(&'f CheckedFormula, bool)>,
) {
    match formula {
        CheckedFormula::Not(inner) => conjuncts(inner, !negated, found),
        CheckedFormula::Consequent { formula, .. } => conjuncts(formula, negated, found),
        CheckedFormula::And(parts) if !negated => parts
            .iter()
            .for_each(|part| conjuncts(part, negated, found)),
        CheckedFormula::Or(parts) if negated => parts
            .iter()
            .for_each(|part| conjuncts(part, negated, found)),
        CheckedFormula::Compare { .. } if compared(formula).is_none() => {}
        CheckedFormula::Compare { .. } | CheckedFormula::Truth { .. } => {
            found.push((formula, negated))
        }
        _ => {}
    }
}

fn opposite(op: Comparison) -> Comparison {
    match op {
        Comparison::Less => Comparison::GreaterEqual,
        Comparison::LessEqual => Comparison::Greater,
        Comparison::Greater => Comparison::LessEqual,
        Comparison::GreaterEqual => Comparison::Less,
        Comparison::Equal => Comparison::Unequal,
        Comparison::Unequal => Comparison::Equal,
    }
}
