//! The table beside a history, stored as several Parquet files. The name of each has its digest, so
//! that damage is noticed.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fs::File;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use polars::prelude::{
    DataFrame, ParquetReader, ParquetWriter, PolarsError, SerReader as _, polars_bail,
};

use crate::TableRun;
use crate::tables::checked::{Checked, FileRuns};
use crate::tables::columns::{ColumnKind, columns};
use crate::tables::frames::Rows;
use crate::tables::outcomes::TableFilter;
use crate::tables::table_files::{
    LONGEST, digest_of_bytes, is_whole, named, present, tables_in, tables_of, whole,
};
use actcheck_base::{Below, Diagnostic, Diagnostics, ScratchFolder, digest_of, guarded};
use actcheck_history::History;

/// Maximum number of runs in a file, and so in memory at once.
const RUNS_IN_A_FILE: usize = 2_000;
/// Number of files of a campaign from which they are written anew as one: each look at a running
/// campaign adds a file.
const MOST_PARTS: usize = 16;
/// Maximum number of rows of a file: a run has some dozens.
const MOST_ROWS: usize = 1_000 * RUNS_IN_A_FILE;
/// File with the digest of the columns.
pub(super) const SCHEMA: &str = "SCHEMA";
/// File with the number of judgements that `recheck` had added to each campaign when its files were
/// written.
const RECHECKED: &str = "RECHECKED";

/// An up-to-date mirror of a history's store.
#[derive(Debug)]
pub struct Mirror {
    /// Where new files are written.
    folder: PathBuf,
    /// The folder of the history, or that of new files if they are elsewhere.
    below: Below,
    /// Its files, sorted by the start of the campaign, then by the time of writing.
    files: Vec<TableFile>,
    /// The runs of known files.
    checked: Checked,
    /// The lock of the folder, or the folder of new files if that of the history can't be written.
    _place: Place,
}

/// A file of a mirror.
#[derive(Debug)]
pub(super) struct TableFile {
    /// Id of its campaign.
    pub campaign: String,
    /// Its path.
    pub path: PathBuf,
    /// Number of its rows.
    pub rows: usize,
}

/// The place of a mirror's new files.
#[derive(Debug)]
enum Place {
    /// Beside the history; the folder is locked.
    Beside { _lock: File },
    /// In a temporary folder: that of the history is read-only, or another process is changing it.
    Scratch(ScratchFolder),
    /// In a folder of the caller.
    Given,
}

impl Place {
    fn find(below: &Below, folder: &Path) -> Result<Self, Diagnostics> {
        let lock = || -> std::io::Result<File> {
            below.create_folder(folder)?;
            let lock = below.open_folder(folder)?;
            lock.try_lock()?;
            // Whether files can be created there.
            drop(below.new_file(&folder.join(SCHEMA))?);
            Ok(lock)
        };
        lock()
            .map(|lock| Self::Beside { _lock: lock })
            .or_else(|_| ScratchFolder::create().map(Self::Scratch))
            .map_err(|error| unwritten(folder, &error))
    }
}

/// The changes made by an update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MirrorChange {
    /// Number of runs written.
    pub added: usize,
    /// Number of runs that were already present.
    pub kept: usize,
    /// Number of files that were damaged, and written anew.
    pub damaged: usize,
}

impl Mirror {
    /// Updates the mirror of a history: writes missing runs, and rewrites files that are damaged,
    /// hold runs that the history lacks, or are older than a recheck. If the folder of the history is
    /// read-only, missing runs are written into a temporary folder, which is removed with the
    /// returned value.
    ///
    /// The campaigns of [`History::selected_campaigns`] are left out, because their scenes were
    /// selected to fail.
    ///
    /// # Errors
    /// `A001` if it can't be written; errors of reading the history. All existing files are
    /// complete.
    pub fn update(history: &History) -> Result<(Self, MirrorChange), Diagnostics> {
        Self::updated(history, &tables_of(history), false)
    }

    /// Rebuilds the mirror of a history.
    ///
    /// # Errors
    /// As [`Mirror::update`]; `A001` if the folder of the history can't be written.
    pub fn rebuild(history: &History) -> Result<(Self, MirrorChange), Diagnostics> {
        Self::updated(history, &tables_of(history), true)
    }

