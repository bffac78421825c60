//! Captures the output of a program: keeps the last lines and counts all bytes.

use std::collections::VecDeque;
use std::io::{PipeReader, Read};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

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
    tail: Arc<Mutex<Tail>>,
    ended: Receiver<()>,
}

#[derive(Debug, Default)]
struct Tail {
    lines: VecDeque<String>,
    /// The current, unfinished line.
    begun: Vec<u8>,
    n_bytes: u64,
}

impl Output {
    /// Reads from a pipe until all its writers have closed it.
    pub fn read(mut pipe: PipeReader) -> Self {
        let tail = Arc::new(Mutex::new(Tail::default()));
        let (end, ended) = channel();
        let filled = Arc::clone(&tail);
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(n_bytes @ 1..) = pipe.read(&mut bytes) {
                filled
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .take(&bytes[..n_bytes]);
            }
            // The receiver may be gone.
            let _ = end.send(());
        });
        Self { tail, ended }
    }

    /// Number of bytes printed so far.
    pub fn n_bytes(&self) -> u64 {
        self.tail
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .n_bytes
    }

    /// The last lines of a program that has ended.
    pub fn last_lines(&self) -> Vec<String> {
        // A process that escaped may still hold the pipe.
        let _ = self.ended.recv_timeout(REST);
        let tail = self.tail.lock().unwrap_or_else(PoisonError::into_inner);
        let rest = (!tail.begun.is_empty()).then(|| readable(&tail.begun));
        let all: Vec<String> = tail.lines.iter().cloned().chain(rest).collect();
        all[all.len().saturating_sub(LINES)..].to_vec()
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
                let line = readable(&std::mem::take(&mut self.begun));
                self.lines.push_back(line);
                if self.lines.len() > LINES {
                    self.lines.pop_front();
                }
            }
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
