//! Files below a folder that others may have written: no link is followed there, and only regular
//! files are opened.
//!
//! A history, a launch or a cache may come with a foreign project. A link in it would lead writers
//! and deleters to any file of the user; a pipe would never answer, and a device or a sparse file
//! would fill the memory.

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind, Read as _};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt as _;
use std::path::{Component, Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Dir, FileType, Mode, OFlags};

use crate::write_atomic::{NewFile, is_leftover};

/// The folder itself, which may be a link: the user named it, or the caller has checked it. It need
/// not exist.
///
/// Every path that its methods take begins with it, and has no `..` after it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Below {
    root: PathBuf,
}

/// The kind of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A regular file.
    File,
    /// A folder.
    Folder,
    /// A symbolic link.
    Link,
    /// A pipe, a socket or a device: reading it may wait for ever, or have no end.
    Special,
}

impl FileKind {
    fn of(kind: FileType) -> Self {
        match kind {
            FileType::RegularFile => Self::File,
            FileType::Directory => Self::Folder,
            FileType::Symlink => Self::Link,
            _ => Self::Special,
        }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::File => "a file",
            Self::Folder => "a folder",
            Self::Link => "a link",
            Self::Special => "a device or a pipe",
        })
    }
}

/// A path that is not used because of its kind: a link, a special file, or a folder in place of a
/// file.
#[derive(Debug, thiserror::Error)]
#[error("`{}` is {kind}, not {}", path.display(), wanted)]
pub struct NotPlain {
    /// The path.
    pub path: PathBuf,
    /// Its kind.
    pub kind: FileKind,
    /// The kind that is needed.
    pub wanted: FileKind,
}

impl NotPlain {
    /// The reason of an error of [`Below`], if it is one.
    pub fn of(error: &io::Error) -> Option<&Self> {
        error.get_ref()?.downcast_ref()
    }

    fn error(path: &Path, kind: FileKind, wanted: FileKind) -> io::Error {
        io::Error::other(Self {
            path: path.to_path_buf(),
            kind,
            wanted,
        })
    }
}

const FOLDER: OFlags = OFlags::DIRECTORY.union(OFlags::CLOEXEC);
/// Opening a pipe does not wait then.
const PLAIN: OFlags = OFlags::NOFOLLOW
    .union(OFlags::NONBLOCK)
    .union(OFlags::NOCTTY)
    .union(OFlags::CLOEXEC);
/// Permissions of new files and folders, from which the user's mask takes some.
const FILE_MODE: Mode = Mode::from_raw_mode(0o666);
const FOLDER_MODE: Mode = Mode::from_raw_mode(0o777);

impl Below {
    /// The files below a folder.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The kind of a path. Returns `None` if there is nothing, or if a folder on the way can't be
    /// opened.
    pub fn kind(&self, path: &Path) -> Option<FileKind> {
        let (folder, name) = self.folder_of(path).ok()?;
        kind_in(&folder, name).ok()
    }

    /// Opens a regular file for reading.
    ///
    /// # Errors
    /// [`NotPlain`] it is not a regular file, or a folder on the way is a link; it can't be opened.
    pub fn open(&self, path: &Path) -> io::Result<File> {
        let (folder, name) = self.folder_of(path)?;
        open_in(&folder, name, path, OFlags::RDONLY)
    }

    /// Reads a regular file of at most `most` bytes.
    ///
    /// # Errors
    /// As [`Below::open`]; it is longer.
    pub fn read(&self, path: &Path, most: u64) -> io::Result<Vec<u8>> {
        read_up_to(self.open(path)?, most)
    }

    /// Reads a regular file of at most `most` bytes as UTF-8 text.
    ///
    /// # Errors
    /// As [`Below::read`]; it is not text.
    pub fn read_text(&self, path: &Path, most: u64) -> io::Result<String> {
        String::from_utf8(self.read(path, most)?)
            .map_err(|error| io::Error::new(ErrorKind::InvalidData, error))
    }

