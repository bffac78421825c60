//! IRIs of files: relative paths between ontology and rule files, without a path of a machine.

use std::path::{Path, PathBuf};

/// IRIs of files begin so. They name a file by its path from the ontology's folder, never by a path of a machine.
const FILE: &str = "https://w3id.org/actcheck/file/";
/// One folder above the one below it. Enough of them stand above the ontology's folder for any sensible `../../…`.
const ABOVE: &str = "~above~/";
const LEVELS: usize = 12;
/// The ontology's own folder.
const HERE: &str = "~here~/";
/// What relative IRIs in a file are resolved against; `relative` is the file's path from the ontology's folder.
pub(super) fn base_of(relative: &str) -> String {
    format!("{FILE}{}{HERE}{relative}", ABOVE.repeat(LEVELS))
}

/// Path of a file IRI from the ontology's folder, with slashes; nothing for any other IRI.
///
/// `…/close_object.rls` next to the folder is `../close_object.rls`.
pub(super) fn relative_of(iri: &str) -> Option<String> {
    let rest = iri.strip_prefix(FILE)?;
    let (rest, levels) = without_above(rest);
    match rest.strip_prefix(HERE) {
        Some(here) => Some(here.to_owned()),
        None => Some(format!("{}{rest}", "../".repeat(LEVELS.saturating_sub(levels) + 1))),
    }
}

fn without_above(mut rest: &str) -> (&str, usize) {
    let mut levels = 0;
    while let Some(shorter) = rest.strip_prefix(ABOVE) {
        (rest, levels) = (shorter, levels + 1);
    }
    (rest, levels)
}

/// A file IRI for statements: `…/file/ontology/actions.ttl`, `…/file/rules/moved_object.rls`.
pub(super) fn plain(relative: &str) -> String {
    match relative.strip_prefix("../") {
        Some(beside) if !beside.starts_with("../") => format!("{FILE}{beside}"),
        Some(above) => format!("{FILE}{}", above.replace("../", "above/")),
        None => format!("{FILE}ontology/{relative}"),
    }
}

/// Path from the ontology's folder of a plain file IRI; nothing for any other IRI.
pub(super) fn path_of_plain(iri: &str) -> Option<String> {
    let rest = iri.strip_prefix(FILE)?;
    Some(match rest.strip_prefix("ontology/") {
        Some(here) => decoded(here),
        None => format!("../{}", decoded(&rest.replace("above/", "../"))),
    })
}

/// A file of which the path from the ontology's folder is known, as an IRI writes it.
pub(super) fn on_disk(folder: &Path, relative: &str) -> PathBuf {
    beside(folder, &decoded(relative))
}

/// A path seen from where the program runs: without `..` where that changes nothing.
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

/// A file name as an IRI writes it.
pub(super) fn encoded(name: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.~".contains(&b);
    name.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

/// Percent signs with two hexadecimal digits become the bytes that they stand for, where that gives UTF-8.
fn decoded(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut idx = 0;
    while let Some(byte) = bytes.get(idx) {
        let hex = bytes.get(idx + 1..idx + 3).filter(|_| *byte == b'%').and_then(|hex| std::str::from_utf8(hex).ok());
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
