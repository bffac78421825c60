//! File IRIs: machine-independent relative paths between ontology and rule files.

use std::path::{Path, PathBuf};

/// Prefix of file IRIs. They contain the path relative to the ontology's folder, never an absolute
/// path.
const FILE: &str = "https://w3id.org/actcheck/file/";
/// Placeholder for a parent folder. [`LEVELS`] of them precede the ontology's folder, enough for
/// any sensible `../../…`.
const ABOVE: &str = "~above~/";
const LEVELS: usize = 12;
/// The ontology's own folder.
const HERE: &str = "~here~/";
/// Base IRI of a file; `relative` is the file's path from the ontology's folder.
pub(super) fn base_of(relative: &str) -> String {
    format!("{FILE}{}{HERE}{relative}", ABOVE.repeat(LEVELS))
}

/// Path of a file IRI relative to the ontology's folder, with slashes. Returns `None` for any other
/// IRI.
///
/// A file `close_object.rls` next to the folder gives `../close_object.rls`.
pub(super) fn relative_of(iri: &str) -> Option<String> {
    let rest = iri.strip_prefix(FILE)?;
    let (rest, levels) = without_above(rest);
    match rest.strip_prefix(HERE) {
        Some(here) => Some(here.to_owned()),
        None => Some(format!(
            "{}{rest}",
            "../".repeat(LEVELS.saturating_sub(levels) + 1)
        )),
    }
}

fn without_above(mut rest: &str) -> (&str, usize) {
    let mut levels = 0;
    while let Some(shorter) = rest.strip_prefix(ABOVE) {
        (rest, levels) = (shorter, levels + 1);
    }
    (rest, levels)
}

/// File IRI without placeholders, for statements: `…/file/ontology/actions.ttl`,
/// `…/file/rules/moved_object.rls`.
pub(super) fn plain(relative: &str) -> String {
    match relative.strip_prefix("../") {
        Some(beside) if !beside.starts_with("../") => format!("{FILE}{beside}"),
        Some(above) => format!("{FILE}{}", above.replace("../", "above/")),
        None => format!("{FILE}ontology/{relative}"),
    }
}

/// Path of a plain file IRI relative to the ontology's folder. Returns `None` for any other IRI.
pub(super) fn path_of_plain(iri: &str) -> Option<String> {
    let rest = iri.strip_prefix(FILE)?;
    Some(match rest.strip_prefix("ontology/") {
        Some(here) => decoded(here),
        None => format!("../{}", decoded(&rest.replace("above/", "../"))),
    })
}

/// Path on disk of a file, given its percent-encoded path relative to the ontology's folder.
pub(super) fn on_disk(folder: &Path, relative: &str) -> PathBuf {
    beside(folder, &decoded(relative))
}

/// Joins a folder and a relative path, and removes `..` if that keeps the meaning.
pub(super) fn beside(folder: &Path, relative: &str) -> PathBuf {
    let (mut base, mut rest) = (folder.to_path_buf(), Path::new(relative));
    while let Ok(shorter) = rest.strip_prefix("..") {
        if base.file_name().is_none() || base.is_symlink() || !base.pop() {
            break;
        }
        rest = shorter;
    }
    base.join(rest)
}

/// Percent-encodes a file name for an IRI.
pub fn encoded(name: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.~".contains(&b);
    name.bytes()
        .map(|b| {
            if plain(b) {
                char::from(b).to_string()
            } else {
                format!("%{b:02X}")
            }
        })
        .collect()
}

/// Decodes percent-encoded bytes, if the result is UTF-8.
fn decoded(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut idx = 0;
    while let Some(byte) = bytes.get(idx) {
        let hex = bytes
            .get(idx + 1..idx + 3)
            .filter(|_| *byte == b'%')
            .and_then(|hex| std::str::from_utf8(hex).ok());
        match hex.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(value) => {
                out.push(value);
                idx += 3;
            }
            None => {
                out.push(*byte);
                idx += 1;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| text.to_owned())
}
