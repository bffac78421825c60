//! A comparison of two campaigns as CSV and JSON.

use serde_json::{Value, json};

use crate::{CompareSummary, Table};
use actcheck_analysis::{Compared, ComparedLine};

/// One row for each property. The first row is for whole runs and has neither action nor property.
pub fn compare_table(summary: &CompareSummary) -> Table {
    let mut table = Table::new([
        "action",
        "property",
        "pairs",
        "both_passed",
        "only_a_passed",
        "only_b_passed",
        "both_failed",
        "difference",
        "low",
        "high",
        "p",
        "p_holm",
        "mid_p",
        "p_b_worse",
        "p_b_worse_holm",
        "left_out",
        "worse",
        "better",
    ]);
    for line in &summary.comparison.lines {
        let (action, property) = parts(&line.of);
        let counts = line.table;
        let difference = line.difference;
        table.rows.push(vec![
            action.into(),
            property.into(),
            counts.pairs().into(),
            counts.both.into(),
            counts.only_first.into(),
            counts.only_second.into(),
            counts.neither.into(),
            difference.map(|found| found.value).into(),
            difference.map(|found| found.low).into(),
            difference.map(|found| found.high).into(),
            line.test.two_sided.into(),
            line.two_sided_adjusted.into(),
            line.test.mid_p.into(),
            line.test.second_worse.into(),
            line.second_worse_adjusted.into(),
            line.left_out[0].total().into(),
            ids(&line.worse).into(),
            ids(&line.better).into(),
        ]);
    }
    table
}

/// Returns the whole comparison as JSON.
pub fn compare_json(summary: &CompareSummary) -> Value {
    let found = &summary.comparison;
    let [first, second] = summary.sides.each_ref().map(|side| {
        json!({
            "name": side.name, "campaign": side.campaign, "config": side.config, "runs": side.runs,
            "planned": side.planned, "started": side.started,
        })
    });
    let changes: Vec<Value> = summary
        .changes
        .iter()
        .map(|change| json!({"kind": change.kind, "name": change.name, "a": change.first, "b": change.second}))
        .collect();
    let [only_a, only_b] = summary.config_lines();
    let worse = summary.level.map(|level| found.worse_at(level).into_iter().map(of).collect::<Vec<Value>>());
    json!({
        "a": first,
        "b": second,
        "pairs": found.pairs,
        "other_physics": found.other_physics,
        "only_in_a": found.alone[0],
        "only_in_b": found.alone[1],
        "other_scene": found.other_scene,
        "judged_only_in_a": found.judged_alone[0].iter().map(parts_json).collect::<Vec<_>>(),
        "judged_only_in_b": found.judged_alone[1].iter().map(parts_json).collect::<Vec<_>>(),
        "changes": changes,
        "config_only_in_a": only_a,
        "config_only_in_b": only_b,
        "lines": found.lines.iter().map(line).collect::<Vec<Value>>(),
        "level": summary.level,
        "worse": worse,
    })
}

fn line(line: &ComparedLine) -> Value {
    let (action, property) = parts(&line.of);
    json!({
        "action": action,
        "property": property,
        "table": line.table,
        "difference": line.difference,
        "p": line.test.two_sided,
        "p_holm": line.two_sided_adjusted,
        "mid_p": line.test.mid_p,
        "p_b_worse": line.test.second_worse,
        "p_b_worse_holm": line.second_worse_adjusted,
        "left_out": { "scenes": line.left_out[0].total(), "a": line.left_out[0], "b": line.left_out[1] },
        "worse": line.worse,
        "better": line.better,
    })
}

fn of(line: &ComparedLine) -> Value {
    parts_json(&line.of)
}

fn parts_json(of: &Compared) -> Value {
    let (action, property) = parts(of);
    json!({ "action": action, "property": property })
}

/// Action and property; `(None, None)` for whole runs.
fn parts(of: &Compared) -> (Option<String>, Option<String>) {
    match of {
        Compared::WholeRun => (None, None),
        Compared::Property { action, property } => (Some(action.clone()), Some(property.clone())),
    }
}

/// Joins pairs of run ids into one cell.
fn ids(runs: &[(String, String)]) -> String {
    runs.iter().map(|(a, b)| format!("{a}/{b}")).collect::<Vec<_>>().join(" ")
}
