//! Temporary folders.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::{Below, FileKind};

const PREFIX: &str = "actcheck-scratch-";
/// File that a living process holds locked.
const ALIVE: &str = "alive";

/// A private folder among the system's temporary files, removed when the value is dropped. The next
/// process that creates one removes those of killed processes.
#[derive(Debug)]
pub struct ScratchFolder {
    path: PathBuf,
    /// Holds the lock.
    _alive: File,
}

impl ScratchFolder {
    /// Creates a folder.
    ///
    /// # Errors
    /// The system's folder for temporary files can't be written.
    pub fn create() -> io::Result<Self> {
        Self::create_in(&std::env::temp_dir())
    }

    /// Creates a folder in a folder that other users may write, too. They can neither look into it
    /// nor take its name first.
    ///
    /// # Errors
    /// The folder can't be written.
    pub fn create_in(parent: &Path) -> io::Result<Self> {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = COUNTER.fetch_add(1, Ordering::Relaxed);
            let path = parent.join(format!("{PREFIX}{}-{number}", std::process::id()));
            match private_folder(&path) {
                Ok(()) => {
                    // The file gets its name after it is locked: a folder without it is left alone.
                    let unnamed = path.join("new");
                    let alive = File::create(&unnamed)?;
                    let _ = alive.try_lock();
                    fs::rename(unnamed, path.join(ALIVE))?;
                    remove_leftovers(parent, alive.metadata()?.uid());
                    return Ok(Self {
                        path,
                        _alive: alive,
                    });
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // If it remains, the next process removes it.
        let _ = fs::remove_dir_all(&self.path);
    }
}

/// Fails if anything has the name, also a link.
fn private_folder(path: &Path) -> io::Result<()> {
    fs::DirBuilder::new().mode(0o700).create(path)
}

/// Removes the folders of this user's killed processes. Another user may have put anything under
/// such a name.
fn remove_leftovers(parent: &Path, user: u32) {
    let below = Below::new(parent);
    for (name, kind) in below.entries(parent).unwrap_or_default() {
        let path = parent.join(&name);
        let is_ours = kind == FileKind::Folder
            && name.to_str().is_some_and(|name| name.starts_with(PREFIX))
            && fs::symlink_metadata(&path).is_ok_and(|found| found.uid() == user);
        if is_ours
            && below
                .open(&path.join(ALIVE))
                .is_ok_and(|file| file.try_lock().is_ok())
        {
            // Harmless if it remains.
            let _ = fs::remove_dir_all(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_killed_processes_are_removed_and_those_of_living_ones_kept() {
        let first = ScratchFolder::create().expect("it can be created");
        let killed = std::env::temp_dir().join(format!("{PREFIX}1-{}", u64::MAX));
        fs::create_dir_all(&killed).expect("it can be created");
        fs::write(killed.join(ALIVE), "").expect("it can be written");
        let second = ScratchFolder::create().expect("it can be created");
        assert!(first.path().is_dir() && second.path().is_dir() && !killed.exists());
        let path = second.path().to_path_buf();
        drop(second);
        assert!(!path.exists());
    }

    /// Another user's pipe under the name of such a folder stopped every command on the machine.
    #[test]
    fn pipes_and_links_in_a_shared_folder_neither_stop_nor_mislead_it() {
        let shared = ScratchFolder::create().expect("it can be created");
        let (parent, outside) = (shared.path().join("tmp"), shared.path().join("outside"));
        let trap = parent.join(format!("{PREFIX}1-1"));
        for folder in [&parent, &outside, &trap] {
            fs::create_dir(folder).expect("it can be created");
        }
        fs::write(outside.join(ALIVE), "").expect("it can be written");
        let pipe = std::process::Command::new("mkfifo")
            .arg(trap.join(ALIVE))
            .status();
        assert!(pipe.expect("mkfifo is installed").success());
        std::os::unix::fs::symlink(&outside, parent.join(format!("{PREFIX}1-2")))
            .expect("links can be made");
        let made = ScratchFolder::create_in(&parent).expect("it can be created");
        let mode = fs::metadata(made.path()).expect("it exists").mode();
        assert_eq!(mode & 0o777, 0o700);
        assert!(outside.join(ALIVE).exists() && trap.exists());
    }
}
