//! The files of outlines in the folder of a history.
//!
//! `CAMPAIGN-NUMBER.outline` has one run. `CAMPAIGN.FIRST-LAST.outlines` has many, whose indices
//! lie between these. A process that is killed while it puts single files together leaves runs in
//! both; they count once.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind, Read as _};
use std::path::{Path, PathBuf};

use crate::folder::{self, Folder, LONGEST};
use crate::outlines::file::{HEADER, Opened, Outline, encode};
use crate::{History, fault};
use actcheck_base::{Below, Diagnostics};

/// Number of times that a reader looks again if the owner has put a file together with others
/// meanwhile.
pub(super) const TRIES: usize = 100;

/// A file of outlines.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct OutlineFile {
    pub campaign: String,
    /// The lowest and the highest index of its runs.
    pub(super) first: u64,
    last: u64,
    pub(super) is_single: bool,
    pub path: PathBuf,
}

/// The folder of outlines.
#[derive(Debug, Clone)]
pub(crate) struct Shelf {
    below: Below,
    dir: PathBuf,
}

/// Receives a file, its parts, and the indices that earlier files have already.
pub(super) type EachFile<'e> =
    dyn FnMut(&OutlineFile, &Opened<'_>, &BTreeSet<u64>) -> Result<(), String> + 'e;

/// The parts of a file that a reader needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Needed {
    /// The indices of its runs.
    Indices,
    /// These, and the values in lists.
    Rows,
    /// All parts.
    All,
}

/// The reason why a file can't be used.
pub(super) enum Unread {
    /// It was removed meanwhile.
    Gone,
    Damaged(PathBuf, String),
}

impl Shelf {
    /// Number of runs of a campaign in a file. Each takes 30 kB of memory while it is written.
    pub(crate) const RUNS_IN_A_FILE: usize = 128;

    /// The outlines in the folder of a history.
    pub(crate) fn new(history: &Path) -> Self {
        Self {
            below: Below::new(history),
            dir: Folder::outlines_in(history),
        }
    }

    /// Whether there may be outlines.
    pub(crate) fn exists(&self) -> bool {
        self.dir.exists()
    }

    /// The files, sorted by campaign and index; a larger one before the single ones that it may
    /// contain.
    pub(crate) fn files(&self, campaign: Option<&str>) -> Vec<OutlineFile> {
        let mut files: Vec<OutlineFile> = self
            .below
            .files(&self.dir)
            .into_iter()
            .filter_map(named)
            .collect();
        files.retain(|file| campaign.is_none_or(|campaign| campaign == file.campaign));
        files.sort();
        files
    }

    /// Removes the partial files of killed processes.
    pub(crate) fn clean(&self) {
        self.below.remove_leftovers(&self.dir);
    }

    /// Writes the outline of a run. `synced`: to the disk at once, so that it survives a power cut.
    pub(crate) fn add(
        &self,
        campaign: &str,
        index: u64,
        outline: &Outline,
        synced: bool,
    ) -> io::Result<()> {
        let bytes = encode(std::slice::from_ref(outline)).map_err(io::Error::other)?;
        let path = self.dir.join(format!("{campaign}-{}.outline", index + 1));
        if synced {
            self.below.write_atomic(&path, &bytes)
        } else {
            self.below.write_quickly(&path, &bytes)
        }
    }

    /// Writes outlines, sorted by index, in one file.
    pub(crate) fn add_all(&self, campaign: &str, outlines: &[Outline]) -> io::Result<()> {
        let (Some(first), Some(last)) = (index_of(outlines.first()), index_of(outlines.last()))
        else {
            return Ok(());
        };
        let bytes = encode(outlines).map_err(io::Error::other)?;
        self.below.write_atomic(
            &self
                .dir
                .join(format!("{campaign}.{first:09}-{last:09}.outlines")),
            &bytes,
        )
    }

