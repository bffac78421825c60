//! The part of a user's program in a run as JSON: for `show`, and for the replays of the page.

use serde_json::{Value, json};

use actcheck_data::{SkillDeed, SkillEntry, Trace};

/// Returns the log of a run's program as JSON; `null` if no program took part. Times are seconds
/// since the run began.
pub fn skill_json(trace: &Trace) -> Value {
    let log = &trace.skill;
    if log.is_empty() {
        return Value::Null;
    }
    let begin_secs = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    json!({
        "entries": log.entries.iter().map(|one| entry(one, begin_secs)).collect::<Vec<Value>>(),
        "lines_left_out": log.lines_left_out, "others_left_out": log.others_left_out,
    })
}

fn entry(entry: &SkillEntry, begin_secs: f64) -> Value {
    let secs = rounded(entry.time_secs - begin_secs);
    match &entry.deed {
        SkillDeed::Printed(line) => json!({ "secs": secs, "printed": line }),
        SkillDeed::Commanded(stretch) => {
            let targets = stretch.targets.iter().map(|target| {
                json!({ "kind": target.kind.word(), "joint": target.joint, "value": digits(target.value) })
            });
            json!({
                "secs": secs, "commands": stretch.commands, "until": rounded(stretch.end_secs - begin_secs),
                "targets": targets.collect::<Vec<Value>>(),
            })
        }
        SkillDeed::Asked(question) => {
            let objects = question.objects.iter().map(
                |object| json!({ "id": object.id, "position_m": object.position_m.map(digits) }),
            );
            json!({
                "secs": secs, "asked": question.what, "of": question.of, "count": question.count, "bytes": question.bytes,
                "objects": objects.collect::<Vec<Value>>(),
            })
        }
    }
}

/// Milliseconds are finer than a control tick.
fn rounded(secs: f64) -> f64 {
    (secs * 1e3).round() / 1e3
}

/// Four decimals: a tenth of a millimetre, or of a milliradian.
fn digits(value: f32) -> f64 {
    (f64::from(value) * 1e4).round() / 1e4
}
