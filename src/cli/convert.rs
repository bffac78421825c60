//! Converts episodes of other formats into episode files, by the Python package in a Python of the
//! user's choice.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;

use actcheck_base::{Diagnostic, Diagnostics, ScratchFolder, open_regular};

/// The Python package, whose module `actcheck.episodes` converts episodes.
#[derive(rust_embed::RustEmbed)]
#[folder = "shipped/python/"]
#[include = "*.py"]
struct PythonPackage;

/// Episode files, and the faults of files that could not be converted.
#[derive(Default)]
pub struct Converted {
    /// In the order of the files and of the episodes in them.
    pub episodes: Vec<ConvertedEpisode>,
    /// Faults of the others.
    pub faults: Diagnostics,
    /// Sentences about faulty episodes that could not be made, such as a dropped object that the
    /// scripted hand could not pick up.
    pub left_out: Vec<String>,
    /// Removed when it is dropped.
    _scratch: Option<ScratchFolder>,
}

/// An episode file.
pub struct ConvertedEpisode {
    /// Where it is.
    pub path: PathBuf,
    /// The file that was given, with the key of the episode in it.
    pub named: String,
}

/// A line of the converter.
#[derive(Debug, Deserialize)]
struct Line {
    file: String,
    #[serde(default)]
    episode: Option<String>,
    #[serde(default)]
    written: Option<PathBuf>,
    #[serde(default)]
    reason: Option<String>,
    #[serde(default)]
    left_out: Option<String>,
}

/// Whether a file's name has the ending of an episode.
pub fn is_episode_name(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    matches!(ending, Some("mcap" | "hdf5" | "h5" | "db3"))
}

/// Whether a folder is a LeRobot dataset or a bag, and not a folder of episodes.
pub fn is_dataset(path: &Path) -> bool {
    path.join("meta/info.json").is_file() || path.join("metadata.yaml").is_file()
}

/// Returns the episode files of some files. Files of `actcheck.record` are taken as they are; the
/// others are converted in a folder that is removed at the end.
///
/// # Errors
/// E008 if a file has to be converted and the converter can't be started.
pub fn episodes(
    files: &[PathBuf],
    python: &Path,
    quaternions: Option<&str>,
) -> Result<Converted, Diagnostics> {
    let mut converted = Converted::default();
    let others: Vec<&PathBuf> = files.iter().filter(|path| !is_ours(path)).collect();
    let scratch = if others.is_empty() {
        None
    } else {
        Some(new_scratch()?)
    };
    for (number, path) in files.iter().enumerate() {
        match &scratch {
            Some(scratch) if !is_ours(path) => {
                let into = scratch.path().join(format!("episodes-{number}"));
                convert(
                    path,
                    &into,
                    scratch.path(),
                    python,
                    quaternions,
                    &mut converted,
                )?;
            }
            _ => converted.episodes.push(ConvertedEpisode {
                path: path.clone(),
                named: path.display().to_string(),
            }),
        }
    }
    converted._scratch = scratch;
    Ok(converted)
}

/// Whether a file is an MCAP file with our profile, which needs no conversion. Files that are
/// damaged at their beginning are read, so that the fault is reported.
fn is_ours(path: &Path) -> bool {
    let mut start = [0u8; 64];
    let read = open_regular(path).and_then(|mut file| file.read(&mut start));
    let Ok(length) = read else {
        return path.is_file();
    };
    let start = &start[..length];
    let is_mcap = start.starts_with(b"\x89MCAP0\r\n");
    is_mcap && start.windows(8).any(|window| window == b"actcheck")
}

/// Writes the Python package into a folder.
fn unpack(folder: &Path) -> Result<(), Diagnostics> {
    for name in PythonPackage::iter() {
        let Some(file) = PythonPackage::get(&name) else {
            continue;
        };
        let target = folder.join("python").join(&*name);
        let written = target
            .parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&target, &file.data));
        if written.is_err() {
            return Err(
                Diagnostic::error("E008", format!("can't write {}", target.display()))
                    .help("free some space, or name another folder in TMPDIR")
                    .into(),
            );
        }
    }
    Ok(())
}

