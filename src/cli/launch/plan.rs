//! The plan of a launch: one file in its folder, from which every task and the same command, given
//! again, go on.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::clock;
use crate::launch::{LaunchArgs, kubernetes, ray, slurm};
use crate::run_args::RunArgs;
use actcheck_base::{
    Below, Diagnostic, Diagnostics, FileKind, Shard, ShellLine, digest_of, program_digest,
};
use actcheck_campaign::Env;
use actcheck_history::History;

/// Names of the files that schedulers write into the folder.
const SCHEDULER_FILES: [&str; 4] = [
    slurm::SCRIPT,
    kubernetes::MANIFEST,
    ray::SETTINGS,
    ray::SCRIPT.0,
];
/// Interval between attempts to take a shard.
const INTERVAL: Duration = Duration::from_millis(250);

/// A launch and its folder.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    /// Its folder, beside the history: `HISTORY.launch`.
    pub folder: PathBuf,
    /// A name that no other launch has: eight hexadecimal digits.
    pub id: String,
    /// Digest of the program that planned it, which its tasks must have too.
    pub program: String,
    /// The configuration, as the user named it.
    pub config: PathBuf,
    /// Digest of the configuration's text.
    digest: String,
    /// `--runs` and `--seed`.
    pub runs: Option<u32>,
    pub seed: Option<u64>,
    pub shards: u64,
    /// Workers of each shard.
    pub jobs: u64,
    /// Number of runs of all shards.
    pub planned: u64,
}

/// Checks that a campaign can be split.
///
/// # Errors
/// `X072` it is a case, has a budget that only a whole campaign can keep, or has fewer runs than
/// shards.
pub(super) fn check(env: &Env, shards: u64) -> Result<(), Diagnostics> {
    let limits = &env.campaign.limits;
    let planned = env.planned_runs();
    let (message, help) = if env.campaign.case.is_some() {
        (
            "a case has one scene, and no shards".to_owned(),
            "`actcheck run` runs it",
        )
    } else if limits.time_secs.is_some()
        || limits.until_width.is_some()
        || limits.max_failures.is_some()
    {
        let message = "the campaign has a budget, which shards can't keep together".to_owned();
        (
            message,
            "remove it from the configuration, and choose the number of runs with `--runs`",
        )
    } else if planned < shards {
        (
            format!("{shards} shards are more than the {planned} runs"),
            "name a smaller number with `--shards`",
        )
    } else {
        return Ok(());
    };
    Err(Diagnostic::error("X072", message).help(help).into())
}

impl Plan {
    /// The plan of a command.
    pub fn new(args: &LaunchArgs, env: &Env, jobs: u64) -> Self {
        let folder = with_ending(&env.campaign.history, ".launch");
        let unique = format!(
            "{} {} {}",
            folder.display(),
            (clock::system().now)(),
            std::process::id()
        );
        Self {
            folder,
            id: digest_of(&unique).chars().take(8).collect(),
            program: program_digest().to_owned(),
            config: args.config.clone(),
            digest: digest_of(&env.campaign.source.text),
            runs: args.runs,
            seed: args.seed,
            shards: args.shards,
            jobs,
            planned: env.planned_runs(),
        }
    }

    /// Reads the plan in a folder.
    ///
    /// # Errors
    /// `X073` the folder has no plan that this program can read.
    pub fn read(folder: &Path) -> Result<Self, Diagnostics> {
        let value: Option<Value> =
            read_below(folder, "plan.json").and_then(|text| serde_json::from_slice(&text).ok());
        value
            .and_then(|value| Self::of_json(folder, &value))
            .ok_or_else(|| {
                let message = format!("`{}` has no plan of a launch", folder.display());
                Diagnostic::error("X073", message)
                    .help("`actcheck launch CONFIG --shards N` makes one")
                    .into()
            })
    }

