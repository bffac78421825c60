//! What performs the actions: our own skills, or a program that is looked for here (`test_launcher`, `[skill]`).

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::ops::Bound;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use crate::base::{Diagnostic, Diagnostics, Digest, Span};
use crate::config::load::beside;
use crate::config::{Launcher, Located, Table};

/// A program that performs actions, found and ready to be started.
#[derive(Debug, Clone, PartialEq)]
pub struct Skill {
    /// The command as the user wrote it, with the arguments of `[skill] args` behind it.
    pub text: String,
    /// The file that is started.
    pub program: PathBuf,
    /// Its arguments.
    pub args: Vec<String>,
    /// The file that `test_launcher` begins with, seen from where this program runs, and the words behind it; nothing where it
    /// begins with an installed program.
    pub launched: Option<(PathBuf, Vec<String>)>,
    /// Digest of the launched file, and of every argument that is a file.
    pub digest: String,
    /// Further variables of its environment (`env`).
    pub env: BTreeMap<String, String>,
    /// Its working folder (`dir`); without one, the configuration's.
    pub dir: PathBuf,
    /// Whether it is told the truth about the scene (`privileged`).
    pub privileged: bool,
    /// Time on the clock until it has introduced itself (`startup_s`). Unit: seconds.
    pub startup_secs: f64,
    /// Time on the clock for each of its answers (`timeout_s`). Unit: seconds.
    pub timeout_secs: f64,
    /// Most memory of each of its processes (`memory_mb`). Unit: megabytes of 2²⁰ bytes.
    pub memory_mb: Option<u64>,
    /// Most computing time of each of its processes (`cpu_s`). Unit: seconds.
    pub cpu_secs: Option<u64>,
    /// So many runs in a row that the program broke stop the campaign (`max_broken`).
    pub max_broken: u64,
}

impl Skill {
    /// What `test_launcher` is in a configuration that lies elsewhere; nothing where it is the same everywhere.
    pub fn launcher(&self, seen: impl Fn(&Path) -> String) -> Option<String> {
        let (file, behind) = self.launched.as_ref()?;
        let file = seen(file);
        let words = [file.as_str()].into_iter().chain(behind.iter().map(String::as_str));
        shlex::try_join(words).ok()
    }
}

/// An hour is more than any answer takes.
const LONGEST_SECS: f64 = 3600.0;
/// Above zero, and no more than that.
const A_WHILE: (Bound<f64>, Bound<f64>) = (Bound::Excluded(0.0), Bound::Included(LONGEST_SECS));

/// What starts a launch file of ROS, by the file's ending.
const ROS: [(&str, &[&str]); 2] = [(".launch.py", &["ros2", "launch"]), (".launch", &["roslaunch"])];

/// Reads `test_launcher` and `[skill]`. Paths are relative to `folder`, the configuration's.
///
/// Notes a command that is none (C030), a program that is not there (C031) or can't be started (C032), a launch file without ROS
/// (C033), a working folder that is none (C034), and a `[skill]` for which there is no program (C035, a warning).
pub(super) fn read(table: &mut Table, folder: &Path, found: &mut Diagnostics) -> Launcher {
    let written = table.string("test_launcher").filter(|written| written.value != "reference");
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
        Ok(Command { program, mut args, launched }) => {
            skill.text = [&written.value].into_iter().chain(&skill.args).cloned().collect::<Vec<_>>().join(" ");
            args.append(&mut skill.args);
            Launcher::Program(Box::new(Skill {
                digest: digest(&program, &args, &skill.dir),
                program,
                args,
                launched,
                ..skill
            }))
        }
        Err(Missing { code, message, help }) => {
            table.fault(code, written.span, message, help);
            Launcher::Reference
        }
    }
}

fn blank(folder: &Path) -> Skill {
    let dir = if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_path_buf() };
    Skill {
        text: String::new(),
        program: PathBuf::new(),
        args: Vec::new(),
        launched: None,
        digest: String::new(),
        env: BTreeMap::new(),
        dir,
        privileged: false,
        // A Python that imports the libraries of learning takes some ten seconds on a busy machine.
        startup_secs: 30.0,
        timeout_secs: 10.0,
        memory_mb: None,
        cpu_secs: None,
        max_broken: 5,
    }
}

/// `[skill]` beside our own skills: its mistakes are told all the same.
fn unused(mut options: Table, folder: &Path, span: Span, found: &mut Diagnostics) {
    let source = options.source().clone();
    fill(&mut blank(folder), &mut options, folder);
    options.finish(found);
    let message = "`[skill]` has no effect: the reference skills perform the actions";
    found.push(
        Diagnostic::warning("C035", message)
            .at(&source, span)
            .help("name a program in `test_launcher`, or leave it out"),
    );
}

fn fill(skill: &mut Skill, options: &mut Table, folder: &Path) {
    let args = options.strings("args").unwrap_or_default();
    skill.args = args.into_iter().filter_map(|arg| whole(options, "args", arg)).collect();
    if let Some(mut env) = options.table("env") {
        let mut faults = Diagnostics::new();
        for name in env.keys() {
            let value = env.string(&name).and_then(|value| whole(&mut env, "env", value));
            skill.env.extend(value.map(|value| (name, value)));
        }
        env.finish(&mut faults);
        options.note(faults);
    }
    if let Some(written) = options.string("dir") {
        skill.dir = beside(folder, &written.value);
        if !skill.dir.is_dir() {
            let message = format!("there is no folder {}", skill.dir.display());
            options.fault(
                "C034",
                written.span,
                message,
                "the program's working folder is relative to the configuration",
            );
        }
    }
    set(&mut skill.privileged, options.boolean("privileged"));
    set(&mut skill.startup_secs, options.number("startup_s", A_WHILE));
    set(&mut skill.timeout_secs, options.number("timeout_s", A_WHILE));
    // Under 16 MB no interpreter starts.
    skill.memory_mb = options.integer("memory_mb", 16..=1 << 30).map(i64::unsigned_abs);
    skill.cpu_secs = options.integer("cpu_s", 1..=i64::from(u32::MAX)).map(i64::unsigned_abs);
    set(&mut skill.max_broken, options.integer("max_broken", 1..=i64::from(u32::MAX)).map(i64::unsigned_abs));
}