    /// The names in a folder with their kinds, sorted. Empty if the folder does not exist.
    ///
    /// # Errors
    /// [`NotPlain`] it is not a folder; it can't be read.
    pub fn entries(&self, folder: &Path) -> io::Result<Vec<(OsString, FileKind)>> {
        let opened = match self.folder(folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            opened => opened?,
        };
        let mut found = Vec::new();
        for entry in Dir::read_from(&opened)? {
            let entry = entry?;
            let name = OsStr::from_bytes(entry.file_name().to_bytes());
            if name == "." || name == ".." {
                continue;
            }
            let kind = match entry.file_type() {
                FileType::Unknown => kind_in(&opened, name)?,
                known => FileKind::of(known),
            };
            found.push((name.to_owned(), kind));
        }
        found.sort_by(|one, other| one.0.cmp(&other.0));
        Ok(found)
    }

    /// The paths of the regular files in a folder, sorted. Empty if the folder can't be read.
    pub fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let entries = self.entries(folder).unwrap_or_default().into_iter();
        entries
            .filter(|(_, kind)| *kind == FileKind::File)
            .map(|(name, _)| folder.join(name))
            .collect()
    }

    /// Creates a folder and those on the way that are missing.
    ///
    /// # Errors
    /// [`NotPlain`] a folder on the way is a link; they can't be created.
    pub fn create_folder(&self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir_all(or_here(&self.root))?;
        let mut opened = open_root(&self.root)?;
        let mut path = self.root.clone();
        for name in self.names(folder)? {
            path.push(name);
            match rustix::fs::mkdirat(&opened, name, FOLDER_MODE) {
                Err(error) if error != rustix::io::Errno::EXIST => return Err(error.into()),
                _ => opened = folder_in(&opened, name, &path)?,
            }
        }
        Ok(())
    }

    /// Creates a file that will have a name here when it is complete: see [`NewFile`]. A link of
    /// that name is replaced.
    ///
    /// # Errors
    /// As [`Below::open`]; it can't be created.
    pub fn new_file(&self, path: &Path) -> io::Result<NewFile> {
        let (folder, name) = self.folder_of(path)?;
        NewFile::replacing(folder, name)
    }

    /// Writes a file atomically, also across a power cut.
    ///
    /// # Errors
    /// As [`Below::new_file`]. An existing file is then unchanged.
    pub fn write_atomic(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let (folder, name) = self.folder_of(path)?;
        let file = NewFile::beside(folder, name)?;
        file.write(bytes)?;
        file.finish()
    }

    /// Writes a file that can be made again: other processes see all of it or nothing, but after a
    /// power cut it may be missing or empty. This takes a hundredth of the time of
    /// [`Below::write_atomic`].
    ///
    /// # Errors
    /// As [`Below::write_atomic`].
    pub fn write_quickly(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let (folder, name) = self.folder_of(path)?;
        let file = NewFile::beside(folder, name)?;
        file.write(bytes)?;
        file.publish()
    }

    /// Opens a file to write at its end, and creates it if it is missing.
    ///
    /// # Errors
    /// As [`Below::open`]; it can't be created.
    pub fn append(&self, path: &Path) -> io::Result<File> {
        self.open_or_create(path, OFlags::RDWR | OFlags::APPEND)
    }

    /// Opens a file to write it anew, and creates it if it is missing.
    ///
    /// # Errors
    /// As [`Below::append`].
    pub fn emptied(&self, path: &Path) -> io::Result<File> {
        let file = self.open_or_create(path, OFlags::RDWR)?;
        file.set_len(0)?;
        Ok(file)
    }

    /// Opens a file whose content does not matter, to lock it, and creates it if it is missing.
    ///
    /// # Errors
    /// As [`Below::append`].
    pub fn lock_file(&self, path: &Path) -> io::Result<File> {
        self.open_or_create(path, OFlags::RDWR)
    }

    fn open_or_create(&self, path: &Path, flags: OFlags) -> io::Result<File> {
        let (folder, name) = self.folder_of(path)?;
        open_in(&folder, name, path, flags | OFlags::CREATE)
    }

    /// Removes a file. A link is removed, not the file that it leads to.
    ///
    /// # Errors
    /// It can't be removed.
    pub fn remove(&self, path: &Path) -> io::Result<()> {
        let (folder, name) = self.folder_of(path)?;
        Ok(rustix::fs::unlinkat(&folder, name, AtFlags::empty())?)
    }

    /// Removes an empty folder.
    ///
    /// # Errors
    /// It can't be removed.
    pub fn remove_folder(&self, path: &Path) -> io::Result<()> {
        let (folder, name) = self.folder_of(path)?;
        Ok(rustix::fs::unlinkat(&folder, name, AtFlags::REMOVEDIR)?)
    }

    /// Removes the regular files below a folder that `is_ours` accepts by their path below it,
    /// partial ones, and the folders that are empty then. Returns the paths of all that remains,
    /// sorted.
    ///
    /// # Errors
    /// Something can't be removed.
    pub fn remove_ours(
        &self,
        folder: &Path,
        is_ours: &dyn Fn(&Path) -> bool,
    ) -> io::Result<Vec<PathBuf>> {
        let mut left = Vec::new();
        self.remove_below(folder, folder, is_ours, &mut left)?;
        Ok(left)
    }

    fn remove_below(
        &self,
        top: &Path,
        folder: &Path,
        is_ours: &dyn Fn(&Path) -> bool,
        left: &mut Vec<PathBuf>,
    ) -> io::Result<()> {
        let before = left.len();
        let entries = match self.kind(folder) {
            None => return Ok(()),
            Some(_) => self.entries(folder)?,
        };
        for (name, kind) in entries {
            let path = folder.join(name);
            let below = path.strip_prefix(top).unwrap_or(&path);
            match kind {
                FileKind::Folder => self.remove_below(top, &path, is_ours, left)?,
                FileKind::File if is_ours(below) || path.file_name().is_some_and(is_leftover) => {
                    self.remove(&path)?
                }
                _ => left.push(path),
            }
        }
        if left.len() == before {
            self.remove_folder(folder)
        } else {
            Ok(())
        }
    }

    /// Removes the partial files in a folder that killed processes have left: see [`NewFile`].
    pub fn remove_leftovers(&self, folder: &Path) {
        for path in self.files(folder) {
            if path.file_name().is_some_and(is_leftover)
                && self.open(&path).is_ok_and(|file| file.try_lock().is_ok())
            {
                // Harmless if it remains.
                let _ = self.remove(&path);
            }
        }
    }

    /// Gives a file or a folder another name.
    ///
    /// # Errors
    /// It can't be renamed.
    pub fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let ((from, old), (to, new)) = (self.folder_of(from)?, self.folder_of(to)?);
        Ok(rustix::fs::renameat(&from, old, &to, new)?)
    }

    /// Gives a regular file that is below another folder a second name here, which takes no space.
    /// On another file system, copies it. Files that may be linked are never changed, only
    /// replaced.
    ///
    /// # Errors
    /// As [`Below::open`]; the new name can't be given, for example because it exists.
    pub fn link(&self, from: &Below, file: &Path, to: &Path) -> io::Result<()> {
        let mut opened = from.open(file)?;
        let ((old_folder, old), (folder, name)) = (from.folder_of(file)?, self.folder_of(to)?);
        if rustix::fs::linkat(&old_folder, old, &folder, name, AtFlags::empty()).is_ok() {
            return Ok(());
        }
        let new = NewFile::beside(folder, name)?;
        io::copy(&mut opened, &mut new.writer()?)?;
        new.publish()
    }

    /// Writes the names of a folder's files to the disk.
    ///
    /// # Errors
    /// The disk fails.
    pub fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        Ok(rustix::fs::fsync(self.folder(folder)?)?)
    }

    /// Opens a folder, for example to lock it.
    ///
    /// # Errors
    /// [`NotPlain`] it is not a folder; it can't be opened.
    pub fn open_folder(&self, folder: &Path) -> io::Result<File> {
        self.folder(folder).map(File::from)
    }

    fn folder(&self, path: &Path) -> io::Result<OwnedFd> {
        let (mut opened, mut at) = (open_root(&self.root)?, self.root.clone());
        for name in self.names(path)? {
            at.push(name);
            opened = folder_in(&opened, name, &at)?;
        }
        Ok(opened)
    }

    /// The folder of a path, opened, and the name in it.
    fn folder_of<'p>(&self, path: &'p Path) -> io::Result<(OwnedFd, &'p OsStr)> {
        let (mut opened, mut at) = (open_root(&self.root)?, self.root.clone());
        let mut names = self.names(path)?;
        let last = names.pop().ok_or_else(|| outside(path))?;
        for name in names {
            at.push(name);
            opened = folder_in(&opened, name, &at)?;
        }
        Ok((opened, last))
    }

    /// The names of a path below the root.
    fn names<'p>(&self, path: &'p Path) -> io::Result<Vec<&'p OsStr>> {
        let below = path.strip_prefix(&self.root).map_err(|_| outside(path))?;
        let name = |component| match component {
            Component::Normal(name) => Some(Ok(name)),
            Component::CurDir => None,
            _ => Some(Err(outside(path))),
        };
        below.components().filter_map(name).collect()
    }
}

