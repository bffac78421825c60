//! A program as a process: its socket, its limits, and the termination of it and all its
//! descendants.

use std::collections::BTreeMap;
use std::fs::{self, DirBuilder};
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use nix::libc;
use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;

use crate::message::PROTOCOL;
use crate::output::Output;
use actcheck_actions::ExternalFault;
use actcheck_config::Skill;

/// Polling interval while waiting for a process.
const POLL: Duration = Duration::from_millis(5);
/// Grace period for a process that should exit, in steps of [`POLL`]: one second.
const GRACE_POLLS: u32 = 200;
/// Longest path of the folder of temporary files in which a socket can be: the whole path of a
/// socket has at most 107 bytes, and on some systems 103. Unit: bytes.
const LONGEST_BASE: usize = 60;
/// Number of passes that kill escaped processes, in case they start others meanwhile.
const SWEEPS: usize = 10;

/// Starts a program with limits on its memory (kilobytes) and CPU time (seconds).
const LIMITED: &str = r#"[ -z "$1" ] || ulimit -v "$1" || exit 126; [ -z "$2" ] || ulimit -t "$2" || exit 126; shift 2; exec "$@""#;
/// Waits for the end of its input, which also occurs when actcheck is killed, then kills a process
/// group and removes the socket's folder.
const GUARD: &str = r#"read -r _; kill -s KILL -- "-$1" 2>/dev/null; rm -rf -- "$2""#;

/// A running program.
#[derive(Debug)]
pub struct Process {
    child: Child,
    /// Kills the program if actcheck itself is killed.
    guard: Child,
    /// Private folder of the socket.
    folder: PathBuf,
    address: String,
    listener: UnixListener,
    pub output: Output,
    /// Whether the process was ended, so that its id may be reused.
    over: bool,
    /// Its descendants when they were last looked for, by their ids, with their start times.
    descendants: BTreeMap<i32, String>,
}

impl Process {
    /// Starts the program of a worker.
    ///
    /// # Errors
    /// It can't be started.
    pub fn start(skill: &Skill, worker: usize) -> Result<Self, ExternalFault> {
        let folder = private_folder()
            .map_err(|error| cannot("the folder of its socket can't be created", &error))?;
        let started = Self::start_in(skill, worker, &folder);
        if started.is_err() {
            // The first error is the cause; a failed removal is ignored.
            let _ = fs::remove_dir_all(&folder);
        }
        started
    }

    fn start_in(skill: &Skill, worker: usize, folder: &Path) -> Result<Self, ExternalFault> {
        let socket = folder.join("skill.sock");
        let listener = UnixListener::bind(&socket)
            .map_err(|error| cannot("its socket can't be created", &error))?;
        listener
            .set_nonblocking(true)
            .map_err(|error| cannot("its socket can't be configured", &error))?;
        let address = format!("unix:{}", socket.display());
        let (reader, writer) =
            std::io::pipe().map_err(|error| cannot("its output can't be captured", &error))?;
        let mut command = limited(skill);
        command
            // Lines are printed when the program prints them; `[skill] env` may say otherwise.
            .env("PYTHONUNBUFFERED", "1")
            .envs(&skill.env)
            .env("ACTCHECK_ADDRESS", &address)
            .env("ACTCHECK_PROTOCOL", PROTOCOL.to_string())
            .env("ACTCHECK_WORKER", worker.to_string())
            .env("ACTCHECK_TIMEOUT_S", skill.timeout_secs.to_string())
            .current_dir(&skill.dir)
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(
                writer
                    .try_clone()
                    .map_err(|error| cannot("its output can't be captured", &error))?,
            )
            .stderr(writer);
        let mut child = command
            .spawn()
            .map_err(|error| not_started(&skill.program, &error))?;
        // The command also holds ends of the pipe.
        drop(command);
        let made = Output::read(reader).and_then(|output| Ok((guard(&child, folder)?, output)));
        match made {
            Ok((guard, output)) => Ok(Self {
                child,
                guard,
                folder: folder.to_path_buf(),
                address,
                listener,
                output,
                over: false,
                descendants: BTreeMap::new(),
            }),
            Err(error) => {
                // It may already have exited.
                let _ = child.kill();
                let _ = child.wait();
                Err(cannot("its guard process can't be started", &error))
            }
        }
    }

