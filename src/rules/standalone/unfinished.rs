//! A file that gets its name when it is whole.

use std::fs::File;
use std::io;
use std::path::PathBuf;

/// A file beside the one that it is to become. Dropped before it is kept, it is removed.
#[derive(Debug)]
pub(super) struct Unfinished {
    path: PathBuf,
    target: PathBuf,
}

impl Unfinished {
    /// Begins a file that is to replace `target`.
    ///
    /// # Errors
    /// It can't be made.
    pub(super) fn begin(target: PathBuf) -> io::Result<(Self, File)> {
        // The number keeps two programs that write the same file apart.
        let path = target.with_added_extension(format!("{}.partial", std::process::id()));
        let file = File::create(&path)?;
        Ok((Self { path, target }, file))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// It can't be renamed; then it is removed.
    pub(super) fn keep(self) -> io::Result<()> {
        std::fs::rename(&self.path, &self.target)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        // Where it has its name already, nothing is left to remove.
        let _ = std::fs::remove_file(&self.path);
    }
}