    /// Returns the files of a history's mirror that are damaged or differ from the
    /// runs, sorted by name. Files of runs that the history no longer has, and from before a
    /// recheck are not compared: an update replaces them.
    ///
    /// # Errors
    /// The history can't be read.
    pub fn damage(history: &History) -> Result<Vec<PathBuf>, Diagnostics> {
        let known: BTreeSet<String> = history
            .run_ids()?
            .into_iter()
            .flat_map(|(_, runs)| runs)
            .collect();
        let (before, later) = (rechecked(&tables_of(history)), history.later_counts()?);
        let is_newest = |campaign: &String| before.get(campaign) == later.get(campaign);
        let mut damaged = Vec::new();
        for file in tables_in(&tables_of(history)) {
            let is_of_today = named(&file).is_none_or(|name| is_newest(&name.campaign));
            if is_of_today && !(is_whole(&file) && is_as_stored(history, &file, &known)?) {
                damaged.push(file);
            }
        }
        damaged.sort();
        Ok(damaged)
    }

    fn updated(
        history: &History,
        tables: &Path,
        anew: bool,
    ) -> Result<(Self, MirrorChange), Diagnostics> {
        let below = Below::new(history.dir());
        let place = Place::find(&below, tables)?;
        let (folder, below, is_beside) = match &place {
            Place::Scratch(_) if anew => {
                return Err(unwritten(
                    tables,
                    &"it is read-only, or another process writes it",
                ));
            }
            Place::Scratch(scratch) => (
                scratch.path().to_path_buf(),
                Below::new(scratch.path()),
                false,
            ),
            Place::Beside { .. } | Place::Given => (tables.to_path_buf(), below, true),
        };
        let is_current = is_current(tables);
        if is_beside && (anew || !is_current) {
            clear(&below, tables)?;
            let written = below.write_atomic(&tables.join(SCHEMA), schema_digest().as_bytes());
            written.map_err(|error| unwritten(tables, &error))?;
        }
        let mut mirror = Self {
            folder,
            below,
            files: Vec::new(),
            checked: Checked::read(tables),
            _place: place,
        };
        let state = history.state();
        let is_same = state
            .as_deref()
            .is_some_and(|state| mirror.checked.is_of(state));
        if is_same
            && is_current
            && !anew
            && mirror.has_all(tables, &history.unselected_campaigns()?)
        {
            let kept = mirror
                .files
                .iter()
                .filter_map(|file| Some(mirror.checked.get(&file.path)?.indices.len()))
                .sum();
            return Ok((
                mirror,
                MirrorChange {
                    kept,
                    ..MirrorChange::default()
                },
            ));
        }
        let mut change = MirrorChange::default();
        let mut present = if anew || !is_current {
            BTreeMap::new()
        } else {
            present(tables)
        };
        if is_beside {
            mirror.below.remove_leftovers(tables);
        }
        let (known, later) = (rechecked(tables), history.later_counts()?);
        for (campaign, runs) in history.run_ids()? {
            let mut files = present.remove(&campaign).unwrap_or_default();
            if known.get(&campaign) != later.get(&campaign) {
                files.drain(..).try_for_each(|file| mirror.remove(&file))?;
            }
            mirror.update_campaign(history, &campaign, &runs, files, &mut change)?;
        }
        present
            .into_values()
            .flatten()
            .try_for_each(|file| mirror.remove(&file))?;
        if is_beside && known != later {
            let lines: String = later
                .iter()
                .map(|(campaign, count)| format!("{campaign} {count}\n"))
                .collect();
            let file = tables.join(RECHECKED);
            mirror
                .below
                .write_atomic(&file, lines.as_bytes())
                .map_err(|error| unwritten(&file, &error))?;
        }
        if is_beside {
            let present: Vec<PathBuf> = mirror.files.iter().map(|file| file.path.clone()).collect();
            mirror.checked.set_state(state);
            // Without the list, the files are read again.
            let _ = mirror.checked.write(&mirror.below, tables, &present);
        }
        Ok((mirror, change))
    }

    /// Adds the files of a folder, unless one has changed since it was checked, was added or
    /// removed. `campaigns`: in the order of the files.
    fn has_all(&mut self, tables: &Path, campaigns: &[String]) -> bool {
        let mut there = present(tables);
        let files = campaigns.iter().flat_map(|campaign| {
            let files = there.remove(campaign).unwrap_or_default();
            files.into_iter().map(|path| {
                let rows = self.checked.get(&path)?.rows;
                Some(TableFile {
                    campaign: campaign.clone(),
                    path,
                    rows,
                })
            })
        });
        let files: Option<Vec<TableFile>> = files.collect();
        let has_all = there.is_empty()
            && files
                .as_ref()
                .is_some_and(|files| files.len() == self.checked.len() && are_whole(files));
        if has_all {
            self.files = files.unwrap_or_default();
        }
        has_all
    }

