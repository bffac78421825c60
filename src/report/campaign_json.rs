//! A campaign for programs.

use serde_json::{Value, json};

use crate::analysis::Interval;
use crate::report::{CampaignSummary, RunSummary};
use crate::verdict::Judgement;

/// The same that [`crate::report::campaign_text`] says, as one JSON object.
pub fn campaign_json(summary: &CampaignSummary) -> Value {
    let properties: Vec<Value> = summary
        .property_lines()
        .iter()
        .zip(&summary.properties)
        .map(|(line, (_, _, unit))| {
            json!({
                "property": line.property, "label": line.label, "unit": unit,
                "counts": line.counts, "pass_rate": line.rate.as_ref().map(interval),
            })
        })
        .collect();
    json!({
        "campaign": summary.campaign,
        "config": summary.config,
        "history": summary.history,
        "planned_runs": summary.planned,
        "finished_runs": summary.runs.len(),
        "interrupted": summary.interrupted,
        "discarded_scenes": summary.discards,
        "counts": summary.counts(),
        "score": summary.total_score(),
        "score_without_broken": summary.total_score_without_broken(),
        "runs_passed": summary.pass_rate().as_ref().map(interval),
        "exit_code": summary.exit_code(),
        "properties": properties,
        "runs": summary.runs.iter().map(run).collect::<Vec<_>>(),
    })
}

fn run(run: &RunSummary) -> Value {
    let actions: Vec<Value> = run
        .actions
        .iter()
        .map(|action| {
            json!({
                "action": action.name, "score": action.score,
                "outcomes": action.judgements.iter().map(judgement).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "run": run.id, "index": run.index, "test": run.test, "status": run.status.word(),
        "reason": run.reason, "score": run.score, "actions": actions,
    })
}

fn judgement(judgement: &Judgement) -> Value {
    json!({
        "property": judgement.property, "outcome": judgement.outcome,
        "margin": judgement.margin, "witness": judgement.witness,
    })
}

fn interval(interval: &Interval) -> Value {
    json!({
        "count": interval.count, "of": interval.of,
        "rate": interval.rate, "low": interval.low, "high": interval.high,
    })
}
