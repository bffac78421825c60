//! The record of the parts that a store has accepted, so that the same command continues where it
//! was.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::Path;

use actcheck_base::{Below, Digest};

/// Longest record that is read: of ten million parts. Unit: bytes.
const LONGEST: u64 = 330 << 20;

/// A file with one line for each accepted part: the digest of its name and statements.
#[derive(Debug)]
pub(crate) struct Ledger {
    accepted: HashSet<u128>,
    /// `None` if the file can't be written: then the command begins anew next time.
    file: Option<File>,
}

impl Ledger {
    /// Opens a record, or begins one for the store at `address`. Returns it with the reason why it
    /// can't be kept, if any.
    pub fn open(path: &Path, address: &str, from_start: bool) -> (Self, Option<io::Error>) {
        let heading = format!("accepted by {address}\n");
        match open(path, &heading, from_start) {
            Ok((accepted, file)) => (
                Self {
                    accepted,
                    file: Some(file),
                },
                None,
            ),
            Err(error) => (
                Self {
                    accepted: HashSet::new(),
                    file: None,
                },
                Some(error),
            ),
        }
    }

    /// Whether a part was accepted.
    pub fn has(&self, part: u128) -> bool {
        self.accepted.contains(&part)
    }

    /// Records accepted parts, which must be complete in the store.
    pub fn add(&mut self, parts: &[u128]) -> io::Result<()> {
        self.accepted.extend(parts);
        let lines: String = parts.iter().map(|part| format!("{part:032x}\n")).collect();
        self.file
            .as_mut()
            .map_or(Ok(()), |file| file.write_all(lines.as_bytes()))
    }
}

/// Opens the file at its end. The last line, if a kill left it incomplete, is removed.
fn open(path: &Path, heading: &str, from_start: bool) -> io::Result<(HashSet<u128>, File)> {
    let folder = path.parent().unwrap_or(path);
    let history = Below::new(folder.parent().unwrap_or(folder));
    history.create_folder(folder)?;
    let mut file = history.append(path)?;
    let mut text = Vec::new();
    (&mut file).take(LONGEST).read_to_end(&mut text)?;
    let text = String::from_utf8_lossy(&text);
    let whole = match text.strip_prefix(heading).filter(|_| !from_start) {
        Some(lines) => lines.rfind('\n').map_or("", |end| &lines[..=end]),
        None => {
            file.set_len(0)?;
            file.write_all(heading.as_bytes())?;
            ""
        }
    };
    file.set_len((heading.len() + whole.len()) as u64)?;
    file.seek(io::SeekFrom::End(0))?;
    Ok((
        whole
            .lines()
            .filter_map(|line| u128::from_str_radix(line, 16).ok())
            .collect(),
        file,
    ))
}

/// The digest of a part: of its name and its statements.
pub(crate) fn digest<'a>(name: &str, statements: impl Iterator<Item = (&'a str, &'a str)>) -> u128 {
    let mut digest = Digest::new();
    digest.update(name.as_bytes());
    for (graph, triple) in statements {
        digest.update(graph.as_bytes());
        digest.update(triple.as_bytes());
    }
    // A digest is 32 hexadecimal digits.
    u128::from_str_radix(&digest.finish(), 16).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::ScratchFolder;

    #[test]
    fn accepted_parts_are_known_again_after_a_kill_in_the_middle_of_a_line() {
        let scratch = ScratchFolder::create().expect("it can be created");
        let path = scratch.path().join("sent").join("a");
        let opened = |from_start| Ledger::open(&path, "http://a", from_start).0;
        opened(false).add(&[1, 2]).expect("it can be written");
        let mut file = File::options().append(true).open(&path).expect("it exists");
        file.write_all(b"0000000000000000000000000000")
            .expect("it can be written");
        let mut ledger = opened(false);
        assert!(ledger.has(1) && ledger.has(2) && !ledger.has(0));
        ledger.add(&[3]).expect("it can be written");
        assert!((1..=3).all(|part| opened(false).has(part)));
        assert!(!opened(true).has(1) && !opened(false).has(1));
        // The record of another store, in a file of the same name.
        opened(false).add(&[1]).expect("it can be written");
        assert!(!Ledger::open(&path, "http://b", false).0.has(1));
        let (ledger, fault) = Ledger::open(&path.join("below"), "http://a", false);
        assert!(fault.is_some() && !ledger.has(1));
    }
}
