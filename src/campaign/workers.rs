//! The thread pool of a command: one simulation or judgement for each worker at a time.

use rayon::{ThreadPool, ThreadPoolBuilder};

use actcheck_base::Diagnostic;

/// Starts `jobs` workers, at least one.
///
/// # Errors
/// `X010` if they can't be started.
pub(super) fn workers(jobs: usize) -> Result<ThreadPool, Diagnostic> {
    let pool = ThreadPoolBuilder::new().num_threads(jobs.max(1)).build();
    pool.map_err(|error| Diagnostic::error("X010", format!("workers can't be started: {error}")))
}