    /// Waits for the program to connect.
    ///
    /// # Errors
    /// The program exits first, or does not connect in time, or `stop` is set.
    pub fn accept(
        &mut self,
        limit_secs: f64,
        clock_secs: fn() -> f64,
        stop: &AtomicBool,
    ) -> Result<UnixStream, ExternalFault> {
        let began = clock_secs();
        let mut waited_secs: f64 = 0.0;
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => return Ok(stream),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(error) => return Err(cannot("its connection can't be accepted", &error)),
            }
            if let Some(status) = self.status() {
                // A program that ends without a fault has probably forgotten to connect.
                let hint = if status.success() {
                    " (in Python, `actcheck.serve()` connects)"
                } else {
                    ""
                };
                let how = how(status);
                return Err(broke(format!(
                    "{how} before it connected to the address in ACTCHECK_ADDRESS{hint}"
                )));
            }
            if stop.load(Ordering::Relaxed) {
                return Err(ExternalFault {
                    late: true,
                    reason: "it was stopped before it connected".to_owned(),
                });
            }
            if waited_secs.max(clock_secs() - began) >= limit_secs {
                let reason = format!(
                    "it did not connect to the address in ACTCHECK_ADDRESS within {limit_secs} s"
                );
                return Err(ExternalFault { late: true, reason });
            }
            std::thread::sleep(POLL);
            waited_secs += POLL.as_secs_f64();
        }
    }

    /// How the process ended, or `None` if it is running.
    pub fn ended(&mut self) -> Option<String> {
        self.status().map(how)
    }

    fn status(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Waits briefly for a possible exit and returns how the process ended. Returns `None` if it is
    /// still running.
    pub fn ends_soon(&mut self) -> Option<String> {
        self.ends_within(GRACE_POLLS / 4)
    }

    /// Waits for the exit of a program that has closed its connection, and returns how it ended. On
    /// a busy machine, an interpreter takes a while to exit. Returns `None` if it is still running.
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

    /// Waits up to a second for a program to exit after it was asked to.
    pub fn let_end(&mut self) {
        self.ends_within(GRACE_POLLS);
    }

    /// Looks for its descendants: once it has ended, those that left its group and its environment
    /// can't be found.
    pub fn notice_descendants(&mut self) {
        let Ok(leader) = i32::try_from(self.child.id()) else {
            return;
        };
        let mut parents: Vec<i32> = self.descendants.keys().copied().chain([leader]).collect();
        while let Some(parent) = parents.pop() {
            for child in children_of(parent) {
                if let (Some(started), false) =
                    (start_time(child), self.descendants.contains_key(&child))
                {
                    self.descendants.insert(child, started);
                    parents.push(child);
                }
            }
        }
    }

    /// Kills the process and all its descendants. Returns the last lines of its output.
    pub fn end(&mut self) -> Vec<String> {
        if std::mem::replace(&mut self.over, true) {
            return Vec::new();
        }
        self.notice_descendants();
        if let Ok(leader) = i32::try_from(self.child.id()) {
            // The group may already be empty.
            let _ = killpg(Pid::from_raw(leader), Signal::SIGKILL);
        }
        let _ = self.child.wait();
        for (pid, started) in std::mem::take(&mut self.descendants) {
            // Its id may belong to another process by now.
            if start_time(pid).as_ref() == Some(&started) {
                let _ = kill(Pid::from_raw(pid), Signal::SIGKILL);
            }
        }
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

/// The program's command, started through a shell if it has limits.
fn limited(skill: &Skill) -> Command {
    if skill.memory_mb.is_none() && skill.cpu_secs.is_none() {
        let mut command = Command::new(&skill.program);
        command.args(&skill.args);
        return command;
    }
    let written = |limit: Option<u64>| limit.map_or_else(String::new, |limit| limit.to_string());
    let mut command = Command::new("sh");
    command.args(["-c", LIMITED, "sh"]);
    command
        .arg(written(skill.memory_mb.map(|memory_mb| memory_mb * 1024)))
        .arg(written(skill.cpu_secs));
    command.arg(&skill.program).args(&skill.args);
    command
}

fn guard(child: &Child, folder: &Path) -> std::io::Result<Child> {
    let mut command = Command::new("sh");
    command
        .args(["-c", GUARD, "sh"])
        .arg(child.id().to_string())
        .arg(folder);
    // A separate process group, so that it survives Ctrl-C.
    command
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
}

/// Ids of the children of a process. Empty if the system has no such list.
fn children_of(pid: i32) -> Vec<i32> {
    let threads = fs::read_dir(format!("/proc/{pid}/task"))
        .into_iter()
        .flatten()
        .flatten();
    let lists =
        threads.filter_map(|thread| fs::read_to_string(thread.path().join("children")).ok());
    lists
        .flat_map(|list| {
            list.split_whitespace()
                .filter_map(|id| id.parse().ok())
                .collect::<Vec<i32>>()
        })
        .collect()
}

/// When a process started, in the system's unit; `None` if it has ended.
fn start_time(pid: i32) -> Option<String> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name before it may have spaces and brackets.
    let (_, rest) = stat.rsplit_once(')')?;
    rest.split_whitespace().nth(19).map(str::to_owned)
}

/// The folder of temporary files, unless a socket in it would have a path that is too long.
fn base_of_sockets() -> PathBuf {
    let base = std::env::temp_dir();
    if base.as_os_str().len() <= LONGEST_BASE {
        base
    } else {
        PathBuf::from("/tmp")
    }
}

/// Creates a new folder that only this user can access.
fn private_folder() -> std::io::Result<PathBuf> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let base = base_of_sockets();
    loop {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder = base.join(format!("actcheck-{}-{number}", std::process::id()));
        match DirBuilder::new().mode(0o700).create(&folder) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            done => return done.map(|()| folder),
        }
    }
}

