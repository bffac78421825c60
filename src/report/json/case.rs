//! The result of re-running a case as JSON.

use serde_json::{Value, json};

use crate::CaseSummary;
use actcheck_verdict::Recurrence;

/// Returns the result of one case as JSON.
pub fn case_json(case: &CaseSummary) -> Value {
    let (failed, undecided) = match &case.recurrence {
        Recurrence::AsBefore => (case.expected.iter().collect::<Vec<_>>(), Vec::new()),
        Recurrence::NoLonger => (Vec::new(), Vec::new()),
        Recurrence::Otherwise(now) => (now.iter().collect(), Vec::new()),
        Recurrence::Undecided(what) => (Vec::new(), what.iter().collect()),
    };
    json!({
        "file": case.file, "run": case.run, "expected": case.expected, "recurrence": case.recurrence.word(),
        "failed": failed, "undecided": undecided, "same_trace": case.same_trace, "reason": case.reason,
        "exit_code": case.exit_code(),
    })
}
