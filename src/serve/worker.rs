//! Child processes of this program: one for a single task, or one that answers question after
//! question. A process that takes too long or writes too much is killed.

use std::io::{BufRead as _, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::time::{Duration, Instant};

use crate::answer::Head;
use crate::watch;

/// The command of a worker process.
#[derive(Debug, Clone)]
pub(super) struct Worker {
    pub program: PathBuf,
    pub arguments: Vec<String>,
}

/// The end of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ended {
    /// The process exited, with its exit code (`None` if a signal killed it) and the contents of
    /// stdout and stderr.
    Itself {
        code: Option<i32>,
        output: Vec<u8>,
        errors: Vec<u8>,
    },
    /// It exceeded its time limit.
    Late,
    /// It wrote more than allowed.
    TooMuch,
    /// It could not be started.
    NotStarted(String),
}

/// The result of a question.
#[derive(Debug)]
pub(super) enum Asked {
    /// The answer.
    Answer(Head, Vec<u8>),
    /// The time limit was exceeded.
    Late,
    /// The memory limit was exceeded.
    MemorySpent,
    /// The answer is larger than allowed.
    TooMuch,
    /// The process crashed.
    Crashed,
    /// The process had exited before it took the question: another one must be asked.
    NotTaken,
    /// The client has gone away.
    Gone,
    /// The process could not be started.
    NotStarted(String),
}

/// Maximum length of stderr: a few diagnostics. Unit: bytes.
const MOST_ERRORS: u64 = 64 * 1024;
/// Interval at which a waiting question checks whether the client is still there.
const LOOK_EVERY: Duration = Duration::from_millis(50);

impl Worker {
    /// Starts the process for a single task, and waits until it exits or is killed. `room` is the
    /// maximum length of stdout. Unit: bytes.
    pub fn run(&self, time: Duration, room: u64) -> Ended {
        let mut command = self.command();
        match command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
        {
            Ok(child) => watched(child, time, room),
            Err(error) => Ended::NotStarted(error.to_string()),
        }
    }

    /// Starts a process that answers questions. `room` is the maximum length of an answer. Unit:
    /// bytes.
    ///
    /// # Errors
    /// It can't be started.
    pub fn start(&self, room: u64) -> std::io::Result<Process> {
        let mut command = self.command();
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let (stdin, stdout) = (child.stdin.take(), child.stdout.take());
        let (sender, answers) = channel();
        if let Some(stdout) = stdout {
            std::thread::spawn(move || read_answers(BufReader::new(stdout), &sender, room));
        }
        Ok(Process {
            child,
            stdin,
            answers,
            is_new: true,
        })
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments).env("NO_COLOR", "1");
        command
    }
}

/// A process that answers questions, one after the other. It is killed when the value is dropped.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    stdin: Option<ChildStdin>,
    answers: Receiver<Piece>,
    is_new: bool,
}

/// Output of a process.
#[derive(Debug)]
enum Piece {
    Answer(Head, Vec<u8>),
    TooMuch,
}

impl Process {
    /// Asks a question, a line of JSON. After any result but [`Asked::Answer`] the process can't be
    /// used again.
    pub fn ask(&mut self, question: &str, time: Duration, is_gone: &dyn Fn() -> bool) -> Asked {
        let until = Instant::now().checked_add(time);
        let is_new = std::mem::replace(&mut self.is_new, false);
        let written = self
            .stdin
            .as_mut()
            .is_some_and(|stdin| writeln!(stdin, "{question}").is_ok());
        if written && let Some(asked) = self.wait(until, is_gone) {
            return asked;
        }
        match self.exit_code() {
            Some(watch::TIME_SPENT) => Asked::Late,
            Some(watch::MEMORY_SPENT) => Asked::MemorySpent,
            // It exits between questions if it holds much memory.
            Some(0) if !is_new => Asked::NotTaken,
            _ => Asked::Crashed,
        }
    }

    /// Waits for the answer. Returns `None` if the process closed its output.
    fn wait(&self, until: Option<Instant>, is_gone: &dyn Fn() -> bool) -> Option<Asked> {
        loop {
            match self.answers.recv_timeout(left(until).min(LOOK_EVERY)) {
                Ok(Piece::Answer(head, body)) => return Some(Asked::Answer(head, body)),
                Ok(Piece::TooMuch) => return Some(Asked::TooMuch),
                Err(RecvTimeoutError::Timeout) if is_gone() => return Some(Asked::Gone),
                Err(RecvTimeoutError::Timeout) if left(until).is_zero() => {
                    return Some(Asked::Late);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
    }

    /// The exit code of a process whose output has ended.
    fn exit_code(&mut self) -> Option<i32> {
        let patience = Instant::now() + Duration::from_secs(1);
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return status.code(),
                Ok(None) if Instant::now() < patience => {
                    std::thread::sleep(Duration::from_millis(2))
                }
                _ => return None,
            }
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have exited in the meantime.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads answers until the process closes its output or writes too much.
fn read_answers(mut stdout: BufReader<ChildStdout>, sender: &Sender<Piece>, room: u64) {
    let mut line = String::new();
    while let Ok(1..) = stdout.read_line(&mut line) {
        let Ok(head) = serde_json::from_str::<Head>(&line) else {
            return;
        };
        line.clear();
        if head.length > room {
            // The receiver is gone if the question was given up.
            let _ = sender.send(Piece::TooMuch);
            return;
        }
        let mut body = Vec::new();
        let read = stdout.by_ref().take(head.length).read_to_end(&mut body);
        if read.is_err()
            || body.len() as u64 != head.length
            || sender.send(Piece::Answer(head, body)).is_err()
        {
            return;
        }
    }
}

fn watched(mut child: Child, time: Duration, room: u64) -> Ended {
    let until = Instant::now().checked_add(time);
    // Each stream has its own thread, so that a full pipe can't block the other.
    let errors = child
        .stderr
        .take()
        .map(|stream| reading(stream, MOST_ERRORS));
    let output = child.stdout.take().map(|stream| reading(stream, room + 1));
    let output = match output.map(|receiver| receiver.recv_timeout(left(until))) {
        Some(Ok(output)) => output,
        Some(Err(RecvTimeoutError::Timeout)) => return end(child, Ended::Late),
        _ => Vec::new(),
    };
    if output.len() as u64 > room {
        return end(child, Ended::TooMuch);
    }
    let errors = errors
        .and_then(|receiver| receiver.recv_timeout(left(until)).ok())
        .unwrap_or_default();
    // Its streams are closed, so it has exited or is about to.
    let patience = Instant::now() + Duration::from_secs(1);
    loop {
        match child.try_wait() {
            Ok(Some(status)) => {
                return Ended::Itself {
                    code: status.code(),
                    output,
                    errors,
                };
            }
            Ok(None) if Instant::now() < patience => std::thread::sleep(Duration::from_millis(2)),
            _ => return end(child, Ended::Late),
        }
    }
}

fn reading(stream: impl Read + Send + 'static, most: u64) -> Receiver<Vec<u8>> {
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
    until.map_or(Duration::from_secs(u64::from(u32::MAX)), |until| {
        until.saturating_duration_since(Instant::now())
    })
}

fn end(mut child: Child, how: Ended) -> Ended {
    // It may have exited in the meantime.
    let _ = child.kill();
    let _ = child.wait();
    how
}