/// Kills processes that left the process group. On Linux they are identified by their environment.
fn sweep(address: &str) {
    let needle = format!("ACTCHECK_ADDRESS={address}\0");
    for _ in 0..SWEEPS {
        let left = holders(needle.as_bytes());
        if left.is_empty() {
            return;
        }
        for pid in left {
            // It may already have exited.
            let _ = kill(Pid::from_raw(pid), Signal::SIGKILL);
        }
        std::thread::sleep(POLL);
    }
}

/// Ids of processes with these bytes in their environment.
fn holders(needle: &[u8]) -> Vec<i32> {
    let Ok(processes) = fs::read_dir("/proc") else {
        return Vec::new();
    };
    let numbers = processes
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    numbers
        .filter(|pid: &i32| {
            let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            environment
                .windows(needle.len())
                .any(|window| window == needle)
        })
        .collect()
}

fn how(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("it exited with code {code}"),
        (None, Some(signal)) => match Signal::try_from(signal) {
            Ok(known) => format!("it was killed by {known}"),
            Err(_) => format!("it was killed by signal {signal}"),
        },
        (None, None) => "it ended".to_owned(),
    }
}

/// Why the program can't be started. The system's own words don't say that a file lacks the program
/// that runs it.
fn not_started(program: &Path, error: &std::io::Error) -> ExternalFault {
    let reason = match error.kind() {
        _ if error.raw_os_error() == Some(libc::ENOEXEC) => {
            "its first line names no interpreter, such as `#!/usr/bin/env python3`"
        }
        ErrorKind::NotFound if program.is_file() => {
            "the interpreter or loader that it names does not exist"
        }
        _ => return cannot("it can't be started", error),
    };
    broke(format!("it can't be started: {reason}"))
}

fn cannot(what: &str, error: &std::io::Error) -> ExternalFault {
    broke(format!("{what}: {}", error.to_string().to_lowercase()))
}

fn broke(reason: String) -> ExternalFault {
    ExternalFault {
        late: false,
        reason,
    }
}
