//! A campaign's summary as JSON.

use serde_json::{Value, json};

use crate::json::repeated::repeated_json;
use crate::json::weighted::weighted_json;
use crate::{CampaignSummary, Proportion, RateBounds, Remark, RunSummary, case_json};
use actcheck_analysis::{FailureMode, Sampling};
use actcheck_base::Judgement;

/// Returns the content of [`crate::campaign_text`] as one JSON object.
pub fn campaign_json(summary: &CampaignSummary) -> Value {
    let properties: Vec<Value> = summary
        .property_lines()
        .iter()
        .zip(&summary.properties)
        .map(|(line, (_, _, unit))| {
            json!({
                "property": line.property, "label": line.label, "unit": unit,
                "counts": line.counts, "pass_rate": line.rate.as_ref().map(share),
                "held_before": line.held_before, "vacuous": line.vacuous, "bounds": line.bounds.as_ref().map(bounds),
            })
        })
        .collect();
    json!({
        "campaign": summary.campaign,
        "config": summary.config,
        "history": summary.history,
        "privileged": summary.privileged,
        "planned_runs": summary.planned,
        "finished_runs": summary.runs.len(),
        "interrupted": summary.interrupted,
        "ended_by": summary.ended_by.as_ref().map(|ended| ended.budget),
        "discarded_scenes": summary.discards,
        "counts": summary.counts(),
        "score": summary.total_score(),
        "score_without_broken": summary.total_score_without_broken(),
        "stopped_by_outcomes": summary.sampling() == Sampling::Stopped,
        "runs_passed": summary.pass_rate().as_ref().map(share),
        "runs_passed_bounds": summary.pass_rate_bounds().as_ref().map(bounds),
        "exit_code": summary.exit_code(),
        "regressions": summary.regressions.iter().map(case_json).collect::<Vec<_>>(),
        "properties": properties,
        "search": weighted_json(summary),
        "repetitions": repeated_json(summary),
        "failure_modes": summary.failure_modes.iter().map(|mode| failure_mode(summary, mode)).collect::<Vec<_>>(),
        "remarks": summary.remarks().iter().map(|one| remark(summary, one)).collect::<Vec<_>>(),
        "runs": summary.runs.iter().map(run).collect::<Vec<_>>(),
    })
}

fn failure_mode(summary: &CampaignSummary, mode: &FailureMode) -> Value {
    json!({
        "failed": mode.failed, "runs": mode.runs,
        "share": summary.mode_share(mode).rate, "low": mode.share.low, "high": mode.share.high,
    })
}

fn remark(summary: &CampaignSummary, remark: &Remark) -> Value {
    let properties: Vec<&str> = remark
        .properties
        .iter()
        .map(|(iri, _)| iri.as_str())
        .collect();
    json!({
        "severity": if remark.warning { "warning" } else { "note" }, "oddity": remark.oddity.word(),
        "properties": properties, "count": remark.count, "of": remark.of, "run": remark.run,
        "text": summary.remark_text(remark),
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
        "run": run.id, "index": run.index, "weight": run.weight, "test": run.test, "status": run.status.word(),
        "reason": run.reason, "score": run.score, "actions": actions,
    })
}

fn judgement(judgement: &Judgement) -> Value {
    json!({
        "property": judgement.property, "outcome": judgement.outcome,
        "margin": judgement.margin, "witness": judgement.witness,
        "held_before": judgement.held_before, "vacuous": judgement.vacuous,
    })
}

/// The bounds of a rate with lost outcomes counted as failures and as passes.
fn bounds(bounds: &RateBounds) -> Value {
    json!({ "lost": bounds.lost, "as_failures": share(&bounds.as_failures), "as_passes": share(&bounds.as_passes) })
}

fn share(share: &Proportion) -> Value {
    json!({
        "count": share.count, "of": share.of,
        "rate": share.rate, "low": share.interval.low, "high": share.interval.high,
    })
}
