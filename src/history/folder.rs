//! The folder of a history: its layout, its version, and its lock.
//!
//! `VERSION` names the format; `lock` is held while a process writes; `store/` is the RDF store,
//! and `seal/` has the checksums of its files; `journal` has the statements that are not in its
//! tables yet; `traces/` has one file for each run that is kept whole, `outlines/` the others;
//! `hulls/` caches the convex solids of meshes, which can be recomputed at any time.

use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use crate::snapshot::LONGEST_COPIED;
use crate::{fault, journal};
use actcheck_base::{Below, Diagnostics, FileKind};

/// Format of the folder. It changes whenever a file of it does.
const FORMAT: u64 = 4;
const TITLE: &str = "actcheck history";
/// The mark of a folder with a journal, which follows the format: without it, a lost journal would
/// not be noticed.
const WITH_JOURNAL: &str = "journal";
/// Longest version file. Unit: bytes.
const LONGEST_VERSION: u64 = 1_000;
/// Longest file of a history that is read as a whole: those of this program have some megabytes.
/// Unit: bytes.
pub(super) const LONGEST: u64 = 256 << 20;
/// The names in the folder of a history that this program opens, with their kinds. Others are left
/// alone.
const LAYOUT: [(&str, FileKind); 10] = [
    ("VERSION", FileKind::File),
    ("lock", FileKind::File),
    (journal::NAME, FileKind::File),
    ("store", FileKind::Folder),
    ("seal", FileKind::Folder),
    ("traces", FileKind::Folder),
    ("outlines", FileKind::Folder),
    ("tables", FileKind::Folder),
    ("hulls", FileKind::Folder),
    ("sent", FileKind::Folder),
];
/// Number of tries to lock a folder: a reader holds the lock for a moment if it finds the store
/// incomplete.
const TRIES: usize = 10;
/// Time between two tries.
const PAUSE: Duration = Duration::from_millis(10);

/// A folder that this process owns, or only reads, until the value is dropped.
#[derive(Debug)]
pub(super) struct Folder {
    dir: PathBuf,
    /// Holds the lock of an owner. The operating system releases it when the process ends, even
    /// after a crash.
    lock: Option<File>,
}

impl Folder {
    /// Locks a folder for writing. Creates it if it is missing and `create` is `true`.
    pub(super) fn lock_exclusive(dir: &Path, create: bool) -> Result<Self, Diagnostics> {
        if dir.is_file() {
            return Err(fault::unusable(dir, "a file exists at its path"));
        }
        check_layout(dir)?;
        let known = has_version(dir)?;
        if !known && !create {
            return Err(if holds_other_things(dir) {
                fault::foreign(dir)
            } else {
                fault::none_there(dir)
            });
        }
        if !known {
            if holds_other_things(dir) {
                return Err(fault::foreign(dir));
            }
            Below::new(dir)
                .create_folder(dir)
                .map_err(|error| fault::io(dir, "creating the folder", &error))?;
        }
        let folder = Self {
            dir: dir.to_path_buf(),
            lock: Some(lock(dir)?),
        };
        if !known {
            folder.write_version(false)?;
        }
        let traces = folder.below().create_folder(&folder.traces());
        traces.map_err(|error| fault::io(dir, "creating the folder of traces", &error))?;
        Ok(folder)
    }

    /// An existing folder, to read it while other processes may read or write it.
    pub(super) fn to_read(dir: &Path) -> Result<Self, Diagnostics> {
        check_layout(dir)?;
        if !has_version(dir)? {
            // A process may have created the history meanwhile.
            let is_foreign = holds_other_things(dir) && !has_version(dir)?;
            return Err(if is_foreign {
                fault::foreign(dir)
            } else {
                fault::none_there(dir)
            });
        }
        Ok(Self {
            dir: dir.to_path_buf(),
            lock: None,
        })
    }

