//! A child process of this program for one task, killed if it takes too long or writes too much.

use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

/// The command of a worker process.
#[derive(Debug, Clone)]
pub(super) struct Worker {
    pub program: PathBuf,
    pub arguments: Vec<String>,
}

/// The end of a worker process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ended {
    /// It exited, with its exit code (`None` if a signal killed it) and the contents of stdout and stderr.
    Itself { code: Option<i32>, output: Vec<u8>, errors: Vec<u8> },
    /// It exceeded its time limit.
    Late,
    /// It wrote more than allowed.
    TooMuch,
    /// It could not be started.
    NotStarted(String),
}

/// Maximum length of stderr: a few diagnostics. Unit: bytes.
const MOST_ERRORS: u64 = 64 * 1024;

impl Worker {
    /// Starts the process, writes `input` to its stdin, and waits until it exits or is killed. `room` is the maximum
    /// length of stdout. Unit: bytes.
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
    // Each stream has its own thread, so that a full pipe can't block the others.
    let stdin = child.stdin.take();
    std::thread::spawn(move || {
        // If the process exits before it has read everything, its output has the reason.
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
    // Its streams are closed, so it has exited or is about to.
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
        // After a read error, the bytes so far are used.
        let _ = stream.take(most).read_to_end(&mut bytes);
        // The receiver is gone if the time limit was exceeded.
        let _ = sender.send(bytes);
    });
    receiver
}

fn left(until: Option<Instant>) -> Duration {
    // `None` is a deadline beyond the range of the clock: it is never reached.
    until.map_or(Duration::from_secs(u64::from(u32::MAX)), |until| until.saturating_duration_since(Instant::now()))
}

fn end(mut child: Child, how: Ended) -> Ended {
    // It may have exited in the meantime.
    let _ = child.kill();
    let _ = child.wait();
    how
}
