//! A program as a process: its socket, its limits, and its end with all that it started.

use std::fs::{self, DirBuilder};
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;

use crate::actions::OutsideFault;
use crate::config::Skill;
use crate::protocol::message::PROTOCOL;
use crate::protocol::output::Output;

/// Who waits for a process looks around so often.
const POLL: Duration = Duration::from_millis(5);
/// How long a process that is told to end has for it, in steps of [`POLL`]: a second.
const GRACE_POLLS: u32 = 200;
/// A process that starts others while it is ended is ended again so many times.
const SWEEPS: usize = 10;

/// Starts a program within limits on its memory (kilobytes) and computing time (seconds).
const LIMITED: &str =
    r#"[ -z "$1" ] || ulimit -v "$1" || exit 126; [ -z "$2" ] || ulimit -t "$2" || exit 126; shift 2; exec "$@""#;
/// Waits until nobody holds its input any more, which also happens when this program is killed, then ends a group of processes.
const GUARD: &str = r#"read -r _; kill -s KILL -- "-$1" 2>/dev/null; rm -rf -- "$2""#;

/// A running program.
#[derive(Debug)]
pub struct Process {
    child: Child,
    /// Ends the program should this one be ended.
    guard: Child,
    /// Holds the socket; nobody else may enter.
    folder: PathBuf,
    address: String,
    listener: UnixListener,
    pub output: Output,
    /// Whether it was ended, and its number may be somebody else's.
    over: bool,
}

impl Process {
    /// Starts the program of a worker.
    ///
    /// # Errors
    /// It can't be started.
    pub fn start(skill: &Skill, worker: usize) -> Result<Self, OutsideFault> {
        let folder = private_folder().map_err(|error| cannot("have a folder for its socket", &error))?;
        let started = Self::start_in(skill, worker, &folder);
        if started.is_err() {
            // The fault that is told is the cause.
            let _ = fs::remove_dir_all(&folder);
        }
        started
    }

    fn start_in(skill: &Skill, worker: usize, folder: &Path) -> Result<Self, OutsideFault> {
        let socket = folder.join("skill.sock");
        let listener = UnixListener::bind(&socket).map_err(|error| cannot("have its socket", &error))?;
        listener.set_nonblocking(true).map_err(|error| cannot("have its socket", &error))?;
        let address = format!("unix:{}", socket.display());
        let (reader, writer) = std::io::pipe().map_err(|error| cannot("have its output read", &error))?;
        let mut command = limited(skill);
        command
            .envs(&skill.env)
            .env("ACTCHECK_ADDRESS", &address)
            .env("ACTCHECK_PROTOCOL", PROTOCOL.to_string())
            .env("ACTCHECK_WORKER", worker.to_string())
            .current_dir(&skill.dir)
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(writer.try_clone().map_err(|error| cannot("have its output read", &error))?)
            .stderr(writer);
        let mut child = command.spawn().map_err(|error| cannot("be started", &error))?;
        // The command holds ends of the pipe, too.
        drop(command);
        let output = Output::read(reader);
        match guard(&child, folder) {
            Ok(guard) => {
                Ok(Self { child, guard, folder: folder.to_path_buf(), address, listener, output, over: false })
            }
            Err(error) => {
                // It may have ended by itself.
                let _ = child.kill();
                let _ = child.wait();
                Err(cannot("be guarded", &error))
            }
        }
    }

