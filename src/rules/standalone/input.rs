//! Opens a file for an import: decompression, the encoding, and the limits of time and memory.

use std::cell::Cell;
use std::fs::File;
use std::io::{BufReader, Cursor, Error, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use crate::engine::budget::Budget;

/// The limits of all imports of a program.
pub(super) struct Limits<'a> {
    budget: &'a Budget,
    /// `None` if the time limit is beyond the range of the clock.
    end: Option<Instant>,
    ended: Cell<Option<Ended>>,
    /// Memory of the facts when it was last computed. Unit: bytes.
    facts: Cell<usize>,
    /// Text read since the last row. Unit: bytes.
    unsettled: Cell<usize>,
}

/// A parser takes at most about this memory for each byte of a text from which it makes no rows,
/// such as brackets and prefixes.
const PARSER_BYTES: usize = 48;

/// Text that is read before its rows are counted.
const READ_AHEAD: usize = 1 << 20;

/// The limit that ended an import.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ended {
    Interrupted,
    Time,
    Memory,
}

impl<'a> Limits<'a> {
    /// Starts the clock.
    pub(super) fn new(budget: &'a Budget) -> Self {
        let time = Duration::try_from_secs_f64(budget.secs.max(0.0)).ok();
        let end = time.and_then(|time| Instant::now().checked_add(time));
        Self {
            budget,
            end,
            ended: Cell::new(None),
            facts: Cell::new(0),
            unsettled: Cell::new(0),
        }
    }

    /// Returns the limit that ended an import, if one did.
    pub(super) fn ended(&self) -> Option<Ended> {
        self.ended.get()
    }

    /// Fails if the import must stop.
    pub(super) fn check(&self) -> std::io::Result<()> {
        if self.budget.stop.load(Ordering::Relaxed) {
            return Err(self.end(Ended::Interrupted));
        }
        match self.end {
            Some(end) if Instant::now() > end => Err(self.end(Ended::Time)),
            _ => Ok(()),
        }
    }

    /// Fails if the facts need more than the permitted memory, or the import must stop.
    ///
    /// `bytes`: the memory of the facts.
    pub(super) fn check_with(&self, bytes: usize) -> std::io::Result<()> {
        self.facts.set(bytes);
        if bytes > self.budget.bytes {
            return Err(self.end(Ended::Memory));
        }
        self.check()
    }

    /// Notes that a row was made of the text read so far.
    pub(super) fn settle(&self) {
        self.unsettled.set(0);
    }

    /// Returns a reader for a parser that makes rows while it reads. Reads fail if the parser may
    /// need more than the permitted memory for a text from which it makes none.
    pub(super) fn counted<R: Read>(&'a self, inner: R) -> Counted<'a, R> {
        Counted {
            inner,
            limits: self,
        }
    }

    fn end(&self, ended: Ended) -> Error {
        self.ended.set(Some(ended));
        // Not `ErrorKind::Interrupted`, after which readers retry.
        Error::other("a limit of the import was reached")
    }
}

/// Why a file can't be imported.
#[derive(Debug, thiserror::Error)]
pub(super) enum InputFault {
    #[error("it is a folder")]
    Folder,
    #[error("it is UTF-16 text; convert it to UTF-8")]
    Utf16,
    #[error("it is not UTF-8 text: a zero byte is at its beginning, as in UTF-16 or binary data")]
    ZeroByte,
    #[cfg(not(feature = "gzip"))]
    #[error(
        "this build can't decompress it; unpack it, or build `actcheck-rules` with the feature `gzip`"
    )]
    Compressed,
    /// It can't be opened.
    #[error("{}", .0.to_string().to_lowercase())]
    Open(Error),
    /// Its content can't be read.
    #[error("{0}")]
    Read(Error),
}

/// How a file is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Gzip,
}

