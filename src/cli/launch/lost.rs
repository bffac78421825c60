//! Shards that could not be completed.

use std::io::{Read as _, Seek as _, SeekFrom};

use actcheck_base::Diagnostic;

use crate::launch::plan::Plan;

/// Maximum number of lines of a shard's output in a message.
const MAX_LINES: usize = 5;
/// Maximum length of the end of the output. Unit: bytes.
const MOST_BYTES: u64 = 1 << 16;

/// X075: a shard that was lost too often, with the end of its output. `how` continues the sentence
/// "shard 3/4 …".
pub(super) fn lost(plan: &Plan, number: u64, how: &str) -> Diagnostic {
    let log = plan.log(number);
    let mut text = Vec::new();
    if let Ok(mut log) = plan.below().open(&log) {
        let length = log.metadata().map_or(0, |about| about.len());
        // A log that can't be read is shown as empty.
        let _ = log.seek(SeekFrom::Start(length.saturating_sub(MOST_BYTES)));
        let _ = log.take(MOST_BYTES).read_to_end(&mut text);
    }
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .collect();
    let last = lines[lines.len().saturating_sub(MAX_LINES)..].join("\n");
    let message = format!("shard {number}/{} {how}", plan.shards);
    let help = match last.is_empty() {
        true => format!(
            "the same command tries again; `{}` has no output",
            log.display()
        ),
        false => format!(
            "the same command tries again; the end of `{}`:\n{last}",
            log.display()
        ),
    };
    Diagnostic::error("X075", message).help(help)
}
