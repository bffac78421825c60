//! The report of the present history. Rendering it takes seconds, so it is cached until the history changes.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use hyper::body::Bytes;

use crate::question::Refusal;
use crate::snapshot::{State, state};
use crate::worker::{Ended, Worker};

/// Time limit; a report takes longer than a query.
const MOST_TIME: Duration = Duration::from_secs(300);
/// Maximum size of the page. Unit: bytes.
const MOST_BYTES: u64 = 1 << 30;
/// Folders that a report depends on.
const FOLDERS: [&str; 3] = ["store", "tables", "traces"];

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
        (*of == state(&self.history, &FOLDERS)).then(|| page.clone())
    }

    /// Renders the page. Nothing else may use the history meanwhile.
    ///
    /// # Errors
    /// A refusal if the page can't be rendered in time, or a campaign locks the history and no page was rendered before.
    pub fn render(&self) -> Result<Bytes, Refusal> {
        // Another request may have rendered it while this one waited.
        if let Some(page) = self.cached() {
            return Ok(page);
        }
        let ended = self.worker.run(MOST_TIME, MOST_BYTES);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        match ended {
            Ended::Itself { code: Some(0), output, .. } => {
                // Rendering updates the tables beside the history.
                let page = Bytes::from(output);
                *kept = Some((state(&self.history, &FOLDERS), page.clone()));
                Ok(page)
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
