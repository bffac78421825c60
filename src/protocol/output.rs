//! Captures the output of a program: hands on its lines, keeps the last ones, and counts all bytes.

use std::collections::VecDeque;
use std::io::{ErrorKind, PipeReader, Read};
use std::os::fd::AsFd as _;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::log::{Ends, LINES_OF_AN_END};
use actcheck_base::printable;

/// Number of lines kept.
const LINES: usize = 20;
/// Longest line kept without truncation. Unit: bytes.
const LONGEST: usize = 400;
/// Time limit for reading the rest of the output after a process has ended.
const REST: Duration = Duration::from_millis(500);

/// Reads the output of a program while it runs.
#[derive(Debug)]
pub struct Output {
    shared: Arc<Shared>,
    ended: Receiver<()>,
}

/// The reading end of the pipe. Two threads read it: one whenever something arrives, so that the
/// program is never held up, and the caller's when it needs everything that was printed before a
/// message.
#[derive(Debug)]
struct Shared {
    pipe: PipeReader,
    tail: Mutex<Tail>,
}

#[derive(Debug, Default)]
struct Tail {
    lines: VecDeque<String>,
    /// Whole lines that were not taken yet.
    fresh: Ends<String, LINES_OF_AN_END>,
    /// The current, unfinished line.
    begun: Vec<u8>,
    n_bytes: u64,
}

impl Output {
    /// Reads from a pipe until all its writers have closed it.
    ///
    /// # Errors
    /// The pipe can't be configured.
    pub fn read(pipe: PipeReader) -> std::io::Result<Self> {
        fcntl(&pipe, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        let shared = Arc::new(Shared {
            pipe,
            tail: Mutex::default(),
        });
        let (end, ended) = channel();
        let filled = Arc::clone(&shared);
        std::thread::spawn(move || {
            while filled.wait() && !filled.drain() {}
            // The receiver may be gone.
            let _ = end.send(());
        });
        Ok(Self { shared, ended })
    }

    /// Number of bytes printed so far.
    pub fn n_bytes(&self) -> u64 {
        self.shared.tail().n_bytes
    }

    /// Everything that was printed until now and was not taken yet: whole lines, and the number of
    /// those that were left out.
    pub fn take(&self) -> (Vec<String>, u64) {
        self.shared.drain();
        self.shared.tail().fresh.take()
    }

    /// As [`Self::take`], with the unfinished line.
    pub fn take_rest(&self) -> (Vec<String>, u64) {
        self.shared.drain();
        let mut tail = self.shared.tail();
        if !tail.begun.is_empty() {
            tail.end_line();
        }
        tail.fresh.take()
    }

    /// The last lines of a program that has ended.
    pub fn last_lines(&self) -> Vec<String> {
        // A process that escaped may still hold the pipe.
        let _ = self.ended.recv_timeout(REST);
        let tail = self.shared.tail();
        let rest = (!tail.begun.is_empty()).then(|| readable(&tail.begun));
        let all: Vec<String> = tail.lines.iter().cloned().chain(rest).collect();
        all[all.len().saturating_sub(LINES)..].to_vec()
    }
}

impl Shared {
    fn tail(&self) -> MutexGuard<'_, Tail> {
        self.tail.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until there is something to read. Returns whether the pipe can be read.
    fn wait(&self) -> bool {
        loop {
            let mut fds = [PollFd::new(self.pipe.as_fd(), PollFlags::POLLIN)];
            match poll(&mut fds, PollTimeout::NONE) {
                Ok(_) => return true,
                Err(Errno::EINTR) => {}
                Err(_) => return false,
            }
        }
    }

    /// Reads everything that is in the pipe. Returns whether it has ended.
    fn drain(&self) -> bool {
        let mut tail = self.tail();
        let mut bytes = [0; 4096];
        loop {
            match (&self.pipe).read(&mut bytes) {
                Ok(0) => return true,
                Ok(n_bytes) => tail.take(&bytes[..n_bytes]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return error.kind() != ErrorKind::WouldBlock,
            }
        }
    }
}

impl Tail {
    fn take(&mut self, bytes: &[u8]) {
        self.n_bytes += bytes.len() as u64;
        for piece in bytes.split_inclusive(|byte| *byte == b'\n') {
            let room = LONGEST.saturating_sub(self.begun.len());
            let (text, ends) = piece
                .strip_suffix(b"\n")
                .map_or((piece, false), |text| (text, true));
            self.begun.extend_from_slice(&text[..text.len().min(room)]);
            if ends {
                self.end_line();
            }
        }
    }

    fn end_line(&mut self) {
        let line = readable(&std::mem::take(&mut self.begun));
        self.fresh.push(line.clone());
        self.lines.push_back(line);
        if self.lines.len() > LINES {
            self.lines.pop_front();
        }
    }
}

/// A line without control characters, so that it can't move a terminal's cursor.
fn readable(line: &[u8]) -> String {
    printable(String::from_utf8_lossy(line).trim_end_matches('\r')).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_lines_are_kept_and_shortened() {
        let mut tail = Tail::default();
        for number in 0..30 {
            tail.take(format!("line {number}\r\nand ").as_bytes());
        }
        tail.take(&[b'x'; 3 * LONGEST]);
        tail.take(b"\n\x1b[2Jlast");
        assert_eq!(tail.lines.len(), LINES);
        assert_eq!(tail.lines[0], "and line 11");
        assert_eq!(tail.lines[LINES - 1].len(), LONGEST);
        assert_eq!(readable(&tail.begun), "\\u{1b}[2Jlast");
    }
}