    /// Creates a mirror of runs from a source other than a history, in its own folder.
    ///
    /// # Errors
    /// `A001` if it can't be written.
    pub fn of_runs(
        folder: &Path,
        campaign: &str,
        runs: impl IntoIterator<Item = impl Into<TableRun>>,
    ) -> Result<Self, Diagnostics> {
        let below = Below::new(folder);
        below
            .create_folder(folder)
            .map_err(|error| unwritten(folder, &error))?;
        let (folder, checked) = (folder.to_path_buf(), Checked::default());
        let mut mirror = Self {
            folder,
            below,
            files: Vec::new(),
            checked,
            _place: Place::Given,
        };
        let mut runs = runs.into_iter().peekable();
        while runs.peek().is_some() {
            let mut rows = Rows::default();
            runs.by_ref()
                .take(RUNS_IN_A_FILE)
                .for_each(|run| rows.add(&run.into()));
            mirror.write(campaign, rows)?;
        }
        Ok(mirror)
    }

    /// Folder of the mirror.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Number of rows of the campaigns that a filter selects.
    pub fn rows(&self, filter: &TableFilter) -> usize {
        self.files
            .iter()
            .filter(|file| filter.takes_campaign(&file.campaign))
            .map(|file| file.rows)
            .sum()
    }

    /// Iterates over its files with their campaigns.
    pub fn paths(&self) -> impl Iterator<Item = (&str, &Path)> {
        self.files
            .iter()
            .map(|file| (file.campaign.as_str(), file.path.as_path()))
    }

    /// Its files, by campaign.
    pub(super) fn files(&self) -> &[TableFile] {
        &self.files
    }

    fn update_campaign(
        &mut self,
        history: &History,
        campaign: &str,
        runs: &[String],
        files: Vec<PathBuf>,
        change: &mut MirrorChange,
    ) -> Result<(), Diagnostics> {
        let known: HashSet<u64> = runs.iter().map(|run| index_of(run)).collect();
        let (mut there, mut kept, mut outdated) = (HashSet::new(), Vec::new(), Vec::new());
        for path in files {
            let is_known = self.checked.get(&path).is_some();
            let runs = if is_known && is_whole(&path) {
                None
            } else {
                Some(runs_of(&path))
            };
            match runs {
                Some(Ok(runs)) => self.checked.set(&path, runs),
                Some(Err(_)) => {
                    change.damaged += 1;
                    outdated.push(path);
                    continue;
                }
                None => {}
            }
            let Some(FileRuns { rows, indices }) = self.checked.get(&path) else {
                continue;
            };
            if indices
                .iter()
                .all(|index| known.contains(index) && !there.contains(index))
            {
                there.extend(indices.iter().copied());
                kept.push(TableFile {
                    campaign: campaign.to_owned(),
                    rows: *rows,
                    path,
                });
            } else {
                // From another history, or duplicate: rewrite it from the store.
                outdated.push(path);
            }
        }
        let is_fragmented =
            kept.len() >= MOST_PARTS && there.len() / kept.len() < RUNS_IN_A_FILE / 4;
        if is_fragmented && there.len() < known.len() {
            outdated.extend(kept.drain(..).map(|file| file.path));
            there.clear();
        }
        outdated.iter().try_for_each(|file| self.remove(file))?;
        self.files.append(&mut kept);
        change.kept += there.len();
        let mut missing: Vec<&String> = runs
            .iter()
            .filter(|run| !there.contains(&index_of(run)))
            .collect();
        missing.sort_by_key(|run| index_of(run));
        for runs in missing.chunks(RUNS_IN_A_FILE) {
            let mut rows = Rows::default();
            for run in table_runs(history, runs) {
                rows.add(&run?);
            }
            let height = rows.height();
            let path = self.write(campaign, rows)?;
            let indices = runs.iter().map(|run| index_of(run)).collect();
            self.checked.set(
                &path,
                FileRuns {
                    rows: height,
                    indices,
                },
            );
            change.added += runs.len();
        }
        Ok(())
    }

