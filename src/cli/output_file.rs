//! Writes results into files, completely or not at all.

use std::io::Write as _;
use std::path::{Component, Path};

use actcheck_base::{Below, Diagnostic, Diagnostics, FileKind, NewFile};

/// Writes a file. If that fails, for instance on a full disk, the previous content is kept.
///
/// # Errors
/// X007: it can't be written.
pub(super) fn write(file: &Path, bytes: impl AsRef<[u8]>) -> Result<(), Diagnostics> {
    let written = NewFile::create(file).and_then(|new| {
        new.writer()?.write_all(bytes.as_ref())?;
        new.finish()
    });
    written.map_err(|error| cannot_write(file, &error).into())
}

/// Writes a file of the project whose path the user did not name. Neither it nor a folder on the
/// way may be a link.
///
/// # Errors
/// X007: it can't be written.
pub(super) fn write_in_project(file: &Path, bytes: impl AsRef<[u8]>) -> Result<(), Diagnostics> {
    let below = project(file);
    let written = match below.kind(file) {
        Some(FileKind::File) | None => below.write_atomic(file, bytes.as_ref()),
        Some(kind) => Err(std::io::Error::other(format!("it is {kind}"))),
    };
    written.map_err(|error| cannot_write(file, &error).into())
}

/// The folder below which a path has no links: the present one, or that of a file elsewhere.
pub(super) fn project(file: &Path) -> Below {
    let is_inside = file
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    Below::new(if is_inside {
        Path::new("")
    } else {
        file.parent().unwrap_or(Path::new(""))
    })
}

/// Whether a path leads below the present folder, whatever links its existing part follows.
pub(super) fn is_below_here(path: &Path) -> bool {
    let Ok(here) = std::env::current_dir() else {
        return false;
    };
    let mut whole = here.clone();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                whole.pop();
            }
            part => whole.push(part),
        }
    }
    let existing = whole
        .ancestors()
        .find_map(|folder| folder.canonicalize().ok());
    here.canonicalize()
        .is_ok_and(|here| existing.is_some_and(|existing| existing.starts_with(here)))
}

/// Creates a folder that the user named, for files that are then written below it.
///
/// # Errors
/// X007: it can't be created.
pub(super) fn folder(folder: &Path) -> Result<Below, Diagnostics> {
    let below = Below::new(folder);
    below
        .create_folder(folder)
        .map_err(|error| cannot_write(folder, error))?;
    Ok(below)
}

/// X007: a file or folder that can't be written.
pub(super) fn cannot_write(file: &Path, why: impl std::fmt::Display) -> Diagnostic {
    Diagnostic::error(
        "X007",
        format!("{} can't be written: {why}", file.display()),
    )
    .help("name a file in an existing, writable folder")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_path_leads_below_the_present_folder_or_not() {
        for (path, below) in [
            ("", true),
            ("src/none/x", true),
            ("none/../src", true),
            ("..", false),
            ("/tmp", false),
        ] {
            assert_eq!(is_below_here(Path::new(path)), below, "{path}");
        }
    }

    #[test]
    fn a_file_is_replaced_atomically_without_leftovers() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("out.txt");
        let names = || -> Vec<_> {
            let entries = fs::read_dir(folder.path()).expect("the folder is there");
            entries
                .map(|entry| entry.expect("it can be read").file_name())
                .collect()
        };
        for text in ["one", "another"] {
            write(&file, text).expect("it can be written");
            assert_eq!(fs::read_to_string(&file).expect("the file exists"), text);
            assert_eq!(names(), ["out.txt"]);
        }
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&file, &link).expect("links can be made");
        write(&link, "through the link").expect("it can be written");
        assert_eq!(
            fs::read_to_string(&file).expect("the file exists"),
            "through the link"
        );
        assert!(write(Path::new("/dev/null"), "gone").is_ok());
        // Writing to /dev/full always fails with a full disk.
        let told =
            write(Path::new("/dev/full"), "too much").expect_err("nothing can be written there");
        assert!(told.iter().any(|fault| fault.code == "X007"));
        let told = write(&folder.path().join("none").join("out.txt"), "x")
            .expect_err("the folder is missing");
        assert_eq!(told.len(), 1);
    }
}
