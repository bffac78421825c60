//! Files that are written completely or not at all.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write as _};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::fs::{AtFlags, OFlags};

use crate::below::{open_in, open_root, or_here};

/// Suffix of files that are not complete yet.
const SUFFIX: &str = ".tmp";

/// A file that appears under its name when [`NewFile::finish`] is called. If it is dropped before,
/// nothing remains of it, and an existing file is unchanged. Until then, its content is in a file
/// beside it with the suffix `.tmp`, under a name that no other process uses.
#[derive(Debug)]
pub struct NewFile {
    file: File,
    /// `None` for a pipe or a device, which is written directly, and once the file is complete.
    unfinished: Option<Unfinished>,
}

/// The folder of a file, its name, and its name until it is complete.
#[derive(Debug)]
struct Unfinished {
    folder: OwnedFd,
    name: OsString,
    temporary: OsString,
}

impl NewFile {
    /// Creates a file that will replace the one at a path that the user named. The target of a link
    /// is replaced, not the link; a file that the program chooses is created by
    /// [`crate::Below::new_file`]. Leftovers of killed processes that were writing the same file
    /// are removed.
    ///
    /// # Errors
    /// The file can't be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
        match fs::metadata(&target) {
            Ok(found) if !found.is_file() => {
                let file = OpenOptions::new().write(true).open(&target)?;
                Ok(Self {
                    file,
                    unfinished: None,
                })
            }
            _ => {
                let folder = open_root(or_here(target.parent().unwrap_or(Path::new("/"))))?;
                Self::replacing(folder, target.file_name().unwrap_or_default())
            }
        }
    }

    /// Creates a file in a folder. Leftovers of killed processes that were writing the same file
    /// are removed.
    pub(crate) fn replacing(folder: OwnedFd, name: &OsStr) -> io::Result<Self> {
        remove_leftovers(&folder, name);
        Self::beside(folder, name)
    }

    /// Creates a file in a folder.
    pub(crate) fn beside(folder: OwnedFd, name: &OsStr) -> io::Result<Self> {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = COUNTER.fetch_add(1, Ordering::Relaxed);
            let mut temporary = name.to_os_string();
            temporary.push(format!(".{}-{number}{SUFFIX}", std::process::id()));
            let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL;
            match open_in(&folder, &temporary, Path::new(&temporary), flags) {
                Ok(file) => {
                    // The lock shows other processes that this one is alive. File systems without
                    // locks do without.
                    let _ = file.try_lock();
                    let unfinished = Unfinished {
                        folder,
                        name: name.to_os_string(),
                        temporary,
                    };
                    return Ok(Self {
                        file,
                        unfinished: Some(unfinished),
                    });
                }
                // The leftover of a killed process with the same id, or another file or link of
                // this name.
                Err(error)
                    if error.kind() == ErrorKind::AlreadyExists
                        || crate::NotPlain::of(&error).is_some() => {}
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

    pub(crate) fn write(&self, bytes: &[u8]) -> io::Result<()> {
        (&self.file).write_all(bytes)
    }

    /// Completes the file: flushes it to the disk and gives it its name.
    ///
    /// # Errors
    /// The disk is full or can't be written. An existing file is then unchanged.
    pub fn finish(mut self) -> io::Result<()> {
        if self.unfinished.is_none() {
            return Ok(());
        }
        self.file.sync_all()?;
        match self.named()? {
            Some(folder) => Ok(rustix::fs::fsync(&folder)?),
            None => Ok(()),
        }
    }

    /// Gives the file its name, without flushing it to the disk.
    pub(crate) fn publish(mut self) -> io::Result<()> {
        self.named().map(drop)
    }

    /// Gives the file its name. Returns its folder.
    fn named(&mut self) -> io::Result<Option<OwnedFd>> {
        if let Some(Unfinished {
            folder,
            name,
            temporary,
        }) = &self.unfinished
        {
            rustix::fs::renameat(folder, temporary, folder, name)?;
        }
        Ok(self.unfinished.take().map(|unfinished| unfinished.folder))
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        if let Some(Unfinished {
            folder, temporary, ..
        }) = &self.unfinished
        {
            // A partial file is useless. If its removal fails too, its suffix marks it as
            // temporary.
            let _ = rustix::fs::unlinkat(folder, temporary, AtFlags::empty());
        }
    }
}

/// Whether a name is that of a partial file: `NAME.PROCESS-NUMBER.tmp`.
pub(crate) fn is_leftover(name: &OsStr) -> bool {
    let parts = name
        .to_str()
        .and_then(|name| name.strip_suffix(SUFFIX)?.rsplit_once('.'));
    parts
        .and_then(|(_, of)| of.split_once('-'))
        .is_some_and(|(process, number)| {
            process.parse::<u32>().is_ok() && number.parse::<u64>().is_ok()
        })
}

/// Removes the partial files of killed processes that were writing a file. Those of living
/// processes are locked.
fn remove_leftovers(folder: &OwnedFd, name: &OsStr) {
    let Ok(entries) = rustix::fs::Dir::read_from(folder) else {
        return;
    };
    for entry in entries.filter_map(Result::ok) {
        let found = std::os::unix::ffi::OsStrExt::from_bytes(entry.file_name().to_bytes());
        let found: &OsStr = found;
        let is_of_name = found
            .as_encoded_bytes()
            .strip_prefix(name.as_encoded_bytes());
        if is_of_name.is_some_and(|rest| rest.starts_with(b"."))
            && is_leftover(found)
            && open_in(folder, found, Path::new(found), OFlags::RDONLY)
                .is_ok_and(|file| file.try_lock().is_ok())
        {
            // Harmless if it remains.
            let _ = rustix::fs::unlinkat(folder, found, AtFlags::empty());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Below;
    use std::path::PathBuf;

    /// A new empty folder.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("actcheck-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("the folder can be created");
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder)
            .expect("the folder can be read")
            .filter_map(Result::ok);
        let mut names: Vec<String> = entries
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Two processes that wrote the same file used the same temporary file, so that one could
    /// publish half of the other's content.
    #[test]
    fn simultaneous_writers_of_a_file_do_not_mix() {
        let folder = folder("writers");
        let target = folder.join("out");
        let (first, second) = (NewFile::create(&target), NewFile::create(&target));
        let (first, second) = (
            first.expect("it can be created"),
            second.expect("it can be created"),
        );
        first
            .writer()
            .and_then(|mut file| file.write_all(b"first"))
            .expect("it can be written");
        second
            .writer()
            .and_then(|mut file| file.write_all(b"second, longer"))
            .expect("it can be written");
        second.finish().expect("it can be completed");
        assert_eq!(
            fs::read(&target).expect("it can be read"),
            b"second, longer"
        );
        first.finish().expect("it can be completed");
        assert_eq!(fs::read(&target).expect("it can be read"), b"first");
        assert_eq!(names(&folder), ["out"]);
        fs::remove_dir_all(folder).expect("it can be removed");
    }

    #[test]
    fn an_unfinished_file_leaves_the_old_content_and_no_leftover() {
        let folder = folder("unfinished");
        let target = folder.join("out");
        Below::new(&folder)
            .write_atomic(&target, b"old")
            .expect("it can be written");
        let file = NewFile::create(&target).expect("it can be created");
        file.writer()
            .and_then(|mut file| file.write_all(b"ne"))
            .expect("it can be written");
        drop(file);
        // A killed process leaves its file without a lock.
        fs::write(folder.join("out.1-7.tmp"), "half").expect("it can be written");
        fs::write(folder.join("out.mine.tmp"), "another program's").expect("it can be written");
        Below::new(&folder)
            .write_quickly(&folder.join("other"), b"x")
            .expect("it can be written");
        let alive = NewFile::create(&target).expect("it can be created");
        let beside = NewFile::create(&target).expect("it can be created");
        beside.finish().expect("it can be completed");
        alive.finish().expect("a living process keeps its file");
        assert_eq!(names(&folder), ["other", "out", "out.mine.tmp"]);
        fs::remove_dir_all(folder).expect("it can be removed");
    }
}
