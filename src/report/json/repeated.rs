//! Consistency of repeated scenes as JSON.

use serde_json::{Value, json};

use crate::{CampaignSummary, RepeatedProperty};
use actcheck_analysis::{PassPower, SceneCounts, Variance};

/// Returns the consistency of repeated scenes as JSON, or `null` if every scene was run once.
pub(super) fn repeated_json(summary: &CampaignSummary) -> Value {
    let repeated = summary.repeated();
    if repeated.is_empty() {
        return Value::Null;
    }
    let property = |RepeatedProperty {
                        property,
                        label,
                        found,
                    }: &RepeatedProperty| {
        let flaky = |SceneCounts { scene, passed, of }: &SceneCounts| {
            let runs: Vec<&str> = summary
                .runs_of_scene(*scene)
                .map(|run| run.id.as_str())
                .collect();
            json!({ "scene": scene, "passed": passed, "of": of, "runs": runs })
        };
        let power = |power: &PassPower| {
            json!({
                "k": power.k, "scenes": power.scenes, "probability": power.probability.rate,
                "low": power.probability.low, "high": power.probability.high,
            })
        };
        json!({
            "property": property, "label": label,
            "always_passed": found.always_passed, "always_failed": found.always_failed,
            "flaky": found.flaky.iter().map(flaky).collect::<Vec<_>>(),
            "pass_powers": found.pass_powers.iter().map(power).collect::<Vec<_>>(),
            "outcome_variance": variance_json(found.outcome), "margin_variance": variance_json(found.margin),
        })
    };
    Value::Array(repeated.iter().map(property).collect())
}

fn variance_json(variance: Option<Variance>) -> Value {
    variance.map_or(
        Value::Null,
        |variance| json!({ "noise": variance.noise, "scene": variance.scene, "noise_share": variance.noise_share() }),
    )
}
