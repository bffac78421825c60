//! The state of the history that queries read: opened once and shared, and renewed when the history
//! has changed.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::{Duration, Instant};

use actcheck_base::Diagnostics;
use actcheck_history::History;

/// Interval at which a history in use is checked for changes.
const CHECK_EVERY: Duration = Duration::from_millis(100);
/// While a process is writing the history, renewing takes at most this part of the time.
const RENEWING_SHARE: u32 = 10;

/// Opens a history to read when a query needs it.
pub(super) struct Snapshots {
    dir: PathBuf,
    open: RwLock<Option<Arc<History>>>,
    started: Instant,
    /// Time of the next check for changes. Unit: microseconds since the start.
    next_check: AtomicU64,
    /// Locked while the history is opened or renewed.
    renewing: Mutex<()>,
}

impl std::fmt::Debug for Snapshots {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Snapshots")
            .field("dir", &self.dir)
            .finish_non_exhaustive()
    }
}

impl Snapshots {
    /// Opens nothing yet.
    pub fn new(dir: &Path) -> Self {
        Self {
            dir: dir.to_owned(),
            open: RwLock::default(),
            started: Instant::now(),
            next_check: AtomicU64::new(0),
            renewing: Mutex::default(),
        }
    }

    /// Returns the present history. Opens or renews it if necessary.
    ///
    /// # Errors
    /// It can't be opened.
    pub fn get(&self) -> Result<Arc<History>, Diagnostics> {
        let _alone = self.renewing.lock().unwrap_or_else(PoisonError::into_inner);
        let known = self.known();
        if let Some(history) = &known
            && self.is_checked()
        {
            return Ok(Arc::clone(history));
        }
        let began = Instant::now();
        let history = match known {
            Some(history) => {
                history.refresh()?;
                history
            }
            None => {
                let history = Arc::new(History::open_to_read(&self.dir)?);
                *self.open.write().unwrap_or_else(PoisonError::into_inner) =
                    Some(Arc::clone(&history));
                history
            }
        };
        self.check_after(CHECK_EVERY.max(began.elapsed() * RENEWING_SHARE));
        Ok(history)
    }

    /// Returns the present history if that takes no time: it is open, and has not changed.
    /// Otherwise [`Snapshots::get`] must be called.
    pub fn ready(&self) -> Option<Arc<History>> {
        let history = self.known()?;
        if !self.is_checked() {
            let _alone = self.renewing.try_lock().ok()?;
            if history.is_stale() {
                return None;
            }
            self.check_after(CHECK_EVERY);
        }
        Some(history)
    }

    /// Closes the history as soon as running queries have ended.
    pub fn close(&self) {
        *self.open.write().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn known(&self) -> Option<Arc<History>> {
        self.open
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    fn is_checked(&self) -> bool {
        self.started.elapsed() < Duration::from_micros(self.next_check.load(Ordering::Acquire))
    }

    fn check_after(&self, time: Duration) {
        let next = (self.started.elapsed() + time).as_micros();
        self.next_check
            .store(u64::try_from(next).unwrap_or(u64::MAX), Ordering::Release);
    }
}
