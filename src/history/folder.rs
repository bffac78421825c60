//! The folder of a history: its layout, its version, and its lock.
//!
//! `VERSION` names the format; `lock` is held while a process writes; `campaigns/ID/` has the
//! campaign and its segments; `tables/` and `hulls/` hold values that can be made again from these,
//! and `sent/` the parts that other stores have received.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use crate::fault;
use crate::segment::SegmentColumn;
use actcheck_base::{Below, Diagnostics, Digest, FileKind, names};

/// Format of the folder. It changes whenever a file of it does.
const FORMAT: u64 = 7;
const TITLE: &str = "actcheck history";
/// Longest version file. Unit: bytes.
const LONGEST_VERSION: u64 = 1_000;
/// The names in the folder of a history that this program opens, with their kinds. Others are left
/// alone.
const LAYOUT: [(&str, FileKind); 6] = [
    ("VERSION", FileKind::File),
    ("lock", FileKind::File),
    ("campaigns", FileKind::Folder),
    ("tables", FileKind::Folder),
    ("hulls", FileKind::Folder),
    ("sent", FileKind::Folder),
];
/// Number of tries to lock a folder: a reader holds the lock for a moment when it looks whether
/// another process does.
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
            folder.write_version()?;
        }
        let campaigns = folder.below().create_folder(&folder.campaigns());
        campaigns.map_err(|error| fault::io(dir, "creating the folder of campaigns", &error))?;
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

    /// Whether this process owns the folder.
    pub(super) fn is_own(&self) -> bool {
        self.lock.is_some()
    }

    fn write_version(&self) -> Result<(), Diagnostics> {
        let line = format!("{TITLE} {FORMAT}\n");
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

    /// Where the campaigns are.
    pub(super) fn campaigns(&self) -> PathBuf {
        self.dir.join("campaigns")
    }

    /// Where a campaign and its segments are.
    pub(super) fn campaign(&self, id: &str) -> PathBuf {
        self.campaigns().join(id)
    }

    /// The files of all campaigns at this moment.
    ///
    /// # Errors
    /// `H026` a name is not an id, `H027` a file is a link or a special file; a folder can't be
    /// read.
    pub(super) fn extent(&self) -> Result<FolderExtent, Diagnostics> {
        let folder = self.campaigns();
        let below = self.below();
        if below.kind(&folder).is_none() {
            return Ok(FolderExtent::default());
        }
        let entries = below
            .entries(&folder)
            .map_err(|error| fault::io(&self.dir, "reading the folder", &error))?;
        let mut campaigns = BTreeMap::new();
        for (name, kind) in entries {
            let path = folder.join(&name);
            match kind {
                FileKind::Folder => {}
                // It is none of this program.
                FileKind::File => continue,
                _ => return Err(fault::not_plain(&self.dir, &path, kind)),
            }
            let id = name.to_string_lossy().into_owned();
            let Some(extent) = self.campaign_extent(&id)? else {
                continue;
            };
            if !names::is_id(&id) {
                return Err(fault::foreign_id(&self.dir, "campaign", &id));
            }
            campaigns.insert(id, extent);
        }
        Ok(FolderExtent { campaigns })
    }

    /// The files of a campaign at this moment. Returns `None` if the history has none with this id, or if
    /// it is just being created.
    ///
    /// # Errors
    /// As [`Folder::extent`].
    pub(super) fn campaign_extent(&self, id: &str) -> Result<Option<CampaignExtent>, Diagnostics> {
        let folder = self.campaign(id);
        let entries = match self.below().entries(&folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(fault::io(&self.dir, "reading the folder", &error)),
        };
        let mut extent = CampaignExtent::default();
        let mut has_state = false;
        for (name, kind) in entries {
            let Some((number, column)) = name.to_str().and_then(part_of_name) else {
                continue;
            };
            let path = folder.join(&name);
            if kind != FileKind::File {
                return Err(fault::not_plain(&self.dir, &path, kind));
            }
            let metadata = match path.symlink_metadata() {
                Ok(metadata) => metadata,
                // The owner has removed it.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                Err(error) => return Err(fault::io(&self.dir, "reading the folder", &error)),
            };
            let length = metadata.len();
            if column == SegmentColumn::Campaign {
                has_state = true;
                extent.state = [
                    length,
                    metadata.ino(),
                    metadata.mtime_nsec().cast_unsigned(),
                ];
                continue;
            }
            let segment = extent.segments.entry(number).or_default();
            match column {
                SegmentColumn::Runs => segment.runs = Some(length),
                SegmentColumn::Judgements => segment.judgements = Some(length),
                _ => {}
            }
        }
        Ok(has_state.then_some(extent))
    }

    /// Whether a history has a file of this path in its folder.
    pub(super) fn writes(path: &Path) -> bool {
        let names: Vec<&str> = path
            .iter()
            .map(|name| name.to_str().unwrap_or_default())
            .collect();
        let ends = |name: &str, endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
        match names[..] {
            ["VERSION" | "lock"] => true,
            ["campaigns", _, file] => part_of_name(file).is_some(),
            ["tables", file] => {
                ["FILES", "SCHEMA", "RECHECKED"].contains(&file) || ends(file, &[".parquet"])
            }
            ["hulls", file] => ends(file, &[".hulls"]),
            ["sent", _] => true,
            _ => false,
        }
    }
}

