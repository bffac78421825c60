//! Rows of runs and outcomes, for tests.

use actcheck_base::Outcome;
use actcheck_history::{OutcomeRow, RunRow, RunStatus};

/// A completed run of a campaign `k`; its number is one more than its index.
pub(crate) fn run_row(index: u64) -> RunRow {
    RunRow {
        run: format!("k-{}", index + 1),
        repetition: None,
        weight: None,
        campaign: "k".to_owned(),
        index,
        test: "Pick".to_owned(),
        status: RunStatus::Completed,
        score: 1.0,
        trace_hash: String::new(),
        started: String::new(),
    }
}

/// The outcome of a property in the only action of that run.
pub(crate) fn outcome_row(index: u64, property: &str, outcome: Outcome) -> OutcomeRow {
    OutcomeRow {
        run: format!("k-{}", index + 1),
        campaign: "k".to_owned(),
        index,
        test: "Pick".to_owned(),
        step: 1,
        action: "Pick".to_owned(),
        property: property.to_owned(),
        outcome,
        margin: None,
    }
}
