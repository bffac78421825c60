//! The state of a store at one moment, taken without its owner's help: readers need no lock, wait
//! for no writer, and write nothing into the folder of the history.
//!
//! Tables never change after they are written, so the snapshot only holds them open; if the owner
//! removes one, its content stays readable. The logs and the manifest, which are appended to, are
//! copied. The owner removes a file only after it has written a manifest without it, so the files
//! belong together if the manifest did not change meanwhile.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read as _, Seek as _};
use std::path::{Path, PathBuf};
use std::thread::yield_now;
use std::time::SystemTime;

use crate::fault;
use crate::folder::{self, Folder};
use crate::journal;
use crate::seal::{CURRENT, Found, Seal, manifest_of};
use actcheck_base::{Diagnostics, ScratchFolder, digest_of};

/// Number of times that a snapshot is tried. The manifest changes a few times a second at most, and
/// a try takes some milliseconds.
const TRIES: usize = 200;
/// Largest store that is compared with its seal before it is read: takes a few tenths of a second.
/// Larger ones are compared by `actcheck health --integrity`. Unit: bytes.
pub(super) const MOST_COMPARED: u64 = 1 << 30;

/// Longest log or manifest that is copied. A sparse file in a foreign store must not fill the disk.
/// Unit: bytes.
pub(super) const LONGEST_COPIED: u64 = 1 << 30;

/// A store that can be opened for reading at [`Snapshot::store`].
#[derive(Debug)]
pub(super) struct Snapshot {
    scratch: ScratchFolder,
    stamp: Stamp,
    /// The tables, open.
    _tables: Vec<File>,
    /// Total size of the tables. Unit: bytes.
    pub(super) size: u64,
    /// The journal, whose statements the store may lack.
    pub(super) journal: Vec<u8>,
}

/// Identifies the state of a store: current manifest, its size, the logs and the journal with their
/// sizes, and the time of the last outline.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stamp {
    manifest: Vec<u8>,
    size: u64,
    logs: Vec<(String, u64)>,
    journal: u64,
    outlines: Option<SystemTime>,
}

impl Snapshot {
    /// Takes a snapshot of a folder's store.
    ///
    /// # Errors
    /// `H007` the store is damaged; `H001`, `H005` the system's folder for temporary files can't be
    /// written.
    pub(super) fn take(folder: &Folder) -> Result<Self, Diagnostics> {
        let seal = match Seal::read(folder) {
            Found::Whole(seal) => Some(seal),
            Found::Missing | Found::Damaged => None,
        };
        for _ in 0..TRIES {
            if let Some(snapshot) = attempt(folder, &folder.store(), seal.as_ref())? {
                return Ok(snapshot);
            }
            yield_now();
        }
        Err(missing(folder))
    }

    /// Takes a snapshot of whatever is left of a damaged store: nothing is compared with the seal,
    /// and its copies replace damaged originals.
    ///
    /// # Errors
    /// As [`Snapshot::take`].
    pub(super) fn salvage(folder: &Folder) -> Result<Self, Diagnostics> {
        let Found::Whole(seal) = Seal::read(folder) else {
            return attempt(folder, &folder.store(), None)?.ok_or_else(|| missing(folder));
        };
        let current = folder::read(&folder.store().join(CURRENT)).unwrap_or_default();
        let manifest = manifest_of(&current).map(|name| folder.store().join(name));
        let is_damaged = |path: PathBuf| {
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            folder::open(&path).map_or(true, |mut file| {
                matches!(seal.is_damaged(&name, &mut file), Some(Ok(true) | Err(_)))
            })
        };
        let damaged = seal.is_wrong_current(&current) || manifest.is_none_or(is_damaged);
        let small = if damaged {
            folder.seal()
        } else {
            folder.store()
        };
        attempt(folder, &small, None)?.ok_or_else(|| missing(folder))
    }

    /// Folder of the store.
    pub(super) fn store(&self) -> &Path {
        self.scratch.path()
    }

    /// A text that identifies the state.
    pub(super) fn state(&self) -> String {
        digest_of(&format!("{:?}", self.stamp))
    }

    /// Whether a folder's store has changed since the snapshot was taken.
    pub(super) fn is_stale(&self, folder: &Folder) -> bool {
        stamp(folder, &folder.store()).is_none_or(|stamp| stamp != self.stamp)
    }
}

