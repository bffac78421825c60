//! The truth and the robustness of a formula over the samples of an action.
//!
//! Source: Donzé and Maler, "Robust satisfaction of temporal logic over real-valued signals", 2010.
//! On samples, windows contain the samples between their ends, and end with the action.

use crate::builtins::Builtin;
use crate::model::expression::Variable;
use crate::model::universe::Universe;
use crate::syntax::{Comparison, TemporalOperator};
use crate::temporal::formula::{CheckedFormula, Quantity, Thing};
use crate::temporal::quantities::values_of;
use crate::temporal::windows::{Window, largest_after, negated, reversed, smallest_after, until};
use crate::watch::Watch;
use actcheck_base::{Course, Term, TermId, names};
use std::borrow::Cow;
use std::rc::Rc;

/// Why a run can't be judged by a rule about time.
pub(crate) const UNRECORDED: &str = "the course of the action was not recorded: the action has no samples, or its motion was not kept";

/// Reads formulas under one binding of a rule's variables.
pub(super) struct Reader<'a> {
    pub(super) course: &'a Course,
    binding: &'a [TermId],
    terms: &'a Universe<'a>,
    watch: &'a Watch,
}

/// One side of a comparison.
enum Side {
    /// The same number at each sample.
    Same(f64),
    Each(Rc<Vec<f64>>),
}

/// The contribution of a comparison: its distance from flipping, or only whether it holds (1 or
/// −1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    Robustness,
    Truth,
}

impl<'a> Reader<'a> {
    /// Returns `None`, and stops the evaluation, if the course of the action was not recorded.
    pub(super) fn new(
        binding: &'a [TermId],
        terms: &'a Universe<'a>,
        watch: &'a Watch,
    ) -> Option<Self> {
        let Some(course) = terms.course().filter(|course| course.count > 0) else {
            watch.no_value(UNRECORDED.to_owned());
            return None;
        };
        Some(Self {
            course,
            binding,
            terms,
            watch,
        })
    }

    /// Returns whether a formula holds in the action.
    pub(super) fn holds(&self, formula: &CheckedFormula) -> Option<bool> {
        let robustness = self.robustness(formula)?;
        if robustness != 0.0 {
            return Some(robustness > 0.0);
        }
        // On the border, `<` and `<=` differ.
        let truth = self.samples(formula, Scale::Truth)?;
        Some(
            truth
                .get(self.moment(formula))
                .is_some_and(|value| *value > 0.0),
        )
    }

    /// Returns how far a formula is from flipping in the action; infinite if no number can flip it.
    pub(super) fn robustness(&self, formula: &CheckedFormula) -> Option<f64> {
        self.over_time(formula)?.get(self.moment(formula)).copied()
    }

    /// Returns the sample at which a formula is read: the first, or the last if it looks back.
    pub(super) fn moment(&self, formula: &CheckedFormula) -> usize {
        if formula.looks_back() {
            self.course.count.saturating_sub(1)
        } else {
            0
        }
    }

    /// Returns the time of a sample since the action began. Unit: seconds.
    pub(super) fn secs(&self, at: usize) -> f64 {
        at as f64 * self.course.period_secs
    }

    /// Returns the robustness at each sample.
    pub(super) fn over_time(&self, formula: &CheckedFormula) -> Option<Vec<f64>> {
        self.samples(formula, Scale::Robustness)
    }

    /// Returns the window of an operator.
    pub(super) fn window(&self, from: f64, to: f64) -> Window {
        Window::of(from, to, self.course.period_secs)
    }

