//! The report of the present history. Rendering it takes seconds, so it is cached until the history changes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, RwLock};
use std::time::{Duration, SystemTime};

use crate::question::Refusal;
use crate::worker::{Ended, Worker};

/// Time limit; a report takes longer than a query.
const MOST_TIME: Duration = Duration::from_secs(300);
/// Maximum size of the page. Unit: bytes.
const MOST_BYTES: u64 = 1 << 30;

/// Paths, sizes and modification times of a history's files.
type State = BTreeMap<PathBuf, (u64, Option<SystemTime>)>;

/// Renders the report and caches the last one.
#[derive(Debug)]
pub(super) struct LiveReport {
    pub worker: Worker,
    pub history: PathBuf,
    pub kept: Mutex<Option<(State, Vec<u8>)>>,
}

impl LiveReport {
    /// Returns the page. `history` is locked while it is rendered.
    ///
    /// # Errors
    /// A refusal if the page can't be rendered in time, or a campaign locks the history and no page was rendered before.
    pub fn page(&self, history: &RwLock<()>) -> Result<Vec<u8>, Refusal> {
        // Concurrent requests wait for the same page.
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, page)) = &*kept
            && *of == state(&self.history)
        {
            return Ok(page.clone());
        }
        let ended = {
            let _alone = history.write().unwrap_or_else(PoisonError::into_inner);
            self.worker.run(&[], MOST_TIME, MOST_BYTES)
        };
        match ended {
            Ended::Itself { code: Some(0), output, .. } => {
                // Rendering updates the tables beside the history.
                *kept = Some((state(&self.history), output.clone()));
                Ok(output)
            }
            Ended::Itself { errors, .. } => {
                let why = String::from_utf8_lossy(&errors).into_owned();
                // While a campaign locks the history, the previous page is served.
                match &*kept {
                    Some((_, page)) => Ok(page.clone()),
                    None => Err(Refusal::new(503, why)),
                }
            }
            Ended::Late => Err(Refusal::new(504, "the report took too long")),
            Ended::TooMuch => Err(Refusal::new(500, "the report is too large to send")),
            Ended::NotStarted(why) => Err(Refusal::new(500, format!("the report process could not be started: {why}"))),
        }
    }
}

fn state(history: &Path) -> State {
    // The store's log files change with every access.
    let files = ["store", "tables", "traces"]
        .iter()
        .flat_map(|part| std::fs::read_dir(history.join(part)).into_iter().flatten());
    files
        .filter_map(Result::ok)
        .filter(|entry| !entry.file_name().to_string_lossy().starts_with("LOG"))
        .filter_map(|entry| entry.metadata().ok().map(|data| (entry.path(), (data.len(), data.modified().ok()))))
        .collect()
}
