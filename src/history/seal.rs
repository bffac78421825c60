//! Checksums of the files of a store, written when a process closes it.
//!
//! `seal/SUMS` lists each file with its size and checksum; beside it are copies of the two small
//! files without which a store can't be opened. The library checks blocks only when it reads them,
//! and a query over a damaged block may never end; a seal finds the damage before.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, ErrorKind, Read as _};
use std::path::Path;

use flate2::Crc;

use crate::folder::{self, Folder};
use crate::threads::filtered;

const TITLE: &str = "actcheck seal 1";
/// Name of the list.
const SUMS: &str = "SUMS";
/// File that names the current manifest.
pub(super) const CURRENT: &str = "CURRENT";
/// First part of the name of a manifest, which lists the tables and is only appended to.
const MANIFEST: &str = "MANIFEST-";
/// Size of the pieces in which files are read. Unit: bytes.
const PIECE: usize = 1 << 17;

/// Size and checksum of a file. Unit: bytes.
type Sum = (u64, u32);

/// The checksums of a store's files.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Seal {
    sums: BTreeMap<String, Sum>,
}

/// The state of a list of checksums.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// It is complete.
    Whole(Seal),
    /// There is none: the history's first process was killed, or the file is lost.
    Missing,
    /// The list itself is damaged.
    Damaged,
}

impl Seal {
    /// Reads the seal of a folder.
    pub(super) fn read(folder: &Folder) -> Found {
        let text = match folder::read(&folder.seal().join(SUMS)) {
            Ok(bytes) => String::from_utf8(bytes).unwrap_or_default(),
            Err(error) if error.kind() == ErrorKind::NotFound => return Found::Missing,
            Err(_) => return Found::Damaged,
        };
        parsed(&text).map_or(Found::Damaged, |sums| Found::Whole(Self { sums }))
    }

    /// Writes the seal of a store that is closed. Checksums of tables that an earlier seal lists
    /// are kept: tables never change.
    pub(super) fn write(folder: &Folder) -> io::Result<()> {
        let earlier = match Self::read(folder) {
            Found::Whole(seal) => seal.sums,
            Found::Missing | Found::Damaged => BTreeMap::new(),
        };
        let mut sums = BTreeMap::new();
        let below = folder.below();
        for file in below.files(&folder.store()) {
            let Some(name) = name_of(&file).filter(|name| is_sealed(name)) else {
                continue;
            };
            let known = earlier.get(name).filter(|_| name.ends_with(".sst"));
            let sum = known
                .copied()
                .map_or_else(|| sum_of(&mut below.open(&file)?, u64::MAX), Ok)?;
            sums.insert(name.to_owned(), sum);
        }
        below.create_folder(&folder.seal())?;
        let current = folder::read(&folder.store().join(CURRENT))?;
        let manifest = manifest_of(&current)
            .ok_or(ErrorKind::InvalidData)?
            .to_owned();
        below.write_atomic(
            &folder.seal().join(&manifest),
            &folder::read(&folder.store().join(&manifest))?,
        )?;
        below.write_atomic(&folder.seal().join(CURRENT), &current)?;
        below.write_atomic(&folder.seal().join(SUMS), listed(&sums).as_bytes())?;
        for file in below.files(&folder.seal()) {
            // The copy of an older manifest; harmless if it remains. Files of others are left
            // alone.
            if name_of(&file).is_some_and(|name| name != manifest && is_manifest(name)) {
                let _ = below.remove(&file);
            }
        }
        below.remove_leftovers(&folder.seal());
        Ok(())
    }

    /// Whether a file of the store differs from its checksum. Returns `None` if the seal does not
    /// list it.
    ///
    /// [`CURRENT`] is replaced whenever a store is opened: see [`Seal::is_wrong_current`].
    pub(super) fn is_damaged(&self, name: &str, file: &mut File) -> Option<io::Result<bool>> {
        let (size, sum) = self.sums.get(name).filter(|_| name != CURRENT)?;
        Some(sum_of(file, *size).map(|found| found != (*size, *sum)))
    }

    /// Whether the content of `CURRENT` can't come from this store: it names no manifest, or an
    /// earlier one.
    pub(super) fn is_wrong_current(&self, content: &[u8]) -> bool {
        let number = |name: &str| {
            name.strip_prefix(MANIFEST)
                .and_then(|number| number.parse::<u64>().ok())
        };
        let sealed = self.sums.keys().filter_map(|name| number(name)).max();
        manifest_of(content)
            .and_then(number)
            .is_none_or(|number| sealed.is_some_and(|sealed| number < sealed))
    }

    /// Returns the names of the files of a folder's store that differ from their checksums. Files
    /// that no longer exist are left out: a later process may have merged them into others. `most`
    /// is the largest size of a store whose tables are compared. Unit: bytes. `threads` is the
    /// number of threads that compare them.
    pub(super) fn damage(&self, folder: &Folder, most: u64, threads: usize) -> Vec<String> {
        let with_tables = self.size() <= most;
        let is_wrong = |name: &str| {
            let path = folder.store().join(name);
            match name {
                CURRENT => {
                    folder::read(&path).map_or(true, |content| self.is_wrong_current(&content))
                }
                _ if name.ends_with(".sst") && !with_tables => false,
                _ => match folder::open(&path) {
                    Ok(mut file) => {
                        !matches!(self.is_damaged(name, &mut file), None | Some(Ok(false)))
                    }
                    Err(error) => error.kind() != ErrorKind::NotFound,
                },
            }
        };
        // A core needs nearly a tenth of a second for a gigabyte.
        let names: Vec<&String> = self.sums.keys().collect();
        filtered(threads, &names, |name| is_wrong(name))
            .into_iter()
            .map(|name| (*name).clone())
            .collect()
    }

