//! Evaluates queries over a store that may be damaged.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel, sync_channel};
use std::time::{Duration, Instant};

use oxigraph::sparql::QueryEvaluationError;
use oxigraph::store::{StorageError, Store};

use crate::Cancel;
use crate::salvage::scan;

/// Interval at which a waiting query checks whether it was stopped: too short to notice.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Time after which the store is read for damage: few queries take longer.
const DOUBT_AFTER: Duration = Duration::from_secs(1);

/// The reason why a query has no answer.
pub(super) enum Unfinished {
    Stopped,
    Failed(QueryEvaluationError),
    Crashed,
    Damaged(StorageError),
}

/// Evaluates a query in its own thread.
///
/// The evaluation checks its token only when it reads the store, which a join of large results may
/// not do for minutes. Over a damaged part of the store it may never end, because the store repeats
/// the error for ever and the evaluator collects errors. So a second thread reads the store for
/// damage if a query takes long. In either case the thread is abandoned.
pub(super) fn evaluate<T: Send + 'static>(
    store: &Store,
    cancel: &Cancel,
    evaluation: impl FnOnce(&Store) -> Result<T, QueryEvaluationError> + Send + 'static,
) -> Result<T, Unfinished> {
    let (sender, receiver) = sync_channel(1);
    let copy = store.clone();
    std::thread::spawn(move || {
        let answer = evaluation(&copy);
        drop(copy);
        // If the query was stopped, the receiver is gone.
        let _ = sender.send(answer);
    });
    let started = Instant::now();
    let mut damage: Option<Receiver<StorageError>> = None;
    loop {
        match receiver.recv_timeout(LOOK_EVERY) {
            Ok(answer) => return answer.map_err(Unfinished::Failed),
            Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => {
                return Err(Unfinished::Stopped);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(Unfinished::Crashed),
        }
        match &damage {
            None if started.elapsed() > DOUBT_AFTER => damage = Some(looked_for(store)),
            Some(found) => {
                if let Ok(error) = found.try_recv() {
                    return Err(Unfinished::Damaged(error));
                }
            }
            None => {}
        }
    }
}

/// Receives the first error of reading the whole store, if there is one.
fn looked_for(store: &Store) -> Receiver<StorageError> {
    let (sender, receiver) = channel();
    let store = store.clone();
    std::thread::spawn(move || {
        if let Err(error) = scan(&store) {
            // The query may have ended meanwhile.
            let _ = sender.send(error);
        }
    });
    receiver
}