    /// Removes a file of the history's mirror, if this process may change it.
    fn remove(&self, file: &Path) -> Result<(), Diagnostics> {
        if file.parent() != Some(self.folder.as_path()) {
            return Ok(());
        }
        self.below
            .remove(file)
            .map_err(|error| unwritten(file, &error))
    }

    /// Writes the rows of some runs to a new file atomically, and adds it.
    fn write(&mut self, campaign: &str, rows: Rows) -> Result<PathBuf, Diagnostics> {
        let number_of = |file: &TableFile| named(&file.path).map(|name| name.number);
        let last = self
            .files
            .iter()
            .filter(|file| file.campaign == campaign)
            .filter_map(number_of)
            .max();
        let number = last.map_or(0, |last| last + 1);
        let height = rows.height();
        let written = || -> Result<PathBuf, PolarsError> {
            let (mut frame, mut bytes) = (rows.frame()?, Cursor::new(Vec::new()));
            ParquetWriter::new(&mut bytes).finish(&mut frame)?;
            let bytes = bytes.into_inner();
            let file = self.folder.join(format!(
                "{campaign}.{number:06}.{}.parquet",
                digest_of_bytes(&bytes)
            ));
            self.below.write_atomic(&file, &bytes)?;
            Ok(file)
        };
        let path = written().map_err(|error| unwritten(&self.folder, &error))?;
        self.files.push(TableFile {
            campaign: campaign.to_owned(),
            path: path.clone(),
            rows: height,
        });
        Ok(path)
    }
}

/// The position of a run in its campaign, from its id. Ids of another form get a number that no
/// position has.
fn index_of(run: &str) -> u64 {
    let number = run
        .rsplit_once('-')
        .and_then(|(_, number)| number.parse::<u64>().ok()?.checked_sub(1));
    number.unwrap_or_else(|| {
        let digest = digest_of(run);
        u64::from_str_radix(digest.get(..15).unwrap_or_default(), 16).unwrap_or_default()
            | (1 << 63)
    })
}

/// Whether a whole file has the rows that its runs have now.
fn is_as_stored(
    history: &History,
    file: &Path,
    known: &BTreeSet<String>,
) -> Result<bool, Diagnostics> {
    let Ok(runs) = ids_of(file) else {
        return Ok(false);
    };
    if !runs.iter().all(|run| known.contains(run)) {
        return Ok(true);
    }
    let mut rows = Rows::default();
    for run in &runs {
        // Without its trace, a run's noise and effects can't be compared.
        let Ok((choices, trace)) = history.traces().recorded(run) else {
            return Ok(true);
        };
        rows.add(&TableRun::new(history.newest_run(run)?, &choices, &trace));
    }
    Ok(rows
        .frame()
        .is_ok_and(|frame| read(file, None).is_ok_and(|there| there.equals_missing(&frame))))
}

/// Reads the number of later judgements of each campaign from the time when the files were written.
fn rechecked(tables: &Path) -> BTreeMap<String, u64> {
    let text = Below::new(tables)
        .read_text(&tables.join(RECHECKED), LONGEST)
        .unwrap_or_default();
    let line = |line: &str| {
        line.split_once(' ')
            .and_then(|(id, count)| Some((id.to_owned(), count.parse().ok()?)))
    };
    text.lines().filter_map(line).collect()
}

/// Reads runs on all cores.
fn table_runs(history: &History, runs: &[&String]) -> Vec<Result<TableRun, Diagnostics>> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let share = runs.len().div_ceil(cores).max(1);
    std::thread::scope(|scope| {
        let read = |runs: &'_ [&String]| {
            runs.iter()
                .map(|run| table_run(history, run))
                .collect::<Vec<_>>()
        };
        let shares: Vec<_> = runs
            .chunks(share)
            .map(|runs| scope.spawn(move || read(runs)))
            .collect();
        let joined = shares.into_iter().map(|share| {
            share
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        joined.flatten().collect()
    })
}

/// Reads a run.
fn table_run(history: &History, run: &str) -> Result<TableRun, Diagnostics> {
    let (choices, trace) = history.traces().recorded(run)?;
    Ok(TableRun::new(history.newest_run(run)?, &choices, &trace))
}