    /// Its connection, once it has made one.
    ///
    /// # Errors
    /// It has ended before, or does not come within the time.
    pub fn accept(&mut self, limit_secs: f64, clock_secs: fn() -> f64) -> Result<UnixStream, OutsideFault> {
        let began = clock_secs();
        let mut waited_secs: f64 = 0.0;
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => return Ok(stream),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(error) => return Err(cannot("connect", &error)),
            }
            if let Some(how) = self.ended() {
                return Err(broke(format!("{how} before it connected to the address in ACTCHECK_ADDRESS")));
            }
            if waited_secs.max(clock_secs() - began) >= limit_secs {
                let reason = format!("it did not connect to the address in ACTCHECK_ADDRESS within {limit_secs} s");
                return Err(OutsideFault { late: true, reason });
            }
            std::thread::sleep(POLL);
            waited_secs += POLL.as_secs_f64();
        }
    }

    /// How it ended, if it has.
    pub fn ended(&mut self) -> Option<String> {
        self.child.try_wait().ok().flatten().map(how)
    }

    /// Waits a moment for an end that may come, and says how it came.
    pub fn ends_soon(&mut self) -> Option<String> {
        self.ends_within(GRACE_POLLS / 4)
    }

    /// Waits for an end that is to be expected, as the program has closed its connection, and says how it came. On a machine that
    /// has much else to do an interpreter takes a while to end.
    pub fn ends_after_closing(&mut self) -> Option<String> {
        self.ends_within(3 * GRACE_POLLS)
    }

    fn ends_within(&mut self, polls: u32) -> Option<String> {
        for _ in 0..polls {
            if let Some(how) = self.ended() {
                return Some(how);
            }
            std::thread::sleep(POLL);
        }
        None
    }

    /// Waits for the end of a program that was told to end, a second at most.
    pub fn let_end(&mut self) {
        self.ends_within(GRACE_POLLS);
    }

    /// Ends it with all that it started. Gives the last lines that it printed.
    pub fn end(&mut self) -> Vec<String> {
        if std::mem::replace(&mut self.over, true) {
            return Vec::new();
        }
        if let Ok(leader) = i32::try_from(self.child.id()) {
            // There may be nobody left.
            let _ = killpg(Pid::from_raw(leader), Signal::SIGKILL);
        }
        let _ = self.child.wait();
        sweep(&self.address);
        let _ = self.guard.kill();
        let _ = self.guard.wait();
        let _ = fs::remove_dir_all(&self.folder);
        self.output.last_lines()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
    }
}

/// The command of a program, through a shell that sets its limits where there are any.
fn limited(skill: &Skill) -> Command {
    if skill.memory_mb.is_none() && skill.cpu_secs.is_none() {
        let mut command = Command::new(&skill.program);
        command.args(&skill.args);
        return command;
    }
    let written = |limit: Option<u64>| limit.map_or_else(String::new, |limit| limit.to_string());
    let mut command = Command::new("sh");
    command.args(["-c", LIMITED, "sh"]);
    command.arg(written(skill.memory_mb.map(|memory_mb| memory_mb * 1024))).arg(written(skill.cpu_secs));
    command.arg(&skill.program).args(&skill.args);
    command
}

fn guard(child: &Child, folder: &Path) -> std::io::Result<Child> {
    let mut command = Command::new("sh");
    command.args(["-c", GUARD, "sh"]).arg(child.id().to_string()).arg(folder);
    // A group of its own: it has to outlive an interrupt from the keyboard.
    command.process_group(0).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()
}

/// A new folder that is nobody else's.
fn private_folder() -> std::io::Result<PathBuf> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let base = std::env::temp_dir();
    loop {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder = base.join(format!("actcheck-{}-{number}", std::process::id()));
        match DirBuilder::new().mode(0o700).create(&folder) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            done => return done.map(|()| folder),
        }
    }
}

/// Ends what left its group of processes: on Linux the environment tells whose it is.
fn sweep(address: &str) {
    let needle = format!("ACTCHECK_ADDRESS={address}\0");
    for _ in 0..SWEEPS {
        let left = holders(needle.as_bytes());
        if left.is_empty() {
            return;
        }
        for pid in left {
            // It may have ended meanwhile.
            let _ = kill(Pid::from_raw(pid), Signal::SIGKILL);
        }
        std::thread::sleep(POLL);
    }
}

/// Processes with these bytes in their environment.
fn holders(needle: &[u8]) -> Vec<i32> {
    let Ok(processes) = fs::read_dir("/proc") else { return Vec::new() };
    let numbers = processes.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    numbers
        .filter(|pid: &i32| {
            let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            environment.windows(needle.len()).any(|window| window == needle)
        })
        .collect()
}

fn how(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("it exited with code {code}"),
        (None, Some(signal)) => match Signal::try_from(signal) {
            Ok(known) => format!("it was ended by {known}"),
            Err(_) => format!("it was ended by signal {signal}"),
        },
        (None, None) => "it ended".to_owned(),
    }
}

fn cannot(what: &str, error: &std::io::Error) -> OutsideFault {
    broke(format!("it can't {what}: {}", error.to_string().to_lowercase()))
}

fn broke(reason: String) -> OutsideFault {
    OutsideFault { late: false, reason }
}
