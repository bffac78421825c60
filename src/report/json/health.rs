//! A campaign's health report as JSON.

use serde_json::{Value, json};

use crate::HealthSummary;

/// Returns the health report as JSON.
pub fn health_json(summary: &HealthSummary) -> Value {
    let health = &summary.health;
    let parameters = health.parameters.iter().map(|parameter| {
        json!({
            "parameter": parameter.name, "draws": parameter.draws, "counts": parameter.counts,
            "hit": parameter.hits(), "expected_hit": parameter.expected_hits,
        })
    });
    let pairs = health.pairs.iter().map(|pair| {
        json!({
            "parameters": pair.names, "draws": pair.draws, "cells": pair.cells, "hit": pair.hits,
            "expected_hit": pair.expected_hits,
        })
    });
    let worst = |worst: &Option<(f64, String)>| {
        worst
            .as_ref()
            .map(|(value, run)| json!({ "value": value, "run": run }))
    };
    let warnings = health.problems.iter().map(|problem| {
        let warning = summary.warning(problem);
        json!({ "code": warning.code, "text": warning.message, "help": warning.help })
    });
    json!({
        "campaign": summary.campaign, "runs": health.runs, "discarded_scenes": health.discards,
        "wall_median_secs": health.median_secs, "wall_longest_secs": worst(&health.slowest),
        "deepest_penetration_m": worst(&health.deepest), "energy_gain_j": worst(&health.energy),
        "parameters": parameters.collect::<Vec<_>>(),
        "pairs": pairs.collect::<Vec<_>>(),
        "warnings": warnings.collect::<Vec<_>>(),
    })
}
