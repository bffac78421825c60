//! The open connections: a limited number, of which idle ones make room for new ones and stalled
//! ones are closed.

use std::collections::BTreeMap;
use std::future::Future;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use tokio::runtime::Handle;
use tokio::task::AbortHandle;

/// Time within which a client must accept the next piece of an answer. Unit: milliseconds.
const WRITE_PATIENCE_MS: u64 = 30_000;
/// Maximum number of open connections, if the system allows that many files.
const MOST: usize = 8192;

/// A connection waits for a request.
const WAITS: u64 = 0;
/// A request is being answered.
const BUSY: u64 = u64::MAX;

/// The state of a connection: [`WAITS`], [`BUSY`], or the moment until which the client must accept
/// the next piece of an answer. Unit: milliseconds since the server started.
#[derive(Debug)]
pub(super) struct Doing {
    state: AtomicU64,
    started: Instant,
}

impl Doing {
    /// A request is being answered.
    pub fn answers(&self) {
        self.state.store(BUSY, Ordering::Relaxed);
    }

    /// A piece of an answer is being written.
    pub fn writes(&self) {
        self.state
            .store(self.now() + WRITE_PATIENCE_MS, Ordering::Relaxed);
    }

    /// The connection waits for the next request.
    pub fn waits(&self) {
        self.state.store(WAITS, Ordering::Relaxed);
    }

    fn is_stalled(&self) -> bool {
        let state = self.state.load(Ordering::Relaxed);
        state != WAITS && state < self.now()
    }

    fn now(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_millis()).unwrap_or(BUSY - 1)
    }
}

/// All open connections, the oldest first.
#[derive(Debug)]
pub(super) struct Connections {
    open: Mutex<BTreeMap<u64, (Arc<Doing>, AbortHandle)>>,
    next: AtomicU64,
    started: Instant,
    most: usize,
}

impl Connections {
    /// No connections.
    pub fn new() -> Arc<Self> {
        let most = most_files().map_or(MOST, |files| (files / 2).clamp(16, MOST));
        Arc::new(Self {
            open: Mutex::default(),
            next: AtomicU64::new(0),
            started: Instant::now(),
            most,
        })
    }

    /// Serves a new connection on a thread. If there are too many, the oldest one without a request
    /// is closed. Returns `false`, with `serve` unused, if all of them have one.
    pub fn add<F: Future<Output = ()> + Send + 'static>(
        self: &Arc<Self>,
        thread: &Handle,
        serve: impl FnOnce(Arc<Doing>) -> F,
    ) -> bool {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if open.len() >= self.most {
            let waits = |(doing, _): &(Arc<Doing>, AbortHandle)| {
                doing.state.load(Ordering::Relaxed) == WAITS
            };
            let Some(oldest) = open
                .iter()
                .find(|(_, entry)| waits(entry))
                .map(|(id, _)| *id)
            else {
                return false;
            };
            if let Some((_, task)) = open.remove(&oldest) {
                task.abort();
            }
        }
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let doing = Arc::new(Doing {
            state: AtomicU64::new(WAITS),
            started: self.started,
        });
        let (serving, all) = (serve(Arc::clone(&doing)), Arc::clone(self));
        // The task can't remove its entry before it is made, because the lock is held.
        let task = thread.spawn(async move {
            serving.await;
            all.open
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .remove(&id);
        });
        open.insert(id, (doing, task.abort_handle()));
        true
    }

    /// Closes connections whose client does not accept its answer.
    pub fn close_stalled(&self) {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|_, (doing, task)| {
            let stalled = doing.is_stalled();
            if stalled {
                task.abort();
            }
            !stalled
        });
    }

    /// Number of open connections.
    #[cfg(test)]
    fn len(&self) -> usize {
        self.open
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .len()
    }
}

/// Maximum number of open files of this process; `None` if the system does not report it.
fn most_files() -> Option<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max open files"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_idle_connection_makes_room() {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .build()
            .unwrap();
        runtime.block_on(async {
            let connections = Arc::new(Connections {
                open: Mutex::default(),
                next: AtomicU64::new(0),
                started: Instant::now(),
                most: 2,
            });
            let mut all = Vec::new();
            for number in 0..4 {
                let added = connections.add(&Handle::current(), |doing| {
                    all.push(Arc::clone(&doing));
                    std::future::pending()
                });
                assert_eq!(added, number < 3, "{number}");
                if number == 0 || number == 2 {
                    all[number].answers();
                }
            }
            assert_eq!(connections.len(), 2);
            // The first and the third are left; the second made room.
            connections.close_stalled();
            assert_eq!(connections.len(), 2);
            all[0].waits();
            assert!(connections.add(&Handle::current(), |_| std::future::ready(())));
        });
    }
}
