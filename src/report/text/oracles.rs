//! Results of testing the oracles for the terminal: the matrix of faults × properties.

use std::fmt::Write as _;

use crate::OracleSummary;
use crate::text::{Page, fitted, ruled};
use actcheck_analysis::{LEVEL, Notice};

/// Formats the matrix: how often each property failed with each fault, and a legend.
pub fn oracles_text(summary: &OracleSummary, page: Page) -> String {
    let mut table = ruled();
    let names = summary.names.iter().cloned();
    table.set_header(
        ["fault".to_owned(), "took effect".to_owned()]
            .into_iter()
            .chain(names),
    );
    let matrix = &summary.matrix;
    let alone = matrix
        .properties
        .iter()
        .map(|(_, passed, failed)| format!("{failed}/{}", passed + failed));
    let scenes = format!("{} of {}", matrix.scenes, summary.planned);
    table.add_row(["(none)".to_owned(), scenes].into_iter().chain(alone));
    for row in &matrix.rows {
        let cells = row.cells.iter().map(|cell| {
            let mark = if cell.notice == Notice::Noticed {
                " *"
            } else {
                ""
            };
            format!("{}/{}{mark}", cell.failed, cell.passed + cell.failed)
        });
        let came_about = format!("{} of {}", row.came_about, row.scenes);
        table.add_row([row.fault.clone(), came_about].into_iter().chain(cells));
    }
    let mut out = fitted(table, page, &[]) + "\n";
    let _ = writeln!(
        out,
        "failed/decided in the scenes in which the fault took effect; * noticed: fails significantly more often than in \
         the same scenes without the fault (McNemar's exact test, one-sided, p ≤ {LEVEL})\n"
    );
    for (fault, what) in &summary.faults {
        let _ = writeln!(out, "  {fault}: {what}");
    }
    let _ = match summary.gaps.len() {
        0 => writeln!(
            out,
            "\nevery fault is noticed, and every property notices a fault"
        ),
        1 => writeln!(out, "\n1 gap"),
        gaps => writeln!(out, "\n{gaps} gaps"),
    };
    page.set(&out)
}