/// Whether all files have the digests that their names say.
fn are_whole(files: &[TableFile]) -> bool {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let check = |files: &'_ [TableFile]| files.iter().all(|file| is_whole(&file.path));
        let shares = files.chunks(files.len().div_ceil(cores).max(1));
        let shares: Vec<_> = shares
            .map(|files| scope.spawn(move || check(files)))
            .collect();
        // All are joined; a thread that panics has found no whole file.
        let whole: Vec<bool> = shares
            .into_iter()
            .map(|share| share.join().unwrap_or(false))
            .collect();
        whole.into_iter().all(|whole| whole)
    })
}

/// Reads the wanted columns of a file, or all of them.
pub(super) fn read(file: &Path, wanted: Option<&[&str]>) -> Result<DataFrame, PolarsError> {
    let wanted: Option<Vec<String>> =
        wanted.map(|names| names.iter().map(|name| (*name).to_owned()).collect());
    let bytes = whole(file)?;
    // The digest in the name of a file that another program wrote fits any content.
    let read = guarded(|| {
        let mut reader = ParquetReader::new(Cursor::new(bytes)).with_columns(wanted);
        if reader.num_rows()? > MOST_ROWS {
            polars_bail!(ComputeError: "it has more rows than any table of this program");
        }
        reader.finish()
    });
    read.unwrap_or_else(|| polars_bail!(ComputeError: "its content is damaged"))
}

/// Creates the diagnostic for an unreadable file of a mirror.
pub(super) fn unread(file: &Path, error: &PolarsError) -> Diagnostics {
    Diagnostic::error(
        "A002",
        format!(
            "the table `{}` can't be read: {}",
            file.display(),
            plain(error)
        ),
    )
    .help("delete the folder `tables` in the history: the same command makes it anew")
    .into()
}

/// Creates the diagnostic for a table that can't be written.
pub(crate) fn unwritten(file: &Path, error: &impl ToString) -> Diagnostics {
    Diagnostic::error(
        "A001",
        format!(
            "the table `{}` can't be written: {}",
            file.display(),
            plain(error)
        ),
    )
    .help("check the folder's permissions and the free disk space")
    .into()
}

fn plain(error: &impl ToString) -> String {
    error.to_string().to_lowercase()
}

/// The runs of a file, in its order.
pub(super) fn runs_of(file: &Path) -> Result<FileRuns, PolarsError> {
    let frame = read(file, Some(&["run"]))?;
    let mut indices: Vec<u64> = Vec::new();
    for run in frame.column("run")?.str()?.iter().flatten() {
        let index = index_of(run);
        // The rows of a run are adjacent.
        if indices.last() != Some(&index) {
            indices.push(index);
        }
    }
    Ok(FileRuns {
        rows: frame.height(),
        indices,
    })
}

/// The ids of the runs of a file, in its order.
fn ids_of(file: &Path) -> Result<Vec<String>, PolarsError> {
    let frame = read(file, Some(&["run"]))?;
    let mut runs: Vec<String> = Vec::new();
    for run in frame.column("run")?.str()?.iter().flatten() {
        // The rows of a run are adjacent.
        if runs.last().is_none_or(|last| last != run) {
            runs.push(run.to_owned());
        }
    }
    Ok(runs)
}

/// Name of a kind in the digest. A new name would make all existing tables outdated.
fn kind(kind: ColumnKind) -> &'static str {
    match kind {
        ColumnKind::Text => "Text",
        ColumnKind::Number => "Number",
        ColumnKind::Count => "Count",
        ColumnKind::Bool => "Truth",
        ColumnKind::Image => "Binary",
    }
}

/// Whether the files in the folder of a mirror have the columns of this version.
pub(super) fn is_current(tables: &Path) -> bool {
    Below::new(tables)
        .read_text(&tables.join(SCHEMA), LONGEST)
        .is_ok_and(|text| text == schema_digest())
}

/// Digest of the columns, to detect tables written by versions with different columns.
pub(super) fn schema_digest() -> String {
    let definitions: Vec<String> = columns()
        .iter()
        .map(|column| {
            format!(
                "{} {} {}",
                column.name,
                kind(column.kind),
                column.description
            )
        })
        .collect();
    digest_of(&definitions.join("\n"))
}

/// Removes all files of a mirror.
fn clear(below: &Below, folder: &Path) -> Result<(), Diagnostics> {
    below.remove_leftovers(folder);
    tables_in(folder)
        .iter()
        .try_for_each(|path| below.remove(path).map_err(|error| unwritten(path, &error)))
}
