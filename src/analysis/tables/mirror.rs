//! The table beside a history, stored as several Parquet files.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use polars::prelude::{DataFrame, ParquetReader, ParquetWriter, PolarsError, SerReader as _};

use crate::TableRun;
use crate::tables::columns::{ColumnKind, columns};
use crate::tables::frames::Rows;
use actcheck_base::{Diagnostic, Diagnostics, digest_of};
use actcheck_history::History;

/// Maximum number of runs in a file, and so in memory at once.
const RUNS_IN_A_FILE: usize = 2_000;
/// File with the digest of the columns.
const SCHEMA: &str = "SCHEMA";

/// An up-to-date mirror of a history's store.
#[derive(Debug)]
pub struct Mirror {
    folder: PathBuf,
    /// Its files, sorted by the start of the campaign, then by the time of writing.
    files: Vec<(String, PathBuf)>,
}

/// The changes made by an update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MirrorChange {
    /// Number of runs written.
    pub added: usize,
    /// Number of runs that were already present.
    pub kept: usize,
}

impl Mirror {
    /// Updates the mirror of a history: writes missing runs, and rewrites files that can't be read or hold runs that
    /// the store lacks.
    ///
    /// The campaigns of [`History::selected_campaigns`] are left out, because their scenes were selected to fail.
    ///
    /// # Errors
    /// `A001` if it can't be written; errors of reading the history. All existing files are complete.
    pub fn update(history: &History) -> Result<(Self, MirrorChange), Diagnostics> {
        let folder = history.dir().join("tables");
        fs::create_dir_all(&folder).map_err(|error| unwritten(&folder, &error))?;
        let digest = schema_digest();
        if fs::read_to_string(folder.join(SCHEMA)).ok().as_deref() != Some(digest.as_str()) {
            clear(&folder)?;
            fs::write(folder.join(SCHEMA), digest).map_err(|error| unwritten(&folder, &error))?;
        }
        let mut mirror = Self { folder, files: Vec::new() };
        let mut change = MirrorChange::default();
        let mut present = mirror.present()?;
        for (campaign, runs) in history.run_ids()? {
            let files = present.remove(&campaign).unwrap_or_default();
            mirror.update_campaign(history, &campaign, &runs, files, &mut change)?;
        }
        for file in present.into_values().flatten() {
            fs::remove_file(&file).map_err(|error| unwritten(&file, &error))?;
        }
        Ok((mirror, change))
    }

    /// Rebuilds the mirror of a history.
    ///
    /// # Errors
    /// As [`Mirror::update`].
    pub fn rebuild(history: &History) -> Result<(Self, MirrorChange), Diagnostics> {
        let folder = history.dir().join("tables");
        if folder.is_dir() {
            clear(&folder)?;
        }
        Self::update(history)
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
        fs::create_dir_all(folder).map_err(|error| unwritten(folder, &error))?;
        let mut mirror = Self { folder: folder.to_path_buf(), files: Vec::new() };
        let mut runs = runs.into_iter().peekable();
        while runs.peek().is_some() {
            let mut rows = Rows::default();
            runs.by_ref().take(RUNS_IN_A_FILE).for_each(|run| rows.add(&run.into()));
            let file = mirror.write(campaign, rows)?;
            mirror.files.push((campaign.to_owned(), file));
        }
        Ok(mirror)
    }

    /// Folder of the mirror.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Iterates over its files with their campaigns.
    pub(super) fn files(&self) -> impl Iterator<Item = (&str, &Path)> {
        self.files.iter().map(|(campaign, file)| (campaign.as_str(), file.as_path()))
    }

    /// Returns the files by campaign, in the order of writing. Removes partial files of killed processes.
    fn present(&self) -> Result<BTreeMap<String, Vec<PathBuf>>, Diagnostics> {
        let mut found: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        let entries = fs::read_dir(&self.folder).map_err(|error| unwritten(&self.folder, &error))?;
        for path in entries.filter_map(Result::ok).map(|entry| entry.path()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if let Some((campaign, _)) = name.strip_suffix(".parquet").and_then(|stem| stem.rsplit_once('.')) {
                found.entry(campaign.to_owned()).or_default().push(path);
            } else if name.ends_with(".tmp") {
                // A failure is harmless.
                let _ = fs::remove_file(&path);
            }
        }
        found.values_mut().for_each(|files| files.sort());
        Ok(found)
    }