    fn samples(&self, formula: &CheckedFormula, scale: Scale) -> Option<Vec<f64>> {
        self.watch.work(size_of::<f64>() * self.course.count)?;
        match formula {
            CheckedFormula::Compare {
                op, left, right, ..
            } => {
                let sides = (self.side(left)?, self.side(right)?);
                let count = self.course.count;
                Some(match (scale, op) {
                    // The common ones, without a choice for each sample.
                    (Scale::Robustness, Comparison::Less | Comparison::LessEqual) => {
                        pairs(sides, count, |a, b| known(b - a))
                    }
                    (Scale::Robustness, Comparison::Greater | Comparison::GreaterEqual) => {
                        pairs(sides, count, |a, b| known(a - b))
                    }
                    (Scale::Robustness, _) => pairs(sides, count, |a, b| distance(*op, a, b)),
                    (Scale::Truth, _) => pairs(sides, count, |a, b| sign(compares(*op, a, b))),
                })
            }
            CheckedFormula::Truth { quantity, .. } => {
                let factor = if scale == Scale::Truth {
                    1.0
                } else {
                    f64::INFINITY
                };
                Some(
                    self.quantity(quantity)?
                        .iter()
                        .map(|value| factor * sign(*value != 0.0))
                        .collect(),
                )
            }
            CheckedFormula::Not(inner) => self.samples(inner, scale).map(negated),
            CheckedFormula::Consequent { needed: true, .. } if self.watch.fails_consequents() => {
                Some(vec![
                    if scale == Scale::Truth {
                        -1.0
                    } else {
                        f64::NEG_INFINITY
                    };
                    self.course.count
                ])
            }
            CheckedFormula::Consequent { formula, .. } => self.samples(formula, scale),
            CheckedFormula::And(parts) => self.joined(parts, scale, f64::min),
            CheckedFormula::Or(parts) => self.joined(parts, scale, f64::max),
            CheckedFormula::Temporal {
                operator,
                from,
                to,
                parts,
                ..
            } => {
                let parts: Option<Vec<Vec<f64>>> =
                    parts.iter().map(|part| self.samples(part, scale)).collect();
                Some(temporal(*operator, self.window(*from, *to), parts?))
            }
        }
    }

    fn joined(
        &self,
        parts: &[CheckedFormula],
        scale: Scale,
        join: fn(f64, f64) -> f64,
    ) -> Option<Vec<f64>> {
        let mut parts = parts.iter();
        let mut joined = self.samples(parts.next()?, scale)?;
        for part in parts {
            let more = self.samples(part, scale)?;
            joined
                .iter_mut()
                .zip(more)
                .for_each(|(slot, value)| *slot = join(*slot, value));
        }
        Some(joined)
    }

    fn side(&self, quantity: &Quantity) -> Option<Side> {
        Some(match quantity {
            Quantity::Number(value) => Side::Same(*value),
            Quantity::Variable(variable) => Side::Same(self.number(*variable)?),
            _ => Side::Each(self.quantity(quantity)?),
        })
    }

    /// Returns the number that a variable is bound to.
    fn number(&self, variable: Variable) -> Option<f64> {
        let term = self.terms.term(self.binding[variable]);
        let value = term.number();
        if value.is_none() {
            self.watch.no_value(format!("{term} is not a number"));
        }
        value
    }

    /// Returns a quantity at each sample.
    pub(super) fn quantity(&self, quantity: &Quantity) -> Option<Rc<Vec<f64>>> {
        let count = self.course.count;
        match quantity {
            Quantity::Number(value) => Some(Rc::new(vec![*value; count])),
            Quantity::Variable(variable) => Some(Rc::new(vec![self.number(*variable)?; count])),
            Quantity::Recorded { iri, things, .. } => {
                let named: Vec<String> = things.iter().map(|thing| self.thing(thing)).collect();
                let values = self
                    .terms
                    .quantity(iri, named, |things| values_of(self.course, iri, things));
                if values.is_none() {
                    let things = things
                        .iter()
                        .map(|thing| names::shorten(&self.thing(thing)));
                    let of = things.collect::<Vec<_>>().join(" and ");
                    self.watch.no_value(format!(
                        "`{}` of {of} was not recorded",
                        names::shorten(iri)
                    ));
                }
                values
            }
            Quantity::Call(builtin, args) => {
                let args: Option<Vec<Rc<Vec<f64>>>> =
                    args.iter().map(|arg| self.quantity(arg)).collect();
                Some(Rc::new(self.called(builtin, &args?)))
            }
        }
    }

    fn thing(&self, thing: &Thing) -> String {
        match thing {
            Thing::Constant(text) => text.clone(),
            Thing::Variable(variable) => match self.terms.term(self.binding[*variable]) {
                Term::Iri(iri) => iri.to_string(),
                Term::String(text) => text.to_string(),
                term => term.to_string(),
            },
        }
    }

