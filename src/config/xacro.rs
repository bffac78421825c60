//! Expands xacro to URDF with the external program `xacro`.
//!
//! A xacro file is a program: it may run for ever, and print without end. The program and
//! everything that it starts end after a minute, and when actcheck ends for any reason.

use std::ffi::OsString;
use std::io::Read;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use crate::skill::on_path;
use actcheck_base::{Below, ScratchFolder, ShellLine, Source};

/// The program, as installed by ROS or by `pip install xacro`.
const PROGRAM: &str = "xacro";
/// A Python module that answers `$(find PACKAGE)` from folders of packages, so that neither ROS nor
/// an installed package is needed. Packages that are not in these folders are left to the module of
/// ROS.
const FINDER: &str = include_str!("find_packages.py");
/// Environment variable with the folders of packages, separated by line breaks.
const FOLDERS_VARIABLE: &str = "ACTCHECK_PACKAGE_DIRS";
/// Time limit of an expansion; the largest robots take a few seconds.
const LIMIT: Duration = Duration::from_secs(60);
/// Longest expansion. Unit: bytes.
const LONGEST: u64 = 16 << 20;
/// Longest error output that is kept. Unit: bytes.
const LONGEST_ERROR: u64 = 64 << 10;

/// Runs a command that can write no file (its output is a pipe) in a process group that is killed
/// when the input ends: that is when actcheck closes it, or ends.
///
/// A write fails with an error, which the program can report: by default, its signal ends the
/// program without a word.
const GUARDED: &str = r#"trap '' XFSZ
ulimit -f 0 || exit 126
exec 3<&0
"$@" 3<&- </dev/null &
program=$!
{ read -r _ <&3; kill -s KILL -- "-$$"; } >/dev/null 2>&1 &
guard=$!
exec 3<&-
wait "$program"
code=$?
kill -s KILL "$guard"
exit "$code""#;

/// A failed expansion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unexpanded {
    /// The error, in lower case.
    pub(super) message: String,
    /// How to fix it.
    pub(super) help: String,
}

/// Whether a file is xacro, by its extension.
pub(super) fn is_xacro(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "xacro")
}

/// Returns why an argument is not given to xacro: all but `NAME:=VALUE` are options, which write
/// files, for example.
pub(super) fn refusal(argument: &str) -> Option<Unexpanded> {
    let name = argument.split_once(":=").map_or("", |(name, _)| name);
    let is_name = name.starts_with(|c: char| c.is_alphabetic() || c == '_')
        && name
            .chars()
            .all(|c| c.is_alphanumeric() || "_-./".contains(c));
    (!is_name || argument.contains('\0')).then(|| Unexpanded {
        message: format!("{argument:?} is not an argument of a xacro file"),
        help:
            "write NAME:=VALUE, such as `arm:=left`; options of the program xacro are not accepted"
                .to_owned(),
    })
}

/// The words of the command that expands a file.
pub(super) fn words(path: &Path, arguments: &[String]) -> Vec<OsString> {
    let words = [
        OsString::from(PROGRAM),
        not_an_option(path).into_os_string(),
    ];
    words
        .into_iter()
        .chain(arguments.iter().map(OsString::from))
        .collect()
}

/// A path that the program takes as a file: it begins with no dash, and has no `:=`, which would
/// make it an argument.
fn not_an_option(path: &Path) -> PathBuf {
    if path.to_string_lossy().starts_with('-') {
        Path::new(".").join(path)
    } else {
        path.to_owned()
    }
}

/// The parts of an expansion besides the file.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Inputs<'a> {
    /// Arguments as `NAME:=VALUE`.
    pub(super) arguments: &'a [String],
    /// Folders in which `$(find PACKAGE)` looks for packages, in order.
    pub(super) folders: &'a [PathBuf],
}

/// Expands a xacro file to URDF with the program `xacro`.
///
/// # Errors
/// The program can't be started, takes longer than a minute, prints more than 16 MiB, reports an
/// error in the file, or prints something other than UTF-8.
pub(super) fn expand(path: &Path, inputs: Inputs<'_>) -> Result<Source, Unexpanded> {
    let program = on_path(PROGRAM).ok_or_else(|| not_started(path, "it is not in `PATH`"))?;
    expand_with(&program, path, inputs, LIMIT)
}