/// Opens a file as UTF-8 text without a byte order mark. Reads fail once a limit is reached.
///
/// # Errors
/// [`InputFault`] if the file can't be opened, or it is UTF-16 text.
pub(super) fn open<'a>(
    path: &Path,
    compression: Compression,
    limits: &'a Limits<'a>,
) -> Result<Box<dyn Read + 'a>, InputFault> {
    let kind = std::fs::metadata(path).map_err(InputFault::Open)?;
    if kind.is_dir() {
        return Err(InputFault::Folder);
    }
    let file: Box<dyn Read + 'a> = match kind.is_file() {
        true => Box::new(File::open(path).map_err(InputFault::Open)?),
        false => Box::new(Pipe::open(path.to_owned(), limits).map_err(InputFault::Open)?),
    };
    let file = Limited {
        inner: file,
        limits,
    };
    let mut text: Box<dyn Read + 'a> = match compression {
        Compression::None => Box::new(file),
        Compression::Gzip => Box::new(Limited {
            inner: unpacked(BufReader::with_capacity(1 << 16, file))?,
            limits,
        }),
    };
    let mut head = Vec::new();
    text.by_ref()
        .take(3)
        .read_to_end(&mut head)
        .map_err(InputFault::Open)?;
    match head.as_slice() {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => {
            return Err(InputFault::Utf16);
        }
        [0, ..] | [_, 0, ..] => {
            return Err(InputFault::ZeroByte);
        }
        [0xef, 0xbb, 0xbf] => head.clear(),
        _ => {}
    }
    Ok(Box::new(Cursor::new(head).chain(text)))
}

/// Decompresses a file.
#[cfg(feature = "gzip")]
fn unpacked<'a>(file: impl std::io::BufRead + 'a) -> Result<Box<dyn Read + 'a>, InputFault> {
    Ok(Box::new(flate2::bufread::MultiGzDecoder::new(file)))
}

/// Reports that compressed files need the feature `gzip`.
#[cfg(not(feature = "gzip"))]
fn unpacked<'a>(_file: impl Read) -> Result<Box<dyn Read + 'a>, InputFault> {
    Err(InputFault::Compressed)
}

/// A reader that counts the text from which no rows were made.
pub(super) struct Counted<'a, R> {
    inner: R,
    limits: &'a Limits<'a>,
}

impl<R: Read> Read for Counted<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        let Limits {
            unsettled,
            facts,
            budget,
            ..
        } = self.limits;
        unsettled.set(unsettled.get() + count);
        let parser = unsettled
            .get()
            .saturating_sub(READ_AHEAD)
            .saturating_mul(PARSER_BYTES);
        if facts.get().saturating_add(parser) > budget.bytes {
            return Err(self.limits.end(Ended::Memory));
        }
        Ok(count)
    }
}

/// A reader whose reads fail once a limit is reached.
struct Limited<'a, R> {
    inner: R,
    limits: &'a Limits<'a>,
}

impl<R: Read> Read for Limited<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.limits.check()?;
        self.inner.read(buffer)
    }
}

/// A pipe or device. It is opened and read in a thread of its own, because either may wait for
/// ever.
struct Pipe<'a> {
    chunks: Receiver<std::io::Result<Vec<u8>>>,
    chunk: Cursor<Vec<u8>>,
    limits: &'a Limits<'a>,
}

/// Time between two checks of the limits while a pipe has no data.
const PIPE_CHECK: Duration = Duration::from_millis(20);

impl<'a> Pipe<'a> {
    fn open(path: PathBuf, limits: &'a Limits<'a>) -> std::io::Result<Self> {
        let (sender, chunks) = sync_channel(4);
        let read = move || {
            let mut file = match File::open(path) {
                Ok(file) => file,
                Err(error) => return drop(sender.send(Err(error))),
            };
            loop {
                let mut chunk = vec![0; 1 << 16];
                let sent = match file.read(&mut chunk) {
                    Ok(0) => return,
                    Ok(count) => {
                        chunk.truncate(count);
                        sender.send(Ok(chunk))
                    }
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                    Err(error) => return drop(sender.send(Err(error))),
                };
                // The import has ended.
                if sent.is_err() {
                    return;
                }
            }
        };
        std::thread::Builder::new().spawn(read)?;
        Ok(Self {
            chunks,
            chunk: Cursor::new(Vec::new()),
            limits,
        })
    }
}

impl Read for Pipe<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            let count = self.chunk.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            self.limits.check()?;
            match self.chunks.recv_timeout(PIPE_CHECK) {
                Ok(chunk) => self.chunk = Cursor::new(chunk?),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
    }
}