    fn of_json(folder: &Path, value: &Value) -> Option<Self> {
        Some(Self {
            folder: folder.to_path_buf(),
            id: value["id"].as_str()?.to_owned(),
            program: value["program"].as_str()?.to_owned(),
            config: value["config"].as_str()?.into(),
            digest: value["config_digest"].as_str()?.to_owned(),
            runs: value["runs"].as_u64().and_then(|runs| runs.try_into().ok()),
            seed: value["seed"].as_u64(),
            shards: value["shards"].as_u64()?,
            jobs: value["jobs"].as_u64()?,
            planned: value["planned"].as_u64()?,
        })
    }

    fn json(&self) -> Value {
        json!({
            "id": self.id,
            "program": self.program,
            "config": self.config.display().to_string(),
            "config_digest": self.digest,
            "runs": self.runs,
            "seed": self.seed,
            "shards": self.shards,
            "jobs": self.jobs,
            "planned": self.planned,
        })
    }

    /// Writes the plan into its folder, or finds it there. The launch has the folder alone while it
    /// keeps the returned file.
    ///
    /// # Errors
    /// `X073` the folder belongs to another launch, `X074` it can't be written.
    pub fn enter(&mut self) -> Result<File, Diagnostics> {
        let file = self.folder.join("plan.json");
        self.find()?;
        // A launch that was killed while it removed its folder.
        let _ = self.remove_ours(&with_ending(&self.folder, ".merged"));
        // Shards are tried again, with whatever their users repaired.
        let below = self.below();
        below
            .files(&self.folder.join("faults"))
            .iter()
            .filter(|file| number_of(file).is_some())
            .for_each(|file| {
                let _ = below.remove(file);
            });
        let folders =
            ["shards", "done", "faults", "locks", "logs"].map(|name| self.folder.join(name));
        folders
            .iter()
            .try_for_each(|name| below.create_folder(name))
            .map_err(|error| self.unwritable(&error))?;
        let alone = self.alone()?;
        if !file.exists() {
            let written = below.write_atomic(&file, format!("{:#}\n", self.json()).as_bytes());
            written.map_err(|error| self.unwritable(&error))?;
        }
        Ok(alone)
    }

    /// Takes the identity of the unfinished launch in the folder, if there is one.
    ///
    /// # Errors
    /// `X073` that launch has other shards.
    pub fn find(&mut self) -> Result<(), Diagnostics> {
        self.check_plain()?;
        if self.folder.join("plan.json").exists() {
            let old = Self::read(&self.folder)?;
            self.same_as(&old)?;
            self.id = old.id;
        }
        Ok(())
    }

