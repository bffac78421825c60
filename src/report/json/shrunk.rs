//! A shrunk run as JSON.

use serde_json::{Value, json};

use crate::{PassingValue, ShrunkSummary};

/// Returns the shrunk run as JSON.
pub fn shrunk_json(shrunk: &ShrunkSummary) -> Value {
    let choices: Vec<Value> = shrunk
        .choices
        .iter()
        .map(|c| {
            json!({
                "name": c.name, "value": c.value, "nominal": c.nominal, "unit": c.unit, "needed": c.matters,
                "fails_from": c.fails.0, "fails_to": c.fails.1,
                "passes_below": c.passes.0.as_ref().map(|at| at.value),
                "passes_above": c.passes.1.as_ref().map(|at| at.value),
                "others_fail_below": c.passes.0.as_ref().map(|at| &at.others),
                "others_fail_above": c.passes.1.as_ref().map(|at| &at.others),
            })
        })
        .collect();
    let objects: Vec<Value> = shrunk
        .run
        .objects
        .iter()
        .map(|o| json!({"id": o.id, "role": o.role.word(), "x": o.x, "y": o.y, "yaw": o.yaw}))
        .collect();
    json!({
        "run": shrunk.run.row.run, "shrunk_from": shrunk.original, "failed": shrunk.failed,
        "others_before": shrunk.others_before, "others": shrunk.others(), "special_before": shrunk.special_before,
        "minimal": shrunk.minimal, "simulations": shrunk.simulations, "explaining_simulations": shrunk.explaining,
        "fresh_noise": shrunk.fresh.map(|(failures, of)| json!({"failed": failures, "of": of})),
        "noise_kept": shrunk.noise_kept, "objects": objects, "choices": choices,
        "passes_means": shrunk.property.as_deref().unwrap_or("everything"),
        "nearest_passing": shrunk.neighbour.as_ref().map(|(name, PassingValue { value, others })| {
            json!({"choice": name, "value": value, "others_fail": others})
        }),
        "why": shrunk.why,
    })
}
