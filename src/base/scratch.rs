//! Temporary folders.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

const PREFIX: &str = "actcheck-scratch-";
/// File that a living process holds locked.
const ALIVE: &str = "alive";

/// A private folder among the system's temporary files, removed when the value is dropped. The next process that
/// creates one removes those of killed processes.
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
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let parent = std::env::temp_dir();
        remove_leftovers(&parent);
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
                    return Ok(Self { path, _alive: alive });
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

#[cfg(unix)]
fn private_folder(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::DirBuilderExt as _;
    fs::DirBuilder::new().mode(0o700).create(path)
}

#[cfg(not(unix))]
fn private_folder(path: &Path) -> io::Result<()> {
    fs::create_dir(path)
}

fn remove_leftovers(parent: &Path) {
    for entry in fs::read_dir(parent).into_iter().flatten().filter_map(Result::ok) {
        let is_ours = entry.file_name().to_str().is_some_and(|name| name.starts_with(PREFIX));
        if is_ours && File::open(entry.path().join(ALIVE)).is_ok_and(|file| file.try_lock().is_ok()) {
            // Harmless if it remains.
            let _ = fs::remove_dir_all(entry.path());
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
}