    /// Puts the single files of a campaign together.
    pub(crate) fn pack(&self, campaign: &str) -> io::Result<()> {
        let files = self.files(Some(campaign));
        let (singles, larger): (Vec<_>, Vec<_>) =
            files.into_iter().partition(|file| file.is_single);
        if singles.is_empty() {
            return Ok(());
        }
        for singles in singles.chunks(Self::RUNS_IN_A_FILE) {
            let mut outlines = Vec::new();
            for single in singles {
                // Left by a killed process in both.
                if larger.iter().any(|file| {
                    file.has(single.first) && indices(&file.path).contains(&single.first)
                }) {
                    continue;
                }
                let bytes = folder::read(&single.path)?;
                let read = Opened::new(&bytes)
                    .and_then(|opened| opened.outlines())
                    .map_err(io::Error::other)?;
                outlines.extend(read);
            }
            self.add_all(campaign, &outlines)?;
            for single in singles {
                self.below.remove(&single.path)?;
            }
        }
        Ok(())
    }

    /// Calls `each` with every file, of which parts that are not `needed` may be missing. If a file
    /// was removed meanwhile, begins anew.
    pub(super) fn each_file(
        &self,
        campaign: Option<&str>,
        needed: Needed,
        each: &mut EachFile<'_>,
    ) -> Result<(), Unread> {
        for file in self.chosen(campaign)? {
            let (file, wanted) = file;
            let bytes =
                read_parts(&file.path, needed).map_err(|error| unread(&file.path, &error))?;
            let read = Opened::new(&bytes).and_then(|opened| each(&file, &opened, &wanted));
            read.map_err(|why| Unread::Damaged(file.path.clone(), why))?;
        }
        Ok(())
    }

    /// The files that are needed for all runs of a campaign, or of all campaigns, each with the
    /// indices that earlier files have already. Sorted by campaign, then by the lowest index.
    pub(super) fn chosen(
        &self,
        campaign: Option<&str>,
    ) -> Result<Vec<(OutlineFile, BTreeSet<u64>)>, Unread> {
        let mut by_campaign: BTreeMap<String, Vec<OutlineFile>> = BTreeMap::new();
        for file in self.files(campaign) {
            by_campaign
                .entry(file.campaign.clone())
                .or_default()
                .push(file);
        }
        let mut chosen = Vec::new();
        for files in by_campaign.into_values() {
            if are_apart(&files) {
                chosen.extend(files.into_iter().map(|file| (file, BTreeSet::new())));
                continue;
            }
            // Shards and killed processes leave files whose ranges overlap. Their runs do not,
            // except after a kill.
            let mut seen = IndexSet::default();
            let mut duplicates = BTreeMap::new();
            let (singles, larger): (Vec<&OutlineFile>, Vec<&OutlineFile>) =
                files.iter().partition(|file| file.is_single);
            for file in larger {
                let bytes = read_parts(&file.path, Needed::Indices)
                    .map_err(|error| unread(&file.path, &error))?;
                let indices = Opened::new(&bytes).and_then(|opened| opened.indices());
                let indices = indices.map_err(|why| Unread::Damaged(file.path.clone(), why))?;
                let there: BTreeSet<u64> = indices
                    .into_iter()
                    .filter(|index| !seen.insert(*index))
                    .collect();
                duplicates.insert(file.path.clone(), there);
            }
            let in_both: BTreeSet<PathBuf> = singles
                .into_iter()
                .filter(|file| !seen.insert(file.first))
                .map(|file| file.path.clone())
                .collect();
            chosen.extend(
                files
                    .into_iter()
                    .filter(|file| !in_both.contains(&file.path))
                    .map(|file| {
                        let there = duplicates.remove(&file.path).unwrap_or_default();
                        (file, there)
                    }),
            );
        }
        Ok(chosen)
    }
}

/// Whether no range of indices begins before the end of an earlier one. The files are sorted.
pub(super) fn are_apart(files: &[OutlineFile]) -> bool {
    let mut highest: Option<u64> = None;
    files.iter().all(|file| {
        let is_apart = highest.is_none_or(|highest| file.first > highest);
        highest = highest.max(Some(file.last));
        is_apart
    })
}

/// A set of indices of runs, one bit for each.
#[derive(Debug, Default)]
pub(super) struct IndexSet(BTreeMap<u64, u64>);

impl IndexSet {
    /// Adds an index. Returns whether it was new.
    pub(super) fn insert(&mut self, index: u64) -> bool {
        let (word, bit) = (self.0.entry(index / 64).or_default(), 1 << (index % 64));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }
}