    /// Whether another process owns the folder.
    pub(super) fn is_locked(&self) -> bool {
        let lock = self.below().open(&self.dir.join("lock"));
        lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// Marks the folder before its journal is created, or after it was removed, so that a lost
    /// journal is noticed.
    pub(super) fn mark_journal(&self, exists: bool) -> Result<(), Diagnostics> {
        if version(&self.dir)?.is_some_and(|version| version.has_journal == exists) {
            Ok(())
        } else {
            self.write_version(exists)
        }
    }

    /// Whether there is a journal that no other process writes, and whether the version says that
    /// there is one.
    pub(super) fn has_journal(&self) -> (bool, bool) {
        if self.lock.is_none() && self.is_locked() {
            return (false, false);
        }
        let exists = self.below().kind(&self.dir.join(journal::NAME)).is_some();
        (
            exists,
            version(&self.dir)
                .is_ok_and(|version| version.is_some_and(|version| version.has_journal)),
        )
    }

    /// Creates the folder of outlines.
    pub(super) fn begin_outlines(&self) -> Result<(), Diagnostics> {
        if self.outlines().exists() {
            return Ok(());
        }
        let created = self.below().create_folder(&self.outlines());
        created.map_err(|error| fault::io(&self.dir, "creating its outlines", &error))
    }

    fn write_version(&self, has_journal: bool) -> Result<(), Diagnostics> {
        let mark = if has_journal { WITH_JOURNAL } else { "" };
        let text = format!("{TITLE} {FORMAT} {mark}");
        let line = format!("{}\n", text.trim_end());
        self.below()
            .write_atomic(&self.dir.join("VERSION"), line.as_bytes())
            .map_err(|error| fault::io(&self.dir, "writing its version", &error))
    }

    /// Its files, of which none is a link.
    pub(super) fn below(&self) -> Below {
        Below::new(&self.dir)
    }

    /// The folder as the user gave it.
    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    /// Where the RDF store is.
    pub(super) fn store(&self) -> PathBuf {
        self.dir.join("store")
    }

    /// Where the checksums of the store's files are.
    pub(super) fn seal(&self) -> PathBuf {
        self.dir.join("seal")
    }

    /// Where the traces are.
    pub(super) fn traces(&self) -> PathBuf {
        self.dir.join("traces")
    }

    /// Where the outlines of runs are that are not kept whole.
    pub(super) fn outlines(&self) -> PathBuf {
        Self::outlines_in(&self.dir)
    }

    /// Where the outlines are in the folder of a history.
    pub(super) fn outlines_in(dir: &Path) -> PathBuf {
        dir.join("outlines")
    }

    /// The ids of the runs that have a trace, sorted.
    pub(super) fn traced(&self) -> Vec<String> {
        let files = self.below().files(&self.traces()).into_iter();
        files
            .filter_map(|file| {
                Some(
                    file.file_name()?
                        .to_str()?
                        .strip_suffix(".trace")?
                        .to_owned(),
                )
            })
            .collect()
    }

    /// Whether a history has a file of this path in its folder.
    pub(super) fn writes(path: &Path) -> bool {
        let mut names = path.iter().map(|name| name.to_str().unwrap_or_default());
        let (first, second) = (
            names.next().unwrap_or_default(),
            names.next().unwrap_or_default(),
        );
        let ends = |endings: &[&str]| endings.iter().any(|ending| second.ends_with(ending));
        let is_ours = match first {
            "store" => {
                let begins = ["MANIFEST-", "OPTIONS-", "LOG", "bulk-"]
                    .iter()
                    .any(|start| second.starts_with(start));
                begins
                    || ["CURRENT", "IDENTITY", "LOCK"].contains(&second)
                    || ends(&[".sst", ".log", ".dbtmp"])
            }
            "seal" => ["SUMS", "CURRENT"].contains(&second) || second.starts_with("MANIFEST-"),
            "traces" => ends(&[".trace"]),
            "outlines" => ends(&[".outline", ".outlines"]),
            "tables" => ["FILES", "SCHEMA", "RECHECKED"].contains(&second) || ends(&[".parquet"]),
            "hulls" => ends(&[".hulls"]),
            "sent" => !second.is_empty(),
            "VERSION" | "lock" | journal::NAME => second.is_empty(),
            _ => false,
        };
        is_ours && names.next().is_none()
    }

    /// File of a run's trace.
    pub(super) fn trace(&self, run: &str) -> PathBuf {
        self.traces().join(format!("{run}.trace"))
    }
}

/// Checks that files and folders of a history are files and folders, not links, pipes or devices.
/// The library opens the files of the store and of its seal by their paths, so these are checked
/// one by one.
///
/// # Errors
/// `H027` one is of another kind.
fn check_layout(dir: &Path) -> Result<(), Diagnostics> {
    let below = Below::new(dir);
    for (name, wanted) in LAYOUT {
        let path = dir.join(name);
        match below.kind(&path) {
            Some(kind) if kind != wanted => return Err(fault::not_plain(dir, &path, kind)),
            _ => {}
        }
    }
    for folder in ["store", "seal"].map(|name| dir.join(name)) {
        let entries = below
            .entries(&folder)
            .map_err(|error| fault::io(dir, "reading the folder", &error))?;
        if let Some((name, kind)) = entries.iter().find(|(_, kind)| *kind != FileKind::File) {
            return Err(fault::not_plain(dir, &folder.join(name), *kind));
        }
        // RocksDB reads its logs and manifests to their ends before it opens a store.
        let mut paths = entries.iter().map(|(name, _)| folder.join(name));
        let is_table = |path: &Path| path.extension().is_some_and(|ending| ending == "sst");
        let is_long = |path: &Path| {
            path.symlink_metadata()
                .is_ok_and(|found| found.len() > LONGEST_COPIED)
        };
        if let Some(path) = paths.find(|path| !is_table(path) && is_long(path)) {
            return Err(fault::too_long(dir, &path));
        }
    }
    Ok(())
}

/// Opens a file in a folder of a history; the folder was checked when the history was opened.
pub(super) fn open(path: &Path) -> io::Result<File> {
    Below::new(path.parent().unwrap_or(path)).open(path)
}

/// Reads such a file.
pub(super) fn read(path: &Path) -> io::Result<Vec<u8>> {
    Below::new(path.parent().unwrap_or(path)).read(path, LONGEST)
}

/// Whether the folder has a history that this program can read.
fn has_version(dir: &Path) -> Result<bool, Diagnostics> {
    match version(dir)? {
        Some(version) if version.format != FORMAT => {
            Err(fault::other_format(dir, version.format, FORMAT))
        }
        version => Ok(version.is_some()),
    }
}

/// The content of the version file.
struct Version {
    format: u64,
    /// Whether the folder has a journal, unless it was lost.
    has_journal: bool,
}

/// The version of the history in a folder. Returns `None` if it has none.
fn version(dir: &Path) -> Result<Option<Version>, Diagnostics> {
    let text = match Below::new(dir).read_text(&dir.join("VERSION"), LONGEST_VERSION) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        // It is too long, or not text.
        Err(error) if [ErrorKind::InvalidData, ErrorKind::Other].contains(&error.kind()) => {
            return Err(fault::foreign(dir));
        }
        Err(error) => return Err(fault::io(dir, "reading its version", &error)),
    };
    let mut words = text
        .strip_prefix(TITLE)
        .unwrap_or_default()
        .split_whitespace();
    match words.next().and_then(|number| number.parse().ok()) {
        Some(format) => Ok(Some(Version {
            format,
            has_journal: words.next() == Some(WITH_JOURNAL),
        })),
        None => Err(fault::foreign(dir)),
    }
}

/// Whether a folder without a version holds any files other than those left by `actcheck check` or
/// by an interrupted start.
fn holds_other_things(dir: &Path) -> bool {
    let is_ours = |name: &str| {
        ["lock", "hulls"].contains(&name)
            || (name.starts_with("VERSION.") && name.ends_with(".tmp"))
    };
    let entries = Below::new(dir).entries(dir).unwrap_or_default();
    entries
        .iter()
        .any(|(name, _)| !name.to_str().is_some_and(is_ours))
}

fn lock(dir: &Path) -> Result<File, Diagnostics> {
    let file = Below::new(dir)
        .lock_file(&dir.join("lock"))
        .map_err(|error| fault::io(dir, "locking it", &error))?;
    for _ in 0..TRIES {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::WouldBlock) => sleep(PAUSE),
            // Some network file systems don't support locks; the store's own lock still protects
            // it.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {
                return Ok(file);
            }
            Err(TryLockError::Error(error)) => return Err(fault::io(dir, "locking it", &error)),
        }
    }
    Err(fault::in_use(dir))
}
