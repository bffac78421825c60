//! Runs modules of the Python package in a Python of the user's choice, which has a simulator that
//! this program does not.

use std::ffi::OsStr;
use std::io::{BufRead as _, BufReader, BufWriter, Read as _, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};

use serde::de::DeserializeOwned;
use serde_json::Value;

use actcheck_base::{Below, Diagnostic, Diagnostics, ScratchFolder};

/// The package. Its modules print one JSON object in each line.
#[derive(rust_embed::RustEmbed)]
#[folder = "shipped/python/"]
#[include = "*.py"]
struct PythonPackage;

/// A module of the package, to be run.
pub(super) struct PythonModule<'a> {
    /// The Python.
    pub python: &'a Path,
    /// Name of the module.
    pub name: &'static str,
    /// The packages that the Python needs, in words.
    pub needs: &'static str,
    /// A folder with the package: see [`new_scratch`].
    pub scratch: &'a Path,
}

/// The end of a module.
pub(super) struct PythonEnd {
    /// Its exit status.
    status: ExitStatus,
    /// The last line of its errors; empty if it has none.
    last_error: String,
}

impl PythonModule<'_> {
    /// Runs the module, and hands over each line that is such an object. Other lines are prints of
    /// the simulator.
    ///
    /// # Errors
    /// E008 if the Python can't be started.
    pub(super) fn run<L: DeserializeOwned>(
        &self,
        arguments: &[&OsStr],
        mut each: impl FnMut(L),
    ) -> Result<PythonEnd, Diagnostics> {
        let not_started = |error: std::io::Error| {
            let message = format!("can't start `{}`: {error}", self.python.display());
            Diagnostic::error("E008", message).help(format!(
                "name a Python with {}: `--python venv/bin/python`",
                self.needs
            ))
        };
        let mut child = self
            .command(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(not_started)?;
        let stderr = child.stderr.take();
        // Read beside the output, so that a module with much to say can't block.
        let errors = std::thread::spawn(move || {
            let mut text = String::new();
            if let Some(stderr) = stderr {
                let _ = stderr.take(1 << 16).read_to_string(&mut text);
            }
            text
        });
        if let Some(stdout) = child.stdout.take() {
            for line in BufReader::new(stdout).lines() {
                let Ok(line) = line else { break };
                if let Ok(line) = serde_json::from_str(&line) {
                    each(line);
                }
            }
        }
        let status = child.wait().map_err(not_started)?;
        let errors = errors.join().unwrap_or_default();
        Ok(PythonEnd {
            status,
            last_error: errors.lines().last().unwrap_or_default().to_owned(),
        })
    }

    /// Returns the fault of a module that crashed, with this message before its last words.
    pub(super) fn crash(&self, end: &PythonEnd, message: &str) -> Diagnostic {
        let last = match end.last_error.as_str() {
            "" => "it printed nothing",
            words => words,
        };
        Diagnostic::error("E009", format!("{message}: {last}")).help(format!(
            "`{} -m {}` ended with {}; it needs {}",
            self.python.display(),
            self.name,
            end.status,
            self.needs
        ))
    }
}

impl PythonEnd {
    /// Whether the module crashed: it ends with 0, or with 1 if it printed a fault.
    pub(super) fn is_crash(&self) -> bool {
        !matches!(self.status.code(), Some(0 | 1))
    }
}

/// Creates a temporary folder with the package.
///
/// # Errors
/// E008 if it can't be written.
pub(super) fn new_scratch() -> Result<ScratchFolder, Diagnostics> {
    let scratch = ScratchFolder::create().map_err(|error| {
        Diagnostic::error("E008", format!("can't create a temporary folder: {error}"))
            .help("name another folder in TMPDIR")
    })?;
    unpack(scratch.path())?;
    Ok(scratch)
}

/// Writes the package into a folder.
fn unpack(folder: &Path) -> Result<(), Diagnostics> {
    let below = Below::new(folder);
    for name in PythonPackage::iter() {
        let Some(file) = PythonPackage::get(&name) else {
            continue;
        };
        let target = folder.join("python").join(&*name);
        let written = target
            .parent()
            .map_or(Ok(()), |parent| below.create_folder(parent))
            .and_then(|()| below.write_quickly(&target, &file.data));
        written.map_err(|error| {
            let message = format!("can't write {}: {error}", target.display());
            Diagnostic::error("E008", message)
                .help("free some space, or name another folder in TMPDIR")
        })?;
    }
    Ok(())
}

/// A module of the package that answers requests, one JSON value in each line.
pub(super) struct PythonTalk {
    child: Child,
    requests: BufWriter<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl PythonModule<'_> {
    /// Starts a module that answers requests.
    ///
    /// # Errors
    /// Why it can't be started, in words.
    pub(super) fn talk(&self, arguments: &[&OsStr]) -> Result<PythonTalk, String> {
        let why = |error: std::io::Error| {
            format!(
                "can't start `{}`: {error}; name a Python with {} (pip install mujoco mcap)",
                self.python.display(),
                self.needs
            )
        };
        let mut child = self
            .command(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .map_err(why)?;
        match (child.stdin.take(), child.stdout.take()) {
            (Some(requests), Some(answers)) => Ok(PythonTalk {
                child,
                requests: BufWriter::new(requests),
                answers: BufReader::new(answers),
            }),
            _ => Err("it has no input or output".to_owned()),
        }
    }

    fn command(&self, arguments: &[&OsStr]) -> Command {
        let mut command = Command::new(self.python);
        command
            .args(["-m", self.name])
            .args(arguments)
            .env("PYTHONPATH", self.scratch.join("python"))
            .env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }
}

impl PythonTalk {
    /// Asks for something.
    ///
    /// # Errors
    /// The module ended, or did not answer as expected, in words.
    pub(super) fn ask<A: DeserializeOwned>(&mut self, request: &Value) -> Result<A, String> {
        let ended = |error: std::io::Error| format!("it ended: {error}");
        writeln!(self.requests, "{request}").map_err(ended)?;
        self.requests.flush().map_err(ended)?;
        let mut line = String::new();
        match self.answers.read_line(&mut line) {
            Ok(0) => Err("it ended".to_owned()),
            Ok(_) => serde_json::from_str(&line).map_err(|error| {
                let said: String = line.trim().chars().take(200).collect();
                format!("it answered `{said}`: {error}")
            }),
            Err(error) => Err(ended(error)),
        }
    }
}

impl Drop for PythonTalk {
    fn drop(&mut self) {
        // It ends with its input, too; a simulator that hangs must not outlive this program.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