/// Opens a file that the user named, or that a file of the project names, for reading: a link is
/// followed. Pipes and devices are refused.
///
/// # Errors
/// [`NotPlain`] it is not a regular file; it can't be opened.
pub fn open_regular(path: &Path) -> io::Result<File> {
    let kind = FileKind::of(FileType::from_raw_mode(rustix::fs::stat(path)?.st_mode));
    // Opening a device can have effects.
    if kind != FileKind::File {
        return Err(NotPlain::error(path, kind, FileKind::File));
    }
    checked(
        File::from(rustix::fs::open(
            path,
            PLAIN.difference(OFlags::NOFOLLOW),
            Mode::empty(),
        )?),
        path,
    )
}

/// Reads a file of at most `most` bytes as [`open_regular`] opens it.
///
/// # Errors
/// As [`open_regular`]; it is longer.
pub fn read_regular(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    read_up_to(open_regular(path)?, most)
}

/// Reads all of a file of at most `most` bytes.
fn read_up_to(file: File, most: u64) -> io::Result<Vec<u8>> {
    let too_long = || io::Error::other(format!("it is longer than {} MiB", most.div_ceil(1 << 20)));
    let length = file.metadata()?.len();
    if length > most {
        return Err(too_long());
    }
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or_default());
    // Some files are longer than their metadata says.
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        Err(too_long())
    } else {
        Ok(bytes)
    }
}