/// Makes and records the faulty episodes of a suite such as `libero_spatial` or `robosuite/Stack`.
///
/// # Errors
/// E008 if the Python can't be started.
pub fn faulty_episodes(suite: &str, python: &Path) -> Result<Converted, Diagnostics> {
    let scratch = new_scratch()?;
    let mut converted = Converted::default();
    let into = scratch.path().join("episodes");
    let arguments = [
        "audit".as_ref(),
        suite.as_ref(),
        "--to".as_ref(),
        into.as_os_str(),
    ];
    run(&arguments, suite, scratch.path(), python, &mut converted)?;
    converted._scratch = Some(scratch);
    Ok(converted)
}

/// Creates a temporary folder with the Python package.
pub(super) fn new_scratch() -> Result<ScratchFolder, Diagnostics> {
    let scratch = ScratchFolder::create().map_err(|error| {
        Diagnostic::error("E008", format!("can't create a temporary folder: {error}"))
            .help("name another folder in TMPDIR")
    })?;
    unpack(scratch.path())?;
    Ok(scratch)
}

/// Converts one file.
fn convert(
    path: &Path,
    into: &Path,
    scratch: &Path,
    python: &Path,
    quaternions: Option<&str>,
    converted: &mut Converted,
) -> Result<(), Diagnostics> {
    let mut arguments: Vec<&OsStr> = vec![
        "convert".as_ref(),
        path.as_os_str(),
        "--to".as_ref(),
        into.as_os_str(),
    ];
    if let Some(order) = quaternions {
        arguments.extend(["--quaternions".as_ref(), OsStr::new(order)]);
    }
    run(
        &arguments,
        &path.display().to_string(),
        scratch,
        python,
        converted,
    )
}

/// Runs the Python package's module `actcheck.episodes`, and takes the episodes that it names, one
/// in each line of its output.
fn run(
    arguments: &[&OsStr],
    shown: &str,
    scratch: &Path,
    python: &Path,
    converted: &mut Converted,
) -> Result<(), Diagnostics> {
    let mut command = Command::new(python);
    command
        .args(["-m", "actcheck.episodes"])
        .args(arguments)
        .env("PYTHONPATH", scratch.join("python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let not_started = |error: std::io::Error| {
        Diagnostic::error(
            "E008",
            format!("can't start `{}`: {error}", python.display()),
        )
        .help("name a Python with h5py and the recording's MuJoCo: `--python venv/bin/python`")
    };
    let mut child = command.spawn().map_err(not_started)?;
    let stderr = child.stderr.take();
    // Read beside the output, so that a converter with much to say can't block.
    let errors = std::thread::spawn(move || {
        let mut text = String::new();
        if let Some(stderr) = stderr {
            let _ = stderr.take(1 << 16).read_to_string(&mut text);
        }
        text
    });
    let mut any = false;
    if let Some(stdout) = child.stdout.take() {
        for line in BufReader::new(stdout).lines() {
            let Ok(line) = line else { break };
            let Ok(line) = serde_json::from_str::<Line>(&line) else {
                continue;
            };
            any = true;
            let named = match &line.episode {
                Some(key) if !key.is_empty() => format!("{}:{key}", line.file),
                _ => line.file.clone(),
            };
            if let Some(path) = line.written {
                converted.episodes.push(ConvertedEpisode { path, named });
            } else if let Some(reason) = line.left_out {
                let sentence = format!("{named} is left out: {reason}");
                converted.left_out.push(sentence);
            } else {
                let reason = line.reason.unwrap_or("it can't be converted".to_owned());
                let fault = Diagnostic::error("E009", format!("{named}: {reason}"));
                converted.faults.push(fault);
            }
        }
    }
    let status = child.wait().map_err(not_started)?;
    let errors = errors.join().unwrap_or_default();
    // The converter ends with 0, or with 1 if it printed a fault.
    let is_crashed = !matches!(status.code(), Some(0 | 1));
    if !any || is_crashed {
        let what = if any {
            format!("some episodes of {shown} are missing")
        } else {
            format!("{shown} can't be converted")
        };
        let last = errors.lines().last().unwrap_or("it printed nothing");
        converted.faults.push(
            Diagnostic::error("E009", format!("{what}: {last}")).help(format!(
                "the converter `{} -m actcheck.episodes` ended with {status}",
                python.display()
            )),
        );
    }
    Ok(())
}