    /// X073 if another process follows this launch.
    fn alone(&self) -> Result<File, Diagnostics> {
        let file = self
            .below()
            .lock_file(&self.folder.join("lock"))
            .map_err(|error| self.unwritable(&error))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let message = format!(
                    "another `actcheck launch` uses the folder `{}`",
                    self.folder.display()
                );
                Err(Diagnostic::error("X073", message)
                    .help("wait until it has ended, or end it")
                    .into())
            }
            // Some network file systems have no locks.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
        }
    }

    /// Takes a shard, which one process at a time may run: a process that lost its scheduler may
    /// live on. Returns `None` if another process keeps it for longer than `wait`.
    pub fn hold(&self, number: u64, wait: Duration) -> Result<Option<File>, Diagnostics> {
        let asked = Instant::now();
        let path = self.folder.join("locks").join(number.to_string());
        let file = self
            .below()
            .lock_file(&path)
            .map_err(|error| self.unwritable(&error))?;
        while let Err(TryLockError::WouldBlock) = file.try_lock() {
            if asked.elapsed() > wait {
                return Ok(None);
            }
            thread::sleep(INTERVAL);
        }
        Ok(Some(file))
    }

    /// Checks that an unfinished launch in the folder has the same runs in the same shards.
    fn same_as(&self, old: &Self) -> Result<(), Diagnostics> {
        let other = |what: &str| -> Result<(), Diagnostics> {
            let message = format!(
                "`{}` has an unfinished launch with {what}",
                self.folder.display()
            );
            let help = "give the command of that launch again, remove the folder, or name another `--history`";
            Err(Diagnostic::error("X073", message).help(help).into())
        };
        if self.digest != old.digest {
            other("another configuration")
        } else if self.program != old.program {
            other("another version of actcheck")
        } else if self.shards != old.shards {
            other(&format!("{} shards", old.shards))
        } else if (self.runs, self.seed, self.planned) != (old.runs, old.seed, old.planned) {
            other("another number of runs or another seed")
        } else {
            Ok(())
        }
    }

    /// X074: a file of the launch can't be written.
    pub fn unwritable(&self, error: &io::Error) -> Diagnostics {
        let message = format!(
            "the folder `{}` of the launch can't be written: {error}",
            self.folder.display()
        );
        Diagnostic::error("X074", message)
            .help("name a history in a writable folder with `--history DIR`")
            .into()
    }

    /// The folder of a shard's history.
    pub fn shard_dir(&self, number: u64) -> PathBuf {
        self.folder.join("shards").join(number.to_string())
    }

    /// The file in which a shard's process prints.
    pub fn log(&self, number: u64) -> PathBuf {
        self.folder.join("logs").join(format!("{number}.log"))
    }

    /// The file that says that a shard is complete: it holds the id of its campaign.
    pub fn done_file(&self, number: u64) -> PathBuf {
        self.folder.join("done").join(number.to_string())
    }

    /// The campaign of a complete shard.
    pub fn done(&self, number: u64) -> Option<String> {
        let id = self
            .below()
            .read_text(&self.done_file(number), LONGEST)
            .ok();
        id.filter(|id| !id.is_empty())
    }

    /// The file that says that a shard ended with a diagnostic, which another start would not
    /// change.
    pub fn fault_file(&self, number: u64) -> PathBuf {
        self.folder.join("faults").join(number.to_string())
    }

    /// The numbers of complete shards.
    pub fn complete(&self) -> BTreeSet<u64> {
        self.numbers_in("done")
    }

    /// The numbers of shards that are neither complete nor ended with a diagnostic.
    pub fn missing(&self) -> BTreeSet<u64> {
        let (done, faulty) = (self.complete(), self.numbers_in("faults"));
        (1..=self.shards)
            .filter(|number| !done.contains(number) && !faulty.contains(number))
            .collect()
    }

    /// The numbers of shards that ended with a diagnostic.
    pub fn faulty(&self) -> BTreeSet<u64> {
        let done = self.complete();
        self.numbers_in("faults")
            .into_iter()
            .filter(|number| !done.contains(number))
            .collect()
    }

    fn numbers_in(&self, folder: &str) -> BTreeSet<u64> {
        self.below()
            .files(&self.folder.join(folder))
            .iter()
            .filter_map(|file| number_of(file))
            .collect()
    }

    /// The options with which a shard runs.
    pub fn run_args(&self, dir: &Path) -> RunArgs {
        let jobs = u16::try_from(self.jobs).unwrap_or(1);
        let Self {
            config, runs, seed, ..
        } = self;
        RunArgs {
            jobs: Some(jobs),
            history: Some(dir.to_path_buf()),
            quiet: true,
            ..LaunchArgs::whole(config, *runs, *seed)
        }
    }

    /// A shard by its number.
    pub fn shard(&self, number: u64) -> Option<Shard> {
        Shard::new(number, self.shards)
    }

    /// Number of runs that the shards have stored; `done` are complete.
    pub fn stored_runs(&self, done: &BTreeSet<u64>) -> u64 {
        let stored = |number: u64| History::count_runs(&self.shard_dir(number));
        let of = |number: u64| match self.shard(number) {
            Some(shard) if done.contains(&number) => shard.share(self.planned),
            _ => stored(number),
        };
        (1..=self.shards).map(of).sum()
    }

    /// Removes the files of a merged launch. Its folder gets another name first, so that no half of
    /// it is taken for a launch. Returns the paths of files that others have written there, which
    /// remain.
    pub fn remove(&self) -> io::Result<Vec<PathBuf>> {
        let merged = with_ending(&self.folder, ".merged");
        let mut left = self.remove_ours(&merged)?;
        if left.is_empty() {
            Self::beside(&self.folder).rename(&self.folder, &merged)?;
            return self.remove_ours(&merged);
        }
        left.extend(self.remove_ours(&self.folder)?);
        Ok(left)
    }

    fn remove_ours(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        Self::beside(folder).remove_ours(folder, &is_ours)
    }

    /// The files of the launch.
    pub fn below(&self) -> Below {
        Below::new(&self.folder)
    }

    /// The files beside a folder, which must not be a link: the user named only that of the
    /// history.
    fn beside(folder: &Path) -> Below {
        Below::new(folder.parent().unwrap_or(Path::new("")))
    }

    /// Checks that the folder, and everything in it and in its folders, is a file or a folder, not
    /// a link, a pipe or a device: processes of shards and schedulers open them by their paths.
    ///
    /// # Errors
    /// `X073` something is of another kind.
    pub fn check_plain(&self) -> Result<(), Diagnostics> {
        let is_plain = |kind: FileKind| kind == FileKind::File || kind == FileKind::Folder;
        let folders =
            ["", "shards", "done", "faults", "locks", "logs"].map(|name| self.folder.join(name));
        let beside = Self::beside(&self.folder);
        let top = beside
            .kind(&self.folder)
            .map(|kind| (self.folder.clone(), kind));
        let inside = folders.iter().flat_map(|folder| {
            let entries = beside.entries(folder).unwrap_or_default().into_iter();
            entries.map(|(name, kind)| (folder.join(name), kind))
        });
        match top
            .into_iter()
            .chain(inside)
            .find(|(_, kind)| !is_plain(*kind))
        {
            None => Ok(()),
            Some((path, kind)) => {
                let message = format!(
                    "the folder `{}` can't be used: `{}` is {kind}",
                    self.folder.display(),
                    path.display()
                );
                let help = "actcheck writes only plain files there, and follows no link: remove it, or name another `--history`";
                Err(Diagnostic::error("X073", message).help(help).into())
            }
        }
    }

    /// The plan's file.
    pub fn dry_run(&self) -> String {
        format!(
            "# {}\n{:#}\n",
            self.folder.join("plan.json").display(),
            self.json()
        )
    }

    /// The commands of the shards.
    pub fn commands(&self) -> String {
        let task = ShellLine::default()
            .fixed("actcheck launch-task")
            .file(&self.folder);
        let of = |number| format!("{task} {number}\n");
        (1..=self.shards).map(of).collect()
    }
}

