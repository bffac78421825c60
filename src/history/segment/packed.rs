//! Compressed frames about runs.
//!
//! Runs of a campaign are much alike, so that most frames are compressed with an earlier one as
//! their dictionary: the key frame, which does not need another. A content is the index of its run,
//! the distance back to its key frame (0 for a key frame), its expanded size, and the compressed
//! bytes.

use std::fs::File;
use std::io::{self, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

use zstd::bulk::{Compressor, Decompressor};

use crate::segment::frame::{
    FRAME_HEADER, FrameFault, FramePlace, HEAD, ReadFault, SegmentColumn, content_of, place_of, put,
};
use actcheck_base::{Below, ByteReader, put_varint};

/// Compression level: higher ones take many times as long and save some percent.
const LEVEL: i32 = 6;
/// Number of frames that a key frame serves at most: damage to it makes all of these unreadable.
const FRAMES_OF_A_KEY: usize = 128;

/// The most bytes that are expected from compressed ones. Motion expands three to five times, that
/// of a robot at rest more, and a run that is much like its key frame a hundred times; damaged or
/// foreign bytes may expand many thousand times.
fn most_expanded(compressed: usize) -> u64 {
    const FEW: u64 = 32 << 20;
    FEW + 64 * compressed as u64
}

/// Path of a column of a segment.
pub(super) fn path(folder: &Path, number: u32, column: SegmentColumn) -> PathBuf {
    folder.join(format!("{number:04}.{}", column.extension()))
}

/// Compresses bytes on their own.
///
/// # Errors
/// The library has no memory.
pub(crate) fn packed(content: &[u8]) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    put_varint(&mut out, content.len() as u64);
    out.extend(zstd::bulk::compress(content, LEVEL)?);
    Ok(out)
}

/// Expands the result of [`packed`]. Returns `None` if it is damaged, or expands to far more than
/// this program writes.
pub(crate) fn unpacked(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut reader = ByteReader { bytes };
    let size = reader.varint()?;
    expanded(&mut Decompressor::new().ok()?, reader.bytes, size)
}

fn expanded(decompressor: &mut Decompressor<'_>, bytes: &[u8], size: u64) -> Option<Vec<u8>> {
    if size > most_expanded(bytes.len()) {
        return None;
    }
    let whole = decompressor.decompress(bytes, usize::try_from(size).ok()?);
    whole.ok().filter(|whole| whole.len() as u64 == size)
}

/// A column that one process writes.
pub(super) struct ColumnWriter {
    file: File,
    end: u64,
    /// Whether half a frame is after the end, which could not be removed: nothing may follow it.
    is_torn: bool,
    key: Option<Key>,
}

/// The present key frame.
struct Key {
    offset: u64,
    frames: usize,
    compressor: Compressor<'static>,
}

impl ColumnWriter {
    /// Begins a file.
    ///
    /// # Errors
    /// It exists already; it can't be created.
    pub(super) fn create(below: &Below, path: &Path, column: SegmentColumn) -> io::Result<Self> {
        let mut file = below.append(path)?;
        if file.metadata()?.len() > 0 {
            return Err(io::Error::new(
                io::ErrorKind::AlreadyExists,
                format!("{} is there already", path.display()),
            ));
        }
        file.write_all(&column.head())?;
        Ok(Self {
            file,
            end: HEAD as u64,
            is_torn: false,
            key: None,
        })
    }

    /// Offset at which the next frame begins.
    pub(super) fn end(&self) -> u64 {
        self.end
    }

    /// Appends a frame, completely or not at all.
    ///
    /// # Errors
    /// Writing failed.
    pub(super) fn append(&mut self, content: &[u8]) -> io::Result<FramePlace> {
        if self.is_torn {
            return Err(io::Error::other("an earlier write failed"));
        }
        let mut bytes = Vec::with_capacity(FRAME_HEADER + content.len());
        let place = put(self.end, content, &mut bytes)?;
        if let Err(error) = self.file.write_all(&bytes) {
            self.is_torn = self.file.set_len(self.end).is_err();
            return Err(error);
        }
        self.end = place.end();
        Ok(place)
    }

    /// Appends a frame about a run, compressed with the key frame as its dictionary.
    ///
    /// # Errors
    /// As [`ColumnWriter::append`].
    pub(super) fn append_alike(&mut self, index: u64, content: &[u8]) -> io::Result<FramePlace> {
        let mut out = Vec::new();
        put_varint(&mut out, index);
        if let Some(key) = &mut self.key
            && key.frames < FRAMES_OF_A_KEY
        {
            key.frames += 1;
            put_varint(&mut out, self.end - key.offset);
            put_varint(&mut out, content.len() as u64);
            out.extend(key.compressor.compress(content)?);
            return self.append(&out);
        }
        put_varint(&mut out, 0);
        out.extend(packed(content)?);
        let place = self.append(&out)?;
        self.key = Some(Key {
            offset: place.offset,
            frames: 1,
            compressor: Compressor::with_dictionary(LEVEL, content)?,
        });
        Ok(place)
    }

    /// Appends a frame about a run whose content is already [`packed`].
    ///
    /// # Errors
    /// As [`ColumnWriter::append`].
    pub(super) fn append_packed(&mut self, index: u64, content: &[u8]) -> io::Result<FramePlace> {
        let mut out = Vec::with_capacity(content.len() + 10);
        put_varint(&mut out, index);
        put_varint(&mut out, 0);
        out.extend(content);
        self.append(&out)
    }

