//! The skills that perform the actions: the reference skills or an external program
//! (`test_launcher`, `[skill]`).

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::ops::Bound;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use crate::paths::resolve_path;
use crate::{Located, Table};
use actcheck_base::{Diagnostic, Diagnostics, Digest, Files, ShellLine, Span};

/// The skills that perform the actions.
#[derive(Debug, Clone, PartialEq)]
pub enum Launcher {
    /// The built-in reference skills, in process.
    Reference,
    /// An external program for the actions that it supports; the reference skills for the others.
    Program(Box<Skill>),
}

/// A program that performs actions, located and ready to start.
#[derive(Debug, Clone, PartialEq)]
pub struct Skill {
    /// The command as the user wrote it, followed by the arguments of `[skill] args`.
    pub text: String,
    /// The executable.
    pub program: PathBuf,
    /// Its arguments.
    pub args: Vec<String>,
    /// The file that `test_launcher` begins with, relative to the current directory, and the words
    /// after it; `None` if it begins with an installed program.
    pub launched: Option<(PathBuf, Vec<String>)>,
    /// Digest of the command and of the files among its words.
    pub digest: String,
    /// Additional environment variables (`env`).
    pub env: BTreeMap<String, String>,
    /// Working directory (`dir`); the configuration's folder by default.
    pub dir: PathBuf,
    /// Whether the program receives the scene's ground truth (`privileged`).
    pub privileged: bool,
    /// Wall-clock time limit for its first message (`startup_s`). Unit: seconds.
    pub startup_secs: f64,
    /// Wall-clock time limit for each reply (`timeout_s`). Unit: seconds.
    pub timeout_secs: f64,
    /// Memory limit of each of its processes (`memory_mb`). Unit: MiB (2²⁰ bytes).
    pub memory_mb: Option<u64>,
    /// CPU time limit of each of its processes (`cpu_s`). Unit: seconds.
    pub cpu_secs: Option<u64>,
    /// The campaign stops after this many consecutive runs that the program broke (`max_broken`).
    pub max_broken: u64,
}

impl Skill {
    /// The words of its command.
    pub fn words(&self) -> Vec<OsString> {
        [self.program.clone().into()]
            .into_iter()
            .chain(self.args.iter().map(OsString::from))
            .collect()
    }

    /// Returns `true` if both start the same program: with the same arguments and environment, in
    /// the same folder.
    pub fn starts_as(&self, other: &Self) -> bool {
        let words = |skill: &Self| -> Vec<PathBuf> {
            let args = skill.args.iter().map(Path::new);
            args.map(|word| {
                if word.is_absolute() {
                    canonical(word)
                } else {
                    word.to_path_buf()
                }
            })
            .collect()
        };
        canonical(&self.program) == canonical(&other.program)
            && words(self) == words(other)
            && self.env == other.env
            && canonical(&self.dir) == canonical(&other.dir)
    }

    /// Returns the value of `test_launcher` for a configuration in another folder; `seen` converts
    /// the file's path. Returns `None` if the value does not depend on the folder.
    pub fn launcher(&self, seen: impl Fn(&Path) -> String) -> Option<String> {
        let (file, behind) = self.launched.as_ref()?;
        let file = seen(file);
        let words = [file.as_str()]
            .into_iter()
            .chain(behind.iter().map(String::as_str));
        shlex::try_join(words).ok()
    }
}

