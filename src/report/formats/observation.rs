//! Exports a run as an observation of a property-based test, in the schema of Hypothesis.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::formats::identity::scene;
use crate::run_json;
use actcheck_base::{Judgement, Outcome, names};
use actcheck_history::{RunDetail, RunStatus};
use actcheck_verdict::Counts;

/// Returns the observation of a run. `campaign_started` is the start of its campaign (RFC 3339), by
/// which viewers group observations.
///
/// The schema has three results: `failed` if a property failed; `gave_up` if the run was broken or
/// timed out, or nothing could be judged; `passed` otherwise. The features include the counts of
/// all six outcomes.
pub fn observation(run: &RunDetail, campaign_started: &str) -> Value {
    let judgements = || run.actions.iter().flat_map(|action| &action.judgements);
    let counts = Counts::of(judgements().map(|judgement| judgement.outcome));
    let (status, reason) = result(run, counts);
    let whole = run_json(run, &BTreeMap::new());
    let mut features: BTreeMap<String, Value> = Outcome::ALL
        .iter()
        .map(|outcome| (outcome.word().to_owned(), counts.get(*outcome).into()))
        .collect();
    features.insert("score".to_owned(), run.row.score.into());
    for action in &run.actions {
        for judgement in &action.judgements {
            let name = format!(
                "{} {}: {}",
                action.step,
                names::local(&action.action),
                names::local(&judgement.property)
            );
            features.insert(format!("{name} margin"), judgement.margin.into());
            features.insert(name, judgement.outcome.word().into());
        }
    }
    json!({
        "type": "test_case",
        "status": status,
        "status_reason": reason,
        "representation": format!("{} in scene {} ({})", run.row.test, scene(run), run.row.run),
        "arguments": {
            "world": run.world, "robot_base": run.robot_base, "objects": whole["objects"], "noise": run.noise,
            "designators": run.designators,
        },
        "how_generated": how(run),
        "features": features,
        "coverage": null,
        "timing": timing(run),
        "metadata": {
            "run": run.row.run, "campaign": run.row.campaign, "index": run.row.index, "seed": run.seed,
            "scene": run.row.repetition.map(|repetition| repetition.scene),
            "repetition": run.row.repetition.map(|repetition| repetition.number), "weight": run.row.weight,
            "run_status": run.row.status.word(), "trace_hash": run.row.trace_hash, "started": run.row.started,
            "program_version": run.program_version, "actions": whole["actions"],
        },
        "property": run.row.test,
        "run_start": campaign_started.parse::<jiff::Timestamp>().map_or(0.0, |moment| moment.as_millisecond() as f64 / 1000.0),
    })
}

fn result(run: &RunDetail, counts: Counts) -> (&'static str, String) {
    if counts.failed > 0 {
        return (
            "failed",
            witnesses(run, |judgement| judgement.outcome == Outcome::Failed),
        );
    }
    if run.row.status != RunStatus::Completed || counts.broken + counts.timeout > 0 {
        let first = run.reason.clone().unwrap_or_else(|| {
            witnesses(run, |judgement| {
                matches!(judgement.outcome, Outcome::Broken | Outcome::Timeout)
            })
        });
        return ("gave_up", first);
    }
    match counts.passed {
        0 => ("gave_up", "nothing could be judged".to_owned()),
        _ => ("passed", String::new()),
    }
}

fn witnesses(run: &RunDetail, about: impl Fn(&Judgement) -> bool) -> String {
    let lines = run.actions.iter().flat_map(|action| {
        let judgements = action
            .judgements
            .iter()
            .filter(|judgement| about(judgement));
        let line = |judgement: &Judgement| {
            let (action, property) = (
                names::local(&action.action),
                names::local(&judgement.property),
            );
            format!("{action}: {property}: {}", judgement.witness)
        };
        judgements.map(line).collect::<Vec<String>>()
    });
    lines.collect::<Vec<String>>().join("; ")
}

fn how(run: &RunDetail) -> String {
    let weighted = if run.row.weight.is_some() {
        ", chosen by a search"
    } else {
        ""
    };
    let again = run
        .row
        .repetition
        .filter(|repetition| repetition.number > 0);
    let again = again.map_or_else(String::new, |it| {
        format!(", repetition {} of its scene", it.number + 1)
    });
    format!(
        "seed {}, run {}{weighted}{again}",
        run.seed,
        run.row.index + 1
    )
}

/// Wall-clock time, divided among the actions in proportion to their simulated time.
fn timing(run: &RunDetail) -> BTreeMap<String, f64> {
    let simulated: f64 = run.actions.iter().map(|action| action.duration_secs).sum();
    let wall = run.wall_secs.max(0.0);
    if simulated <= 0.0 {
        return BTreeMap::from([("execute:run".to_owned(), wall)]);
    }
    let shared = run.actions.iter().map(|action| {
        let name = format!("execute:{} {}", action.step, names::local(&action.action));
        (name, wall * action.duration_secs.max(0.0) / simulated)
    });
    shared.collect()
}