fn expand_with(
    program: &PathBuf,
    path: &Path,
    inputs: Inputs<'_>,
    limit: Duration,
) -> Result<Source, Unexpanded> {
    let shown = path.display();
    let output =
        run(program, path, inputs, limit).map_err(|error| not_started(path, &error.to_string()))?;
    let refused = |message: String| Unexpanded {
        message,
        help: format!(
            "expand it elsewhere, and name the result: `{}`",
            to_copy(path)
        ),
    };
    let Some(output) = output else {
        return Err(refused(format!(
            "xacro did not expand {shown} within {} s",
            limit.as_secs_f64()
        )));
    };
    if output.text.len() as u64 > LONGEST {
        return Err(refused(format!(
            "the expansion of {shown} is longer than {} MiB",
            LONGEST >> 20
        )));
    }
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.error);
        let said: Vec<&str> = said
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty())
            .collect();
        return Err(Unexpanded {
            message: format!("xacro cannot expand {shown}: {}", plain(&said.join("; "))),
            help: format!(
                "run `{}` to see the error; name the folders of the packages that it refers to in \
                 `package_dirs` of the profile, and its arguments in `xacro_args`",
                words(path, inputs.arguments).iter().collect::<ShellLine>()
            ),
        });
    }
    let text = String::from_utf8(output.text).map_err(|_| Unexpanded {
        message: format!("the expansion of {shown} is not UTF-8 text"),
        help: "check the file's encoding".to_owned(),
    })?;
    Ok(Source::new(format!("{shown} (expanded)"), text))
}

fn not_started(path: &Path, why: &str) -> Unexpanded {
    let shown = path.display();
    Unexpanded {
        message: format!("cannot start the program `xacro` to expand {shown}: {why}"),
        help: format!(
            "install it (`pip install xacro`), or expand the file elsewhere: `{}`",
            to_copy(path)
        ),
    }
}

/// The command that expands a file by hand.
fn to_copy(path: &Path) -> ShellLine {
    words(path, &[])
        .iter()
        .collect::<ShellLine>()
        .fixed("> robot.urdf")
}

/// The output of a program.
struct Output {
    status: ExitStatus,
    text: Vec<u8>,
    error: Vec<u8>,
}

/// Runs a program with a file and further arguments. Returns `None` if it takes longer than
/// `limit`.
fn run(
    program: &PathBuf,
    path: &Path,
    inputs: Inputs<'_>,
    limit: Duration,
) -> std::io::Result<Option<Output>> {
    let finder = Finder::new()?;
    let mut command = Command::new("/bin/sh");
    command
        .args(["-c", GUARDED, "sh"])
        .arg(program)
        .args(&words(path, inputs.arguments)[1..]);
    let others = std::env::var_os("PYTHONPATH").filter(|paths| !paths.is_empty());
    let mut paths = finder.0.path().as_os_str().to_owned();
    if let Some(others) = others {
        paths.push(":");
        paths.push(others);
    }
    let folders: Vec<String> = inputs
        .folders
        .iter()
        .map(|folder| absolute(folder))
        .collect();
    command
        .env("PYTHONPATH", paths)
        .env(FOLDERS_VARIABLE, folders.join("\n"));
    // Compiled modules could not be written.
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    command
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn()?;
    let received = read_both(&mut child).recv_timeout(limit);
    let (text, error) = match received {
        // With output left to read, the program still runs.
        Ok((text, error)) if text.len() as u64 <= LONGEST => (text, error),
        Ok((text, error)) => {
            end(&mut child)?;
            return Ok(Some(Output {
                status: ExitStatus::default(),
                text,
                error,
            }));
        }
        Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
            end(&mut child)?;
            return Ok(None);
        }
    };
    // The shell waits for the program and its guard, which hold no pipe any more; the guard ends
    // with the input.
    let status = child.wait()?;
    Ok(Some(Output {
        status,
        text,
        error,
    }))
}

/// A temporary folder with the module [`FINDER`].
struct Finder(ScratchFolder);

