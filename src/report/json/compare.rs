//! A comparison of two campaigns as JSON.

use serde_json::{Value, json};

use crate::summary::compared_parts;
use crate::{CompareSummary, KnownIssueRuns};
use actcheck_analysis::{Answer, Compared, ComparedLine, Sampling};

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
    let worse = summary.level.map(|level| {
        found
            .worse_at(level)
            .into_iter()
            .map(of)
            .collect::<Vec<Value>>()
    });
    let without_contested = summary.without_contested.as_ref().map(|found| {
        let line = |line: &ComparedLine| {
            let (action, property) = compared_parts(&line.of);
            json!({ "action": action, "property": property, "table": line.table, "difference": line.difference })
        };
        json!({ "pairs": found.pairs, "lines": found.lines.iter().map(line).collect::<Vec<Value>>() })
    });
    json!({
        "a": first,
        "b": second,
        "pairs": found.pairs,
        "stopped_by_outcomes": found.sampling == Sampling::Stopped,
        "other_physics": found.other_physics,
        "only_in_a": found.alone[0],
        "only_in_b": found.alone[1],
        "other_scene": found.other_scene,
        "judged_only_in_a": found.judged_alone[0].iter().map(parts_json).collect::<Vec<_>>(),
        "judged_only_in_b": found.judged_alone[1].iter().map(parts_json).collect::<Vec<_>>(),
        "changes": changes,
        "config_only_in_a": only_a,
        "config_only_in_b": only_b,
        "lines": found.lines.iter().map(|found| line(found, summary)).collect::<Vec<Value>>(),
        "level": summary.level,
        "margin": summary.margin,
        "answer": summary.answer().word(),
        "worse": worse,
        "sequential": summary.sequential,
        "without_contested": without_contested,
        "known": summary.known.iter().map(known).collect::<Vec<Value>>(),
    })
}

fn known(issue: &KnownIssueRuns) -> Value {
    let [a, b] = &issue.runs;
    json!({
        "fails": issue.fails, "reason": issue.reason, "until": issue.until, "expired": issue.is_expired,
        "a": a, "b": b,
    })
}

fn line(line: &ComparedLine, summary: &CompareSummary) -> Value {
    let (action, property) = compared_parts(&line.of);
    let answer = summary
        .comparison
        .answer_of(line, summary.answer_level(), summary.margin);
    let scenes = if let Answer::Underpowered { scenes } = answer {
        scenes
    } else {
        None
    };
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
        "answer": answer.word(),
        "scenes_to_decide": scenes,
        "worse": line.worse,
        "better": line.better,
    })
}

fn of(line: &ComparedLine) -> Value {
    parts_json(&line.of)
}

fn parts_json(of: &Compared) -> Value {
    let (action, property) = compared_parts(of);
    json!({ "action": action, "property": property })
}
