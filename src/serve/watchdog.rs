//! Cancels queries that take longer than a moment, from a separate thread.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use actcheck_history::Cancel;

/// Cancels watched queries after a time.
#[derive(Debug)]
pub(super) struct Watchdog {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    running: Mutex<Running>,
    begun: Condvar,
}

#[derive(Default)]
struct Running {
    /// The oldest first.
    queries: VecDeque<(u64, Instant, Cancel)>,
    next: u64,
    ended: bool,
}

impl std::fmt::Debug for Running {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Running")
            .field("queries", &self.queries.len())
            .finish_non_exhaustive()
    }
}

impl Watchdog {
    /// Starts the thread, which ends with the value.
    pub fn start(time: Duration) -> Self {
        let shared = Arc::new(Shared::default());
        let seen = Arc::clone(&shared);
        std::thread::spawn(move || seen.guard(time));
        Self { shared }
    }

    /// Watches a query until the returned value is dropped.
    pub fn watch(&self, query: Cancel) -> Watched<'_> {
        let mut running = self.shared.lock();
        let id = running.next;
        running.next += 1;
        running.queries.push_back((id, Instant::now(), query));
        if running.queries.len() == 1 {
            self.shared.begun.notify_one();
        }
        Watched {
            shared: &self.shared,
            id,
        }
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.shared.lock().ended = true;
        self.shared.begun.notify_one();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Running> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn guard(&self, time: Duration) {
        let mut running = self.lock();
        while !running.ended {
            if running.queries.is_empty() {
                running = self
                    .begun
                    .wait(running)
                    .unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            drop(running);
            // Most queries end meanwhile; the thread does not wake up for each.
            std::thread::sleep(time);
            running = self.lock();
            let late = running
                .queries
                .iter()
                .filter(|(_, since, _)| since.elapsed() >= time);
            late.for_each(|(_, _, query)| query.cancel());
        }
    }
}

/// A query that is watched.
#[derive(Debug)]
pub(super) struct Watched<'a> {
    shared: &'a Shared,
    id: u64,
}

impl Drop for Watched<'_> {
    fn drop(&mut self) {
        self.shared.lock().queries.retain(|(id, ..)| *id != self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_that_take_long_are_cancelled_and_others_forgotten() {
        let watchdog = Watchdog::start(Duration::from_millis(1));
        let long = Cancel::new();
        drop(watchdog.watch(Cancel::new()));
        let watched = watchdog.watch(long.clone());
        while !long.is_cancelled() {
            std::thread::yield_now();
        }
        drop(watched);
        assert!(watchdog.shared.lock().queries.is_empty());
    }
}