/// The files of a history at one moment.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct FolderExtent {
    pub campaigns: BTreeMap<String, CampaignExtent>,
}

impl FolderExtent {
    /// A text that is equal for equal extents.
    pub(super) fn digest(&self) -> String {
        let mut digest = Digest::new();
        for (id, campaign) in &self.campaigns {
            digest.update(id.as_bytes());
            digest.update(format!("{campaign:?}").as_bytes());
        }
        digest.finish()
    }
}

/// The files of a campaign at one moment.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct CampaignExtent {
    /// Length (bytes), number and time of the file of the campaign itself, which is replaced as a
    /// whole.
    pub state: [u64; 3],
    /// Its segments by number.
    pub segments: BTreeMap<u32, SegmentExtent>,
}

/// The files of a segment at one moment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct SegmentExtent {
    /// Length of its column of runs. Unit: bytes.
    pub runs: Option<u64>,
    /// Length of its column of judgements. Unit: bytes.
    pub judgements: Option<u64>,
}

/// The segment and the column of a file in the folder of a campaign; the campaign itself has the
/// number 0. Returns `None` for any other name.
fn part_of_name(name: &str) -> Option<(u32, SegmentColumn)> {
    if name == SegmentColumn::Campaign.extension() {
        return Some((0, SegmentColumn::Campaign));
    }
    let (number, extension) = name.split_once('.')?;
    let column = SegmentColumn::OF_SEGMENTS
        .into_iter()
        .find(|column| column.extension() == extension)?;
    let number: u32 = number.parse().ok()?;
    (number > 0).then_some((number, column))
}

/// Checks that files and folders of a history are files and folders, not links, pipes or devices.
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
    Ok(())
}

/// Whether the folder has a version that this program reads.
///
/// # Errors
/// `H003` it holds other files, `H004` it has another format.
fn has_version(dir: &Path) -> Result<bool, Diagnostics> {
    let text = match Below::new(dir).read_text(&dir.join("VERSION"), LONGEST_VERSION) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
        // It is too long, or not text.
        Err(error) if [ErrorKind::InvalidData, ErrorKind::Other].contains(&error.kind()) => {
            return Err(fault::foreign(dir));
        }
        Err(error) => return Err(fault::io(dir, "reading its version", &error)),
    };
    let number = text.strip_prefix(TITLE).and_then(|rest| {
        let number = rest.split_whitespace().next();
        number.and_then(|number| number.parse::<u64>().ok())
    });
    match number {
        Some(FORMAT) => Ok(true),
        Some(theirs) => Err(fault::other_format(dir, theirs, FORMAT)),
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
            // Some network file systems don't support locks.
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {
                return Ok(file);
            }
            Err(TryLockError::Error(error)) => return Err(fault::io(dir, "locking it", &error)),
        }
    }
    Err(fault::in_use(dir))
}
