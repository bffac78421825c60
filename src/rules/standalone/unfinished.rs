//! Atomic file writing: a file is renamed into place when it is complete.

use std::fs::File;
use std::io;
use std::path::PathBuf;

/// A temporary file beside its target. It is removed if dropped before [`Unfinished::keep`].
#[derive(Debug)]
pub(super) struct Unfinished {
    path: PathBuf,
    target: PathBuf,
}

impl Unfinished {
    /// Creates a temporary file that will replace `target`.
    ///
    /// # Errors
    /// The file can't be created.
    pub(super) fn begin(target: PathBuf) -> io::Result<(Self, File)> {
        // The process id separates two programs that write the same file.
        let path = target.with_added_extension(format!("{}.partial", std::process::id()));
        let file = File::create(&path)?;
        Ok((Self { path, target }, file))
    }

    /// Renames the file to its target.
    ///
    /// # Errors
    /// The file can't be renamed; it is then removed.
    pub(super) fn keep(self) -> io::Result<()> {
        std::fs::rename(&self.path, &self.target)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        // After a successful rename the file no longer exists, so the error is ignored.
        let _ = std::fs::remove_file(&self.path);
    }
}
