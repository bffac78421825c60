//! The same runs in two physics engines as JSON.

use serde_json::{Value, json};

use crate::EngineSummary;
use actcheck_analysis::{Agreement, RunInEngines};

/// Returns the whole comparison as JSON.
pub fn engines_json(summary: &EngineSummary) -> Value {
    let comparison = &summary.comparison;
    let properties: Vec<Value> = comparison
        .of_properties()
        .into_iter()
        .map(|own| {
            json!({
                "property": own.property, "agreement": agreement(own.engines),
                "mujoco_with_itself": agreement(own.itself),
                "passes_only_here": own.only_here, "passes_only_in_mujoco": own.only_there,
            })
        })
        .collect();
    let settings: Vec<Value> = comparison
        .settings()
        .into_iter()
        .map(|setting| {
            let [here, there] = comparison.of_setting(setting).map(agreement);
            json!({ "setting": setting, "with_actcheck": here, "with_mujoco": there })
        })
        .collect();
    json!({
        "campaign": summary.campaign,
        "mujoco": summary.version,
        "closed_loop": summary.closed_loop,
        "imported": summary.imported,
        "all_properties": agreement(comparison.agreement()),
        "properties": properties,
        "settings": settings,
        "likely_cause": comparison.likely_cause().map(|(setting, _)| setting),
        "mujoco_cpu_secs": summary.plain_secs,
        "runs": comparison.runs.iter().map(run).collect::<Vec<Value>>(),
    })
}

fn agreement(of: Agreement) -> Value {
    let interval = of.interval().map(|interval| [interval.low, interval.high]);
    json!({ "agree": of.agree, "of": of.of, "interval": interval })
}

fn run(run: &RunInEngines) -> Value {
    let flips: Vec<Value> = run
        .disagreements
        .iter()
        .map(|one| json!({ "property": one.property, "here": one.here, "in_mujoco": one.there }))
        .collect();
    let parting = run.parting.as_ref();
    let contact = run.contact.as_ref();
    json!({
        "run": run.run,
        "contested": run.contested(),
        "flips": flips,
        "flips_by_setting": run.flips_here,
        "parting": parting.map(|parting| json!({ "secs": parting.secs, "body": parting.body })),
        "first_contact": contact.map(|contact| json!({
            "pair": contact.pair, "secs": contact.secs, "only_here": contact.is_here,
        })),
    })
}
