//! The history that queries read: opened once and shared, until it changes or is not used for a moment.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use actcheck_base::Diagnostics;
use actcheck_history::History;

/// Interval at which the files of a history in use are compared with those that were opened.
const CHECK_EVERY: Duration = Duration::from_millis(100);
/// Time after which an unused history is closed, so that a campaign can write to it.
const IDLE: Duration = Duration::from_millis(50);
/// Interval at which [`Snapshots::rest`] is to be called.
const REST_EVERY: Duration = Duration::from_millis(25);

/// Paths, sizes and modification times of a history's files.
pub(super) type State = BTreeMap<PathBuf, (u64, Option<SystemTime>)>;

/// Returns the state of some folders of a history.
pub(super) fn state(history: &Path, folders: &[&str]) -> State {
    let files = folders.iter().flat_map(|part| std::fs::read_dir(history.join(part)).into_iter().flatten());
    files
        .filter_map(Result::ok)
        // The store's log files change with every access.
        .filter(|entry| !entry.file_name().to_string_lossy().starts_with("LOG"))
        .filter_map(|entry| entry.metadata().ok().map(|data| (entry.path(), (data.len(), data.modified().ok()))))
        .collect()
}

/// Opens a history to read when a query needs it.
#[derive(Debug)]
pub(super) struct Snapshots {
    history: PathBuf,
    held: Mutex<Option<Held>>,
}

struct Held {
    history: Arc<History>,
    state: State,
    checked: Instant,
    used: Instant,
}

impl std::fmt::Debug for Held {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Held").field("used", &self.used).finish_non_exhaustive()
    }
}

impl Snapshots {
    /// Opens nothing yet.
    pub fn new(history: &Path) -> Self {
        Self { history: history.to_owned(), held: Mutex::default() }
    }

    /// Returns the present history.
    ///
    /// # Errors
    /// It can't be opened, for example because a campaign is writing.
    pub fn get(&self) -> Result<Arc<History>, Diagnostics> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        if let Some(known) = &mut *held
            && now.duration_since(known.checked) > CHECK_EVERY
        {
            known.checked = now;
            if state(&self.history, &["store"]) != known.state {
                *held = None;
            }
        }
        if let Some(known) = &mut *held {
            known.used = now;
            return Ok(Arc::clone(&known.history));
        }
        let state = state(&self.history, &["store"]);
        let history = Arc::new(History::open_to_read(&self.history)?);
        *held = Some(Held { history: Arc::clone(&history), state, checked: now, used: now });
        Ok(history)
    }

    /// Returns the present history if that takes no time: it is open, and was compared with its files a moment ago.
    pub fn ready(&self) -> Option<Arc<History>> {
        let mut held = self.held.try_lock().ok()?;
        let known = held.as_mut()?;
        let now = Instant::now();
        if now.duration_since(known.checked) > CHECK_EVERY {
            return None;
        }
        known.used = now;
        Some(Arc::clone(&known.history))
    }

    /// Closes the history as soon as running queries have ended.
    pub fn close(&self) {
        *self.held.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Closes the history if it was not used for a while.
    pub fn rest(&self) {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        if held.as_ref().is_some_and(|held| held.used.elapsed() > IDLE) {
            *held = None;
        }
    }

    /// Starts a thread that calls [`Snapshots::rest`] now and then, as long as the value exists.
    pub fn rest_in_background(self: &Arc<Self>) {
        let weak = Arc::downgrade(self);
        std::thread::spawn(move || {
            while let Some(snapshots) = weak.upgrade() {
                snapshots.rest();
                drop(snapshots);
                std::thread::sleep(REST_EVERY);
            }
        });
    }
}
