//! Files that are written completely or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Suffix of files that are not complete yet.
const SUFFIX: &str = ".tmp";

/// Writes a file atomically, also across a power cut. Until it is complete, its content is in a file beside it with the
/// suffix `.tmp`, under a name that no other process uses.
///
/// # Errors
/// Returns an error if the file can't be written. An existing file is then unchanged.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = NewFile::beside(path.to_path_buf())?;
    (&file.file).write_all(bytes)?;
    file.finish()
}

/// Writes a file that can be made again, such as one of a report: other processes see all of it or nothing, but after a
/// power cut it may be missing or empty. This takes a hundredth of the time of [`write_atomic`].
///
/// # Errors
/// Returns an error if the file can't be written. An existing file is then unchanged.
pub fn write_quickly(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let file = NewFile::beside(path.to_path_buf())?;
    (&file.file).write_all(bytes)?;
    file.publish()
}

/// A file that appears under its name when [`NewFile::finish`] is called. If it is dropped before, nothing remains of
/// it, and an existing file is unchanged.
#[derive(Debug)]
pub struct NewFile {
    file: File,
    target: PathBuf,
    /// `None` for a pipe or a device, which is written directly, and once the file is complete.
    temporary: Option<PathBuf>,
}

impl NewFile {
    /// Creates a file that will replace the one at a path. The target of a link is replaced, not the link. Leftovers of
    /// killed processes that were writing the same file are removed.
    ///
    /// # Errors
    /// The file can't be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        match fs::metadata(&target) {
            Ok(found) if !found.is_file() => {
                let file = OpenOptions::new().write(true).open(&target)?;
                Ok(Self { file, target, temporary: None })
            }
            _ => {
                remove_leftovers(&target);
                Self::beside(target)
            }
        }
    }

    fn beside(target: PathBuf) -> io::Result<Self> {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = COUNTER.fetch_add(1, Ordering::Relaxed);
            let mut name = target.file_name().unwrap_or_default().to_os_string();
            name.push(format!(".{}-{number}{SUFFIX}", std::process::id()));
            let temporary = target.with_file_name(name);
            match OpenOptions::new().write(true).create_new(true).open(&temporary) {
                Ok(file) => {
                    // The lock shows other processes that this one is alive. File systems without locks do without.
                    let _ = file.try_lock();
                    return Ok(Self { file, target, temporary: Some(temporary) });
                }
                // The leftover of a killed process with the same id.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// A handle to write the content.
    ///
    /// # Errors
    /// The process has too many open files.
    pub fn writer(&self) -> io::Result<File> {
        self.file.try_clone()
    }

    /// Completes the file: flushes it to the disk and gives it its name.
    ///
    /// # Errors
    /// The disk is full or can't be written. An existing file is then unchanged.
    pub fn finish(self) -> io::Result<()> {
        if self.temporary.is_none() {
            return Ok(());
        }
        self.file.sync_all()?;
        let folder = self.target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = folder.to_path_buf();
        self.publish()?;
        File::open(folder)?.sync_all()
    }

    /// Gives the file its name, without flushing it to the disk.
    fn publish(mut self) -> io::Result<()> {
        if let Some(temporary) = &self.temporary {
            fs::rename(temporary, &self.target)?;
            self.temporary = None;
        }
        Ok(())
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            // A partial file is useless. If its removal fails too, its suffix marks it as temporary.
            let _ = fs::remove_file(temporary);
        }
    }
}

/// Removes the partial files of killed processes. Those of living processes are locked.
fn remove_leftovers(target: &Path) {
    let Some(name) = target.file_name().and_then(|name| name.to_str()) else { return };
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let found = entry.file_name();
        let of_process =
            found.to_str().and_then(|found| found.strip_prefix(name)?.strip_prefix('.')?.strip_suffix(SUFFIX));
        let is_ours = of_process
            .and_then(|of| of.split_once('-'))
            .is_some_and(|(process, number)| process.parse::<u32>().is_ok() && number.parse::<u64>().is_ok());
        if is_ours && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
            // Harmless if it remains.
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A new empty folder.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("actcheck-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("the folder can be created");
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("the folder can be read").filter_map(Result::ok);
        let mut names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Two processes that wrote the same file used the same temporary file, so that one could publish half of the
    /// other's content.
    #[test]
    fn simultaneous_writers_of_a_file_do_not_mix() {
        let folder = folder("writers");
        let target = folder.join("out");
        let (first, second) = (NewFile::create(&target), NewFile::create(&target));
        let (first, second) = (first.expect("it can be created"), second.expect("it can be created"));
        first.writer().and_then(|mut file| file.write_all(b"first")).expect("it can be written");
        second.writer().and_then(|mut file| file.write_all(b"second, longer")).expect("it can be written");
        second.finish().expect("it can be completed");
        assert_eq!(fs::read(&target).expect("it can be read"), b"second, longer");
        first.finish().expect("it can be completed");
        assert_eq!(fs::read(&target).expect("it can be read"), b"first");
        assert_eq!(names(&folder), ["out"]);
        fs::remove_dir_all(folder).expect("it can be removed");
    }

    #[test]
    fn an_unfinished_file_leaves_the_old_content_and_no_leftover() {
        let folder = folder("unfinished");
        let target = folder.join("out");
        write_atomic(&target, b"old").expect("it can be written");
        let file = NewFile::create(&target).expect("it can be created");
        file.writer().and_then(|mut file| file.write_all(b"ne")).expect("it can be written");
        drop(file);
        // A killed process leaves its file without a lock.
        fs::write(folder.join("out.1-7.tmp"), "half").expect("it can be written");
        fs::write(folder.join("out.mine.tmp"), "another program's").expect("it can be written");
        write_quickly(&folder.join("other"), b"x").expect("it can be written");
        let alive = NewFile::create(&target).expect("it can be created");
        let beside = NewFile::create(&target).expect("it can be created");
        beside.finish().expect("it can be completed");
        alive.finish().expect("a living process keeps its file");
        assert_eq!(names(&folder), ["other", "out", "out.mine.tmp"]);
        fs::remove_dir_all(folder).expect("it can be removed");
    }
}
