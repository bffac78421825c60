//! Checks formulas over the course of an action: their quantities, their things and their
//! intervals.

use crate::builtins::{self, Builtin};
use crate::check::checking::{Role, counted};
use crate::check::expressions::operator;
use crate::check::translate::Translation;
use crate::syntax::{self, Expression, ExpressionKind, FormulaKind};
use crate::temporal::{CheckedFormula, Quantity, Thing, known_quantity, quantity_names};
use actcheck_base::{Span, Term, did_you_mean, names};

impl Translation<'_, '_> {
    /// Translates a formula. Returns `None` if an error was reported.
    pub(super) fn formula(&mut self, formula: &syntax::Formula) -> Option<CheckedFormula> {
        if self.role == Role::Standalone {
            let help = "write it in a property or in a rule library: a program on its own has no course of an action";
            self.error(
                "R053",
                &formula.span,
                "a temporal operator can't be used here",
                help,
            );
            return None;
        }
        self.checked(formula)
    }

    fn checked(&mut self, formula: &syntax::Formula) -> Option<CheckedFormula> {
        let span = formula.span.clone();
        Some(match &formula.kind {
            FormulaKind::Compare(op, left, right) => {
                let (left, right) = (self.quantity(left), self.quantity(right));
                CheckedFormula::Compare {
                    op: *op,
                    left: left?,
                    right: right?,
                    span,
                }
            }
            FormulaKind::Signal(expression) => {
                let quantity = self.quantity(expression)?;
                if !matches!(quantity, Quantity::Recorded { .. }) {
                    let help = "compare the number, for example with `> 0`";
                    self.error("R051", &span, "this is a number, not a condition", help);
                    return None;
                }
                CheckedFormula::Truth { quantity, span }
            }
            FormulaKind::Not(inner) => CheckedFormula::Not(Box::new(self.checked(inner)?)),
            FormulaKind::And(parts) => CheckedFormula::And(self.all_checked(parts)?),
            FormulaKind::Or(parts) => CheckedFormula::Or(self.all_checked(parts)?),
            FormulaKind::Implies(left, right) => {
                let (left, right) = (self.checked(left), self.checked(right));
                let consequent = CheckedFormula::Consequent {
                    formula: Box::new(right?),
                    needed: false,
                };
                CheckedFormula::Or(vec![CheckedFormula::Not(Box::new(left?)), consequent])
            }
            FormulaKind::Temporal {
                operator,
                bound,
                parts,
            } => {
                let interval = self.interval(bound.as_ref(), operator.name());
                let parts = self.all_checked(parts);
                let (from, to) = interval?;
                CheckedFormula::Temporal {
                    operator: *operator,
                    from,
                    to,
                    parts: parts?,
                    span,
                }
            }
        })
    }

    fn all_checked(&mut self, parts: &[syntax::Formula]) -> Option<Vec<CheckedFormula>> {
        let parts: Vec<Option<CheckedFormula>> =
            parts.iter().map(|part| self.checked(part)).collect();
        parts.into_iter().collect()
    }

    /// Returns the ends of an interval. Unit: seconds. Without an interval, the operator reaches to
    /// the end of the action, or to its start.
    fn interval(&mut self, bound: Option<&[Expression; 2]>, operator: &str) -> Option<(f64, f64)> {
        let Some([from, to]) = bound else {
            return Some((0.0, f64::INFINITY));
        };
        let mut end = |expression: &Expression| {
            let value = self.ground(expression)?;
            let number = value.number().filter(|number| *number >= 0.0);
            if number.is_none() {
                let help = format!(
                    "write seconds, as in `{operator}[0, 1.5](…)`; `once` and `since` look back"
                );
                self.error(
                    "R051",
                    &expression.span,
                    format!("{value} is not a time"),
                    help,
                );
            }
            number
        };
        let (from_secs, to_secs) = (end(from), end(to));
        let (from_secs, to_secs) = (from_secs?, to_secs?);
        if to_secs < from_secs {
            let span = from.span.start..to.span.end;
            let help =
                format!("write the earlier end first: `{operator}[{to_secs}, {from_secs}](…)`");
            self.error("R051", &span, "the interval is empty", help);
            return None;
        }
        Some((from_secs, to_secs))
    }

