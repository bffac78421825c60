//! The relations between pairs of runs as JSON.

use serde_json::{Value, json};

use crate::RelationsSummary;

/// Returns all relations with all pairs as JSON.
pub fn relations_json(summary: &RelationsSummary) -> Value {
    let relations: Vec<Value> = summary
        .relations()
        .iter()
        .map(|relation| {
            let interval = relation.kept.interval();
            json!({
                "relation": relation.name,
                "holds": relation.kept.agree,
                "of": relation.kept.of,
                "interval": interval.map(|interval| [interval.low, interval.high]),
                "inapplicable": relation.inapplicable,
                "unjudged": relation.broken,
            })
        })
        .collect();
    json!({
        "campaign": summary.related.campaign,
        "relations": relations,
        "pairs": summary.related.pairs,
    })
}