pub(crate) fn or_here(path: &Path) -> &Path {
    if path.as_os_str().is_empty() {
        Path::new(".")
    } else {
        path
    }
}

/// Opens a folder that may be a link.
pub(crate) fn open_root(root: &Path) -> io::Result<OwnedFd> {
    Ok(rustix::fs::openat(
        CWD,
        or_here(root),
        FOLDER | OFlags::RDONLY,
        Mode::empty(),
    )?)
}

/// Opens a folder in a folder.
fn folder_in(folder: &OwnedFd, name: &OsStr, path: &Path) -> io::Result<OwnedFd> {
    rustix::fs::openat(
        folder,
        name,
        FOLDER | OFlags::NOFOLLOW | OFlags::RDONLY,
        Mode::empty(),
    )
    .map_err(|error| match kind_in(folder, name) {
        Ok(kind) if kind != FileKind::Folder => NotPlain::error(path, kind, FileKind::Folder),
        _ => error.into(),
    })
}

/// Opens a regular file in a folder. `path` is named in the error.
pub(crate) fn open_in(
    folder: &OwnedFd,
    name: &OsStr,
    path: &Path,
    flags: OFlags,
) -> io::Result<File> {
    match kind_in(folder, name) {
        Ok(FileKind::File) => {}
        // Opening a device can have effects.
        Ok(kind) => return Err(NotPlain::error(path, kind, FileKind::File)),
        Err(error) if error.kind() == ErrorKind::NotFound && flags.contains(OFlags::CREATE) => {}
        Err(error) => return Err(error),
    }
    let opened = rustix::fs::openat(folder, name, PLAIN | flags, FILE_MODE)?;
    checked(File::from(opened), path)
}

/// The file, if it is a regular one: another process may have replaced it after it was looked at.
fn checked(file: File, path: &Path) -> io::Result<File> {
    let kind = FileKind::of(FileType::from_raw_mode(rustix::fs::fstat(&file)?.st_mode));
    if kind == FileKind::File {
        Ok(file)
    } else {
        Err(NotPlain::error(path, kind, FileKind::File))
    }
}

fn kind_in(folder: &OwnedFd, name: &OsStr) -> io::Result<FileKind> {
    let found = rustix::fs::statat(folder, name, AtFlags::SYMLINK_NOFOLLOW)?;
    Ok(FileKind::of(FileType::from_raw_mode(found.st_mode)))
}

fn outside(path: &Path) -> io::Error {
    io::Error::new(
        ErrorKind::InvalidInput,
        format!("`{}` leads out of its folder", path.display()),
    )
}
