//! Shards that could not be completed.

use actcheck_base::Diagnostic;

use crate::launch::plan::Plan;

/// Maximum number of lines of a shard's output in a message.
const MAX_LINES: usize = 5;

/// X075: a shard that was lost too often, with the end of its output. `how` continues the sentence "shard 3/4 …".
pub(super) fn lost(plan: &Plan, number: u64, how: &str) -> Diagnostic {
    let log = plan.log(number);
    let text = std::fs::read(&log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = lines[lines.len().saturating_sub(MAX_LINES)..].join("\n");
    let message = format!("shard {number}/{} {how}", plan.shards);
    let help = match last.is_empty() {
        true => format!("the same command tries again; `{}` has no output", log.display()),
        false => format!("the same command tries again; the end of `{}`:\n{last}", log.display()),
    };
    Diagnostic::error("X075", message).help(help)
}
