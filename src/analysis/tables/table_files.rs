//! The files of a mirror: their names, with the digests by which damage is noticed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use actcheck_base::Digest;
use actcheck_history::History;

/// The folder of a history's mirror.
pub(super) fn tables_of(history: &History) -> PathBuf {
    history.dir().join("tables")
}

/// The parts of a file's name.
pub(super) struct TableName {
    pub campaign: String,
    pub number: usize,
    /// `None` in names of earlier versions.
    pub digest: Option<String>,
}

pub(super) fn named(file: &Path) -> Option<TableName> {
    let stem = file.file_name()?.to_str()?.strip_suffix(".parquet")?;
    let (rest, last) = stem.rsplit_once('.')?;
    let of_today = rest.rsplit_once('.').and_then(|(campaign, number)| {
        Some(TableName { campaign: campaign.to_owned(), number: number.parse().ok()?, digest: Some(last.to_owned()) })
    });
    of_today.or_else(|| Some(TableName { campaign: rest.to_owned(), number: last.parse().ok()?, digest: None }))
}

/// Whether a file has the digest that its name says.
pub(super) fn is_whole(file: &Path) -> bool {
    let digest = named(file).and_then(|name| name.digest);
    digest.is_some_and(|digest| fs::read(file).is_ok_and(|bytes| digest_of_bytes(&bytes) == digest))
}

pub(super) fn digest_of_bytes(bytes: &[u8]) -> String {
    let mut digest = Digest::new();
    digest.update(bytes);
    digest.finish()
}

pub(super) fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect()
}

pub(super) fn is_table(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "parquet")
}

/// Returns the files by campaign, in the order of writing. Removes partial files of killed processes, if this process
/// may change the folder.
pub(super) fn present(tables: &Path, may_change: bool) -> BTreeMap<String, Vec<PathBuf>> {
    let mut found: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in entries(tables) {
        if let Some(name) = named(&path) {
            found.entry(name.campaign).or_default().push(path);
        } else if is_table(&path) {
            // Its name is damaged.
            found.entry(String::new()).or_default().push(path);
        } else if may_change && path.extension().is_some_and(|ending| ending == "tmp") {
            // A failure is harmless.
            let _ = fs::remove_file(&path);
        }
    }
    found.values_mut().for_each(|files| files.sort());
    found
}
