//! Answers questions: in the server itself if they are light, else in a worker process, which reads
//! questions from stdin and writes answers to stdout.

use std::io::{BufRead, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::accept;
use crate::snapshot::Snapshots;
use crate::watch::{Watch, resident};
use actcheck_base::{Diagnostics, Source};
use actcheck_history::{Cancel, History, WireFault, WireLimits, WireSyntax};

/// A worker process that holds more memory than this after an answer exits, so that its next
/// question has all memory that it may use. Unit: bytes.
const MOST_KEPT: u64 = 300_000_000;

/// A query and its limits: a line of input of the worker process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Question {
    pub query: String,
    /// The client's `Accept` header.
    pub accept: String,
    pub most_rows: u64,
    /// Unit: bytes.
    pub most_bytes: u64,
    /// Unit: seconds.
    pub most_secs: f64,
    /// Unit: bytes.
    pub most_memory: u64,
}

/// Status, media type and length, as one line of JSON before the body.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Head {
    pub status: u16,
    pub media_type: String,
    /// Unit: bytes.
    pub length: u64,
}

/// An answer.
pub(super) struct Answered {
    pub status: u16,
    pub media_type: &'static str,
    pub body: Vec<u8>,
}

/// Answers the questions from `input`, a line each, on `output`. Exits the process when the time or
/// memory limit of one is exceeded. Ends with the input, or if the process holds much memory.
///
/// # Errors
/// Reading or writing the streams fails.
pub fn answer(history: &Path, input: impl BufRead, mut output: impl Write) -> std::io::Result<()> {
    let snapshots = Snapshots::new(history);
    let watch = Watch::start();
    for line in input.lines() {
        let question: Question = serde_json::from_str(&line?)?;
        watch.begin(question.most_secs, question.most_memory);
        let Answered {
            status,
            media_type,
            body,
        } = match snapshots.get() {
            Ok(history) => run_query(&history, &question),
            Err(faults) => unopened(&faults),
        };
        let head = Head {
            status,
            media_type: media_type.to_owned(),
            length: body.len() as u64,
        };
        writeln!(output, "{}", serde_json::to_string(&head)?)?;
        output.write_all(&body)?;
        output.flush()?;
        watch.end();
        if resident().is_some_and(|bytes| bytes > MOST_KEPT) {
            break;
        }
    }
    Ok(())
}

fn run_query(history: &History, question: &Question) -> Answered {
    let source = Source::new("query", question.query.as_str());
    let choose = |offered: &[_]| accept::choose(&question.accept, offered);
    let limits = WireLimits {
        rows: question.most_rows,
        bytes: question.most_bytes,
    };
    answered(question, history.wire_answer(&source, choose, limits))
}

/// The result of a query in this process.
pub(super) enum Light {
    /// The answer.
    Answered(Answered),
    /// It was cancelled.
    Stopped,
    /// It must be answered by another process: it is not light, or has a large answer.
    Heavy,
}

/// Answers a light query in this process.
pub(super) fn light(
    history: &History,
    question: &Question,
    most_bytes: u64,
    cancel: &Cancel,
) -> Light {
    let source = Source::new("query", question.query.as_str());
    let choose = |offered: &[_]| accept::choose(&question.accept, offered);
    let limits = WireLimits {
        rows: question.most_rows,
        bytes: question.most_bytes.min(most_bytes),
    };
    match history.light_answer(&source, choose, limits, cancel) {
        None | Some(Err(WireFault::TooLarge)) => Light::Heavy,
        Some(Err(WireFault::Failed(_))) if cancel.is_cancelled() => Light::Stopped,
        Some(answer) => Light::Answered(answered(question, answer)),
    }
}

fn answered(question: &Question, answer: Result<(WireSyntax, Vec<u8>), WireFault>) -> Answered {
    match answer {
        Ok((syntax, body)) => Answered {
            status: 200,
            media_type: syntax.media_types()[0],
            body,
        },
        Err(WireFault::Malformed(faults)) => format_faults(400, &faults),
        Err(WireFault::Refused(faults)) => format_faults(403, &faults),
        Err(WireFault::Failed(faults)) => format_faults(500, &faults),
        Err(WireFault::TooLarge) => too_large(question.most_bytes),
        Err(WireFault::NotAcceptable) => {
            let why = format!(
                "the answer has no format that `Accept: {}` allows\n",
                question.accept
            );
            Answered {
                status: 406,
                media_type: "text/plain",
                body: why.into_bytes(),
            }
        }
    }
}

/// The refusal of a large answer.
pub(super) fn too_large(most_bytes: u64) -> Answered {
    let why = format!(
        "the answer is larger than {} MB: use `LIMIT`\n",
        most_bytes / 1_000_000
    );
    Answered {
        status: 500,
        media_type: "text/plain",
        body: why.into_bytes(),
    }
}

/// The history can't be opened. If a campaign is writing, the client can retry soon.
pub(super) fn unopened(faults: &Diagnostics) -> Answered {
    format_faults(503, faults)
}

/// Formats diagnostics as lines with their places.
fn format_faults(status: u16, faults: &Diagnostics) -> Answered {
    let mut text = String::new();
    for fault in faults.iter() {
        let place = fault
            .place()
            .map_or_else(String::new, |place| format!("{place}: "));
        text.push_str(&format!("{place}{} ({})\n", fault.message, fault.code));
        if let Some(help) = &fault.help {
            text.push_str(&format!("  {help}\n"));
        }
    }
    Answered {
        status,
        media_type: "text/plain",
        body: text.into_bytes(),
    }
}
