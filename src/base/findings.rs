//! The findings of a rule about one property in one action.

use std::fmt;

use crate::{Outcome, Term};

/// Result of a property's rule file over the facts of one action.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// Whether the property applies to this action (`applicable`).
    pub applicable: bool,
    /// Whether the property holds.
    pub holds: bool,
    /// The tuples that prove the outcome: of `success` or `violation`, sorted. At most
    /// [`Findings::WITNESS_LIMIT`].
    pub witness: Vec<WitnessRow>,
    /// Total number of such tuples.
    pub witness_count: usize,
    /// Smallest `margin`, in the property's unit. Positive if the property passed.
    pub margin: Option<f64>,
    /// Explanations written by the rule's author (`because`), sorted.
    pub because: Vec<String>,
}

impl Findings {
    /// Maximum number of tuples kept as witness; the rest are only counted.
    pub const WITNESS_LIMIT: usize = 8;

    /// Returns the outcome: `Inapplicable`, `Passed` or `Failed`.
    pub fn outcome(&self) -> Outcome {
        match (self.applicable, self.holds) {
            (false, _) => Outcome::Inapplicable,
            (true, true) => Outcome::Passed,
            (true, false) => Outcome::Failed,
        }
    }
}

/// One tuple with the argument names of the rule's head.
#[derive(Debug, Clone, PartialEq)]
pub struct WitnessRow {
    /// `success`, `violation`, or `row` for SPARQL.
    pub predicate: String,
    /// Variable name (empty if the head has a constant) and value.
    pub values: Vec<(String, Term)>,
}

impl fmt::Display for WitnessRow {
    /// Writes the tuple with the names of its arguments: `violation(object = obj:cup_1)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(", self.predicate)?;
        for (idx, (name, term)) in self.values.iter().enumerate() {
            let comma = if idx == 0 { "" } else { ", " };
            let equals = if name.is_empty() { "" } else { " = " };
            write!(f, "{comma}{name}{equals}{term}")?;
        }
        f.write_str(")")
    }
}

/// Why a property could not be decided.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RuleFault {
    /// The evaluation exceeded its budget of time or tuples.
    #[error("evaluation stopped at its budget: {0}")]
    BudgetSpent(String),
    /// An invalid value, for example a margin that is not a number.
    #[error("{0}")]
    Value(String),
    /// The caller requested a stop (the `stop` flag of its budget).
    #[error("interrupted")]
    Interrupted,
}

impl RuleFault {
    /// Returns the outcome of a property that could not be decided: `Timeout`, `Broken` or
    /// `Untested`.
    pub fn outcome(&self) -> Outcome {
        match self {
            Self::BudgetSpent(_) => Outcome::Timeout,
            Self::Value(_) => Outcome::Broken,
            Self::Interrupted => Outcome::Untested,
        }
    }

    /// Returns the reason without the kind of the fault.
    pub fn reason(&self) -> &str {
        match self {
            Self::BudgetSpent(reason) | Self::Value(reason) => reason,
            Self::Interrupted => "interrupted",
        }
    }
}
