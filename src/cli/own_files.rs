//! The files whose text is shown in diagnostics: those of the project at hand.
//!
//! A configuration from elsewhere may name any file of this machine, such as
//! `ontology = "/etc/passwd"`. Its faults are printed with their places, but the lines of such a
//! file must not get into the log of a build server.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Folders of which at least one is in the root of a project.
const MARKS: [&str; 5] = ["ontology", "rules", "models", "configs", ".git"];

/// Whether the text of a source may be shown: it is not a file, or one in the folder of a file that
/// the command names, or in the project around that.
pub(super) fn is_own(name: &str) -> bool {
    static ROOTS: OnceLock<Vec<PathBuf>> = OnceLock::new();
    let Ok(file) = std::fs::canonicalize(name.trim_end_matches(" (expanded)")) else {
        return true;
    };
    ROOTS
        .get_or_init(|| {
            roots(
                std::env::args_os()
                    .skip(1)
                    .map(|word| word.to_string_lossy().into_owned()),
            )
        })
        .iter()
        .any(|root| file.starts_with(root))
}

/// The projects of the files that a command line names; without any, that of the current folder.
fn roots(words: impl Iterator<Item = String>) -> Vec<PathBuf> {
    let named = words.filter_map(|word| {
        let path = word
            .strip_prefix("--")
            .and_then(|option| option.split_once('='))
            .map_or(word.as_str(), |(_, it)| it);
        let path = Path::new(path);
        let folder = if path.is_dir() {
            Some(path)
        } else {
            path.parent().filter(|_| path.exists())
        };
        project(folder?)
    });
    let named: Vec<PathBuf> = named.collect();
    if named.is_empty() {
        project(Path::new(".")).into_iter().collect()
    } else {
        named
    }
}

/// The root of the project of a folder: the folder, or the one around it if that has a project's
/// folders.
fn project(folder: &Path) -> Option<PathBuf> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let folder = std::fs::canonicalize(folder).ok()?;
    let is_root = |folder: &&Path| MARKS.iter().any(|mark| folder.join(mark).exists());
    let root = [folder.as_path()]
        .into_iter()
        .chain(folder.parent())
        .find(is_root);
    Some(root.map_or_else(|| folder.clone(), Path::to_owned))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_project_of_a_named_file_is_around_its_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let here = std::fs::canonicalize(folder.path()).expect("its path");
        for name in ["p/configs", "p/ontology", "alone"] {
            std::fs::create_dir_all(here.join(name)).expect("a folder");
        }
        for file in ["p/configs/c.toml", "alone/c.toml"] {
            std::fs::write(here.join(file), "").expect("a file");
        }
        let of = |words: &[&str]| roots(words.iter().map(|word| (*word).to_owned()));
        let at = |name: &str| here.join(name).display().to_string();
        assert_eq!(of(&["check", &at("p/configs/c.toml")]), [here.join("p")]);
        assert_eq!(
            of(&[&format!("--config={}", at("alone/c.toml"))]),
            [here.join("alone")]
        );
        assert_eq!(
            of(&["list", "--history", &at("p/ontology")]),
            [here.join("p")]
        );
    }
}
