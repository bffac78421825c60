//! The changes that a recheck made as JSON.

use serde_json::{Value, json};

use crate::{RecheckSummary, recheck_table};

/// Returns the changes and the counts of each property as JSON.
pub fn recheck_json(summary: &RecheckSummary) -> Value {
    let properties: Vec<Value> = summary
        .properties
        .iter()
        .map(|(iri, line)| {
            json!({
                "property": iri,
                "before": line.before,
                "now": line.now,
                "changed": line.changed,
                "new": line.new,
                "restated": line.restated,
                "vacuous": line.vacuous,
                "held_before": line.held_before,
            })
        })
        .collect();
    json!({ "runs": summary.runs, "properties": properties, "changes": recheck_table(summary).objects() })
}