/// A path in its shortest absolute form, if it is one.
fn canonical(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

/// Largest accepted time limit: an hour. Unit: seconds.
const LONGEST_SECS: f64 = 3600.0;
/// Bounds of a time limit.
const A_WHILE: (Bound<f64>, Bound<f64>) = (Bound::Excluded(0.0), Bound::Included(LONGEST_SECS));

/// Commands that start ROS launch files, by the file's extension.
const ROS: [(&str, &[&str]); 2] = [
    (".launch.py", &["ros2", "launch"]),
    (".launch", &["roslaunch"]),
];

/// Reads `test_launcher` and `[skill]`. Paths are relative to `folder`, the configuration's.
///
/// Reports an invalid command (C030), a program that is missing (C031) or can't be started (C032),
/// a launch file without ROS (C033), a missing working directory (C034), and a `[skill]` without a
/// program (C035, a warning).
pub(super) fn read(table: &mut Table, folder: &Path, found: &mut Diagnostics) -> Launcher {
    let written = table
        .string("test_launcher")
        .filter(|written| written.value != "reference");
    let span = table.key_span("skill");
    let options = table.table("skill");
    let Some(written) = written else {
        if let (Some(options), Some(span)) = (options, span) {
            unused(options, folder, span, found);
        }
        return Launcher::Reference;
    };
    let mut skill = blank(folder);
    if let Some(mut options) = options {
        fill(&mut skill, &mut options, folder);
        options.finish(found);
    }
    match find(&written, folder) {
        Ok(Command {
            program,
            mut args,
            launched,
        }) => {
            skill.text = [&written.value]
                .into_iter()
                .chain(&skill.args)
                .cloned()
                .collect::<Vec<_>>()
                .join(" ");
            args.append(&mut skill.args);
            Launcher::Program(Box::new(Skill {
                digest: digest(&program, &args, &skill.dir),
                program,
                args,
                launched,
                ..skill
            }))
        }
        Err(Missing {
            code,
            message,
            help,
        }) => {
            table.fault(code, written.span, message, help);
            Launcher::Reference
        }
    }
}

/// Takes `test_launcher` and `[skill]` without reading them: other skills perform the actions.
pub(super) fn pass_over(table: &mut Table) {
    drop(table.string("test_launcher"));
    drop(table.table("skill"));
}

fn blank(folder: &Path) -> Skill {
    let dir = if folder.as_os_str().is_empty() {
        PathBuf::from(".")
    } else {
        folder.to_path_buf()
    };
    Skill {
        text: String::new(),
        program: PathBuf::new(),
        args: Vec::new(),
        launched: None,
        digest: String::new(),
        env: BTreeMap::new(),
        dir,
        privileged: false,
        // A Python program that imports machine-learning libraries takes about ten seconds on a
        // busy machine.
        startup_secs: 30.0,
        timeout_secs: 10.0,
        memory_mb: None,
        cpu_secs: None,
        max_broken: 5,
    }
}

/// Reports a `[skill]` table without a program, including the faults in it.
fn unused(mut options: Table, folder: &Path, span: Span, found: &mut Diagnostics) {
    let source = options.source().clone();
    fill(&mut blank(folder), &mut options, folder);
    options.finish(found);
    let message = "`[skill]` has no effect: the reference skills perform the actions";
    found.push(
        Diagnostic::warning("C035", message)
            .at(&source, span)
            .help("name a program in `test_launcher`, or remove `[skill]`"),
    );
}

fn fill(skill: &mut Skill, options: &mut Table, folder: &Path) {
    let args = options.strings("args").unwrap_or_default();
    skill.args = args
        .into_iter()
        .filter_map(|arg| whole(options, "args", arg))
        .collect();
    if let Some(mut env) = options.table("env") {
        let mut faults = Diagnostics::new();
        for name in env.keys() {
            let value = env
                .string(&name)
                .and_then(|value| whole(&mut env, "env", value));
            skill.env.extend(value.map(|value| (name, value)));
        }
        env.finish(&mut faults);
        options.note(faults);
    }
    if let Some(written) = options.string("dir") {
        skill.dir = resolve_path(folder, &written.value);
        if !skill.dir.is_dir() {
            let message = format!("there is no folder {}", skill.dir.display());
            options.fault(
                "C034",
                written.span,
                message,
                "`dir` is relative to the configuration",
            );
        }
    }
    set(&mut skill.privileged, options.boolean("privileged"));
    set(
        &mut skill.startup_secs,
        options.number("startup_s", A_WHILE),
    );
    set(
        &mut skill.timeout_secs,
        options.number("timeout_s", A_WHILE),
    );
    // Interpreters need at least 16 MB to start.
    skill.memory_mb = options
        .integer("memory_mb", 16..=1 << 30)
        .map(i64::unsigned_abs);
    skill.cpu_secs = options
        .integer("cpu_s", 1..=i64::from(u32::MAX))
        .map(i64::unsigned_abs);
    set(
        &mut skill.max_broken,
        options
            .integer("max_broken", 1..=i64::from(u32::MAX))
            .map(i64::unsigned_abs),
    );
}

/// Returns the text, or reports an error if it contains a NUL character, which would end the
/// argument.
fn whole(table: &mut Table, key: &str, text: Located<String>) -> Option<String> {
    if text.value.contains('\0') {
        table.fault(
            "C006",
            text.span,
            format!("`{key}` contains a NUL character"),
            "remove it",
        );
        return None;
    }
    Some(text.value)
}

fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

/// Why a command can't be started.
struct Missing {
    code: &'static str,
    message: String,
    help: String,
}

/// A resolved command.
struct Command {
    program: PathBuf,
    args: Vec<String>,
    /// The file that the command begins with, if any, and the words after it.
    launched: Option<(PathBuf, Vec<String>)>,
}

/// Resolves a command to an executable and its arguments.
fn find(written: &Located<String>, folder: &Path) -> Result<Command, Missing> {
    let text = written.value.as_str();
    // A path may contain spaces.
    let words = if resolve_path(folder, text).is_file() {
        Some(vec![text.to_owned()])
    } else {
        shlex::split(text)
    };
    let split = words
        .filter(|words| !text.contains('\0') && !words.is_empty())
        .ok_or_else(|| Missing {
            code: "C030",
            message: format!(
                "`{text}` is not a command: it is empty or a quotation mark is not closed"
            ),
            help: "write it as in a shell, such as `python3 my_pick.py --speed 0.5`".to_owned(),
        })?;
    let mut words = split.into_iter();
    let (name, args) = (words.next().unwrap_or_default(), words.collect::<Vec<_>>());
    let path = resolve_path(folder, &name);
    if name.contains('/') || path.is_file() || name.ends_with(".py") || name.ends_with(".launch") {
        return find_file(&name, path, args);
    }
    let program = on_path(&name).ok_or_else(|| Missing {
        code: "C031",
        message: format!(
            "there is no program `{name}`, neither next to the configuration nor in `PATH`"
        ),
        help: "name a file relative to the configuration, an installed program, or `reference`"
            .to_owned(),
    })?;
    Ok(Command {
        program,
        args,
        launched: None,
    })
}

/// Resolves a command that begins with a file: `name` as written, `path` relative to the current
/// directory.
fn find_file(name: &str, path: PathBuf, args: Vec<String>) -> Result<Command, Missing> {
    if !path.is_file() {
        let fault = if path.is_dir() {
            "is a folder"
        } else {
            "does not exist"
        };
        return Err(Missing {
            code: "C031",
            message: format!("{} {fault}", path.display()),
            help: "the path of `test_launcher` is relative to the configuration".to_owned(),
        });
    }
    let launched = Some((path.clone(), args.clone()));
    let (program, args) = match (
        ROS.iter().find(|(ending, _)| name.ends_with(ending)),
        name.ends_with(".py"),
    ) {
        (Some((_, starter)), _) => through(starter, &path, args, Starter::Ros)?,
        (None, true) => through(&["python3"], &path, args, Starter::Python)?,
        (None, false) if is_executable(&path) => (std::path::absolute(&path).unwrap_or(path), args),
        (None, false) => {
            return Err(Missing {
                code: "C032",
                message: format!("{} is not executable", path.display()),
                help: format!(
                    "run `{}`, or name the program that runs it before it in `test_launcher`",
                    ShellLine::default().fixed("chmod +x").file(name),
                ),
            });
        }
    };
    Ok(Command {
        program,
        args,
        launched,
    })
}

/// The kind of a program that runs files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Starter {
    Ros,
    Python,
}

