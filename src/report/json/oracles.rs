//! Results of testing the oracles as JSON.

use serde_json::{Value, json};

use crate::OracleSummary;
use crate::summary::notice_word;
use actcheck_analysis::LEVEL;

/// Returns the matrix and its gaps as JSON.
pub fn oracles_json(summary: &OracleSummary) -> Value {
    let properties = summary.matrix.properties.iter().zip(&summary.names).map(
        |((iri, passed, failed), name)| json!({ "property": iri, "name": name, "passed": passed, "failed": failed }),
    );
    let faults = summary.matrix.rows.iter().zip(&summary.faults).map(|(row, (name, what))| {
        let cells = row.cells.iter().map(|cell| {
            json!({
                "property": cell.property, "passed": cell.passed, "failed": cell.failed, "other": cell.other,
                "newly_failed": cell.newly_failed, "newly_passed": cell.newly_passed, "p": cell.p,
                "verdict": notice_word(cell.notice),
            })
        });
        json!({
            "fault": name, "what": what, "scenes": row.scenes, "came_about": row.came_about,
            "passed_anyway": row.passed_anyway, "properties": cells.collect::<Vec<_>>(),
        })
    });
    let gaps = summary.gaps.iter().map(|gap| {
        let warning = summary.warning(gap);
        json!({ "code": warning.code, "text": warning.message, "help": warning.help })
    });
    json!({
        "config": summary.config, "seed": summary.seed, "planned_runs": summary.planned, "level": LEVEL,
        "scenes": summary.matrix.scenes, "exit_code": summary.exit_code(),
        "properties": properties.collect::<Vec<_>>(),
        "faults": faults.collect::<Vec<_>>(),
        "gaps": gaps.collect::<Vec<_>>(),
    })
}
