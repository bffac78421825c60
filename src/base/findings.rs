//! The findings of a rule about one property in one action.

use crate::Term;

/// Result of a property's rule file over the facts of one action.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// Whether the property applies to this action (`applicable`).
    pub applicable: bool,
    /// Whether the property holds.
    pub holds: bool,
    /// The tuples that prove the outcome: of `success` or `violation`, sorted. At most [`Findings::WITNESS_LIMIT`].
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
}

/// One tuple with the argument names of the rule's head.
#[derive(Debug, Clone, PartialEq)]
pub struct WitnessRow {
    /// `success`, `violation`, or `row` for SPARQL.
    pub predicate: String,
    /// Variable name (empty if the head has a constant) and value.
    pub values: Vec<(String, Term)>,
}

/// Why a property could not be decided.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
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
