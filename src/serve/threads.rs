//! The threads that serve connections. Each connection stays on one of them, so that no thread
//! waits for another.

use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::runtime::{Builder, Handle};
use tokio::sync::oneshot;

/// Threads that end with this value.
#[derive(Debug)]
pub(super) struct Threads {
    handles: Vec<Handle>,
    next: AtomicUsize,
    _running: Vec<oneshot::Sender<()>>,
}

impl Threads {
    /// Starts threads with a stack of this size. Unit: bytes.
    ///
    /// # Errors
    /// The system has no resources for another thread.
    pub fn start(number: usize, stack: usize) -> std::io::Result<Self> {
        let mut threads = Self {
            handles: Vec::new(),
            next: AtomicUsize::new(0),
            _running: Vec::new(),
        };
        for _ in 0..number {
            let runtime = Builder::new_current_thread().enable_all().build()?;
            threads.handles.push(runtime.handle().clone());
            let (running, ended) = oneshot::channel();
            threads._running.push(running);
            std::thread::Builder::new()
                .name("connections".to_owned())
                .stack_size(stack)
                .spawn(move || {
                    // The sender never sends: it is dropped.
                    let _ = runtime.block_on(ended);
                    runtime.shutdown_background();
                })?;
        }
        Ok(threads)
    }

    /// Returns each thread in turn.
    pub fn next(&self) -> Option<&Handle> {
        self.handles
            .get(self.next.fetch_add(1, Ordering::Relaxed) % self.handles.len().max(1))
    }
}