impl Finder {
    fn new() -> std::io::Result<Self> {
        // No other user can write into it, so that no other user's module is run.
        let folder = ScratchFolder::create()?;
        let (below, module) = (
            Below::new(folder.path()),
            folder.path().join("ament_index_python"),
        );
        below.create_folder(&module)?;
        below.write_quickly(&module.join("__init__.py"), b"")?;
        below.write_quickly(&module.join("packages.py"), FINDER.as_bytes())?;
        Ok(Self(folder))
    }
}

/// Folders are given to a program of another language: as absolute paths.
fn absolute(folder: &Path) -> String {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    std::path::absolute(folder)
        .unwrap_or_else(|_| folder.to_owned())
        .display()
        .to_string()
}

/// Closes the input, so that the process group is killed, and waits for its end.
fn end(child: &mut Child) -> std::io::Result<()> {
    drop(child.stdin.take());
    child.wait().map(drop)
}

/// Reads both outputs of a process, each in its own thread, so that neither fills its pipe.
fn read_both(child: &mut Child) -> Receiver<(Vec<u8>, Vec<u8>)> {
    let (sender, receiver) = channel();
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    std::thread::spawn(move || {
        let error = std::thread::spawn(move || beginning(stderr, LONGEST_ERROR));
        let text = beginning(stdout, LONGEST + 1);
        // With too much output, the program may run on, and its error output may never end.
        let error = if text.len() as u64 > LONGEST {
            Vec::new()
        } else {
            error.join().unwrap_or_default()
        };
        // The receiver is gone if this took too long.
        let _ = sender.send((text, error));
    });
    receiver
}

/// Reads up to `most` bytes; of shorter limits than the output's length, the rest is dropped until
/// the pipe ends.
fn beginning(pipe: Option<impl Read>, most: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    let Some(mut pipe) = pipe else { return bytes };
    // An unreadable rest counts as the end.
    let _ = pipe.by_ref().take(most).read_to_end(&mut bytes);
    if most <= LONGEST {
        let _ = std::io::copy(&mut pipe, &mut std::io::sink());
    }
    bytes
}