impl Starter {
    /// The code of the fault that it is not installed.
    fn code(self) -> &'static str {
        match self {
            Self::Ros => "C033",
            Self::Python => "C032",
        }
    }

    fn help(self) -> &'static str {
        match self {
            Self::Ros => {
                "install ROS and source its `setup.bash` first, or name the program that the file launches"
            }
            Self::Python => {
                "install it, or name a program that runs the file: `test_launcher = \"/path/to/python my_pick.py\"`"
            }
        }
    }
}

/// Resolves a file that `starter` runs.
fn through(
    starter: &[&str],
    path: &Path,
    args: Vec<String>,
    kind: Starter,
) -> Result<(PathBuf, Vec<String>), Missing> {
    let (program, before) = starter.split_first().unwrap_or((&"sh", &[]));
    let found = on_path(program).ok_or_else(|| Missing {
        code: kind.code(),
        message: format!(
            "{} needs `{program}`, which is not in `PATH`",
            path.display()
        ),
        help: kind.help().to_owned(),
    })?;
    let mut all: Vec<String> = before.iter().map(|word| (*word).to_owned()).collect();
    // The program may have another working directory.
    all.push(
        std::path::absolute(path)
            .unwrap_or_else(|_| path.to_path_buf())
            .display()
            .to_string(),
    );
    all.extend(args);
    Ok((found, all))
}

/// Finds a program in `PATH`. Like the disk, `PATH` is part of the machine that the configuration
/// refers to.
pub(super) fn on_path(name: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .map(|folder| folder.join(name))
        .find(|path| is_executable(path))
}

fn is_executable(path: &Path) -> bool {
    std::fs::metadata(path)
        .is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

/// Digest of a command: its words without their folders, and the contents of those that are files.
/// Only the name of an installed program, such as an interpreter, is included, so that the digest
/// is the same on all machines.
fn digest(program: &Path, args: &[String], dir: &Path) -> String {
    let mut digest = Digest::new();
    let installed = program
        .file_name()
        .and_then(OsStr::to_str)
        .and_then(on_path)
        .is_some_and(|found| found == program);
    digest.update(last(program).as_bytes());
    digest.update(&if installed {
        Vec::new()
    } else {
        bytes(program)
    });
    for word in args.iter().map(Path::new) {
        digest.update(last(word).as_bytes());
        digest.update(&bytes(&dir.join(word)));
    }
    digest.finish()
}

fn last(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
}

/// Returns the contents of a file, or nothing if it can't be read.
fn bytes(path: &Path) -> Vec<u8> {
    Files::Disk.read_bytes(path).unwrap_or_default()
}