    fn update_campaign(
        &mut self,
        history: &History,
        campaign: &str,
        runs: &[String],
        files: Vec<PathBuf>,
        change: &mut MirrorChange,
    ) -> Result<(), Diagnostics> {
        let known: BTreeSet<&String> = runs.iter().collect();
        let mut there = BTreeSet::new();
        for file in files {
            match runs_of(&file) {
                Ok(runs) if runs.iter().all(|run| known.contains(run)) && there.is_disjoint(&runs) => {
                    there.extend(runs);
                    self.files.push((campaign.to_owned(), file));
                }
                // From another history, duplicate, or corrupt: rewrite it from the store.
                _ => fs::remove_file(&file).map_err(|error| unwritten(&file, &error))?,
            }
        }
        change.kept += there.len();
        let missing: Vec<&String> = runs.iter().filter(|run| !there.contains(*run)).collect();
        for runs in missing.chunks(RUNS_IN_A_FILE) {
            let mut rows = Rows::default();
            for run in runs {
                rows.add(&table_run(history, run)?);
            }
            let file = self.write(campaign, rows)?;
            self.files.push((campaign.to_owned(), file));
            change.added += runs.len();
        }
        Ok(())
    }

    /// Writes rows to a new file atomically.
    fn write(&self, campaign: &str, rows: Rows) -> Result<PathBuf, Diagnostics> {
        let taken = |number: &usize| self.files.iter().any(|(_, file)| *file == self.file(campaign, *number));
        let number = (0..).find(|number| !taken(number)).unwrap_or_default();
        let file = self.file(campaign, number);
        let temporary = file.with_extension("tmp");
        let written = || -> Result<(), PolarsError> {
            let mut frame = rows.frame()?;
            ParquetWriter::new(File::create(&temporary)?).finish(&mut frame)?;
            Ok(fs::rename(&temporary, &file)?)
        };
        written().map_err(|error| unwritten(&file, &error))?;
        Ok(file)
    }

    fn file(&self, campaign: &str, number: usize) -> PathBuf {
        self.folder.join(format!("{campaign}.{number:06}.parquet"))
    }
}

/// Reads a run. Noise and effects are unknown if its trace is missing, damaged, or of an unknown version.
fn table_run(history: &History, run: &str) -> Result<TableRun, Diagnostics> {
    let detail = history.run(run)?;
    Ok(match history.recorded(run) {
        Ok((choices, trace)) => TableRun::new(detail, &choices, &trace),
        Err(_) => detail.into(),
    })
}

/// Reads the wanted columns of a file, or all of them.
pub(super) fn read(file: &Path, wanted: Option<&[&str]>) -> Result<DataFrame, PolarsError> {
    let wanted = wanted.map(|names| names.iter().map(|name| (*name).to_owned()).collect());
    ParquetReader::new(File::open(file)?).with_columns(wanted).finish()
}

/// Creates the diagnostic for an unreadable file of a mirror.
pub(super) fn unread(file: &Path, error: &PolarsError) -> Diagnostics {
    Diagnostic::error("A002", format!("the table `{}` can't be read: {}", file.display(), plain(error)))
        .help("rebuild it with `actcheck export --rebuild-mirror`")
        .into()
}

/// Creates the diagnostic for a table that can't be written.
pub(crate) fn unwritten(file: &Path, error: &impl ToString) -> Diagnostics {
    Diagnostic::error("A001", format!("the table `{}` can't be written: {}", file.display(), plain(error)))
        .help("check the folder's permissions and the free disk space")
        .into()
}

fn plain(error: &impl ToString) -> String {
    error.to_string().to_lowercase()
}

fn runs_of(file: &Path) -> Result<BTreeSet<String>, PolarsError> {
    let frame = read(file, Some(&["run"]))?;
    let runs = frame.column("run")?.str()?.iter().flatten().map(str::to_owned).collect();
    Ok(runs)
}

/// Name of a kind in the digest. A new name would make all existing tables outdated.
fn kind(kind: ColumnKind) -> &'static str {
    match kind {
        ColumnKind::Text => "Text",
        ColumnKind::Number => "Number",
        ColumnKind::Count => "Count",
        ColumnKind::Bool => "Truth",
    }
}

/// Digest of the columns, to detect tables written by versions with different columns.
fn schema_digest() -> String {
    let definitions: Vec<String> = columns()
        .iter()
        .map(|column| format!("{} {} {}", column.name, kind(column.kind), column.description))
        .collect();
    digest_of(&definitions.join("\n"))
}

/// Removes all files of a mirror.
fn clear(folder: &Path) -> Result<(), Diagnostics> {
    for path in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path()) {
        if path.extension().is_some_and(|ending| ending == "parquet" || ending == "tmp") {
            fs::remove_file(&path).map_err(|error| unwritten(&path, &error))?;
        }
    }
    Ok(())
}