/// Removes colours and other terminal codes.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text.chars();
    while let Some(char) = rest.next() {
        match char {
            '\u{1b}' => _ = rest.find(char::is_ascii_alphabetic),
            char if char.is_control() => plain.push(' '),
            char => plain.push(char),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::foreign::{self, Lookup};
    use crate::mutations::cases;
    use actcheck_base::{Diagnostics, Files};

    /// Writes an executable script by another process. A child that another test starts meanwhile
    /// would inherit an open file of ours, and a program that is open for writing can't be started
    /// ("Text file busy").
    fn write_program(path: &Path, script: &str) {
        let write = Command::new("sh")
            .args(["-c", "printf %s \"$2\" > \"$1\" && chmod 755 \"$1\"", "sh"])
            .arg(path)
            .arg(script)
            .status();
        assert!(write.expect("a shell").success());
    }

    /// Expands a file with a shell script in the place of xacro.
    fn expanded(script: &str, limit: Duration) -> Result<Source, Unexpanded> {
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("xacro");
        write_program(&program, &format!("#!/bin/sh\n{script}\n"));
        expand_with(
            &program,
            Path::new("r.urdf.xacro"),
            Inputs::default(),
            limit,
        )
    }

    #[test]
    fn output_and_exit_code_are_those_of_the_program() {
        let source = expanded("echo \"<robot/>\"; echo warning >&2", LIMIT).expect("it expands");
        assert_eq!(
            (&*source.text, &*source.name),
            ("<robot/>\n", "r.urdf.xacro (expanded)")
        );
        let fault = expanded("echo 'no such arm' >&2; exit 3", LIMIT).expect_err("it fails");
        assert_eq!(
            fault.message,
            "xacro cannot expand r.urdf.xacro: no such arm"
        );
    }

    /// The module that finds packages is where Python looks first, and is removed afterwards.
    #[test]
    fn folders_of_packages_and_arguments_reach_the_program() {
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("xacro");
        let script = "#!/bin/sh\nfound=${PYTHONPATH%%:*}\ncat \"$found/ament_index_python/packages.py\" > /dev/null || exit 1\n\
                      echo \"$found|$ACTCHECK_PACKAGE_DIRS|$2 $3\"\n";
        write_program(&program, script);
        let folders = [PathBuf::from("/a/packages"), PathBuf::from("/b")];
        let arguments = ["arm:=left".to_owned(), "hand:=none".to_owned()];
        let inputs = Inputs {
            arguments: &arguments,
            folders: &folders,
        };
        let source =
            expand_with(&program, Path::new("r.urdf.xacro"), inputs, LIMIT).expect("it expands");
        let (found, rest) = source.text.split_once('|').expect("three parts");
        assert_eq!(rest, "/a/packages\n/b|arm:=left hand:=none\n");
        assert!(!Path::new(found).exists(), "{found}");
    }

    /// The program prints mutated texts, and the expansion is read as a robot's URDF.
    #[test]
    fn mutated_expansions_are_read_or_refused() {
        const WORDS: [&str; 8] = [
            "<xacro:if value=\"${x}\">",
            "${",
            "$(find a)",
            "\u{1b}[31m",
            "<link name=\"l\"/>",
            "<!DOCTYPE a [",
            "&x;",
            "\u{80}",
        ];
        let folder = tempfile::tempdir().expect("a folder");
        let (program, printed) = (folder.path().join("xacro"), folder.path().join("printed"));
        write_program(
            &program,
            &format!(
                "#!/bin/sh\ncat '{}'\n[ ! -e \"$1\" ] || exit 1\n",
                printed.display()
            ),
        );
        let urdf =
            b"<robot name=\"r\"><link name=\"a\"><inertial><mass value=\"1\"/></inertial></link><link name=\"b\"/>\
            <joint name=\"j\" type=\"prismatic\"><parent link=\"a\"/><child link=\"b\"/><limit lower=\"0\" upper=\"1\" \
            effort=\"1\" velocity=\"1\"/></joint></robot>";
        cases("xacro", 20, |mut random| {
            fs::write(&printed, random.text(urdf, &WORDS, &[])).expect("a text");
            match expand_with(
                &program,
                Path::new("r.urdf.xacro"),
                Inputs::default(),
                LIMIT,
            ) {
                Ok(source) => {
                    let lookup = Lookup::new(&Files::Disk, Vec::new());
                    let mut found = Diagnostics::new();
                    foreign::robot::read(&source, Path::new("r.urdf.xacro"), &lookup, &mut found);
                    // Longer messages are cut.
                    assert!(
                        found
                            .iter()
                            .all(|fault| fault.message.chars().count() <= 20_001)
                    );
                }
                Err(fault) => assert!(!fault.message.is_empty()),
            }
        });
    }

    /// An endless loop in a xacro file went on for 33 minutes after actcheck was gone.
    #[test]
    fn an_expansion_without_end_is_ended_with_everything_it_started() {
        let folder = tempfile::tempdir().expect("a folder");
        let note = folder.path().join("pids");
        let script = format!(
            "mkdir '{0}' '{0}'/$$; sleep 1000 & mkdir '{0}'/$!; wait",
            note.display()
        );
        let fault = expanded(&script, Duration::from_millis(500)).expect_err("it takes too long");
        assert_eq!(
            fault.message,
            "xacro did not expand r.urdf.xacro within 0.5 s"
        );
        let names = fs::read_dir(&note)
            .expect("a folder")
            .flatten()
            .map(|entry| entry.file_name());
        let pids: Vec<String> = names
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        assert_eq!(pids.len(), 2, "both processes were started: {pids:?}");
        let state = |pid: &str| fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        let is_over = |pid: &str| state(pid).is_empty() || state(pid).contains(") Z ");
        // A signal that was sent may not have been delivered yet.
        let ends = |pid: &str| {
            (0..1_000).any(|_| {
                std::thread::sleep(Duration::from_millis(5));
                is_over(pid)
            })
        };
        assert!(pids.iter().all(|pid| ends(pid)), "still running: {pids:?}");
    }

    #[test]
    fn an_expansion_without_end_in_length_is_refused() {
        let fault = expanded(
            "while :; do echo '<robot name=\"a very long robot, again and again\"/>'; done",
            LIMIT,
        );
        assert_eq!(
            fault.expect_err("it is too long").message,
            "the expansion of r.urdf.xacro is longer than 16 MiB"
        );
        let fault = expanded(
            "while echo error >&2; do :; done",
            Duration::from_millis(300),
        )
        .expect_err("it never ends");
        assert!(fault.message.contains("within 0.3 s"), "{}", fault.message);
    }
}
