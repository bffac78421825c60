//! Files of a project: on disk, or embedded in the binary.

use std::path::{Component, Path, PathBuf};

use crate::shipped;
use crate::{FileKind, NotPlain, Source, read_regular, xml_text};

/// Why a file of a project can't be read: a lower-case sentence without the path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FileFault {
    /// The file does not exist.
    #[error("there is no such file")]
    Missing,
    /// No file with this path is embedded in the binary.
    #[error("no built-in file has this path")]
    NotShipped,
    /// The permissions of the file or of its folder do not allow it.
    #[error("reading it is not permitted")]
    NotPermitted,
    /// The path is that of a folder.
    #[error("it is a folder")]
    Folder,
    /// Devices and pipes may have no end.
    #[error("it is {0}, not a file")]
    NotRegular(FileKind),
    /// The bytes are not valid UTF-8.
    #[error("it is not UTF-8 text")]
    NotText,
    /// The encoding of an XML text, by its declaration or its first bytes.
    #[error("its encoding, `{0}`, is unknown; save it as UTF-8")]
    Encoding(String),
    /// Some bytes of an XML text are not in its encoding.
    #[error(
        "line {line} is not in its encoding, {encoding}; save it as UTF-8, or state its encoding in the XML declaration"
    )]
    NotInEncoding {
        /// The name in the XML declaration, or that of a byte-order mark.
        encoding: String,
        /// The first such line, from 1.
        line: usize,
    },
    /// The operating system reports another error, or the file is too large.
    #[error("{0}")]
    System(String),
}

/// Longest file that is read as a whole. Unit: bytes.
const LONGEST: u64 = 1 << 30;
/// Longest text of a configuration, a model, a rule or an ontology. Unit: bytes.
const LONGEST_TEXT: u64 = 64 << 20;

/// A source of files, by path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Files {
    /// The files embedded in the binary: `ontology/`, `rules/` and `models/` at build time.
    Shipped,
    /// The file system; paths are as the user gave them.
    Disk,
}

impl Files {
    /// Reads a file's bytes.
    ///
    /// # Errors
    /// As [`Files::read`], except that the file need not be UTF-8 and may have up to 1 GiB.
    pub fn read_bytes(&self, path: &Path) -> Result<Vec<u8>, FileFault> {
        self.read_up_to(path, LONGEST)
    }

    fn read_up_to(&self, path: &Path, longest: u64) -> Result<Vec<u8>, FileFault> {
        match self {
            Self::Shipped => {
                shipped::read(&slashed(&normalised(path))).ok_or(FileFault::NotShipped)
            }
            Self::Disk => read_disk(path, longest),
        }
    }

    /// Reads a text of at most 64 MiB. The source's name is the path, prefixed with `built-in:` for
    /// embedded files. XML may have other encodings than UTF-8, see [`xml_text`].
    ///
    /// # Errors
    /// The reason. Devices and pipes are refused: they may have no end.
    pub fn read(&self, path: &Path) -> Result<Source, FileFault> {
        self.read_text(path, LONGEST_TEXT)
    }

    /// Reads a text as [`Files::read`] does, of up to 1 GiB: a program may contain its facts.
    ///
    /// # Errors
    /// As [`Files::read`].
    pub fn read_program(&self, path: &Path) -> Result<Source, FileFault> {
        self.read_text(path, LONGEST)
    }

    fn read_text(&self, path: &Path, longest: u64) -> Result<Source, FileFault> {
        let name = match self {
            Self::Shipped => format!("built-in:{}", slashed(&normalised(path))),
            Self::Disk => path.display().to_string(),
        };
        let text = xml_text(self.read_up_to(path, longest)?)?;
        Ok(Source::new(name, text))
    }

    /// Returns the paths of the files directly in a folder, sorted; empty if the folder does not
    /// exist.
    pub fn list(&self, folder: &Path) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = match self {
            Self::Shipped => {
                let folder = normalised(folder);
                shipped::paths()
                    .into_iter()
                    .filter(|path| path.parent() == Some(&folder))
                    .collect()
            }
            Self::Disk => std::fs::read_dir(folder)
                .into_iter()
                .flatten()
                .filter_map(Result::ok)
                .map(|entry| entry.path())
                .filter(|path| path.is_file())
                .collect(),
        };
        paths.sort();
        paths
    }

    /// Returns the paths of all shipped files in a folder and its subfolders, sorted.
    pub fn all_shipped(folder: &Path) -> Vec<PathBuf> {
        let mut paths = shipped::paths();
        paths.retain(|path| path.starts_with(folder));
        paths.sort();
        paths
    }

    /// Returns the paths of the direct subfolders of a folder, sorted; empty if the folder does not
    /// exist.
    pub fn folders(&self, folder: &Path) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = match self {
            Self::Shipped => {
                let folder = normalised(folder);
                let below = shipped::paths().into_iter().filter_map(|path| {
                    let mut below = path.strip_prefix(&folder).ok()?.components();
                    let first = below.next()?;
                    below.next().map(|_| folder.join(first))
                });
                below.collect()
            }
            Self::Disk => std::fs::read_dir(folder)
                .into_iter()
                .flatten()
                .filter_map(Result::ok)
                .map(|entry| entry.path())
                .filter(|path| path.is_dir())
                .collect(),
        };
        paths.sort();
        paths.dedup();
        paths
    }
}

/// Reads a regular file: opening a pipe may wait for ever, and a device may have no end.
fn read_disk(path: &Path, longest: u64) -> Result<Vec<u8>, FileFault> {
    read_regular(path, longest).map_err(|error| match NotPlain::of(&error) {
        Some(NotPlain { kind, .. }) if *kind == FileKind::Folder => FileFault::Folder,
        Some(NotPlain { kind, .. }) => FileFault::NotRegular(*kind),
        None => system_fault(&error),
    })
}

/// Removes `.` and `..` from a path as far as possible without reading the disk.
fn normalised(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if out.file_name().is_some() => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

fn slashed(path: &Path) -> String {
    path.components()
        .map(|c| c.as_os_str().to_string_lossy())
        .collect::<Vec<_>>()
        .join("/")
}

fn system_fault(error: &std::io::Error) -> FileFault {
    match error.kind() {
        std::io::ErrorKind::NotFound => FileFault::Missing,
        std::io::ErrorKind::PermissionDenied => FileFault::NotPermitted,
        std::io::ErrorKind::IsADirectory => FileFault::Folder,
        _ => FileFault::System(error.to_string().to_lowercase()),
    }
}
