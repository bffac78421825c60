//! Files are written and deleted only through `base::Below`, which follows no link, or
//! `base::NewFile::create` for a file that the user named.

use std::path::{Path, PathBuf};

use crate::support::root;

/// Functions that write, delete or open files by their paths, and follow links.
const FORBIDDEN: [&str; 15] = [
    "fs::write(",
    "fs::remove_",
    "fs::rename(",
    "fs::create_dir",
    "fs::hard_link(",
    "fs::copy(",
    "fs::set_permissions(",
    "File::create",
    "File::options",
    "OpenOptions",
    "DirBuilder",
    "fs::symlink(",
    "fs::read(",
    "fs::read_to_string(",
    "File::open(",
];

/// Sources that may use some of them, with the reason.
const EXCEPTIONS: [(&str, &str); 10] = [
    ("base/below.rs", "creates the folder that the user named"),
    (
        "base/write_atomic.rs",
        "writes a pipe or a device that the user named as the output",
    ),
    (
        "base/scratch.rs",
        "a folder of its own, which only this user can write",
    ),
    ("cli/bisect/child.rs", "writes into a scratch folder"),
    ("cli/bisect/repository.rs", "writes into a scratch folder"),
    (
        "cli/bisect/scenes.rs",
        "removes a history in a scratch folder",
    ),
    (
        "protocol/process.rs",
        "the folder of a socket, which only this user can write, and /proc",
    ),
    (
        "rules/standalone/input.rs",
        "reads a file or a pipe that the user or the program names, within limits",
    ),
    ("serve/watch.rs", "reads /proc"),
    ("serve/connections.rs", "reads /proc"),
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let found = entries.flat_map(|path| {
        if path.is_dir() {
            sources(&path)
        } else {
            vec![path]
        }
    });
    found
        .filter(|path| path.extension().is_some_and(|ending| ending == "rs"))
        .collect()
}

/// The text of a source without comments and tests.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let own = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    own.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn files_are_opened_written_and_deleted_without_following_links() {
    let folder = root().join("src");
    let mut needed = Vec::new();
    for path in sources(&folder) {
        let name = path.strip_prefix(&folder).unwrap().display().to_string();
        if name.ends_with("tests.rs") || name.ends_with("/fuzz.rs") {
            continue;
        }
        let text = code(&path);
        // `NewFile::create` is meant for files that the user named.
        let text = text.replace("NewFile::create", "");
        let found: Vec<&str> = FORBIDDEN
            .into_iter()
            .filter(|call| text.contains(call))
            .collect();
        if EXCEPTIONS.iter().any(|(exception, _)| *exception == name) {
            needed.push((name, found));
            continue;
        }
        assert!(
            found.is_empty(),
            "{name} uses {found:?}: use `base::Below`, `open_regular` or `read_regular`"
        );
    }
    let unneeded: Vec<&str> = EXCEPTIONS
        .into_iter()
        .filter(|(exception, _)| {
            !needed
                .iter()
                .any(|(name, found)| name == exception && !found.is_empty())
        })
        .map(|(exception, _)| exception)
        .collect();
    assert!(
        unneeded.is_empty(),
        "exceptions without a use: {unneeded:?}"
    );
}
