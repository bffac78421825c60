//! Where queries are evaluated. A light query gets a short slice of time in the server itself;
//! every other query, and a light one that needs more, goes to a worker process with limits on time
//! and memory. Queries that take long there wait for each other, so that they never occupy all
//! processes. Each queue is in the order of arrival; a connection has one query at a time, so none
//! gets more than its share.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};
use tokio::time::timeout;

use crate::answer::{Answered, Light, Question, light, unopened};
use crate::counts::Counts;
use crate::question::Refusal;
use crate::snapshot::Snapshots;
use crate::watchdog::Watchdog;
use crate::worker::{Asked, Process, Worker};
use actcheck_history::Cancel;

/// Time of a query on the thread of its connection, where it delays other connections.
const MOMENT: Duration = Duration::from_millis(5);
/// Time slice of a query on another thread of the server.
const SLICE: Duration = Duration::from_millis(100);
/// Maximum size of an answer that the server itself writes. Unit: bytes.
const LIGHT_BYTES: u64 = 2_000_000;
/// Time for which a query waits for its slice, before it goes to a process.
const LIGHT_WAIT: Duration = Duration::from_secs(2);
/// Time after which a query in a process is one of the long ones. Unit: seconds.
const QUICK_SECS: f64 = 1.0;
/// Additional time for a process to start and open the history.
const START: Duration = Duration::from_secs(5);
/// Maximum number of queries that wait for a process.
const MOST_WAITING: usize = 1024;
/// Maximum number of queries that are remembered as not light.
const MOST_REMEMBERED: usize = 4096;

/// The result of a query.
pub(super) enum Evaluated {
    /// Of the server itself.
    Here(Answered),
    /// Of a process.
    There(Asked),
}

/// All queues.
#[derive(Debug)]
pub(super) struct Lanes {
    snapshots: Snapshots,
    counts: Arc<Counts>,
    watchdog: Watchdog,
    /// Its threads evaluate slices.
    evaluating: Handle,
    /// One slice for each processor.
    slices: Arc<Semaphore>,
    /// Hashes of queries that were not light or took more than a slice.
    heavy: Mutex<HashSet<u64>>,
    worker: Worker,
    idle: Mutex<Vec<Process>>,
    /// One for each process.
    processes: Arc<Semaphore>,
    /// One for each process that may take long.
    long: Arc<Semaphore>,
    waiting: AtomicUsize,
}

impl Lanes {
    /// Empty queues for at most `most_queries` processes. Called in the runtime whose threads
    /// evaluate slices.
    pub fn new(
        snapshots: Snapshots,
        counts: Arc<Counts>,
        worker: Worker,
        most_queries: usize,
    ) -> Self {
        Self {
            snapshots,
            counts,
            watchdog: Watchdog::start(MOMENT),
            evaluating: Handle::current(),
            slices: Arc::new(Semaphore::new(processors())),
            heavy: Mutex::default(),
            worker,
            idle: Mutex::default(),
            processes: Arc::new(Semaphore::new(most_queries)),
            long: Arc::new(Semaphore::new(most_queries.div_ceil(2))),
            waiting: AtomicUsize::new(0),
        }
    }

    /// Evaluates a query. Dropping the future stops it.
    ///
    /// # Errors
    /// Too many queries are waiting.
    pub async fn evaluate(
        self: &Arc<Self>,
        question: &Arc<Question>,
    ) -> Result<Evaluated, Refusal> {
        let mut hasher = DefaultHasher::new();
        question.query.hash(&mut hasher);
        let hash = hasher.finish();
        if !lock(&self.heavy).contains(&hash) {
            if let Some(answered) = self.here(question).await {
                return Ok(Evaluated::Here(answered));
            }
            let mut heavy = lock(&self.heavy);
            if heavy.len() >= MOST_REMEMBERED {
                heavy.clear();
            }
            heavy.insert(hash);
        }
        self.there(question).await.map(Evaluated::There)
    }

    /// Evaluates a light query in this process: for a moment on the thread of its connection, which
    /// saves the way to another thread, and if it takes longer, for a slice of time on another one.
    /// Returns `None` if it is not light, or not finished after that.
    async fn here(self: &Arc<Self>, question: &Arc<Question>) -> Option<Answered> {
        if let Some(history) = self.snapshots.ready() {
            let cancel = Cancel::new();
            let _watched = self.watchdog.watch(cancel.clone());
            match light(&history, question, LIGHT_BYTES, &cancel) {
                Light::Answered(answered) => return Some(answered),
                Light::Heavy => return None,
                Light::Stopped => {}
            }
        }
        self.in_slice(question).await
    }

