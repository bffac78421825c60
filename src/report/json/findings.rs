//! Findings of the analysis as JSON.

use serde_json::{Value, json};

use crate::{Causes, FindingsSummary, PropertyReport};
use actcheck_analysis::{
    Cascade, Collisions, Condition, FailureMode, HitKind, Judged, Parameter, Pattern,
    PropertyFindings, Sampling, Sector, Strongest, TwoByTwo, TwoWay,
};

/// Returns all findings as JSON.
pub fn findings_json(summary: &FindingsSummary) -> Value {
    let mode = |mode: &FailureMode| json!({ "failed": mode.failed, "share": mode.share, "runs": mode.runs });
    findings_with(summary, summary.modes.iter().map(mode).collect())
}

/// Returns all findings as JSON, with these failure modes: of a million runs, the ids in them are
/// most of the text.
pub(crate) fn findings_with(summary: &FindingsSummary, modes: Vec<Value>) -> Value {
    json!({
        "campaigns": summary.campaigns,
        "runs": summary.runs, "twins": summary.twins,
        "stopped_by_outcomes": summary.sampling == Sampling::Stopped, "sampled_runs": summary.sampled_runs,
        "outcomes": summary.counts,
        "level": summary.level,
        "failure_modes": modes,
        "cascades": summary.cascades.iter().map(cascade).collect::<Vec<Value>>(),
        "collisions": summary.collisions.iter().map(collisions).collect::<Vec<Value>>(),
        "properties": summary.properties.iter().map(property).collect::<Vec<Value>>(),
    })
}

fn cascade(cascade: &Cascade) -> Value {
    let judged =
        |of: &Judged| json!({ "step": of.step, "action": of.action, "property": of.property });
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
        "patterns": causes(report.when(), found),
        "effects": causes(report.how(), found),
        "trend": { "campaigns": points.collect::<Vec<Value>>(), "changes": changes.collect::<Vec<Value>>() },
        "flaky": { "scenes": report.repeated_scenes, "both_ways": flaky.collect::<Vec<Value>>() },
        "maps": report.maps.iter().map(map).collect::<Vec<Value>>(),
    })
}

/// Patterns of conditions or of effects.
fn causes(causes: Causes<'_>, found: &PropertyFindings) -> Value {
    let patterns = causes.patterns;
    json!({
        "runs": patterns.runs, "failed": patterns.failed, "held_out": patterns.held_out, "tried": patterns.tried,
        "parameters": patterns.parameters, "depth": patterns.depth, "combined": patterns.combined,
        "twins": found.twins, "repeated": found.repeated, "steered": found.weighted_runs,
        "found": patterns.patterns.iter().map(|one| pattern(&causes, one)).collect::<Vec<Value>>(),
        "strongest": patterns.strongest.iter().map(|one| strongest(&causes, one)).collect::<Vec<Value>>(),
    })
}

/// A condition that may go with failures by chance.
fn strongest(causes: &Causes<'_>, strongest: &Strongest) -> Value {
    let one = &strongest.condition;
    json!({
        "sentence": causes.strongest_sentence(strongest),
        "conditions": [condition(one, &causes.input.parameters[one.parameter()])],
        "all": table(strongest.all), "rate": strongest.rate, "elsewhere": strongest.elsewhere,
        "p": strongest.p, "p_corrected": strongest.p_corrected, "runs_needed": strongest.runs_needed,
    })
}

fn pattern(causes: &Causes<'_>, pattern: &Pattern) -> Value {
    let parameters = &causes.input.parameters;
    let conditions: Vec<Value> = pattern
        .conditions
        .iter()
        .map(|one| condition(one, &parameters[one.parameter()]))
        .collect();
    json!({
        "sentence": causes.sentence(pattern), "plain": causes.plain_sentence(pattern),
        "conditions": conditions,
        "all": table(pattern.all), "searched": table(pattern.searched), "held_out": table(pattern.held_out),
        "rate": pattern.rate, "elsewhere": pattern.elsewhere, "lift": pattern.lift, "wracc": pattern.wracc,
        "p": pattern.p, "q": pattern.q, "p_held_out": pattern.p_held_out, "confirmed": pattern.confirmed,
        "runs": causes.runs(pattern),
    })
}

fn condition(condition: &Condition, parameter: &Parameter) -> Value {
    match condition {
        Condition::Kind { kind, .. } => json!({ "parameter": parameter.name, "kind": kind }),
        Condition::Range { low, high, .. } => {
            json!({ "parameter": parameter.name, "low": low, "high": high, "unit": parameter.unit })
        }
        // An arc through ±π: its lower end is above its upper end.
        Condition::Arc { from, to, .. } => {
            json!({ "parameter": parameter.name, "low": from, "high": to, "unit": parameter.unit, "wraps": true })
        }
    }
}

fn collisions(of: &Collisions) -> Value {
    let counted = |counts: &[(String, u64)]| -> Vec<Value> {
        counts
            .iter()
            .map(|(name, count)| json!({ "name": name, "count": count }))
            .collect()
    };
    let kind = |kind: &HitKind| {
        json!({
            "category": kind.category, "furniture": kind.furniture, "present": kind.present, "hit": kind.hit,
            "rate": kind.rate, "force_n": kind.force_n, "by": counted(&kind.by), "phases": counted(&kind.phases),
            "directions": counted(&kind.directions), "runs": kind.runs,
        })
    };
    let sector = |sector: &Sector| {
        let (from, to) = sector.distance_m;
        json!({
            "direction": sector.direction, "from_m": from, "to_m": to, "present": sector.present, "hit": sector.hit,
            "rate": sector.rate,
        })
    };
    let things = of.things.iter().map(|thing| {
        json!({
            "run": thing.run, "object": thing.object, "category": thing.category, "beyond_m": thing.beyond_m,
            "left_m": thing.left_m, "force_n": thing.force_n,
        })
    });
    json!({
        "action": of.action, "executions": of.executions, "hit": of.hit, "rate": of.rate,
        "kinds": of.kinds.iter().map(kind).collect::<Vec<Value>>(),
        "sectors": of.sectors.iter().map(|row| row.iter().map(sector).collect()).collect::<Vec<Vec<Value>>>(),
        "things": things.collect::<Vec<Value>>(),
    })
}

fn map(map: &TwoWay) -> Value {
    let cell = |cell: &actcheck_analysis::TwoWayCell| json!({ "runs": cell.runs, "failed": cell.failed, "failing": cell.failing });
    let rows: Vec<Vec<Value>> = map
        .cells
        .iter()
        .map(|row| row.iter().map(cell).collect())
        .collect();
    json!({ "by": map.by, "down": map.down, "across": map.across, "cells": rows })
}
