//! What the rules found out about one property in one action.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::base::{Diagnostic, Term};

/// Result of one property's rule file over the facts of one action.
#[derive(Debug, Clone, PartialEq)]
pub struct Findings {
    /// Whether the property says anything here (`applicable`).
    pub applicable: bool,
    /// Whether it holds.
    pub holds: bool,
    /// The tuples that prove the outcome: of `success` or `violation`, sorted. At most [`Findings::WITNESS_LIMIT`].
    pub witness: Vec<WitnessRow>,
    /// How many such tuples there are in all.
    pub witness_count: usize,
    /// Smallest `margin`, in the property's unit. Positive: on the side of passed.
    pub margin: Option<f64>,
    /// The rule author's own words (`because`), sorted.
    pub because: Vec<String>,
}

impl Findings {
    /// Tuples kept as witness; the rest are only counted.
    pub const WITNESS_LIMIT: usize = 8;
}

/// One tuple with the names under which its values stand in the rule's head.
#[derive(Debug, Clone, PartialEq)]
pub struct WitnessRow {
    /// `success`, `violation`, or `row` for SPARQL.
    pub predicate: String,
    /// Variable name (empty where the head has a constant) and value.
    pub values: Vec<(String, Term)>,
}

/// Why a property could not be decided.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RuleFault {
    /// The evaluation exceeded its budget of time or tuples.
    #[error("evaluation stopped at its budget: {0}")]
    BudgetSpent(String),
    /// A value that a rule can't work with, such as a margin that is no number.
    #[error("{0}")]
    Value(String),
    /// Somebody asked for its end ([`Budget::stop`]).
    #[error("interrupted")]
    Interrupted,
}

/// The fault of something that was ended because somebody asked for it.
pub(crate) fn interrupted() -> Diagnostic {
    Diagnostic::error("R091", RuleFault::Interrupted.to_string())
}

/// Limits on one evaluation.
#[derive(Debug, Clone)]
pub struct Budget {
    /// Derived tuples.
    pub tuples: usize,
    /// Wall time. Unit: seconds.
    pub secs: f64,
    /// Set from outside, it ends the evaluation: at once, or when it has lasted as long as an ordinary one (0.2 s).
    pub stop: Arc<AtomicBool>,
}

impl Default for Budget {
    fn default() -> Self {
        // A pick run derives some hundred tuples in under a millisecond: both are far out of a sound rule's way.
        Self { tuples: 5_000_000, secs: 10.0, stop: Arc::default() }
    }
}