    async fn in_slice(self: &Arc<Self>, question: &Arc<Question>) -> Option<Answered> {
        let slice = timeout(LIGHT_WAIT, Arc::clone(&self.slices).acquire_owned())
            .await
            .ok()?
            .ok()?;
        let stopper = Stopper(Cancel::new());
        let (lanes, question, cancel) = (Arc::clone(self), Arc::clone(question), stopper.0.clone());
        let task = self.evaluating.spawn_blocking(move || {
            let _slice = slice;
            match lanes.snapshots.get() {
                Ok(history) => light(&history, &question, LIGHT_BYTES, &cancel),
                Err(faults) => Light::Answered(unopened(&faults)),
            }
        });
        match timeout(SLICE, task).await {
            Ok(Ok(Light::Answered(answered))) => return Some(answered),
            Ok(Ok(Light::Heavy)) => {}
            _ => self.counts.record_moved(),
        }
        None
    }

    /// Evaluates a query in a process: for a short time first, and again as one of the long ones.
    async fn there(self: &Arc<Self>, question: &Arc<Question>) -> Result<Asked, Refusal> {
        let _waiting = self.wait_in_line()?;
        let slot = acquire(&self.processes).await;
        let quick_secs = question.most_secs.min(QUICK_SECS);
        let asked = self.ask(question, quick_secs, vec![slot]).await;
        if !matches!(asked, Asked::Late) || quick_secs >= question.most_secs {
            return Ok(asked);
        }
        let long = acquire(&self.long).await;
        let slot = acquire(&self.processes).await;
        Ok(self
            .ask(question, question.most_secs, vec![long, slot])
            .await)
    }

    /// Asks a process on a thread of its own, which holds the slots until the process is free
    /// again.
    async fn ask(
        self: &Arc<Self>,
        question: &Question,
        secs: f64,
        slots: Vec<Option<OwnedSemaphorePermit>>,
    ) -> Asked {
        let Ok(line) = serde_json::to_string(&Question {
            most_secs: secs,
            ..question.clone()
        }) else {
            return Asked::Crashed;
        };
        let time = START + Duration::try_from_secs_f64(secs).unwrap_or(Duration::MAX / 2);
        let (room, lanes) = (question.most_bytes, Arc::clone(self));
        let (sender, receiver) = oneshot::channel();
        let gone = Gone::default();
        let flag = Arc::clone(&gone.0);
        std::thread::spawn(move || {
            let asked = lanes.ask_a_process(&line, time, room, &|| flag.load(Ordering::Relaxed));
            drop(slots);
            // The receiver is gone if the client is.
            let _ = sender.send(asked);
        });
        receiver.await.unwrap_or(Asked::Crashed)
    }

    fn ask_a_process(
        &self,
        line: &str,
        time: Duration,
        room: u64,
        is_gone: &dyn Fn() -> bool,
    ) -> Asked {
        loop {
            let known = lock(&self.idle).pop();
            let mut process = match known.map_or_else(|| self.worker.start(room), Ok) {
                Ok(process) => process,
                Err(error) => return Asked::NotStarted(error.to_string()),
            };
            match process.ask(line, time, is_gone) {
                Asked::NotTaken => {}
                answer @ Asked::Answer(..) => {
                    lock(&self.idle).push(process);
                    return answer;
                }
                other => return other,
            }
        }
    }

    /// Ends the processes without a question, and closes the history.
    pub fn close(&self) {
        lock(&self.idle).clear();
        self.snapshots.close();
    }

    fn wait_in_line(&self) -> Result<InLine<'_>, Refusal> {
        let before = self.waiting.fetch_add(1, Ordering::AcqRel);
        let place = InLine(&self.waiting);
        if before < MOST_WAITING {
            Ok(place)
        } else {
            Err(Refusal::new(
                503,
                "too many queries are waiting: try again soon",
            ))
        }
    }
}

/// Number of processors.
pub(super) fn processors() -> usize {
    std::thread::available_parallelism().map_or(2, usize::from)
}

/// The semaphores are never closed, so there is always a permit.
async fn acquire(semaphore: &Arc<Semaphore>) -> Option<OwnedSemaphorePermit> {
    Arc::clone(semaphore).acquire_owned().await.ok()
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Stops a query when it is dropped.
struct Stopper(Cancel);

impl Drop for Stopper {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// Reports that the client has gone away when it is dropped.
#[derive(Default)]
struct Gone(Arc<AtomicBool>);

impl Drop for Gone {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A place in the queue for processes.
struct InLine<'a>(&'a AtomicUsize);

impl Drop for InLine<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}
