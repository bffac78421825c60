//! Limits on one evaluation.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Limits on one evaluation. Change single limits of the default, so that new ones keep their
/// default:
///
/// ```
/// use actcheck_rules::Budget;
///
/// let budget = Budget { secs: 0.5, ..Budget::default() };
/// assert!(budget.tuples > 1_000_000);
/// ```
#[derive(Debug, Clone)]
pub struct Budget {
    /// Maximum number of derived tuples, without duplicates and given facts.
    pub tuples: usize,
    /// Maximum memory of tuples, matches and created texts, approximately. Unit: bytes.
    pub bytes: usize,
    /// Maximum number of new things (`!x`) of rules that may make them without end.
    pub new_things: usize,
    /// Wall time. Unit: seconds.
    pub secs: f64,
    /// Set by another thread to stop the evaluation, but not before it has run for 0.2 s: short
    /// ones are finished.
    pub stop: Arc<AtomicBool>,
}

impl Default for Budget {
    fn default() -> Self {
        // A pick run derives some hundred tuples in under a millisecond, so all limits are far
        // above realistic rules.
        Self {
            tuples: 5_000_000,
            bytes: 1 << 30,
            new_things: 10_000,
            secs: 10.0,
            stop: Arc::default(),
        }
    }
}
