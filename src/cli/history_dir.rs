//! Finds the history if none is named.

use std::path::{Path, PathBuf};

use crate::options::HistoryArgs;
use crate::output;
use crate::work::all_cores;
use actcheck_base::{Below, Diagnostic, Diagnostics};
use actcheck_config as config;
use actcheck_history::History;

/// Code of the fault for a missing history.
const NONE_FOUND: &str = "X002";

/// Opens the named history, or the one that is found.
///
/// # Errors
/// No history or several are found, or the history can't be opened.
pub fn open(args: &HistoryArgs) -> Result<History, Diagnostics> {
    open_with(args, all_cores())
}

/// Like [`open`], with at most this number of threads.
///
/// # Errors
/// As [`open`].
pub fn open_with(args: &HistoryArgs, threads: usize) -> Result<History, Diagnostics> {
    warned(History::open_existing_with(&folder(args)?, threads)?)
}

/// Like [`open`], but the state of this moment for reading: other processes may read and write the
/// history.
///
/// # Errors
/// As [`open`].
pub fn open_to_read(args: &HistoryArgs) -> Result<History, Diagnostics> {
    warned(History::open_to_read(&folder(args)?)?)
}

/// An open history, after warnings about lost ends of its segments.
fn warned(history: History) -> Result<History, Diagnostics> {
    if let Some(warning) = history.tail_warning()? {
        output::print_diagnostics(&warning.into());
    }
    Ok(history)
}

/// Returns the folder of the named history, or of the one that is found.
///
/// # Errors
/// No history or several are found.
pub fn folder(args: &HistoryArgs) -> Result<PathBuf, Diagnostics> {
    match &args.history {
        Some(folder) => Ok(folder.clone()),
        None => {
            let found = find(Path::new("."))?;
            config::check_unnamed(Path::new(""), &found)?;
            Ok(found)
        }
    }
}

/// A trace, or a part of one, if it can be read. `None` if it is missing, or can't be simulated
/// again.
///
/// # Errors
/// `H007` it is damaged: an answer without it would be another than before.
pub fn unless_damaged<T>(read: Result<T, Diagnostics>) -> Result<Option<T>, Diagnostics> {
    match read {
        Err(faults) if faults.iter().any(|fault| fault.code == "H007") => Err(faults),
        read => Ok(read.ok()),
    }
}

/// Opens the named history, or the one that is found. Returns `None` if none is named and none is
/// found.
///
/// # Errors
/// Several histories are found, or the history can't be opened.
pub fn open_if_any(args: &HistoryArgs) -> Result<Option<History>, Diagnostics> {
    match (&args.history, find(Path::new("."))) {
        (None, Err(faults)) if faults.iter().all(|fault| fault.code == NONE_FOUND) => Ok(None),
        _ => open_to_read(args).map(Some),
    }
}

fn find(here: &Path) -> Result<PathBuf, Diagnostics> {
    const NAME: &str = ".actcheck";
    if here.join(NAME).is_dir() {
        return Ok(PathBuf::from(NAME));
    }
    let mut found: Vec<PathBuf> = Below::new(here)
        .entries(here)
        .unwrap_or_default()
        .into_iter()
        .map(|(name, _)| PathBuf::from(name).join(NAME))
        .filter(|path| here.join(path).is_dir())
        .collect();
    found.sort();
    match found.as_slice() {
        [only] => Ok(only.clone()),
        [] => Err(Diagnostic::error(NONE_FOUND, "no history was named, and this folder has none")
            .help("name one with `--history DIR`; a campaign writes `.actcheck` beside its configuration")
            .into()),
        several => {
            let names: Vec<String> = several.iter().map(|path| path.display().to_string()).collect();
            Err(Diagnostic::error("X003", "no history was named, and this folder has several")
                .help(format!("name one with `--history DIR`: {}", names.join(", ")))
                .into())
        }
    }
}
