//! The thread pool of a command: one simulation or judgement for each worker at a time.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use actcheck_base::{Diagnostic, Diagnostics};

/// Starts `jobs` workers, at least one.
///
/// # Errors
/// `X010` if they can't be started.
pub(super) fn workers(jobs: usize) -> Result<ThreadPool, Diagnostics> {
    let pool = ThreadPoolBuilder::new().num_threads(jobs.max(1)).build();
    pool.map_err(|error| {
        Diagnostic::error("X010", format!("workers can't be started: {error}")).into()
    })
}

/// Does the same with each thing on several workers. The results are in the order of the things.
///
/// # Errors
/// `X010` if the workers can't be started.
pub fn on_workers<T: Sync, R: Send>(
    jobs: usize,
    things: &[T],
    work: impl Fn(&T) -> R + Sync + Send,
) -> Result<Vec<R>, Diagnostics> {
    Ok(workers(jobs)?.install(|| things.par_iter().map(work).collect()))
}

/// Does two things side by side with two workers or more, otherwise one after the other.
///
/// # Errors
/// `X010` if the workers can't be started.
pub fn side_by_side<A: Send, B: Send>(
    jobs: usize,
    first: impl FnOnce() -> A + Send,
    second: impl FnOnce() -> B + Send,
) -> Result<(A, B), Diagnostics> {
    Ok(workers(jobs.min(2))?.install(|| rayon::join(first, second)))
}
