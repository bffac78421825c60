//! A reader that somebody can stop.

use std::io::{Error, Read};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::rules::findings::RuleFault;

/// Reads until somebody sets the flag; from then on every read fails.
pub(super) struct Stoppable<'a, R> {
    pub(super) inner: R,
    pub(super) stop: &'a AtomicBool,
}

impl<R: Read> Read for Stoppable<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.stop.load(Ordering::Relaxed) {
            // Not the kind `Interrupted`, after which readers try again.
            true => Err(Error::other(RuleFault::Interrupted)),
            false => self.inner.read(buffer),
        }
    }
}
