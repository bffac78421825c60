//! Scenes that are run with each version.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::judge::{Judged, Unjudged, explain};
use super::repository::{Repository, last_line};
use super::stored::lacks;
use super::versions::{Version, Versions};
use super::{BisectArgs, child};
use crate::compare;
use actcheck_analysis::Compared;
use actcheck_base::{Below, Diagnostic, Diagnostics, read_regular};
use actcheck_config as config;
use actcheck_config::Overrides;
use actcheck_history::{History, RunFilter};
use actcheck_ontology as ontology;
use actcheck_rules::RuleBook;

/// Longest configuration. Unit: bytes.
const LONGEST_CONFIG: u64 = 64 << 20;

/// A configuration or a case, and the way to run it.
pub struct Scenes<'a> {
    args: &'a BisectArgs,
    repository: Option<&'a Repository>,
    scratch: &'a Path,
    /// As the user named it.
    config: &'a Path,
    is_case: bool,
    stop: &'a Arc<AtomicBool>,
}

impl<'a> Scenes<'a> {
    /// Reads the configuration, to see whether it is a case.
    pub fn prepare(
        args: &'a BisectArgs,
        config: &'a Path,
        versions: &'a Versions,
        scratch: &'a Path,
        stop: &'a Arc<AtomicBool>,
    ) -> Result<Self, Diagnostics> {
        let is_case = config::load(config, &Overrides::default())?.case.is_some();
        Ok(Self {
            args,
            repository: versions.repository(),
            scratch,
            config,
            is_case,
            stop,
        })
    }

    /// Whether there is a single scene.
    pub fn is_case(&self) -> bool {
        self.is_case
    }

    /// Builds a version, runs scenes with it, and reads their outcomes.
    pub fn judge(&self, version: &Version, scenes: u64) -> Result<Judged, Unjudged> {
        let (folder, config) = self.folder(version)?;
        self.build(&folder)?;
        let dir = self.history(version);
        if dir.exists() {
            std::fs::remove_dir_all(&dir).map_err(|error| unwritable(&dir, &error))?;
        }
        let mut command = Command::new(self.program(version, &folder)?);
        command
            .arg("run")
            .arg(&config)
            .arg("--history")
            .arg(&dir)
            .current_dir(&folder);
        match (self.is_case, self.args.trust) {
            (true, true) => command.arg("--trust"),
            (true, false) => &mut command,
            (false, _) => command.args(["--runs", &scenes.to_string()]),
        };
        if let Some(jobs) = self.args.jobs {
            command.args(["--jobs", &jobs.to_string()]);
        }
        // 1 is an answer: a property failed.
        self.start(&mut command, "it can't run the scenes", 1)?;
        self.read(&dir)
    }

    /// The folder of a version and the configuration in it.
    fn folder(&self, version: &Version) -> Result<(PathBuf, PathBuf), Unjudged> {
        let Some(repository) = self.repository else {
            return Ok((PathBuf::from("."), self.config.to_owned()));
        };
        let folder = repository.extract(version)?;
        let Some(inside) = repository.inside(self.config) else {
            return Ok((folder, self.config.to_owned()));
        };
        let config = config::resolve_path(&folder, &inside.to_string_lossy());
        // A case is the same at each version. So is a configuration that the version does not have.
        if self.is_case || !config.is_file() {
            let parent = config.parent().filter(|parent| parent.is_dir());
            let parent = parent.ok_or_else(|| Unjudged::Skipped(lacks(&inside).into()))?;
            // A link in the version would lead to the user's files.
            let copied = read_regular(self.config, LONGEST_CONFIG)
                .and_then(|text| Below::new(self.scratch).write_quickly(&config, &text));
            copied.map_err(|error| unwritable(parent, &error))?;
        }
        Ok((folder, config))
    }

    fn build(&self, folder: &Path) -> Result<(), Unjudged> {
        let Some(build) = &self.args.build else {
            return Ok(());
        };
        self.start(
            Command::new("sh").args(["-c", build]).current_dir(folder),
            "it can't be built",
            0,
        )
    }

