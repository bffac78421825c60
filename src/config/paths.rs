//! Paths that a configuration names.

use std::path::{Path, PathBuf};

use actcheck_base::{Diagnostic, Diagnostics, ShellLine};

/// Resolves a path of a configuration relative to `folder`, without `..` where removing it does not
/// change the target.
pub fn resolve_path(folder: &Path, written: &str) -> PathBuf {
    let (mut base, mut rest) = (folder.to_path_buf(), Path::new(written));
    while let Ok(shorter) = rest.strip_prefix("..") {
        if base.file_name().is_none() || base.is_symlink() || !base.pop() {
            break;
        }
        rest = shorter;
    }
    let path = base.join(rest);
    // An empty path is the current directory.
    if path.as_os_str().is_empty() {
        PathBuf::from(".")
    } else {
        path
    }
}

/// Checks the folder of a history that the user did not name: a link would lead its writers to any
/// folder. `from`: the folder of the configuration, which the user did name.
///
/// # Errors
/// `H028` it is a link, or in a folder that is one.
pub fn check_unnamed(from: &Path, history: &Path) -> Result<(), Diagnostics> {
    let shared = from
        .components()
        .zip(history.components())
        .take_while(|(one, other)| one == other)
        .count();
    let is_elsewhere = history.is_absolute() != from.is_absolute();
    let mut path = PathBuf::new();
    let steps = history.components().enumerate().map(|(place, part)| {
        path.push(part);
        (place, path.clone())
    });
    let last = history.components().count().saturating_sub(1);
    let links = steps.filter(|(place, path)| {
        (*place >= shared && !is_elsewhere || *place == last) && path.is_symlink()
    });
    match links.map(|(_, path)| path).next() {
        None => Ok(()),
        Some(link) => {
            let message = format!(
                "the history `{}` isn't used: `{}` is a link",
                history.display(),
                link.display()
            );
            let option = ShellLine::default().option("--history", history);
            let help = format!(
                "if you know where it leads, name the folder on the command line: `{option}`; otherwise remove the link"
            );
            Err(Diagnostic::error("H028", message).help(help).into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_to_the_configuration() {
        assert_eq!(
            resolve_path(Path::new("no-such"), "../models"),
            Path::new("models")
        );
        assert_eq!(
            resolve_path(Path::new(""), "../models"),
            Path::new("../models")
        );
        assert_eq!(
            resolve_path(Path::new("a/b"), "../../../m"),
            Path::new("../m")
        );
        assert_eq!(resolve_path(Path::new("a"), "/m"), Path::new("/m"));
        assert_eq!(resolve_path(Path::new("a"), ".."), Path::new("."));
    }
}
