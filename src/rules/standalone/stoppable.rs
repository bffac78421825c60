//! A reader that another thread can stop.

use std::io::{Error, Read};
use std::sync::atomic::{AtomicBool, Ordering};

use actcheck_base::RuleFault;

/// A reader whose reads fail once `stop` is set.
pub(super) struct Stoppable<'a, R> {
    pub(super) inner: R,
    pub(super) stop: &'a AtomicBool,
}

impl<R: Read> Read for Stoppable<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.stop.load(Ordering::Relaxed) {
            // Not `ErrorKind::Interrupted`, after which readers retry.
            true => Err(Error::other(RuleFault::Interrupted)),
            false => self.inner.read(buffer),
        }
    }
}