    /// Removes frames of a run that was not written completely.
    pub(super) fn cut(&mut self, end: u64) {
        self.key.take_if(|key| key.offset >= end);
        // If this fails, the frames that nothing refers to are harmless.
        if self.file.set_len(end).is_ok() {
            self.end = end;
        }
    }

    /// Makes the frames so far survive a power cut.
    ///
    /// # Errors
    /// The system can't write them to the disk.
    pub(super) fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }
}

/// Reads frames about runs from a column.
pub(crate) struct ColumnReader {
    file: File,
    key: Option<(u64, Decompressor<'static>)>,
}

impl ColumnReader {
    /// Opens a column of a segment.
    ///
    /// # Errors
    /// The file is missing, is one of another kind, or can't be opened.
    pub(crate) fn open(
        below: &Below,
        folder: &Path,
        number: u32,
        column: SegmentColumn,
    ) -> Result<Self, ReadFault> {
        let reader = Self::open_damaged(below, folder, number, column)?;
        let mut head = [0; HEAD];
        let has_head = reader.file.read_exact_at(&mut head, 0).is_ok() && head == column.head();
        if has_head {
            Ok(reader)
        } else {
            Err(FrameFault::Head.into())
        }
    }

    /// As [`ColumnReader::open`], also if the first bytes are others.
    ///
    /// # Errors
    /// The file is missing, or can't be opened.
    pub(crate) fn open_damaged(
        below: &Below,
        folder: &Path,
        number: u32,
        column: SegmentColumn,
    ) -> Result<Self, ReadFault> {
        let file = below.open(&path(folder, number, column))?;
        Ok(Self { file, key: None })
    }

    /// Expands the frame of a run.
    ///
    /// # Errors
    /// It is damaged, or the frame of another run; it can't be read.
    pub(crate) fn read(&mut self, index: u64, place: FramePlace) -> Result<Vec<u8>, ReadFault> {
        let fault = || ReadFault::from(FrameFault::Content(place.offset));
        let bytes = self.content(place)?;
        let frame = PackedFrame::parse(&bytes).filter(|frame| frame.index == index);
        let frame = frame.ok_or_else(fault)?;
        if frame.back == 0 {
            let mut decompressor = Decompressor::new()?;
            return expanded(&mut decompressor, frame.bytes, frame.size).ok_or_else(fault);
        }
        let key = place.offset.checked_sub(frame.back).ok_or_else(fault)?;
        let decompressor = match &mut self.key {
            Some((offset, decompressor)) if *offset == key => decompressor,
            _ => {
                let dictionary = self.key_content(key)?;
                let decompressor = Decompressor::with_dictionary(&dictionary)?;
                &mut self.key.insert((key, decompressor)).1
            }
        };
        expanded(decompressor, frame.bytes, frame.size).ok_or_else(fault)
    }

    /// The packed content of the frame of a run that is its own key frame.
    ///
    /// # Errors
    /// As [`ColumnReader::read`].
    pub(crate) fn read_packed(&self, index: u64, place: FramePlace) -> Result<Vec<u8>, ReadFault> {
        let bytes = self.content(place)?;
        let mut reader = ByteReader { bytes: &bytes };
        match (reader.varint(), reader.varint()) {
            (Some(of), Some(0)) if of == index => Ok(reader.bytes.to_vec()),
            _ => Err(FrameFault::Content(place.offset).into()),
        }
    }

    fn key_content(&self, offset: u64) -> Result<Vec<u8>, ReadFault> {
        let fault = || ReadFault::from(FrameFault::Content(offset));
        let mut head = [0; FRAME_HEADER];
        self.file
            .read_exact_at(&mut head, offset)
            .map_err(|error| cut(error, offset))?;
        let bytes = self.content(place_of(offset, head)?)?;
        let frame = PackedFrame::parse(&bytes).filter(|frame| frame.back == 0);
        let frame = frame.ok_or_else(fault)?;
        expanded(&mut Decompressor::new()?, frame.bytes, frame.size).ok_or_else(fault)
    }

    /// Reads the content of the frame at a place.
    fn content(&self, place: FramePlace) -> Result<Vec<u8>, ReadFault> {
        let mut bytes = vec![0; FRAME_HEADER + place.size as usize];
        let read = self.file.read_exact_at(&mut bytes, place.offset);
        read.map_err(|error| cut(error, place.offset))?;
        content_of(place, &bytes)?;
        bytes.drain(..FRAME_HEADER);
        Ok(bytes)
    }
}

/// The fault of a frame that can't be read: its row is whole, so that a file that ends before it has
/// been cut.
fn cut(error: io::Error, offset: u64) -> ReadFault {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => FrameFault::Missing(offset).into(),
        _ => error.into(),
    }
}

/// The parts of a content.
pub(super) struct PackedFrame<'b> {
    pub(super) index: u64,
    back: u64,
    size: u64,
    bytes: &'b [u8],
}

impl<'b> PackedFrame<'b> {
    pub(super) fn parse(content: &'b [u8]) -> Option<Self> {
        let mut reader = ByteReader { bytes: content };
        Some(Self {
            index: reader.varint()?,
            back: reader.varint()?,
            size: reader.varint()?,
            bytes: reader.bytes,
        })
    }
}
