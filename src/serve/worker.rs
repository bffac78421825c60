//! A process of our own program, started for one piece of work, and ended when that takes too long or gives too much.

use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

/// How to start it.
#[derive(Debug, Clone)]
pub(super) struct Worker {
    pub program: PathBuf,
    pub arguments: Vec<String>,
}

/// How it ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ended {
    /// By itself, with its exit code (none: a signal ended it) and what it wrote to both streams.
    Itself { code: Option<i32>, output: Vec<u8>, errors: Vec<u8> },
    /// Its time was spent.
    Late,
    /// It wrote more than there is room for.
    TooMuch,
    /// It could not be started.
    NotStarted(String),
}

/// What its error stream may hold: a few diagnostics.
const MOST_ERRORS: u64 = 64 * 1024;

impl Worker {
    /// Starts it, gives it `input`, and waits until it ends or is ended. Units: bytes.
    pub fn run(&self, input: &[u8], time: Duration, room: u64) -> Ended {
        let mut command = Command::new(&self.program);
        let command = command.args(&self.arguments).env("NO_COLOR", "1");
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        match child {
            Ok(child) => watched(child, input.to_vec(), time, room),
            Err(error) => Ended::NotStarted(error.to_string()),
        }
    }
}

fn watched(mut child: Child, input: Vec<u8>, time: Duration, room: u64) -> Ended {
    let until = Instant::now().checked_add(time);
    // Each stream has a thread, so that none is held up by another that nobody reads.
    let stdin = child.stdin.take();
    std::thread::spawn(move || {
        // A process that ends before it has read everything says why itself.
        let _ = stdin.map(|mut stdin| stdin.write_all(&input));
    });
    let errors = child.stderr.take().map(|stream| reading(stream, MOST_ERRORS));
    let output = child.stdout.take().map(|stream| reading(stream, room + 1));
    let output = match output.map(|receiver| receiver.recv_timeout(left(until))) {
        Some(Ok(output)) => output,
        Some(Err(RecvTimeoutError::Timeout)) => return end(child, Ended::Late),
        _ => Vec::new(),
    };
    if output.len() as u64 > room {
        return end(child, Ended::TooMuch);
    }
    let errors = errors.and_then(|receiver| receiver.recv_timeout(left(until)).ok()).unwrap_or_default();
    // Its streams are closed: it has ended, or does at once.
    let patience = Instant::now() + Duration::from_secs(1);
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ended::Itself { code: status.code(), output, errors },
            Ok(None) if Instant::now() < patience => std::thread::sleep(Duration::from_millis(2)),
            _ => return end(child, Ended::Late),
        }
    }
}

fn reading(stream: impl Read + Send + 'static, most: u64) -> std::sync::mpsc::Receiver<Vec<u8>> {
    let (sender, receiver) = sync_channel(1);
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // What was read before a fault is all there is.
        let _ = stream.take(most).read_to_end(&mut bytes);
        // Nobody listens any more when the time was spent.
        let _ = sender.send(bytes);
    });
    receiver
}

fn left(until: Option<Instant>) -> Duration {
    // A moment that no clock can tell never comes.
    until.map_or(Duration::from_secs(u64::from(u32::MAX)), |until| until.saturating_duration_since(Instant::now()))
}

fn end(mut child: Child, how: Ended) -> Ended {
    // It may have ended meanwhile.
    let _ = child.kill();
    let _ = child.wait();
    how
}