    /// Applies a built-in at each sample. Its value is NaN where it has none.
    fn called(&self, builtin: &Builtin, args: &[Rc<Vec<f64>>]) -> Vec<f64> {
        let at = |idx: usize| args.iter().map(move |values| values[idx]);
        let each = |value: &dyn Fn(usize) -> f64| (0..self.course.count).map(value).collect();
        match (builtin.name, args) {
            ("SUM", _) => each(&|idx| at(idx).sum()),
            ("PRODUCT", _) => each(&|idx| at(idx).product()),
            ("MIN", _) => each(&|idx| at(idx).fold(f64::INFINITY, f64::min)),
            ("MAX", _) => each(&|idx| at(idx).fold(f64::NEG_INFINITY, f64::max)),
            ("MINUS", [a, b]) => each(&|idx| a[idx] - b[idx]),
            ("DIVISION", [a, b]) => each(&|idx| a[idx] / b[idx]),
            ("INVERSE" | "NEGATIVE", [a]) => each(&|idx| -a[idx]),
            ("ABS", [a]) => each(&|idx| a[idx].abs()),
            ("SQRT", [a]) => each(&|idx| a[idx].sqrt()),
            ("ATAN2", [a, b]) => each(&|idx| libm::atan2(a[idx], b[idx])),
            _ => each(&|idx| {
                let values: Vec<Cow<'_, Term>> = at(idx)
                    .map(|value| Cow::Owned(Term::Double(value)))
                    .collect();
                builtin
                    .call(&values, self.watch)
                    .and_then(|term| term.number())
                    .unwrap_or(f64::NAN)
            }),
        }
    }
}

fn temporal(operator: TemporalOperator, window: Window, parts: Vec<Vec<f64>>) -> Vec<f64> {
    let mut parts = parts.into_iter().map(|values| {
        if operator.is_past() {
            reversed(values)
        } else {
            values
        }
    });
    let first = parts.next().unwrap_or_default();
    let values = match operator {
        TemporalOperator::Always | TemporalOperator::Historically => smallest_after(&first, window),
        TemporalOperator::Eventually | TemporalOperator::Once => largest_after(&first, window),
        TemporalOperator::Until | TemporalOperator::Since => {
            let second = parts.next().unwrap_or_default();
            until(&first, &second, window)
        }
    };
    if operator.is_past() {
        reversed(values)
    } else {
        values
    }
}

/// Applies a comparison at each sample.
fn pairs((left, right): (Side, Side), count: usize, compare: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    match (left, right) {
        (Side::Each(left), Side::Same(b)) => left.iter().map(|a| compare(*a, b)).collect(),
        (Side::Same(a), Side::Each(right)) => right.iter().map(|b| compare(a, *b)).collect(),
        (Side::Each(left), Side::Each(right)) => left
            .iter()
            .zip(&*right)
            .map(|(a, b)| compare(*a, *b))
            .collect(),
        (Side::Same(a), Side::Same(b)) => vec![compare(a, b); count],
    }
}

/// A value that is not a number can't hold.
fn known(value: f64) -> f64 {
    if value.is_nan() {
        f64::NEG_INFINITY
    } else {
        value
    }
}

/// Returns how far a comparison is from flipping; negative if it does not hold. A value that is not
/// a number can't hold.
fn distance(op: Comparison, left: f64, right: f64) -> f64 {
    let value = match op {
        Comparison::Less | Comparison::LessEqual => right - left,
        Comparison::Greater | Comparison::GreaterEqual => left - right,
        Comparison::Equal => -(left - right).abs(),
        Comparison::Unequal => (left - right).abs(),
    };
    known(value)
}

/// Returns whether a comparison of two numbers holds.
pub(super) fn compares(op: Comparison, left: f64, right: f64) -> bool {
    match op {
        Comparison::Less => left < right,
        Comparison::LessEqual => left <= right,
        Comparison::Greater => left > right,
        Comparison::GreaterEqual => left >= right,
        Comparison::Equal => left == right,
        Comparison::Unequal => left != right,
    }
}

fn sign(holds: bool) -> f64 {
    if holds { 1.0 } else { -1.0 }
}
