//! Converts episodes of other formats into episode files, by the Python package in a Python of the
//! user's choice.

use std::ffi::OsStr;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::python::{PythonModule, new_scratch};
use actcheck_base::{Diagnostic, Diagnostics, ScratchFolder, open_regular};

/// The packages that a converter needs.
const NEEDS: &str = "h5py and the recording's MuJoCo";

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
    let module = PythonModule {
        python,
        name: "actcheck.episodes",
        needs: NEEDS,
        scratch,
    };
    let mut any = false;
    let end = module.run(arguments, |line: Line| {
        any = true;
        converted.add(line);
    })?;
    if !any || end.is_crash() {
        let what = if any {
            format!("some episodes of {shown} are missing")
        } else {
            format!("{shown} can't be converted")
        };
        converted.faults.push(module.crash(&end, &what));
    }
    Ok(())
}

impl Converted {
    /// Adds the episode, or the fault, of a line.
    fn add(&mut self, line: Line) {
        let named = match &line.episode {
            Some(key) if !key.is_empty() => format!("{}:{key}", line.file),
            _ => line.file.clone(),
        };
        if let Some(path) = line.written {
            self.episodes.push(ConvertedEpisode { path, named });
        } else if let Some(reason) = line.left_out {
            self.left_out.push(format!("{named} is left out: {reason}"));
        } else {
            let reason = line.reason.unwrap_or("it can't be converted".to_owned());
            let fault = Diagnostic::error("E009", format!("{named}: {reason}"));
            self.faults.push(fault);
        }
    }
}