/// Longest file of a launch that is read as a whole. Unit: bytes.
const LONGEST: u64 = 1 << 20;

/// Reads a file of a launch. Returns `None` if it can't be read.
pub(super) fn read_below(folder: &Path, name: &str) -> Option<Vec<u8>> {
    Below::new(folder).read(&folder.join(name), LONGEST).ok()
}

/// The number that is the name of a file.
fn number_of(file: &Path) -> Option<u64> {
    file.file_name()?.to_str()?.parse().ok()
}

/// Whether a launch writes a file of this path in its folder.
fn is_ours(path: &Path) -> bool {
    let mut names = path.iter().map(|name| name.to_str().unwrap_or_default());
    let is_number = |name: Option<&str>| name.is_some_and(|name| name.parse::<u64>().is_ok());
    match names.next() {
        Some("plan.json" | "job.json" | "lock") => names.next().is_none(),
        Some("done" | "faults" | "locks") => is_number(names.next()) && names.next().is_none(),
        Some("logs") => {
            names.next().is_some_and(|name| name.ends_with(".log")) && names.next().is_none()
        }
        Some("shards") => is_number(names.next()) && History::writes(&names.collect::<PathBuf>()),
        Some(name) => SCHEDULER_FILES.contains(&name) && names.next().is_none(),
        None => false,
    }
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    name.into()
}
