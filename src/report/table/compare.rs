//! A comparison of two campaigns as a flat table.

use crate::summary::compared_parts;
use crate::{CompareSummary, Table};

/// One row for each property. The first row is for whole runs and has neither action nor property.
pub fn compare_table(summary: &CompareSummary) -> Table {
    let mut table = Table::new([
        "action",
        "property",
        "pairs",
        "both_passed",
        "only_a_passed",
        "only_b_passed",
        "both_failed",
        "difference",
        "low",
        "high",
        "p",
        "p_holm",
        "mid_p",
        "p_b_worse",
        "p_b_worse_holm",
        "left_out",
        "worse",
        "better",
        "answer",
    ]);
    for line in &summary.comparison.lines {
        let (action, property) = compared_parts(&line.of);
        let counts = line.table;
        let difference = line.difference;
        table.rows.push(vec![
            action.into(),
            property.into(),
            counts.pairs().into(),
            counts.both.into(),
            counts.only_first.into(),
            counts.only_second.into(),
            counts.neither.into(),
            difference.map(|found| found.value).into(),
            difference.map(|found| found.low).into(),
            difference.map(|found| found.high).into(),
            line.test.two_sided.into(),
            line.two_sided_adjusted.into(),
            line.test.mid_p.into(),
            line.test.second_worse.into(),
            line.second_worse_adjusted.into(),
            line.left_out[0].total().into(),
            ids(&line.worse).into(),
            ids(&line.better).into(),
            summary
                .comparison
                .answer_of(line, summary.answer_level(), summary.margin)
                .word()
                .into(),
        ]);
    }
    table
}

/// Joins pairs of run ids into one cell.
fn ids(runs: &[(String, String)]) -> String {
    runs.iter()
        .map(|(a, b)| format!("{a}/{b}"))
        .collect::<Vec<_>>()
        .join(" ")
}
