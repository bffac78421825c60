//! Programs that a bisection starts, each as a group of processes that ends with it.

use std::fs::File;
use std::io;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Interval between looks at the program and at Ctrl-C.
const INTERVAL: Duration = Duration::from_millis(20);
/// Time in which a program must end after it was asked to.
const GRACE: Duration = Duration::from_secs(5);

/// Runs a program to its end, with its error stream in a file. Returns `None` if `stop` was set:
/// the program and its descendants are gone then.
///
/// # Errors
/// The program can't be started.
pub fn run(
    command: &mut Command,
    errors: &Path,
    stop: &AtomicBool,
) -> io::Result<Option<ExitStatus>> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(errors)?);
    // Ctrl-C at the terminal does not reach another group, so that it ends in an orderly way.
    let mut child = command.process_group(0).spawn()?;
    while !stop.load(Ordering::Relaxed) {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        std::thread::sleep(INTERVAL);
    }
    end(&mut child)?;
    Ok(None)
}

fn end(child: &mut Child) -> io::Result<()> {
    signal(child, "TERM");
    let asked = Instant::now();
    while asked.elapsed() < GRACE {
        if child.try_wait()?.is_some() {
            break;
        }
        std::thread::sleep(INTERVAL);
    }
    // Descendants may outlive the program.
    signal(child, "KILL");
    child.wait().map(|_| ())
}

/// Sends a signal to all processes of the group, with the shell's builtin `kill`: minimal systems
/// have no other.
fn signal(child: &Child, name: &str) {
    let kill = format!("kill -s {name} -- -{}", child.id());
    // A group that has ended needs no signal.
    let _ = Command::new("sh")
        .args(["-c", &kill])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .status();
}
