//! Results of replays as text, table and JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use actcheck_base::names;
use actcheck_campaign::{Replay, TraceDifference, other_physics};
use actcheck_report::Table;

/// Maximum number of lines of one kind below a run; the rest are counted.
const MOST_LINES: usize = 12;

/// Describes every replay, and counts those that were the same.
pub fn replay_text(replays: &[Replay], refused: usize) -> String {
    let mut out = String::new();
    for replay in replays {
        one_text(&mut out, replay);
    }
    let same = replays.iter().filter(|replay| replay.same).count();
    if replays.len() + refused > 1 {
        let expected = |replay: &&Replay| !replay.same && other_physics(&replay.changes).is_some();
        let other = replays.iter().filter(expected).count();
        let differ = replays.len() - same - other;
        let _ = write!(
            out,
            "{same} of {} runs are the same, {differ} differ",
            replays.len() + refused
        );
        let _ = match other {
            0 => writeln!(out),
            _ => writeln!(out, ", {other} were made by other physics"),
        };
    }
    out
}

fn one_text(out: &mut String, replay: &Replay) {
    let [was, is] = &replay.hashes;
    let made = other_physics(&replay.changes).filter(|_| !replay.same);
    let told = match (replay.same, &made) {
        (true, _) => format!("the same, every bit of every state (trace {was})"),
        (false, Some(made)) => format!("{made}; its states differ"),
        (false, None) => format!("differs (trace {was}, now {is})"),
    };
    let _ = writeln!(out, "{} ({}): {told}", replay.run, replay.test);
    if !replay.same && made.is_none() {
        let _ = writeln!(out, "  {}", difference_text(replay));
    }
    if let Some(secs) = replay.cut_secs {
        let _ = writeln!(
            out,
            "  only up to {secs:.3} s, where the wall-clock limit had ended the run (`[budget] run_secs`)"
        );
    }
    lines(
        out,
        "choice",
        replay.misfits.iter().map(ToString::to_string),
    );
    let or_none = |word: &Option<String>| word.clone().unwrap_or_else(|| "not judged".to_owned());
    let outcomes = replay.outcomes.iter().map(|change| {
        let property = names::local(&change.property);
        format!(
            "{property} of action {} was {}, is {}",
            change.step,
            or_none(&change.was),
            or_none(&change.is)
        )
    });
    lines(out, "outcome", outcomes);
    let or_gone = |digest: &Option<String>| digest.clone().unwrap_or_else(|| "missing".to_owned());
    let changes = replay.changes.iter().map(|change| {
        format!(
            "{} `{}` was {}, is {}",
            change.kind.word(),
            change.name,
            or_gone(&change.was),
            or_gone(&change.is)
        )
    });
    lines(out, "changed since", changes);
}

fn lines(out: &mut String, what: &str, lines: impl ExactSizeIterator<Item = String>) {
    let more = lines.len().saturating_sub(MOST_LINES);
    for line in lines.take(MOST_LINES) {
        let _ = writeln!(out, "  {what}: {line}");
    }
    if more > 0 {
        let _ = writeln!(out, "  {what}: and {more} more");
    }
}

fn difference_text(replay: &Replay) -> String {
    let Some(found) = &replay.difference else {
        let [was, is] = replay
            .reasons
            .each_ref()
            .map(|reason| reason.as_deref().unwrap_or("completed"));
        return match was == is {
            true => {
                "by less than the resolution of the stored states: 0.1 mm between the starts and ends of actions".into()
            }
            false => format!("it ended differently: was {was}, is {is}"),
        };
    };
    let TraceDifference {
        time_secs,
        step,
        body,
        quantity,
        unit,
        was,
        is,
        by,
        others,
    } = found;
    let place = if *step == 0 {
        "before the first action".to_owned()
    } else {
        format!("in action {step}")
    };
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let by = by.map_or_else(String::new, |by| format!(", by {by:.3e}{unit}"));
    let rest = if *others > 0 {
        format!("; {others} more quantities differ then")
    } else {
        String::new()
    };
    format!(
        "first at {time_secs:.3} s, {place}: {quantity} of {body} was {was}{unit}, is {is}{unit}{by}{rest}"
    )
}

/// One row for each run.
pub fn replay_table(replays: &[Replay]) -> Table {
    let columns = [
        "run",
        "same",
        "time_secs",
        "step",
        "body",
        "quantity",
        "unit",
        "was",
        "is",
        "by",
        "changed",
    ];
    let mut table = Table::new(columns);
    for replay in replays {
        let of = |value: fn(&TraceDifference) -> Value| {
            replay.difference.as_ref().map_or(Value::Null, value)
        };
        let changed: Vec<String> = replay
            .changes
            .iter()
            .map(|change| format!("{} {}", change.kind.word(), change.name))
            .collect();
        table.rows.push(vec![
            replay.run.clone().into(),
            replay.same.into(),
            of(|found| found.time_secs.into()),
            of(|found| found.step.into()),
            of(|found| found.body.clone().into()),
            of(|found| found.quantity.clone().into()),
            of(|found| found.unit.into()),
            of(|found| found.was.clone().into()),
            of(|found| found.is.clone().into()),
            of(|found| found.by.into()),
            changed.join("; ").into(),
        ]);
    }
    table
}

/// All results as JSON.
pub fn replay_json(replays: &[Replay]) -> Value {
    let one = |replay: &Replay| {
        json!({
            "run": replay.run, "test": replay.test, "same": replay.same, "cut_secs": replay.cut_secs,
            "hash": { "was": replay.hashes[0], "is": replay.hashes[1] },
            "reason": { "was": replay.reasons[0], "is": replay.reasons[1] },
            "difference": replay.difference.as_ref().map(|found| json!({
                "time_secs": found.time_secs, "step": found.step, "body": found.body, "quantity": found.quantity,
                "unit": found.unit, "was": found.was, "is": found.is, "by": found.by, "others": found.others,
            })),
            "choices": replay.misfits.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "outcomes": replay.outcomes.iter().map(|change| json!({
                "step": change.step, "property": change.property, "was": change.was, "is": change.is,
            })).collect::<Vec<_>>(),
            "changes": replay.changes.iter().map(|change| json!({
                "kind": change.kind.word(), "name": change.name, "was": change.was, "is": change.is,
            })).collect::<Vec<_>>(),
        })
    };
    Value::Array(replays.iter().map(one).collect())
}
