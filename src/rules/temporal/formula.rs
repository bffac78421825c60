//! Checked formulas.

use crate::builtins::Builtin;
use crate::model::expression::Variable;
use crate::model::universe::Universe;
use crate::syntax::{Comparison, TemporalOperator};
use crate::temporal::semantics::Reader;
use crate::watch::Watch;
use actcheck_base::{Span, Term, TermId};

/// A checked formula.
#[derive(Debug, Clone)]
pub(crate) enum CheckedFormula {
    /// The comparison of two quantities.
    Compare {
        op: Comparison,
        left: Quantity,
        right: Quantity,
        span: Span,
    },
    /// A quantity that is true while it is not 0.
    Truth {
        quantity: Quantity,
        span: Span,
    },
    Not(Box<CheckedFormula>),
    And(Vec<CheckedFormula>),
    Or(Vec<CheckedFormula>),
    /// The right side of `a implies b`, which is the formula `~a or b`.
    Consequent {
        formula: Box<CheckedFormula>,
        /// Whether the property can only become harder to pass if this is false.
        needed: bool,
    },
    /// An operator over times between `from` and `to` after the present, or before it. Unit:
    /// seconds.
    Temporal {
        operator: TemporalOperator,
        from: f64,
        to: f64,
        parts: Vec<CheckedFormula>,
        span: Span,
    },
}

/// A number over time.
#[derive(Debug, Clone)]
pub(crate) enum Quantity {
    Number(f64),
    /// A number that another condition of the rule binds.
    Variable(Variable),
    /// A recorded quantity, or one that follows from recorded ones.
    Recorded {
        iri: String,
        things: Vec<Thing>,
    },
    Call(&'static Builtin, Vec<Quantity>),
}

/// The thing of a quantity: an IRI, or the text of a phase.
#[derive(Debug, Clone)]
pub(crate) enum Thing {
    Constant(String),
    Variable(Variable),
}

impl CheckedFormula {
    /// Calls a function with this formula and all its parts.
    pub(crate) fn visit<'f>(&'f self, see: &mut impl FnMut(&'f Self)) {
        see(self);
        match self {
            Self::Compare { .. } | Self::Truth { .. } => {}
            Self::Not(inner) | Self::Consequent { formula: inner, .. } => inner.visit(see),
            Self::And(parts) | Self::Or(parts) | Self::Temporal { parts, .. } => {
                parts.iter().for_each(|part| part.visit(see));
            }
        }
    }

    fn variables(&self, found: &mut Vec<Variable>) {
        match self {
            Self::Compare { left, right, .. } => [left, right]
                .into_iter()
                .for_each(|side| side.variables(found)),
            Self::Truth { quantity, .. } => quantity.variables(found),
            Self::Not(inner) | Self::Consequent { formula: inner, .. } => inner.variables(found),
            Self::And(parts) | Self::Or(parts) | Self::Temporal { parts, .. } => {
                parts.iter().for_each(|part| part.variables(found));
            }
        }
    }

    /// Returns whether its value is read at the end of the action: its outermost operator looks
    /// back.
    pub(super) fn looks_back(&self) -> bool {
        match self {
            Self::Temporal { operator, .. } => operator.is_past(),
            Self::Not(inner) => inner.looks_back(),
            _ => false,
        }
    }
}

impl Quantity {
    /// Appends the variables whose values must be numbers.
    pub(crate) fn numbers(&self, found: &mut Vec<Variable>) {
        match self {
            Self::Variable(variable) => found.push(*variable),
            Self::Call(_, args) => args.iter().for_each(|arg| arg.numbers(found)),
            Self::Number(_) | Self::Recorded { .. } => {}
        }
    }

    fn variables(&self, found: &mut Vec<Variable>) {
        match self {
            Self::Number(_) => {}
            Self::Variable(variable) => found.push(*variable),
            Self::Recorded { things, .. } => {
                found.extend(things.iter().filter_map(|thing| match thing {
                    Thing::Variable(variable) => Some(*variable),
                    Thing::Constant(_) => None,
                }))
            }
            Self::Call(_, args) => args.iter().for_each(|arg| arg.variables(found)),
        }
    }
}

/// The value that a rule asks of formulas.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Truth,
    Robustness,
    Moment,
}

/// Formulas that a rule joins, and the value that it asks of them.
#[derive(Debug, Clone)]
pub(crate) struct Timed {
    pub(super) formulas: Vec<CheckedFormula>,
    asked: Asked,
}

impl Timed {
    /// Asks whether a formula holds.
    pub(crate) fn truth(formula: CheckedFormula) -> Self {
        Self {
            formulas: vec![formula],
            asked: Asked::Truth,
        }
    }

    /// Asks for the robustness of several formulas together: the smallest.
    pub(super) fn robustness_of(formulas: Vec<CheckedFormula>) -> Self {
        Self {
            formulas,
            asked: Asked::Robustness,
        }
    }

    /// Asks for the moment that decides several formulas together.
    pub(super) fn moment_of(formulas: Vec<CheckedFormula>) -> Self {
        Self {
            formulas,
            asked: Asked::Moment,
        }
    }

    /// Asks for the robustness of the same formulas.
    pub(crate) fn robustness(&self) -> Self {
        Self::robustness_of(self.formulas.clone())
    }

    /// Appends the variables of its formulas.
    pub(crate) fn variables(&self, found: &mut Vec<Variable>) {
        self.formulas
            .iter()
            .for_each(|formula| formula.variables(found));
    }

    /// Returns its formulas.
    pub(crate) fn formulas(&self) -> &[CheckedFormula] {
        &self.formulas
    }

    /// Returns its formulas, to be changed.
    pub(crate) fn formulas_mut(&mut self) -> &mut [CheckedFormula] {
        &mut self.formulas
    }

    /// Returns the truth, the robustness if it is finite, or the moment. Returns `None` if a
    /// quantity was not recorded; then the watch stops the evaluation.
    pub(crate) fn value(
        &self,
        binding: &[TermId],
        terms: &Universe<'_>,
        watch: &Watch,
    ) -> Option<Term> {
        if self.asked == Asked::Moment {
            return self.moment(binding, terms, watch).map(Term::Double);
        }
        let reader = Reader::new(binding, terms, watch)?;
        match self.asked {
            Asked::Truth => {
                let truths: Option<Vec<bool>> = self
                    .formulas
                    .iter()
                    .map(|formula| reader.holds(formula))
                    .collect();
                Some(Term::Boolean(truths?.into_iter().all(|holds| holds)))
            }
            Asked::Robustness => {
                let mut smallest = f64::INFINITY;
                for formula in &self.formulas {
                    smallest = smallest.min(reader.robustness(formula)?);
                }
                smallest.is_finite().then_some(Term::Double(smallest))
            }
            Asked::Moment => None,
        }
    }
}
