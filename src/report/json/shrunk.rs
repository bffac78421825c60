//! A shrunk run as JSON.

use serde_json::{Value, json};

use crate::ShrunkSummary;

/// Returns the shrunk run as JSON.
pub fn shrunk_json(shrunk: &ShrunkSummary) -> Value {
    let choices: Vec<Value> = shrunk
        .choices
        .iter()
        .map(|c| {
            json!({
                "name": c.name, "value": c.value, "nominal": c.nominal, "unit": c.unit, "needed": c.matters,
                "fails_from": c.fails.0, "fails_to": c.fails.1, "passes_below": c.passes.0, "passes_above": c.passes.1,
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
        "nearest_passing": shrunk.neighbour.as_ref().map(|(name, value)| json!({"choice": name, "value": value})),
        "why": shrunk.why,
    })
}
