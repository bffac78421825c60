//! The worker process that answers one query: it reads the question from stdin and writes the answer to stdout.

use std::io::{Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{accept, watch};
use actcheck_base::{Diagnostics, Source};
use actcheck_history::{History, WireFault};

/// The input of the worker process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Question {
    pub query: String,
    /// The client's `Accept` header.
    pub accept: String,
    pub most_rows: u64,
    /// Unit: seconds.
    pub most_secs: f64,
    /// Unit: bytes.
    pub most_memory: u64,
}

/// Status and media type, as one line of JSON before the body.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Head {
    pub status: u16,
    pub media_type: String,
}

/// Reads a question from `input` and writes the answer to `output`. Exits the process when the time or memory limit is
/// exceeded.
///
/// # Errors
/// Reading or writing the streams fails.
pub fn answer(history: &Path, mut input: impl Read, mut output: impl Write) -> std::io::Result<()> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    let question: Question = serde_json::from_slice(&bytes)?;
    watch::limit(question.most_secs, question.most_memory);
    let (status, media_type, body) = run_query(history, &question);
    let head = Head { status, media_type: media_type.to_owned() };
    writeln!(output, "{}", serde_json::to_string(&head)?)?;
    output.write_all(&body)?;
    output.flush()
}

fn run_query(history: &Path, question: &Question) -> (u16, &'static str, Vec<u8>) {
    let source = Source::new("query", question.query.as_str());
    let history = match History::open_to_read(history) {
        Ok(history) => history,
        // A campaign is writing: the client can retry soon.
        Err(faults) => return format_faults(503, &faults),
    };
    let choose = |offered: &[_]| accept::choose(&question.accept, offered);
    match history.wire_answer(&source, choose, question.most_rows) {
        Ok((syntax, body)) => (200, syntax.media_types()[0], body),
        Err(WireFault::Malformed(faults)) => format_faults(400, &faults),
        Err(WireFault::Refused(faults)) => format_faults(403, &faults),
        Err(WireFault::Failed(faults)) => format_faults(500, &faults),
        Err(WireFault::NotAcceptable) => {
            let why = format!("the answer has no format that `Accept: {}` allows\n", question.accept);
            (406, "text/plain", why.into_bytes())
        }
    }
}

/// Formats diagnostics as lines with their places.
fn format_faults(status: u16, faults: &Diagnostics) -> (u16, &'static str, Vec<u8>) {
    let mut text = String::new();
    for fault in faults.iter() {
        let place = fault.place().map_or_else(String::new, |place| format!("{place}: "));
        text.push_str(&format!("{place}{} ({})\n", fault.message, fault.code));
        if let Some(help) = &fault.help {
            text.push_str(&format!("  {help}\n"));
        }
    }
    (status, "text/plain", text.into_bytes())
}
