//! Results of testing the oracles as a flat table.

use crate::summary::notice_word;
use crate::{OracleSummary, Table};

/// Returns the matrix as a table with one row for each fault and property.
pub fn oracles_table(summary: &OracleSummary) -> Table {
    let mut table = Table::new([
        "fault",
        "scenes",
        "came_about",
        "property",
        "passed",
        "failed",
        "other",
        "newly_failed",
        "newly_passed",
        "p",
        "verdict",
    ]);
    for (row, name, cell) in summary.cells() {
        table.rows.push(vec![
            row.fault.clone().into(),
            row.scenes.into(),
            row.came_about.into(),
            name.into(),
            cell.passed.into(),
            cell.failed.into(),
            cell.other.into(),
            cell.newly_failed.into(),
            cell.newly_passed.into(),
            cell.p.into(),
            notice_word(cell.notice).into(),
        ]);
    }
    table
}
