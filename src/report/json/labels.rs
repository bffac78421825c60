//! Verdicts beside people's labels as JSON.

use serde_json::{Value, json};

use crate::summary::label_word;
use crate::{LabelSummary, LabelledProperty};

/// Returns one object for each property.
pub fn labels_json(summary: &LabelSummary) -> Value {
    summary.properties.iter().map(property).collect()
}

fn property(one: &LabelledProperty) -> Value {
    let found = &one.found;
    let fitted = found.fitted.map(|fitted| {
        json!({
            "margin": fitted.margin, "limit": one.fitted_limit(&fitted),
            "fitted_to": fitted.fitted_to, "fitted": fitted.fitted,
            "held_out": fitted.held_out, "confirmed": fitted.confirmed,
            "p": fitted.test.second_worse,
        })
    });
    let contradicting: Vec<Value> = found
        .contradicting
        .iter()
        .map(|run| json!({ "run": run.run, "label": label_word(run.label), "margin": run.margin }))
        .collect();
    json!({
        "property": one.property,
        "labels": found.agreement.of,
        "agreeing": found.agreement.agree,
        "passes_only_by_rules": found.only_rules,
        "passes_only_by_labels": found.only_labels,
        "limit": one.limit.map(|limit| limit.at),
        "fitted": fitted,
        "contradicting": contradicting,
    })
}
