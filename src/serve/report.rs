//! The report of the present history. Rendering it takes seconds, so it is cached until the history
//! changes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use hyper::body::Bytes;

use crate::question::Refusal;
use crate::worker::{Ended, Worker};

/// Time limit; a report takes longer than a query.
const MOST_TIME: Duration = Duration::from_secs(300);
/// Maximum size of the page. Unit: bytes.
const MOST_BYTES: u64 = 1 << 30;
/// Folders that a report depends on.
const FOLDERS: [&str; 3] = ["store", "tables", "traces"];

/// Paths, sizes and modification times of a history's files.
type State = BTreeMap<PathBuf, (u64, Option<SystemTime>)>;

/// Renders the report and caches the last one.
#[derive(Debug)]
pub(super) struct LiveReport {
    pub worker: Worker,
    pub history: PathBuf,
    pub kept: Mutex<Option<(State, Bytes)>>,
}

impl LiveReport {
    /// Returns the last page if the history is unchanged.
    pub fn cached(&self) -> Option<Bytes> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let (of, page) = kept.as_ref()?;
        (*of == state(&self.history)).then(|| page.clone())
    }

    /// Renders the page.
    ///
    /// # Errors
    /// A refusal if the page can't be rendered, and no page was rendered before, or if that takes
    /// too long.
    pub fn render(&self) -> Result<Bytes, Refusal> {
        // Another request may have rendered it while this one waited.
        if let Some(page) = self.cached() {
            return Ok(page);
        }
        let ended = self.worker.run(MOST_TIME, MOST_BYTES);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        match ended {
            Ended::Itself {
                code: Some(0),
                output,
                ..
            } => {
                // Rendering updates the tables beside the history.
                let page = Bytes::from(output);
                *kept = Some((state(&self.history), page.clone()));
                Ok(page)
            }
            Ended::Itself { errors, .. } => {
                let why = String::from_utf8_lossy(&errors).into_owned();
                // Such as a damaged history: the previous page is served.
                match &*kept {
                    Some((_, page)) => Ok(page.clone()),
                    None => Err(Refusal::new(503, why)),
                }
            }
            Ended::Late => Err(Refusal::new(504, "the report took too long")),
            Ended::TooMuch => Err(Refusal::new(500, "the report is too large to send")),
            Ended::NotStarted(why) => Err(Refusal::new(
                500,
                format!("the report process could not be started: {why}"),
            )),
        }
    }
}

fn state(history: &Path) -> State {
    let files = FOLDERS
        .iter()
        .flat_map(|part| std::fs::read_dir(history.join(part)).into_iter().flatten());
    files
        .filter_map(Result::ok)
        // The store's log files change with every access.
        .filter(|entry| !entry.file_name().to_string_lossy().starts_with("LOG"))
        .filter_map(|entry| {
            entry
                .metadata()
                .ok()
                .map(|data| (entry.path(), (data.len(), data.modified().ok())))
        })
        .collect()
}
