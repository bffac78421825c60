//! The runs of each file of a mirror, so that files that have not changed since need not be read to
//! know them.
//!
//! The file `FILES` has a line for each: name, size, time of the last change, number of rows, and
//! the indices of its runs as `first+step*count`, joined by commas. A line `state` has the state of
//! the history whose runs the files have, and the last one a digest of the list.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use crate::tables::table_files::LONGEST;
use actcheck_base::{Below, digest_of};

const NAME: &str = "FILES";
/// Begins the line with the state of the history.
const STATE: &str = "state ";
/// Begins the last line, with the digest of the others.
const SUM: &str = "digest ";

/// The runs of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FileRuns {
    /// Number of rows.
    pub rows: usize,
    /// Positions of its runs in their campaign, in the order of the file.
    pub indices: Vec<u64>,
}

/// The known files of a folder.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Checked {
    files: BTreeMap<String, (Stamp, FileRuns)>,
    /// The state of the history of which the files have all runs.
    state: Option<String>,
    changed: bool,
}

/// Size and time of the last change of a file. Units: bytes, nanoseconds since 1970.
type Stamp = (u64, u128);

impl Checked {
    /// Reads the list of a folder. It is empty if it is missing or damaged.
    pub fn read(folder: &Path) -> Self {
        let text = Below::new(folder)
            .read_text(&folder.join(NAME), LONGEST)
            .unwrap_or_default();
        let text = text
            .rsplit_once(SUM)
            .filter(|(text, sum)| digest_of(text) == sum.trim_end())
            .map_or("", |(text, _)| text);
        let state = text
            .lines()
            .find_map(|line| line.strip_prefix(STATE))
            .map(str::to_owned);
        Self {
            files: text.lines().filter_map(line).collect(),
            state,
            changed: false,
        }
    }

    /// Whether the files have all runs that a history has in this state.
    pub fn is_of(&self, state: &str) -> bool {
        self.state.as_deref() == Some(state)
    }

    /// Sets the state of the history of which the files have all runs.
    pub fn set_state(&mut self, state: Option<String>) {
        self.changed |= self.state != state;
        self.state = state;
    }

    /// Number of the known files.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// The runs of a file. Returns `None` if it is unknown or has changed.
    pub fn get(&self, file: &Path) -> Option<&FileRuns> {
        let (stamp, runs) = self.files.get(name_of(file)?)?;
        (stamp_of(file).ok()? == *stamp).then_some(runs)
    }

    /// Sets the runs of a file.
    pub fn set(&mut self, file: &Path, runs: FileRuns) {
        if let (Some(name), Ok(stamp)) = (name_of(file), stamp_of(file)) {
            self.files.insert(name.to_owned(), (stamp, runs));
            self.changed = true;
        }
    }

    /// Writes the list, without files that no longer exist, if it has changed.
    ///
    /// # Errors
    /// The file can't be written; the list was only a shortcut.
    pub fn write(&mut self, below: &Below, folder: &Path, present: &[PathBuf]) -> io::Result<()> {
        let present: HashSet<&str> = present.iter().filter_map(|file| name_of(file)).collect();
        let before = self.files.len();
        self.files.retain(|name, _| present.contains(name.as_str()));
        if !self.changed && self.files.len() == before {
            return Ok(());
        }
        let mut text: String = self
            .files
            .iter()
            .map(|(name, (stamp, runs))| text_of(name, *stamp, runs))
            .collect();
        if let Some(state) = &self.state {
            text.push_str(&format!("{STATE}{state}\n"));
        }
        let sum = digest_of(&text);
        self.changed = false;
        below.write_quickly(&folder.join(NAME), format!("{text}{SUM}{sum}\n").as_bytes())
    }
}

fn name_of(file: &Path) -> Option<&str> {
    file.file_name()?.to_str()
}

fn stamp_of(file: &Path) -> io::Result<Stamp> {
    let metadata = fs::metadata(file)?;
    let modified = metadata
        .modified()?
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos());
    Ok((metadata.len(), modified))
}