/// A text that the system takes as an argument: it ends at a zero.
fn whole(table: &mut Table, key: &str, text: Located<String>) -> Option<String> {
    if text.value.contains('\0') {
        table.fault("C006", text.span, format!("a zero character stands in `{key}`"), "leave it out");
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

/// What a command starts.
struct Command {
    program: PathBuf,
    args: Vec<String>,
    /// The file that the command begins with, if it does, and the words behind it.
    launched: Option<(PathBuf, Vec<String>)>,
}

/// The file that a command starts, and its arguments.
fn find(written: &Located<String>, folder: &Path) -> Result<Command, Missing> {
    let text = written.value.as_str();
    // A path may have spaces in it.
    let words = if beside(folder, text).is_file() { Some(vec![text.to_owned()]) } else { shlex::split(text) };
    let split = words.filter(|words| !text.contains('\0') && !words.is_empty()).ok_or_else(|| Missing {
        code: "C030",
        message: format!("`{text}` is no command: a quotation mark is left open, or nothing is in it"),
        help: "write it as in a shell, such as `python3 my_pick.py --speed 0.5`".to_owned(),
    })?;
    let mut words = split.into_iter();
    let (name, args) = (words.next().unwrap_or_default(), words.collect::<Vec<_>>());
    let path = beside(folder, &name);
    if name.contains('/') || path.is_file() || name.ends_with(".py") || name.ends_with(".launch") {
        return find_file(&name, path, args);
    }
    let program = on_path(&name).ok_or_else(|| Missing {
        code: "C031",
        message: format!("there is no program `{name}`, neither beside the configuration nor on the search path"),
        help: "name a file relative to the configuration, or an installed program; `reference` means our own skills"
            .to_owned(),
    })?;
    Ok(Command { program, args, launched: None })
}

/// The same where a command begins with a file: `name` is how it is written, `path` where it is.
fn find_file(name: &str, path: PathBuf, args: Vec<String>) -> Result<Command, Missing> {
    if !path.is_file() {
        return Err(Missing {
            code: "C031",
            message: format!("there is no file {}", path.display()),
            help: "the path of `test_launcher` is relative to the configuration".to_owned(),
        });
    }
    let launched = Some((path.clone(), args.clone()));
    let (program, args) = match (ROS.iter().find(|(ending, _)| name.ends_with(ending)), name.ends_with(".py")) {
        (Some((_, starter)), _) => through(starter, &path, args, "C033")?,
        (None, true) => through(&["python3"], &path, args, "C032")?,
        (None, false) if is_executable(&path) => (std::path::absolute(&path).unwrap_or(path), args),
        (None, false) => {
            return Err(Missing {
                code: "C032",
                message: format!("{} is not executable", path.display()),
                help: format!("run `chmod +x {name}`, or name what runs it: `test_launcher = \"sh {name}\"`"),
            });
        }
    };
    Ok(Command { program, args, launched })
}

/// A file that something else runs.
fn through(
    starter: &[&str],
    path: &Path,
    args: Vec<String>,
    code: &'static str,
) -> Result<(PathBuf, Vec<String>), Missing> {
    let (program, before) = starter.split_first().unwrap_or((&"sh", &[]));
    let found = on_path(program).ok_or_else(|| Missing {
        code,
        message: format!("{} needs `{program}`, which is not on the search path", path.display()),
        help: match code {
            "C033" => "install ROS and source its `setup.bash` first, or name the program that the file launches",
            _ => "install it, or name what shall run the file: `test_launcher = \"/path/to/python my_pick.py\"`",
        }
        .to_owned(),
    })?;
    let mut all: Vec<String> = before.iter().map(|word| (*word).to_owned()).collect();
    // The program's working folder may be another one.
    all.push(std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).display().to_string());
    all.extend(args);
    Ok((found, all))
}

/// A program of the search path, which like the disk is part of the machine that the configuration speaks of.
fn on_path(name: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|path| is_executable(path))
}

fn is_executable(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

/// Digest of a command: its words without their folders, and the bytes of those that are files. Of an installed program, such as
/// an interpreter, the name counts alone, so that machines agree.
fn digest(program: &Path, args: &[String], dir: &Path) -> String {
    let mut digest = Digest::new();
    let installed = program.file_name().and_then(OsStr::to_str).and_then(on_path).is_some_and(|found| found == program);
    digest.update(last(program).as_bytes());
    digest.update(&if installed { Vec::new() } else { bytes(program) });
    for word in args.iter().map(Path::new) {
        digest.update(last(word).as_bytes());
        digest.update(&bytes(&dir.join(word)));
    }
    digest.finish()
}

fn last(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy()
}

/// Of a file, if it is one.
fn bytes(path: &Path) -> Vec<u8> {
    let file = path.is_file().then(|| std::fs::read(path).ok());
    file.flatten().unwrap_or_default()
}