/// Takes a snapshot whose manifest is in the folder `small`. Returns `None` if the manifest changed
/// meanwhile.
fn attempt(
    folder: &Folder,
    small: &Path,
    seal: Option<&Seal>,
) -> Result<Option<Snapshot>, Diagnostics> {
    let dir = folder.dir();
    let Some(before) = stamp(folder, small) else {
        return Ok(None);
    };
    if seal.is_some_and(|seal| seal.is_wrong_current(&before.manifest)) {
        return Err(fault::damaged_file(dir, CURRENT));
    }
    let scratch = ScratchFolder::create().map_err(|error| fault::temporary(dir, &error))?;
    let compared = seal.filter(|seal| seal.size() <= MOST_COMPARED);
    // Read before the store's files: the owner puts statements into the store before it removes
    // them from here.
    let journal =
        journal::read(dir).map_err(|error| fault::io(dir, "reading its journal", &error))?;
    let (mut tables, mut size) = (Vec::new(), 0);
    let manifest = manifest_of(&before.manifest).unwrap_or_default();
    let entries = folder
        .below()
        .entries(&folder.store())
        .map_err(|error| fault::io(dir, "reading its store", &error))?;
    let names: Vec<String> = entries
        .into_iter()
        .filter_map(|(name, _)| name.into_string().ok())
        .collect();
    for name in names
        .iter()
        .map(String::as_str)
        .filter(|name| name.ends_with(".sst") || name.ends_with(".log"))
    {
        let from = folder.store().join(name);
        let mut file = match folder::open(&from) {
            Ok(file) => file,
            // Removed meanwhile; if it is needed, the manifest changes.
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => return Err(fault::io(dir, "reading its store", &error)),
        };
        if let Some(compared) = compared.and_then(|seal| seal.is_damaged(name, &mut file)) {
            if compared.map_err(|error| fault::io(dir, "reading its store", &error))? {
                return Err(fault::damaged_file(dir, name));
            }
            file.rewind()
                .map_err(|error| fault::io(dir, "reading its store", &error))?;
        }
        let to = scratch.path().join(name);
        let linked = if name.ends_with(".sst") {
            link(&file, &from, &to)
        } else {
            copy(&mut file, &to)
        };
        linked.map_err(|error| fault::temporary(dir, &error))?;
        if name.ends_with(".sst") {
            size += file.metadata().map_or(0, |found| found.len());
            tables.push(file);
        }
    }
    for name in [manifest, "IDENTITY"] {
        let from = if name == manifest {
            small.join(name)
        } else {
            folder.store().join(name)
        };
        let Ok(mut file) = folder::open(&from) else {
            continue;
        };
        if let Some(Ok(true)) = seal.and_then(|seal| seal.is_damaged(name, &mut file)) {
            return Err(fault::damaged_file(dir, name));
        }
        let copied = file
            .rewind()
            .and_then(|()| copy(&mut file, &scratch.path().join(name)));
        copied.map_err(|error| fault::temporary(dir, &error))?;
    }
    fs::write(scratch.path().join(CURRENT), &before.manifest)
        .map_err(|error| fault::temporary(dir, &error))?;
    let copied = fs::metadata(scratch.path().join(manifest)).map_or(0, |found| found.len());
    let is_same = stamp(folder, small)
        .is_some_and(|after| after.manifest == before.manifest && after.size == before.size);
    let whole = is_same && copied == before.size;
    Ok(whole.then_some(Snapshot {
        scratch,
        stamp: before,
        _tables: tables,
        size,
        journal,
    }))
}

/// The fault of a store without a readable manifest: another process is creating it, or it is
/// damaged.
fn missing(folder: &Folder) -> Diagnostics {
    if folder.is_locked() {
        fault::in_use(folder.dir())
    } else {
        fault::damaged_file(folder.dir(), CURRENT)
    }
}

/// Reads the stamp of a store. Returns `None` if it has no readable manifest.
fn stamp(folder: &Folder, store: &Path) -> Option<Stamp> {
    let current = folder::read(&store.join(CURRENT)).ok()?;
    let size = fs::metadata(store.join(manifest_of(&current)?)).ok()?.len();
    let logs = folder.below().files(store).into_iter().filter_map(|file| {
        let name = file
            .file_name()?
            .to_str()
            .filter(|name| name.ends_with(".log"))?
            .to_owned();
        Some((name, fs::metadata(file).ok()?.len()))
    });
    let logs: Vec<(String, u64)> = logs.collect();
    let journal = fs::metadata(folder.dir().join(journal::NAME)).map_or(0, |found| found.len());
    let outlines = fs::metadata(folder.outlines())
        .and_then(|found| found.modified())
        .ok();
    Some(Stamp {
        manifest: current,
        size,
        logs,
        journal,
        outlines,
    })
}

/// Copies a file into the reader's folder for temporary files.
fn copy(file: &mut File, to: &Path) -> io::Result<()> {
    if file.metadata()?.len() > LONGEST_COPIED {
        return Err(io::Error::other(
            "a file of its store is far longer than any that this program writes",
        ));
    }
    io::copy(&mut file.take(LONGEST_COPIED), &mut File::create(to)?).map(drop)
}

/// Makes an open file available under another name, also after its removal.
#[cfg(target_os = "linux")]
fn link(file: &File, from: &Path, to: &Path) -> io::Result<()> {
    use std::os::fd::AsRawFd as _;
    let open = PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()));
    if open.exists() {
        std::os::unix::fs::symlink(open, to)
    } else {
        copied(from, to)
    }
}

#[cfg(not(target_os = "linux"))]
fn link(_: &File, from: &Path, to: &Path) -> io::Result<()> {
    copied(from, to)
}

/// A second name for the file if it is on the same file system, else a copy.
fn copied(from: &Path, to: &Path) -> io::Result<()> {
    fs::hard_link(from, to).or_else(|_| fs::copy(from, to).map(drop))
}