fn text_of(name: &str, (size, modified): Stamp, runs: &FileRuns) -> String {
    let mut text = format!("{name} {size} {modified} {} ", runs.rows);
    let mut rest = runs.indices.as_slice();
    while let [first, ..] = rest {
        let step = rest
            .get(1)
            .and_then(|second| second.checked_sub(*first))
            .unwrap_or(0);
        let continues = |pair: &&[u64]| pair[1].checked_sub(pair[0]) == Some(step);
        let count = if step == 0 {
            1
        } else {
            1 + rest.windows(2).take_while(continues).count()
        };
        if rest.len() < runs.indices.len() {
            text.push(',');
        }
        text.push_str(&format!("{first}+{step}*{count}"));
        rest = &rest[count..];
    }
    text.push('\n');
    text
}

fn line(line: &str) -> Option<(String, (Stamp, FileRuns))> {
    let mut words = line.split(' ');
    let name = words.next()?.to_owned();
    let stamp = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    let rows: usize = words.next()?.parse().ok()?;
    let mut indices = Vec::new();
    for part in words.next()?.split(',').filter(|part| !part.is_empty()) {
        let (first, rest) = part.split_once('+')?;
        let (step, count) = rest.split_once('*')?;
        let (first, step, count): (u64, u64, u64) =
            (first.parse().ok()?, step.parse().ok()?, count.parse().ok()?);
        // A damaged count must not fill the memory: each run has a row at least.
        if count > rows as u64 {
            return None;
        }
        for place in 0..count {
            indices.push(first.checked_add(step.checked_mul(place)?)?);
        }
    }
    Some((name, (stamp, FileRuns { rows, indices })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::ScratchFolder;

    #[test]
    fn lines_are_read_as_they_were_written() {
        for indices in [
            vec![],
            vec![7],
            vec![0, 1000, 2000, 3000],
            vec![5, 6, 7, 3, 3, 100, 90],
            vec![u64::MAX],
        ] {
            let runs = FileRuns { rows: 35, indices };
            let text = text_of("k.000000.ab.parquet", (12, 34), &runs);
            let read = line(text.trim_end_matches('\n')).expect("it was written");
            assert_eq!(
                read,
                ("k.000000.ab.parquet".to_owned(), ((12, 34), runs)),
                "{text}"
            );
        }
        assert!(
            text_of(
                "k",
                (1, 1),
                &FileRuns {
                    rows: 99,
                    indices: (0..99).collect()
                }
            )
            .len()
                < 30
        );
    }

    #[test]
    fn damaged_lines_are_ignored() {
        for text in [
            "",
            "k",
            "k 1 1 1",
            "k 1 1 5 0+1*6",
            "k 1 1 5 0+1",
            "k 1 1 9 18446744073709551615+1*2",
            "k x 1 1 0+1*1",
        ] {
            assert_eq!(line(text), None, "{text}");
        }
    }

    #[test]
    fn a_changed_file_is_unknown() {
        let folder = ScratchFolder::create().expect("a temporary folder");
        let file = folder.path().join("k.parquet");
        fs::write(&file, "old").expect("it can be written");
        let runs = FileRuns {
            rows: 5,
            indices: vec![0],
        };
        let mut checked = Checked::read(folder.path());
        checked.set(&file, runs.clone());
        checked
            .write(
                &Below::new(folder.path()),
                folder.path(),
                std::slice::from_ref(&file),
            )
            .expect("it can be written");
        assert_eq!(Checked::read(folder.path()).get(&file), Some(&runs));
        checked.set_state(Some("f00".to_owned()));
        checked
            .write(
                &Below::new(folder.path()),
                folder.path(),
                std::slice::from_ref(&file),
            )
            .expect("it can be written");
        let read = Checked::read(folder.path());
        assert!(read.is_of("f00") && !read.is_of("f0"));
        assert_eq!(read.get(&file), Some(&runs));
        fs::write(&file, "changed").expect("it can be written");
        assert_eq!(Checked::read(folder.path()).get(&file), None);
    }
}
