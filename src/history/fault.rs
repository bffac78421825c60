//! Faults of a history: each names the folder and how to fix it.

use std::io::ErrorKind;
use std::path::Path;

use crate::segment::ReadFault;
use actcheck_base::{Diagnostic, Diagnostics, FileKind, NotPlain};

/// H001: a folder can't be used as a history, or can't be accessed.
pub(super) fn unusable(dir: &Path, why: &str) -> Diagnostics {
    Diagnostic::error(
        "H001",
        format!("the history `{}` can't be opened: {why}", dir.display()),
    )
    .help("name a writable folder with `--history DIR`")
    .into()
}

/// H002: another process has the history open.
pub(super) fn in_use(dir: &Path) -> Diagnostics {
    Diagnostic::error(
        "H002",
        format!("the history `{}` is open in another process", dir.display()),
    )
    .help("wait until it ends, or name another folder with `--history DIR`; nothing was changed")
    .into()
}

/// H027: a file of the history is a link or a special file.
pub(super) fn not_plain(dir: &Path, path: &Path, kind: FileKind) -> Diagnostics {
    let message = format!(
        "the history `{}` can't be used: `{}` is {kind}",
        dir.display(),
        path.display()
    );
    Diagnostic::error("H027", message)
        .help(
            "actcheck writes only plain files there, and follows no link: remove it if you do not know its origin; a history \
             elsewhere is named with `--history DIR`",
        )
        .into()
}

/// H003: the folder has no history.
pub(super) fn none_there(dir: &Path) -> Diagnostics {
    Diagnostic::error(
        "H003",
        format!("there is no history at `{}`", dir.display()),
    )
    .help("`actcheck run CONFIG` writes one; name its folder with `--history DIR`")
    .into()
}

/// H003: the folder holds other files.
pub(super) fn foreign(dir: &Path) -> Diagnostics {
    Diagnostic::error("H003", format!("the folder `{}` is not a history: it holds other files", dir.display()))
        .help("name a new or empty folder, or that of a history, with `--history DIR`; nothing was changed")
        .into()
}

/// H004: the history has another format.
pub(super) fn other_format(dir: &Path, theirs: u64, ours: u64) -> Diagnostics {
    let message = format!(
        "the history `{}` has format {theirs}; this version of actcheck reads format {ours}",
        dir.display()
    );
    let help = if theirs > ours {
        "update actcheck, or name another folder with `--history DIR`; nothing was changed"
    } else {
        "no release wrote this format: name another folder with `--history DIR`; nothing was changed"
    };
    Diagnostic::error("H004", message).help(help).into()
}

/// Reading or writing a file failed.
pub(super) fn io(dir: &Path, doing: &str, error: &std::io::Error) -> Diagnostics {
    if let Some(NotPlain { path, kind, .. }) = NotPlain::of(error) {
        return not_plain(dir, path, *kind);
    }
    failed(dir, doing, error.kind(), &error.to_string())
}

/// H007: a file of a segment or of a campaign is damaged; H009: it is missing; or it can't be read.
pub(super) fn segment(dir: &Path, file: &Path, fault: &ReadFault) -> Diagnostics {
    match fault {
        ReadFault::Io(error) if error.kind() == ErrorKind::NotFound => missing(dir, file),
        ReadFault::Io(error) => io(dir, &format!("reading `{}`", file.display()), error),
        ReadFault::Damaged(fault) => damaged(
            dir,
            &format!("`{}`: {fault}", relative(dir, file).display()),
        ),
    }
}

/// H007: a segment has fewer runs or judgements than it had.
pub(super) fn shortened(dir: &Path, file: &Path) -> Diagnostics {
    let file = relative(dir, file).display();
    damaged(dir, &format!("`{file}` is shorter than it was"))
}

/// H007: a value of a run is damaged; or it can't be read. `file`: the column.
pub(super) fn run(dir: &Path, id: &str, file: &Path, fault: &ReadFault) -> Diagnostics {
    match fault {
        ReadFault::Io(_) => segment(dir, file, fault),
        ReadFault::Damaged(fault) => undecodable(dir, id, file, &fault.to_string()),
    }
}

/// H007: the content of a value of a run is none of this program. `file`: the column.
pub(super) fn undecodable(dir: &Path, id: &str, file: &Path, why: &str) -> Diagnostics {
    let file = relative(dir, file).display();
    damaged(dir, &format!("`{file}`, run {id}: {why}"))
}

