//! The files of a mirror: their names, with the digests by which damage is noticed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use actcheck_base::{Below, Digest};
use actcheck_history::History;

/// The folder of a history's mirror.
pub(super) fn tables_of(history: &History) -> PathBuf {
    history.dir().join("tables")
}

/// The parts of a file's name.
pub(super) struct TableName {
    pub campaign: String,
    pub number: usize,
    pub digest: String,
}

pub(super) fn named(file: &Path) -> Option<TableName> {
    let stem = file.file_name()?.to_str()?.strip_suffix(".parquet")?;
    let (rest, digest) = stem.rsplit_once('.')?;
    let (campaign, number) = rest.rsplit_once('.')?;
    Some(TableName {
        campaign: campaign.to_owned(),
        number: number.parse().ok()?,
        digest: digest.to_owned(),
    })
}

/// Longest file of a mirror: those of this program have some megabytes. Unit: bytes.
pub(super) const LONGEST: u64 = 256 << 20;

/// Reads a file that has the digest that its name says. The table library may panic on any other.
pub(super) fn whole(file: &Path) -> std::io::Result<Vec<u8>> {
    let bytes = Below::new(file.parent().unwrap_or(file)).read(file, LONGEST)?;
    if named(file).is_some_and(|name| digest_of_bytes(&bytes) == name.digest) {
        return Ok(bytes);
    }
    Err(std::io::Error::other("it has changed since it was written"))
}

/// Whether a file has the digest that its name says.
pub(super) fn is_whole(file: &Path) -> bool {
    whole(file).is_ok()
}

pub(super) fn digest_of_bytes(bytes: &[u8]) -> String {
    let mut digest = Digest::new();
    digest.update(bytes);
    digest.finish()
}

/// The regular files in the folder of a mirror that have the name of a table. Others are left
/// alone.
pub(super) fn tables_in(folder: &Path) -> Vec<PathBuf> {
    Below::new(folder)
        .files(folder)
        .into_iter()
        .filter(|file| named(file).is_some())
        .collect()
}

/// Returns the files by campaign, in the order of writing.
pub(super) fn present(tables: &Path) -> BTreeMap<String, Vec<PathBuf>> {
    let mut found: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in tables_in(tables) {
        if let Some(name) = named(&path) {
            found.entry(name.campaign).or_default().push(path);
        }
    }
    found.values_mut().for_each(|files| files.sort());
    found
}
