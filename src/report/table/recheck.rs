//! The changes that a recheck made as a flat table.

use crate::summary::reason_text;
use crate::{RecheckSummary, Table};

/// Returns one row for each outcome that changed or is new.
pub fn recheck_table(summary: &RecheckSummary) -> Table {
    let mut table = Table::new([
        "run",
        "step",
        "action",
        "property",
        "before",
        "now",
        "margin_before",
        "margin_now",
        "why",
        "witness",
    ]);
    for change in &summary.changes {
        table.rows.push(vec![
            change.run.clone().into(),
            change.step.into(),
            change.action.clone().into(),
            change.now.property.clone().into(),
            change.before.map(|(outcome, _)| outcome.word()).into(),
            change.now.outcome.word().into(),
            change.before.and_then(|(_, margin)| margin).into(),
            change.now.margin.into(),
            reason_text(&change.why, usize::MAX).into(),
            change.now.witness.clone().into(),
        ]);
    }
    table
}