/// A path as messages name it: relative to the history.
pub(super) fn relative<'p>(dir: &Path, path: &'p Path) -> &'p Path {
    path.strip_prefix(dir).unwrap_or(path)
}

/// H009: a file of a segment is missing.
fn missing(dir: &Path, file: &Path) -> Diagnostics {
    let message = format!(
        "values of runs can't be read: `{}` is missing",
        file.display()
    );
    Diagnostic::error("H009", message)
        .help(format!(
            "restore the file from a backup; the other files of the history `{}` are intact",
            dir.display()
        ))
        .into()
}

/// H008: the history has no run with this name.
pub(super) fn no_run(dir: &Path, name: &str) -> Diagnostics {
    let message = format!("the history `{}` has no run `{name}`", dir.display());
    Diagnostic::error("H008", message)
        .help("`actcheck list` shows all runs")
        .into()
}

/// H006: this process, or the system, has too many open files. Returns `None` if a message has
/// another cause.
pub(super) fn too_many_files(dir: &Path, message: &str) -> Option<Diagnostics> {
    if ![
        "Too many open files",
        "too many open files",
        "file descriptors",
        "too many files are open",
    ]
    .iter()
    .any(|cause| message.contains(cause))
    {
        return None;
    }
    let message = format!(
        "the history `{}` can't be read: too many files are open",
        dir.display()
    );
    let help = "allow more, such as with `ulimit -n 1024`, and give the same command again; stored data is complete";
    Some(Diagnostic::error("H006", message).help(help).into())
}

/// H007: stored data can't be read any more.
pub(super) fn damaged(dir: &Path, what: &str) -> Diagnostics {
    if let Some(fault) = too_many_files(dir, what) {
        return fault;
    }
    Diagnostic::error("H007", format!("the history `{}` is damaged: {}", dir.display(), lower(what)))
        .help(
            "`actcheck health --integrity` lists the damage; `actcheck merge --salvage DIR --into NEW` copies all \
             readable data; or restore the folder from a backup",
        )
        .into()
}

/// H026: an id can't be part of a file name.
pub(super) fn foreign_id(dir: &Path, kind: &str, id: &str) -> Diagnostics {
    let id: String = id.chars().take(80).collect();
    let message = format!(
        "the history `{}` has a {kind} with the id `{id}`, which is not an id",
        dir.display()
    );
    Diagnostic::error("H026", message)
        .help("an id has only letters, digits, `-` and `_`: actcheck did not write this history, so don't trust it")
        .into()
}

fn failed(dir: &Path, doing: &str, kind: ErrorKind, text: &str) -> Diagnostics {
    let has = |words: &[&str]| words.iter().any(|word| text.contains(word));
    if matches!(kind, ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
        || has(&["No space left", "quota exceeded"])
    {
        return Diagnostic::error(
            "H005",
            format!("the disk of the history `{}` is full: {doing} failed", dir.display()),
        )
        .help(
            "free some space and run again: data stored before is complete; or name another folder with `--history DIR`",
        )
        .into();
    }
    if let Some(fault) = too_many_files(dir, text) {
        return fault;
    }
    match kind {
        ErrorKind::PermissionDenied => unusable(dir, "writing there is not permitted"),
        ErrorKind::ReadOnlyFilesystem => unusable(dir, "it is on a read-only file system"),
        _ if has(&["Permission denied"]) => unusable(dir, "writing there is not permitted"),
        _ if has(&["Read-only file system"]) => unusable(dir, "it is on a read-only file system"),
        ErrorKind::NotFound => unusable(dir, "a part of its path is missing and can't be created"),
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
            unusable(dir, "a file exists at its path")
        }
        _ => Diagnostic::error(
            "H006",
            format!(
                "{doing} failed in the history `{}`: {}",
                dir.display(),
                lower(text)
            ),
        )
        .help("check the disk and run again: data stored before is complete")
        .into(),
    }
}

/// A library's message in our style: the first letter in lower case, no full stop.
fn lower(text: &str) -> String {
    let text = text.trim().trim_end_matches('.');
    let mut letters = text.chars();
    match letters.next() {
        // "IO error" is kept.
        Some(first) if !letters.as_str().starts_with(|c: char| c.is_uppercase()) => {
            first.to_lowercase().chain(letters).collect()
        }
        _ => text.to_owned(),
    }
}
