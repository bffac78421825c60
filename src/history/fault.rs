//! Faults of a history: each names the folder and how to fix it.

use std::io::ErrorKind;
use std::path::Path;

use oxigraph::store::StorageError;

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

/// H002: another process is creating the history.
pub(super) fn being_created(dir: &Path) -> Diagnostics {
    Diagnostic::error(
        "H002",
        format!(
            "the history `{}` is being created by another process",
            dir.display()
        ),
    )
    .help("try again in a moment: it has no runs yet")
    .into()
}

/// H003: the process that created the history was stopped before it was complete.
pub(super) fn not_created(dir: &Path) -> Diagnostics {
    Diagnostic::error("H003", format!("the history `{}` has no runs: its creation was interrupted", dir.display()))
        .help("`actcheck run CONFIG` completes it, and adds runs; or name another folder with `--history DIR`")
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

/// H027: a file of the store would fill the memory, or be read for hours.
pub(super) fn too_long(dir: &Path, path: &Path) -> Diagnostics {
    let (dir, path) = (dir.display(), path.display());
    let message = format!(
        "the history `{dir}` can't be used: `{path}` is far longer than any that this program writes"
    );
    Diagnostic::error("H027", message)
        .help("remove the file if you do not know its origin; a history elsewhere is named with `--history DIR`")
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

/// The store failed.
pub(super) fn store(dir: &Path, doing: &str, error: &StorageError) -> Diagnostics {
    match error {
        StorageError::Io(error) => io(dir, doing, error),
        StorageError::Corruption(error) => damaged(dir, &error.to_string()),
        other => failed(dir, doing, ErrorKind::Other, &other.to_string()),
    }
}

/// A reader can't write its temporary files.
pub(super) fn temporary(dir: &Path, error: &std::io::Error) -> Diagnostics {
    let folder = std::env::temp_dir();
    let message = format!(
        "the history `{}` can't be read: temporary files in `{}` can't be written: {}",
        dir.display(),
        folder.display(),
        lower(&error.to_string())
    );
    Diagnostic::error("H001", message)
        .help("free some space there, or name another folder with `TMPDIR`")
        .into()
}

/// A reader can't open its copy of the store, or add to it.
pub(super) fn unread(dir: &Path, error: &StorageError) -> Diagnostics {
    match error {
        StorageError::Io(error)
            if matches!(
                error.kind(),
                ErrorKind::StorageFull | ErrorKind::QuotaExceeded
            ) =>
        {
            temporary(dir, error)
        }
        other => damaged(dir, &other.to_string()),
    }
}

/// H007: a file of the store differs from its checksum.
pub(super) fn damaged_file(dir: &Path, name: &str) -> Diagnostics {
    damaged(
        dir,
        &format!("`store/{name}` has changed since it was written"),
    )
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
    if has(&["lock file", "lock hold by"]) {
        return in_use(dir);
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