impl History {
    /// Number of outlines in a folder of a history, which another process may be writing: about, if
    /// it is.
    pub fn count_outlines(dir: &Path) -> u64 {
        let mut count = 0;
        // A file that can't be read is reported when the history is opened.
        let _ = Shelf::new(dir).each_file(None, Needed::Indices, &mut |_, opened, there| {
            count += opened
                .indices()?
                .iter()
                .filter(|index| !there.contains(index))
                .count() as u64;
            Ok(())
        });
        count
    }
}

impl OutlineFile {
    fn has(&self, index: u64) -> bool {
        (self.first..=self.last).contains(&index)
    }
}

impl History {
    /// Reads outlines, again if the owner of the history changed them meanwhile.
    ///
    /// # Errors
    /// `H007` a file is damaged.
    pub(super) fn of_outlines<T>(
        &self,
        read: &mut dyn FnMut(&Shelf) -> Result<T, Unread>,
    ) -> Result<T, Diagnostics> {
        let shelf = self.shelf();
        for _ in 0..TRIES {
            match read(&shelf) {
                Ok(found) => return Ok(found),
                Err(Unread::Gone) => {}
                Err(Unread::Damaged(file, why)) => {
                    return Err(fault::damaged(
                        self.dir(),
                        &format!("`{}`: {why}", file.display()),
                    ));
                }
            }
        }
        Err(fault::in_use(self.dir()))
    }
}

pub(super) fn unread(path: &Path, error: &io::Error) -> Unread {
    match error.kind() {
        ErrorKind::NotFound => Unread::Gone,
        _ => Unread::Damaged(path.to_path_buf(), error.to_string()),
    }
}

/// The bytes of a file up to the end of the needed parts, or more.
pub(super) fn read_parts(path: &Path, needed: Needed) -> io::Result<Vec<u8>> {
    let parts = match needed {
        Needed::Indices => 1,
        Needed::Rows => 2,
        Needed::All => return folder::read(path),
    };
    let mut file = folder::open(path)?;
    let mut bytes = vec![0; HEADER];
    file.read_exact(&mut bytes)?;
    let size = Opened::size_of_start(&bytes, parts)
        .unwrap_or(HEADER)
        .max(HEADER)
        - HEADER;
    io::Read::take(&mut file, (size as u64).min(LONGEST)).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn indices(path: &Path) -> Vec<u64> {
    let read = read_parts(path, Needed::Indices)
        .ok()
        .and_then(|bytes| Opened::new(&bytes).ok()?.indices().ok());
    read.unwrap_or_default()
}

/// Whether a file has a run, or is damaged.
fn may_have(path: &Path, index: u64) -> bool {
    let read = read_parts(path, Needed::Indices)
        .ok()
        .and_then(|bytes| Opened::new(&bytes).ok()?.indices().ok());
    read.is_none_or(|indices| indices.contains(&index))
}

fn index_of(outline: Option<&Outline>) -> Option<u64> {
    outline?.rows.rows.first().map(|row| row.index)
}

/// The name of a file. Returns `None` for other files.
fn named(path: PathBuf) -> Option<OutlineFile> {
    let name = path.file_name()?.to_str()?;
    if let Some(run) = name.strip_suffix(".outline") {
        let (campaign, number) = run.rsplit_once('-')?;
        let index = number.parse::<u64>().ok()?.checked_sub(1)?;
        return Some(OutlineFile {
            campaign: campaign.to_owned(),
            first: index,
            last: index,
            is_single: true,
            path,
        });
    }
    let (campaign, range) = name.strip_suffix(".outlines")?.rsplit_once('.')?;
    let (first, last) = range.split_once('-')?;
    let (first, last) = (first.parse().ok()?, last.parse().ok()?);
    Some(OutlineFile {
        campaign: campaign.to_owned(),
        first,
        last,
        is_single: false,
        path,
    })
}

impl Shelf {
    /// The files that may have a run, single ones first.
    pub(crate) fn files_with(&self, campaign: &str, index: u64) -> Vec<PathBuf> {
        let single = self.dir.join(format!("{campaign}-{}.outline", index + 1));
        if single.exists() {
            return vec![single];
        }
        // Ranges of files from shards overlap.
        let files = self
            .files(Some(campaign))
            .into_iter()
            .filter(|file| !file.is_single && file.has(index));
        files
            .map(|file| file.path)
            .filter(|path| may_have(path, index))
            .collect()
    }
}
