//! Configurations in the folder that the program runs in.

use std::path::{Path, PathBuf};

use actcheck_base::{Diagnostic, Files, ShellLine};
use actcheck_config::Table;

/// Names beyond this number are counted instead of listed.
const MOST_LISTED: usize = 12;

/// The configurations in this folder and in its folder `configs`: TOML files with a key `tests`.
pub(super) fn here() -> Vec<PathBuf> {
    let files = ["", "configs"].into_iter().flat_map(|folder| {
        let shown = Path::new(folder);
        // An empty path can't be listed.
        let listed = if folder.is_empty() {
            Path::new(".")
        } else {
            shown
        };
        let names = Files::Disk
            .list(listed)
            .into_iter()
            .filter_map(|path| path.file_name().map(ToOwned::to_owned));
        names.map(|name| shown.join(name)).collect::<Vec<_>>()
    });
    files
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml") && has_tests(path))
        .collect()
}

fn has_tests(path: &Path) -> bool {
    let table = Files::Disk
        .read(path)
        .ok()
        .and_then(|source| Table::parse(&source).ok());
    table.is_some_and(|table| table.has("tests"))
}

/// X014: a command lacks its configuration. Lists those in this folder, or explains how to create
/// the first one.
pub(super) fn none_given(command: &str) -> Diagnostic {
    let here = here();
    let help = match here
        .iter()
        .find(|path| path.ends_with("pick.toml"))
        .or(here.first())
    {
        None => format!(
            "this folder has none: `actcheck new campaign` writes pick.toml; then `actcheck {command} pick.toml`"
        ),
        Some(first) => {
            format!(
                "write `actcheck {command} {}`{}",
                ShellLine::default().file(first),
                others(&here, first)
            )
        }
    };
    Diagnostic::error(
        "X014",
        format!("`actcheck {command}` needs a configuration"),
    )
    .help(help)
}

/// The other configurations, as the end of a sentence.
fn others(here: &[PathBuf], first: &Path) -> String {
    let mut names: Vec<String> = here
        .iter()
        .filter(|path| *path != first)
        .map(|path| path.display().to_string())
        .collect();
    let unlisted = names.len().saturating_sub(MOST_LISTED);
    names.truncate(MOST_LISTED);
    if unlisted > 0 {
        names.push(format!("{unlisted} more"));
    }
    if names.is_empty() {
        String::new()
    } else {
        format!("; also here: {}", names.join(", "))
    }
}
