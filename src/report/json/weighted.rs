//! Weighted failure rates of a guided search as JSON.

use serde_json::{Value, json};

use crate::{CampaignSummary, GuidedSearch, WeightedLine};

/// Returns the weighted rates as JSON, or `null` if scenes were sampled at random.
pub(super) fn weighted_json(summary: &CampaignSummary) -> Value {
    let Some(GuidedSearch { strategy, lines }) = &summary.search else {
        return Value::Null;
    };
    let line = |line: &WeightedLine| {
        json!({
            "test": line.test, "property": line.property, "label": line.label,
            "rate": line.failing.rate, "low": line.failing.low, "high": line.failing.high, "scenes": line.scenes,
            "raw_failed": line.raw.map(|raw| raw.count), "raw_runs": line.raw.map(|raw| raw.of),
        })
    };
    json!({
        "strategy": strategy, "counts_are_rates": false,
        "weighted_failure_rates": lines.iter().map(line).collect::<Vec<_>>(),
    })
}