    fn quantity(&mut self, expression: &Expression) -> Option<Quantity> {
        let span = &expression.span;
        match &expression.kind {
            ExpressionKind::Variable(name) => Some(Quantity::Variable(self.variable(name, span))),
            ExpressionKind::Call(name, args)
                if name.contains(':') && !name.starts_with(builtins::GEO3D) =>
            {
                self.recorded(name, args, span)
            }
            ExpressionKind::Call(name, args) => {
                let quantity = quantity_names().find(|known| *known == name);
                if let Some(quantity) = quantity.filter(|_| builtins::builtin(name).is_none()) {
                    let help = format!("did you mean `w:{quantity}(…)`?");
                    self.error("R027", span, format!("unknown function `{name}`"), help);
                    return None;
                }
                let builtin = self.builtin(name, args.len(), span)?;
                self.call_of(builtin, args.iter())
            }
            ExpressionKind::Arithmetic(op, left, right) => {
                let builtin = builtins::builtin(operator(*op))?;
                self.call_of(builtin, [left.as_ref(), right.as_ref()].into_iter())
            }
            ExpressionKind::Negative(inner) => self.call_of(
                builtins::builtin("INVERSE")?,
                std::iter::once(inner.as_ref()),
            ),
            _ => {
                let value = self.ground(expression)?;
                let number = value.number();
                if number.is_none() {
                    let help = "compare numbers: quantities such as `w:z(?object)`, variables, and constants";
                    self.error("R051", span, format!("{value} is not a number"), help);
                }
                number.map(Quantity::Number)
            }
        }
    }

    fn call_of<'e>(
        &mut self,
        builtin: &'static Builtin,
        args: impl Iterator<Item = &'e Expression>,
    ) -> Option<Quantity> {
        let args: Vec<Option<Quantity>> = args.map(|arg| self.quantity(arg)).collect();
        Some(Quantity::Call(
            builtin,
            args.into_iter().collect::<Option<_>>()?,
        ))
    }

    /// Checks a quantity and the number of its things.
    fn recorded(&mut self, iri: &str, args: &[Expression], span: &Span) -> Option<Quantity> {
        if let Some(local) = iri.strip_prefix(names::W) {
            let Some(things) = known_quantity(local) else {
                let (message, help) = if self
                    .checking
                    .vocabulary
                    .is_some_and(|known| known.terms.contains_key(iri))
                {
                    let message = format!("`w:{local}` is not recorded over time");
                    (
                        message,
                        format!(
                            "read it before or after the action: `before(?thing, w:{local}, ?value)`"
                        ),
                    )
                } else {
                    (
                        format!("unknown quantity `w:{local}`"),
                        did_you_mean(local, quantity_names()),
                    )
                };
                self.error("R052", span, message, help);
                return None;
            };
            if things != args.len() {
                let message = format!("`w:{local}` has {} here", counted(args.len()));
                let help = match things {
                    0 => format!("write `w:{local}()`"),
                    1 => format!("write `w:{local}(?thing)`"),
                    _ => format!("write `w:{local}(?one, ?other)`"),
                };
                self.error("R052", span, message, help);
                return None;
            }
        }
        let things: Vec<Option<Thing>> = args.iter().map(|arg| self.thing(arg)).collect();
        let things = things.into_iter().collect::<Option<_>>()?;
        Some(Quantity::Recorded {
            iri: iri.to_owned(),
            things,
        })
    }

    fn thing(&mut self, arg: &Expression) -> Option<Thing> {
        match &arg.kind {
            ExpressionKind::Variable(name) => Some(Thing::Variable(self.variable(name, &arg.span))),
            _ => match self.ground(arg)? {
                Term::Iri(iri) => Some(Thing::Constant(iri.to_string())),
                Term::String(text) => Some(Thing::Constant(text.to_string())),
                value => {
                    let help = "write a variable, or the name of a thing such as `w:gripper`";
                    self.error("R051", &arg.span, format!("{value} is not a thing"), help);
                    None
                }
            },
        }
    }
}
