//! Files about campaigns, beside their runs: one JSON file for each campaign in a folder for each
//! kind.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use actcheck_base::{Below, Diagnostic, Diagnostics};

/// Largest file. Unit: bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Writes a file of a history. It replaces an earlier one.
///
/// # Errors
/// `H006` if it can't be written.
pub(crate) fn store(
    history: &Path,
    file: &Path,
    content: &impl Serialize,
) -> Result<(), Diagnostics> {
    let below = Below::new(history);
    let file = history.join(file);
    let text = serde_json::to_string_pretty(content).unwrap_or_default();
    let folder = file.parent().unwrap_or(history);
    let written = below
        .create_folder(folder)
        .and_then(|()| below.write_atomic(&file, text.as_bytes()));
    written.map_err(|error| {
        Diagnostic::error("H006", format!("can't write {}: {error}", file.display()))
            .help("free some space, or make the folder writable")
            .into()
    })
}

/// Reads a file of a history; `None` if there is none.
///
/// # Errors
/// `H007` if it is damaged.
pub(crate) fn read<T: DeserializeOwned>(
    history: &Path,
    file: &Path,
    help: &str,
) -> Result<Option<T>, Diagnostics> {
    let below = Below::new(history);
    let file = history.join(file);
    if below.kind(&file).is_none() {
        return Ok(None);
    }
    let damaged = |why: String| {
        Diagnostic::error("H007", format!("{} can't be read: {why}", file.display())).help(help)
    };
    let text = below
        .read_text(&file, MOST_BYTES)
        .map_err(|error| damaged(error.to_string()))?;
    let content = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
    Ok(Some(content))
}
