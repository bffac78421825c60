//! Findings of the analysis as JSON.

use serde_json::{Value, json};

use crate::{FindingsSummary, PropertyReport};
use actcheck_analysis::{Cascade, Condition, Judged, Parameter, Pattern, TwoByTwo, TwoWay};

/// Returns all findings as JSON.
pub fn findings_json(summary: &FindingsSummary) -> Value {
    let modes: Vec<Value> = summary
        .modes
        .iter()
        .map(|mode| json!({ "failed": mode.failed, "share": mode.share, "runs": mode.runs }))
        .collect();
    json!({
        "campaigns": summary.campaigns,
        "runs": summary.runs,
        "outcomes": summary.counts,
        "level": summary.level,
        "failure_modes": modes,
        "cascades": summary.cascades.iter().map(cascade).collect::<Vec<Value>>(),
        "properties": summary.properties.iter().map(property).collect::<Vec<Value>>(),
    })
}

fn cascade(cascade: &Cascade) -> Value {
    let judged = |of: &Judged| json!({ "step": of.step, "action": of.action, "property": of.property });
    json!({
        "first": judged(&cascade.first), "later": judged(&cascade.later), "table": table(cascade.table),
        "p": cascade.p, "q": cascade.q,
    })
}

fn table(table: TwoByTwo) -> Value {
    json!({
        "failed_in": table.failed_in, "passed_in": table.passed_in,
        "failed_out": table.failed_out, "passed_out": table.passed_out,
    })
}

fn property(report: &PropertyReport) -> Value {
    let found = &report.findings;
    let patterns = &found.patterns;
    let points = report.trend.points.iter().map(|point| {
        json!({
            "campaign": point.campaign, "started": point.started, "runs": point.runs, "failed": point.failed,
            "failing": point.failing,
        })
    });
    let changes = report.trend.changes.iter().map(|change| {
        json!({
            "campaign": report.trend.points[change.at].campaign, "before": change.before, "behind": change.behind,
            "p": change.p,
        })
    });
    let flaky = report.flaky.iter().map(
        |scene| json!({ "campaign": scene.campaign, "scene": scene.scene, "passed": scene.passed, "of": scene.of }),
    );
    json!({
        "action": found.action,
        "property": found.property,
        "outcomes": found.counts,
        "failing": found.failing,
        "margin": { "unit": report.unit, "quantiles": found.margins },
        "patterns": {
            "runs": patterns.runs, "failed": patterns.failed, "held_out": patterns.held_out, "tried": patterns.tried,
            "parameters": patterns.parameters, "depth": patterns.depth, "combined": patterns.combined,
            "twins": found.twins, "repeated": found.repeated, "steered": found.weighted_runs,
            "found": patterns.patterns.iter().map(|one| pattern(report, one)).collect::<Vec<Value>>(),
        },
        "trend": { "campaigns": points.collect::<Vec<Value>>(), "changes": changes.collect::<Vec<Value>>() },
        "flaky": { "scenes": report.repeated_scenes, "both_ways": flaky.collect::<Vec<Value>>() },
        "maps": report.maps.iter().map(map).collect::<Vec<Value>>(),
    })
}

fn pattern(report: &PropertyReport, pattern: &Pattern) -> Value {
    let parameters = &report.findings.input.parameters;
    let conditions: Vec<Value> =
        pattern.conditions.iter().map(|one| condition(one, &parameters[one.parameter()])).collect();
    json!({
        "sentence": report.sentence(pattern),
        "conditions": conditions,
        "all": table(pattern.all), "searched": table(pattern.searched), "held_out": table(pattern.held_out),
        "rate": pattern.rate, "elsewhere": pattern.elsewhere, "lift": pattern.lift, "wracc": pattern.wracc,
        "p": pattern.p, "q": pattern.q, "p_held_out": pattern.p_held_out, "confirmed": pattern.confirmed,
        "runs": report.runs(pattern),
    })
}

fn condition(condition: &Condition, parameter: &Parameter) -> Value {
    match condition {
        Condition::Kind { kind, .. } => json!({ "parameter": parameter.name, "kind": kind }),
        Condition::Range { low, high, .. } => {
            json!({ "parameter": parameter.name, "low": low, "high": high, "unit": parameter.unit })
        }
    }
}

fn map(map: &TwoWay) -> Value {
    let cell = |cell: &actcheck_analysis::TwoWayCell| json!({ "runs": cell.runs, "failed": cell.failed, "failing": cell.failing });
    let rows: Vec<Vec<Value>> = map.cells.iter().map(|row| row.iter().map(cell).collect()).collect();
    json!({ "by": map.by, "down": map.down, "across": map.across, "cells": rows })
}