    /// Returns the names of the copies beside the list that differ from the originals.
    pub(super) fn damaged_copies(&self, folder: &Folder) -> Vec<String> {
        let is_copied = |name: &str| name == CURRENT || name.starts_with(MANIFEST);
        let is_wrong = |name: &str, sum: &Sum| {
            let found = folder::open(&folder.seal().join(name))
                .and_then(|mut file| sum_of(&mut file, u64::MAX));
            // An older manifest has no copy any more.
            found.map_or_else(
                |error| error.kind() != ErrorKind::NotFound,
                |found| found != *sum,
            )
        };
        let copies = self.sums.iter().filter(|(name, _)| is_copied(name));
        copies
            .filter(|(name, sum)| is_wrong(name, sum))
            .map(|(name, _)| name.clone())
            .collect()
    }

    /// The number of tables of a folder's store that the seal does not list: those of a killed
    /// process.
    pub(super) fn unlisted(&self, folder: &Folder) -> usize {
        let files = folder.below().files(&folder.store());
        let names = files.iter().filter_map(|file| name_of(file));
        names
            .filter(|name| name.ends_with(".sst") && !self.sums.contains_key(*name))
            .count()
    }

    /// Total size of the listed files. Unit: bytes.
    pub(super) fn size(&self) -> u64 {
        self.sums.values().map(|(size, _)| size).sum()
    }
}

/// The manifest that the content of `CURRENT` names. Returns `None` if it names none.
pub(super) fn manifest_of(current: &[u8]) -> Option<&str> {
    let name = std::str::from_utf8(current).ok()?.strip_suffix('\n')?;
    is_manifest(name).then_some(name)
}

fn is_manifest(name: &str) -> bool {
    let number = name.strip_prefix(MANIFEST);
    number.is_some_and(|number| {
        !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
    })
}

fn name_of(file: &Path) -> Option<&str> {
    file.file_name()?.to_str()
}

/// Whether damage to a file of a store matters: tables, logs and manifests, and which manifest is
/// current.
fn is_sealed(name: &str) -> bool {
    name == CURRENT
        || name.starts_with(MANIFEST)
        || name.ends_with(".sst")
        || name.ends_with(".log")
}

/// Size and checksum of a file's first `most` bytes.
fn sum_of(file: &mut File, most: u64) -> io::Result<Sum> {
    let (mut crc, mut piece, mut left) = (Crc::new(), vec![0; PIECE], most);
    while left > 0 {
        let room = usize::try_from(left).map_or(PIECE, |left| left.min(PIECE));
        let length = file.read(&mut piece[..room])?;
        if length == 0 {
            break;
        }
        crc.update(&piece[..length]);
        left -= length as u64;
    }
    Ok((most - left, crc.sum()))
}

fn listed(sums: &BTreeMap<String, Sum>) -> String {
    let lines: String = sums
        .iter()
        .map(|(name, (size, sum))| format!("{sum:08x} {size} {name}\n"))
        .collect();
    let text = format!("{TITLE}\n{lines}");
    format!("{text}{:08x}\n", sum_of_text(&text))
}

/// Parses a list. Returns `None` if it is damaged.
fn parsed(text: &str) -> Option<BTreeMap<String, Sum>> {
    let (body, sum) = text.strip_suffix('\n')?.rsplit_once('\n')?;
    let body = format!("{body}\n");
    if format!("{:08x}", sum_of_text(&body)) != sum {
        return None;
    }
    let mut lines = body.lines();
    lines.next().filter(|title| *title == TITLE)?;
    lines
        .map(|line| {
            let mut words = line.splitn(3, ' ');
            let sum = u32::from_str_radix(words.next()?, 16).ok()?;
            let size = words.next()?.parse().ok()?;
            Some((words.next()?.to_owned(), (size, sum)))
        })
        .collect()
}

fn sum_of_text(text: &str) -> u32 {
    let mut crc = Crc::new();
    crc.update(text.as_bytes());
    crc.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flipped_bit_of_a_list_is_noticed() {
        let sums = BTreeMap::from([
            ("000012.sst".to_owned(), (4096, 0x00ab_cdef)),
            (CURRENT.to_owned(), (16, 7)),
        ]);
        let text = listed(&sums);
        assert_eq!(parsed(&text), Some(sums));
        for at in 0..text.len() {
            for bit in 0..8 {
                let mut bytes = text.clone().into_bytes();
                bytes[at] ^= 1 << bit;
                let found = String::from_utf8(bytes).ok().and_then(|text| parsed(&text));
                assert!(found.is_none(), "bit {bit} of byte {at}");
            }
        }
    }

    #[test]
    fn the_current_manifest_is_named_by_a_number() {
        assert_eq!(manifest_of(b"MANIFEST-002348\n"), Some("MANIFEST-002348"));
        for wrong in [
            "MANIFEST-",
            "MANIFEST-1",
            "MANIFEST-x\n",
            "NANIFEST-1\n",
            "",
        ] {
            assert_eq!(manifest_of(wrong.as_bytes()), None, "{wrong}");
        }
        let seal = Seal {
            sums: BTreeMap::from([("MANIFEST-000010".to_owned(), (1, 1))]),
        };
        assert!(
            !seal.is_wrong_current(b"MANIFEST-000010\n")
                && !seal.is_wrong_current(b"MANIFEST-000012\n")
        );
        assert!(
            seal.is_wrong_current(b"MANIFEST-000008\n")
                && seal.is_wrong_current(b"MANIFEST-00001\x11\n")
        );
    }
}
