//! Records the events of a run as log lines.

use re_sdk_types::archetypes::TextLog;

use crate::contacts::strongest;
use crate::moment::deciding_moment;
use crate::recording::stream::{Recording, RecordingFault, place};
use actcheck_base::{Outcome, names};
use actcheck_data::Trace;
use actcheck_history::RunDetail;

/// A log line with its time. Unit: seconds since the run began.
struct LogLine {
    secs: f64,
    level: &'static str,
    text: String,
}

/// Records the events below `events`: actions with their phases, contacts, and outcomes other than
/// passed. For a run without a trace, all known events are at the beginning.
///
/// # Errors
/// The rerun library rejects a line.
pub(super) fn record(
    recording: &mut Recording<'_>,
    run: &RunDetail,
    trace: Option<&Trace>,
) -> Result<(), RecordingFault> {
    let kinds = [
        ("actions", actions(run, trace)),
        ("contacts", contacts(trace)),
        ("outcomes", outcomes(run, trace)),
    ];
    for (kind, mut lines) in kinds {
        if lines.is_empty() {
            continue;
        }
        lines.sort_by(|a, b| a.secs.total_cmp(&b.secs));
        let texts = TextLog::update_fields()
            .with_many_text(lines.iter().map(|line| line.text.as_str()))
            .with_many_level(lines.iter().map(|line| line.level));
        let columns = texts.columns_of_unit_batches()?;
        recording.log_series(
            place(["events", kind]),
            lines.iter().map(|line| line.secs),
            columns,
        )?;
    }
    Ok(())
}

/// Start time of an action, given its index in the run. Returns the end of the run if the action
/// was never reached.
fn begin(trace: Option<&Trace>, idx: usize) -> f64 {
    let Some(trace) = trace else { return 0.0 };
    let time = |idx: usize| {
        trace
            .snapshots
            .get(idx)
            .or(trace.snapshots.last())
            .map_or(0.0, |state| state.time_secs)
    };
    time(idx) - time(0)
}

fn actions(run: &RunDetail, trace: Option<&Trace>) -> Vec<LogLine> {
    let mut lines = Vec::new();
    for (idx, action) in run.actions.iter().enumerate() {
        let (name, start) = (names::local(&action.action), begin(trace, idx));
        let line = |secs: f64, level, event: &str| LogLine {
            secs,
            level,
            text: format!("{}. {name} {event}", action.step),
        };
        if action.end == Outcome::Untested.word() {
            lines.push(line(start, "WARN", "was not reached"));
            continue;
        }
        if action.end == Outcome::Inapplicable.word() {
            let reason = action.message.as_deref().unwrap_or_default();
            lines.push(line(start, "WARN", &format!("was not performed: {reason}")));
            continue;
        }
        lines.push(line(start, "INFO", "begins"));
        let phases = trace
            .and_then(|trace| trace.actions.get(idx))
            .into_iter()
            .flat_map(|action| &action.phases);
        lines.extend(phases.map(|phase| {
            line(
                start + phase.start_secs,
                "DEBUG",
                &format!("· {}", phase.name),
            )
        }));
        let words = action
            .message
            .as_deref()
            .filter(|message| !message.is_empty());
        let words = words.map_or_else(String::new, |message| format!(": {message}"));
        let (level, event) = match action.reported {
            Some(true) => ("INFO", "reports success".to_owned()),
            Some(false) => ("WARN", "reports failure".to_owned()),
            None => ("ERROR", format!("ends as {}", action.end)),
        };
        lines.push(line(start + action.duration_secs, level, &(event + &words)));
    }
    lines
}

fn contacts(trace: Option<&Trace>) -> Vec<LogLine> {
    let Some(of) = trace else { return Vec::new() };
    let all = of.actions.iter().enumerate().flat_map(|(idx, action)| {
        strongest(&action.contacts).into_iter().map(move |contact| {
            let ([a, b], start) = (&contact.pair, begin(trace, idx));
            let (until, force) = (start + contact.end_secs, contact.max_force_n);
            let text = format!("{a} touches {b} until {until:.2} s, with {force:.1} N at most");
            LogLine {
                secs: start + contact.start_secs,
                level: "TRACE",
                text,
            }
        })
    });
    all.collect()
}

/// Outcomes other than passed. Failures are at the moment that decided them, all others at the end
/// of the action.
fn outcomes(run: &RunDetail, trace: Option<&Trace>) -> Vec<LogLine> {
    let mut lines = Vec::new();
    for (idx, action) in run.actions.iter().enumerate() {
        for judgement in &action.judgements {
            let failed = judgement.outcome == Outcome::Failed;
            let level = match judgement.outcome {
                Outcome::Passed => continue,
                Outcome::Failed => "ERROR",
                Outcome::Broken | Outcome::Timeout => "CRITICAL",
                Outcome::Inapplicable | Outcome::Untested => "WARN",
            };
            let secs = match trace {
                Some(trace) if failed => deciding_moment(trace, idx, &judgement.witness),
                _ => begin(trace, idx) + action.duration_secs,
            };
            let (action, property) = (
                names::local(&action.action),
                names::local(&judgement.property),
            );
            let text = format!(
                "{action}: {property} {}: {}",
                judgement.outcome.word(),
                judgement.witness
            );
            lines.push(LogLine { secs, level, text });
        }
    }
    lines
}
