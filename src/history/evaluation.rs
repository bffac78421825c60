//! Evaluates queries in threads of their own.

use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use oxigraph::sparql::QueryEvaluationError;

use crate::Cancel;
use crate::view::Dataset;

/// Interval at which a waiting query checks whether it was stopped: too short to notice.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The reason why a query has no answer.
pub(super) enum Unfinished {
    Stopped,
    Failed(QueryEvaluationError),
    Crashed,
}

/// Evaluates a query in its own thread.
///
/// The evaluation checks its token only when it reads statements, which a join of large results may
/// not do for minutes. If the query is stopped, the thread is abandoned.
pub(super) fn evaluate<T: Send + 'static>(
    dataset: Arc<Dataset>,
    cancel: &Cancel,
    evaluation: impl FnOnce(&Dataset) -> Result<T, QueryEvaluationError> + Send + 'static,
) -> Result<T, Unfinished> {
    let (sender, receiver) = sync_channel(1);
    std::thread::spawn(move || {
        let answer = evaluation(&dataset);
        drop(dataset);
        // If the query was stopped, the receiver is gone.
        let _ = sender.send(answer);
    });
    loop {
        match receiver.recv_timeout(LOOK_EVERY) {
            Ok(answer) => return answer.map_err(Unfinished::Failed),
            Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => {
                return Err(Unfinished::Stopped);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(Unfinished::Crashed),
        }
    }
}