    fn program(&self, version: &Version, folder: &Path) -> Result<PathBuf, Unjudged> {
        if self.repository.is_none() {
            return Ok(PathBuf::from(&version.name));
        }
        match &self.args.program {
            Some(program) if program.components().count() > 1 => Ok(folder.join(program)),
            Some(program) => Ok(program.clone()),
            None => std::env::current_exe().map_err(|error| {
                Unjudged::Stopped(
                    Diagnostic::error("X052", format!("this program has no path: {error}")).into(),
                )
            }),
        }
    }

    /// Runs a program of a version. A higher exit code than `highest` skips the version, with the
    /// program's message.
    fn start(&self, command: &mut Command, what: &str, highest: i32) -> Result<(), Unjudged> {
        let errors = self.scratch.join("errors");
        let skipped = |reason: String| {
            Unjudged::Skipped(Diagnostic::error("X065", format!("{what}: {reason}")).into())
        };
        match child::run(command, &errors, self.stop) {
            Ok(Some(status)) if status.code().is_some_and(|code| code <= highest) => Ok(()),
            Ok(Some(status)) => {
                let printed = std::fs::read(&errors).unwrap_or_default();
                Err(skipped(format!(
                    "{status}, {}",
                    self.shown(&message(&printed))
                )))
            }
            Ok(None) => Err(Unjudged::Stopped(
                Diagnostic::error("X030", "interrupted").into(),
            )),
            Err(error) => Err(skipped(format!(
                "{} can't be started: {error}",
                command.get_program().display()
            ))),
        }
    }

    fn shown(&self, text: &str) -> String {
        self.repository.map_or_else(
            || text.to_owned(),
            |repository| repository.without_folder(text),
        )
    }

    /// The outcomes of a history with one campaign. Its regressions are left out.
    fn read(&self, dir: &Path) -> Result<Judged, Unjudged> {
        let read = || {
            let history = History::open_to_read(dir)?;
            let newest = history.campaigns()?.pop().map(|campaign| campaign.id);
            let campaign = if self.is_case {
                newest
            } else {
                Some(compare::newest(&history)?)
            };
            let filter = RunFilter {
                campaign,
                ..RunFilter::default()
            };
            let rows = history.runs(&filter)?;
            Ok(Judged {
                scenes: history.scenes(&rows)?,
                outcomes: history.outcomes(&filter)?,
                rows,
            })
        };
        read().map_err(Unjudged::Skipped)
    }

    /// Explains an outcome by the rules of the version.
    pub fn explain(
        &self,
        version: &Version,
        run: &str,
        of: &Compared,
    ) -> Result<String, Diagnostics> {
        let (_, config) = self.folder(version).map_err(Unjudged::into_faults)?;
        let (files, path) = config::load(&config, &Overrides::default())?.ontology;
        let rules = RuleBook::prepare(&ontology::load(&files, &path)?)?;
        let history = History::open_to_read(&self.history(version))?;
        Ok(self.shown(&explain(&rules, &history, run, of)?))
    }

    fn history(&self, version: &Version) -> PathBuf {
        self.scratch.join(format!("history-{}", version.id))
    }
}

/// The message of a program: actcheck's own first one, or the last line.
fn message(printed: &[u8]) -> String {
    let text = String::from_utf8_lossy(printed);
    let own = text
        .lines()
        .find_map(|line| line.trim_start().strip_prefix("× "));
    own.map_or_else(|| last_line(printed), str::to_owned)
}

fn unwritable(path: &Path, error: &std::io::Error) -> Unjudged {
    Unjudged::Stopped(
        Diagnostic::error(
            "X066",
            format!("{} can't be written: {error}", path.display()),
        )
        .into(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_of_a_program_is_its_first_error_or_last_line() {
        assert_eq!(
            message("C003\n\n  × the value is wrong\n  help: x\n".as_bytes()),
            "the value is wrong"
        );
        assert_eq!(
            message(b"make: begin\nmake: *** no rule\n\n"),
            "make: *** no rule"
        );
        assert_eq!(message(b""), "no message");
    }
}
