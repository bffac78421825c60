//! Files of a new project: either all of them are written, or none.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::output_file;
use actcheck_base::{Diagnostic, Diagnostics, Files};

/// Files to write, relative to the folder that the program runs in. None may exist.
#[derive(Debug, Default)]
pub(super) struct NewFiles {
    files: BTreeMap<PathBuf, Vec<u8>>,
}

impl NewFiles {
    /// Adds a file, or replaces one that was added before.
    pub(super) fn add(&mut self, file: impl Into<PathBuf>, bytes: impl Into<Vec<u8>>) {
        self.files.insert(file.into(), bytes.into());
    }

    /// Adds all files of a shipped folder, such as `rules`.
    ///
    /// # Errors
    /// X016: the program lacks one of them, which is a bug.
    pub(super) fn add_shipped(&mut self, folder: &str) -> Result<(), Diagnostics> {
        for file in Files::all_shipped(Path::new(folder)) {
            let bytes = Files::Shipped.read_bytes(&file).map_err(|why| {
                Diagnostic::error("X016", format!("{} can't be copied: {why}", file.display()))
                    .help("report this bug: the file is part of the program")
            })?;
            self.add(file, bytes);
        }
        Ok(())
    }

    /// Checks that a file does not exist. A dangling symbolic link counts as existing.
    ///
    /// # Errors
    /// X015: it exists.
    pub(super) fn check_absent(file: &Path, help: &str) -> Result<(), Diagnostics> {
        match fs::symlink_metadata(file) {
            Err(_) => Ok(()),
            Ok(_) => {
                let message = format!("{} already exists", file.display());
                Err(Diagnostic::error("X015", message).help(help).into())
            }
        }
    }

    /// Writes all files and the folders that they need. If one fails, removes those that it has
    /// written.
    ///
    /// # Errors
    /// X015: one of the files exists. X007: one can't be written.
    pub(super) fn write(&self, help: &str) -> Result<(), Diagnostics> {
        for file in self.files.keys() {
            Self::check_absent(file, help)?;
        }
        let mut made = Vec::new();
        for (file, bytes) in &self.files {
            if let Err(faults) = make_folders(file, &mut made)
                .and_then(|()| output_file::write_in_project(file, bytes))
            {
                take_back(&made);
                return Err(faults);
            }
            made.push(file.clone());
        }
        Ok(())
    }

    /// Summarises the files: `pick.toml, rules/ (27 files)`.
    pub(super) fn in_words(&self) -> String {
        let mut folders: BTreeMap<&Path, Vec<&Path>> = BTreeMap::new();
        for file in self.files.keys() {
            let first = file
                .components()
                .next()
                .map_or(Path::new(""), |first| Path::new(first.as_os_str()));
            folders.entry(first).or_default().push(file);
        }
        let words = folders
            .into_iter()
            .map(|(folder, files)| match files.as_slice() {
                [only] => only.display().to_string(),
                several => format!("{}/ ({} files)", folder.display(), several.len()),
            });
        words.collect::<Vec<_>>().join(", ")
    }
}

/// Creates the folders that a file needs, outermost first.
fn make_folders(file: &Path, made: &mut Vec<PathBuf>) -> Result<(), Diagnostics> {
    let mut missing: Vec<&Path> = file
        .ancestors()
        .skip(1)
        .take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists())
        .collect();
    missing.reverse();
    for folder in missing {
        let created = output_file::project(folder).create_folder(folder);
        created.map_err(|error| output_file::cannot_write(folder, error))?;
        made.push(folder.to_owned());
    }
    Ok(())
}

/// Removes files and folders, the last one first. Ignores errors: the caller reports the fault that
/// came before.
fn take_back(made: &[PathBuf]) {
    for path in made.iter().rev() {
        let below = output_file::project(path);
        let _ = if path.is_dir() {
            below.remove_folder(path)
        } else {
            below.remove(path)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_files_are_written_or_none() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("taken"), "a file, where a folder is needed").expect("it can be written");
        let mut files = NewFiles::default();
        files.add(at("a/b/one.txt"), "1");
        files.add(at("a/two.txt"), "2");
        files.add(at("taken/three.txt"), "3");
        let faults = files.write("").expect_err("a file is not a folder");
        assert!(faults.iter().all(|fault| fault.code == "X007"), "{faults}");
        assert!(!at("a").exists(), "written files are removed");
        fs::remove_file(at("taken")).expect("it can be removed");
        files.write("").expect("all can be written");
        assert_eq!(
            fs::read_to_string(at("a/b/one.txt")).expect("the file exists"),
            "1"
        );
        let faults = files.write("move it").expect_err("they exist");
        assert!(faults.iter().all(|fault| fault.code == "X015"), "{faults}");
    }

    #[test]
    fn many_files_of_a_folder_are_counted() {
        let mut files = NewFiles::default();
        [
            "rules/a.rls",
            "rules/lib/b.rls",
            "pick.toml",
            "skills/pick.py",
        ]
        .iter()
        .for_each(|file| files.add(*file, ""));
        assert_eq!(
            files.in_words(),
            "pick.toml, rules/ (2 files), skills/pick.py"
        );
    }
}
