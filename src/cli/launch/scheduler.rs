//! The common side of all schedulers: commands, jobs, and their states.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::launch::args::On;
use crate::launch::plan::Plan;
use crate::launch::resources::Resources;
use actcheck_base::{Diagnostic, Diagnostics};

/// Maximum length of a scheduler's words in a message. Unit: characters.
const MOST_WORDS: usize = 2_000;

/// The state of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Look {
    /// It has tasks that run or wait.
    Active {
        running: u64,
        waiting: u64,
        /// The scheduler's reason for waiting.
        reason: Option<String>,
        /// A reason that needs a user.
        trouble: Option<String>,
    },
    /// It has ended, or is unknown.
    Ended,
    /// The scheduler doesn't answer: its words.
    Unanswered(String),
}

/// A scheduler that starts `actcheck launch-task` once for each shard.
pub(super) trait Scheduler {
    fn on(&self) -> On;
    /// The name in messages.
    fn title(&self) -> &'static str;
    /// The files of a job: names in the folder of the launch, and texts.
    fn files(&self, job: &Job<'_>) -> Vec<(&'static str, String)>;
    /// The command that submits the job.
    fn command(&self, job: &Job<'_>) -> Vec<String>;
    /// Submits the job, whose files are written. Returns the scheduler's id.
    fn submit(&mut self, job: &Job<'_>) -> Result<String, Diagnostics>;
    /// The id of a job whose submission was interrupted, if the scheduler has it.
    fn find(&mut self, name: &str) -> Result<Option<String>, Diagnostics>;
    /// Looks at a job.
    fn look(&mut self, id: &str) -> Result<Look, Diagnostics>;
    /// Whether its jobs outlive this process.
    fn outlives(&self) -> bool {
        true
    }
    /// The command that ends a job that outlives this process.
    fn cancel(&self, id: &str) -> Option<String>;
    /// Ends a job that does not outlive this process.
    fn end(&mut self) {}
}

/// A job to be submitted.
pub(super) struct Job<'a> {
    pub plan: &'a Plan,
    pub name: String,
    pub shards: BTreeSet<u64>,
    pub place: &'a Place,
}

/// Where and how the shards run.
pub(super) struct Place {
    /// The working folder of this process: paths in the plan are relative to it.
    pub folder: PathBuf,
    pub resources: Resources,
    /// Shards that run at once.
    pub parallel: Option<u64>,
    /// Starts of a shard in one job.
    pub tries: u32,
}

impl Place {
    /// Workers of a shard.
    pub fn cpus(&self) -> u64 {
        self.resources.cpus.unwrap_or(1)
    }

    /// A path as seen from any folder.
    pub fn absolute(&self, path: &Path) -> PathBuf {
        self.folder.join(path)
    }

    /// The path of actcheck on machines that see this one's files.
    ///
    /// # Errors
    /// `X052` it can't be found.
    pub fn program(&self) -> Result<String, Diagnostics> {
        if let Some(program) = &self.resources.program {
            return Ok(program.clone());
        }
        let own = std::env::current_exe().map(|program| program.display().to_string());
        own.map_err(|error| {
            Diagnostic::error(
                "X052",
                format!("the path of this program can't be found: {error}"),
            )
            .help("name it with `--resources program=/path/of/actcheck`")
            .into()
        })
    }
}

/// Runs a command of a scheduler. Ctrl-C at the terminal doesn't reach it: a submission must be
/// complete.
///
/// # Errors
/// `X077` it can't be started.
pub(super) fn ask(scheduler: &str, words: &[String]) -> Result<Output, Diagnostics> {
    let (program, arguments) = words
        .split_first()
        .map_or(("", words), |(program, rest)| (program.as_str(), rest));
    let output = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .process_group(0)
        .output();
    output.map_err(|error| unstarted(scheduler, program, &error).into())
}

/// X077: a command of a scheduler can't be started.
pub(super) fn unstarted(scheduler: &str, program: &str, error: &std::io::Error) -> Diagnostic {
    let message = match error.kind() {
        ErrorKind::NotFound => format!("`{program}` of {scheduler} was not found"),
        _ => format!("`{program}` of {scheduler} can't be started: {error}"),
    };
    Diagnostic::error("X077", message).help(format!(
        "give this command on a machine with {scheduler}'s programs, or add their folder to PATH"
    ))
}

/// X078: the scheduler refused a job.
pub(super) fn refused(scheduler: &str, words: &str, help: &str) -> Diagnostics {
    Diagnostic::error("X078", format!("{scheduler} refused the job: {words}"))
        .help(help.to_owned())
        .into()
}

/// The words that a command printed to its error stream, else to its output, in one line.
pub(super) fn words_of(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    let text = if errors.trim().is_empty() {
        String::from_utf8_lossy(&output.stdout)
    } else {
        errors
    };
    let words: Vec<&str> = text.split_whitespace().collect();
    let words: String = words.join(" ").chars().take(MOST_WORDS).collect();
    if words.is_empty() {
        format!("no message, {}", output.status)
    } else {
        words
    }
}
