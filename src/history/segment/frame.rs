//! Frames: the units in which a column file grows.
//!
//! A file begins with eight bytes that name its format and its column. Each frame has a header of
//! twelve bytes: the size of its content, the checksum of its content, and a checksum of these two
//! and of the frame's place. A frame that was moved, or whose size was changed, is therefore found
//! before its size is used; only a file that ends within a frame has a torn tail.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt as _;
use std::path::Path;

use flate2::Crc;

use actcheck_base::Below;

/// Size of a file's first bytes. Unit: bytes.
pub(crate) const HEAD: usize = 8;
/// Size of a frame's header. Unit: bytes.
pub(crate) const FRAME_HEADER: usize = 12;
/// Largest content of a frame. Unit: bytes.
const MOST_CONTENT: u32 = 1 << 30;
/// Format of all columns: it increases with every change of the stored values.
const FORMAT: u8 = b'1';

/// Longest file that is searched for whole frames. Unit: bytes.
const LONGEST: u64 = 16 << 30;

/// The kinds of values of a campaign, each in files of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum SegmentColumn {
    /// The values of runs in lists, and where the rest of each run is.
    Runs,
    /// The other values of runs.
    Details,
    /// Choices and states of runs.
    States,
    /// Motion of runs that are kept whole.
    Motion,
    /// Judgements that were made after the runs.
    Judgements,
    /// The campaign itself.
    Campaign,
}

impl SegmentColumn {
    /// The columns of a run, in the order in which it is written: the frame in
    /// [`SegmentColumn::Runs`] says that it is complete.
    pub(crate) const OF_RUNS: [Self; 4] = [Self::Motion, Self::States, Self::Details, Self::Runs];
    /// The columns of which a segment has one file each.
    pub(crate) const OF_SEGMENTS: [Self; 5] = [
        Self::Motion,
        Self::States,
        Self::Details,
        Self::Runs,
        Self::Judgements,
    ];

    /// Extension of its files.
    pub(crate) fn extension(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Details => "details",
            Self::States => "states",
            Self::Motion => "motion",
            Self::Judgements => "judgements",
            Self::Campaign => "campaign",
        }
    }

    /// The first bytes of its files.
    pub(crate) fn head(self) -> [u8; HEAD] {
        let letter = match self {
            Self::Runs => b'r',
            Self::Details => b'd',
            Self::States => b's',
            Self::Motion => b'm',
            Self::Judgements => b'j',
            Self::Campaign => b'c',
        };
        [b'a', b'c', b't', b's', b'e', b'g', FORMAT, letter]
    }
}

/// Where a frame is, and the checksum of its content, which shows another frame in its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FramePlace {
    /// Offset of its header in the file. Unit: bytes.
    pub offset: u64,
    /// Size of its content. Unit: bytes.
    pub size: u32,
    /// Checksum of its content.
    pub sum: u32,
}

impl FramePlace {
    /// Offset of the first byte after the frame.
    pub(crate) fn end(self) -> u64 {
        self.offset + FRAME_HEADER as u64 + u64::from(self.size)
    }
}

/// Damage to a column file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum FrameFault {
    /// The first bytes are others.
    #[error("it is not a file of this column in format {}", char::from(FORMAT))]
    Head,
    /// A header has a wrong checksum.
    #[error("the frame at byte {0} has a damaged header")]
    Header(u64),
    /// A content has a wrong checksum.
    #[error("the frame at byte {0} is damaged")]
    Content(u64),
    /// A frame that is referred to is not in the file, which has been cut.
    #[error("the frame at byte {0} is missing")]
    Missing(u64),
}

/// Why a file of frames can't be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReadFault {
    /// It is damaged.
    #[error(transparent)]
    Damaged(#[from] FrameFault),
    /// The system can't read it.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Appends a frame that begins at `offset` to `out`.
///
/// # Errors
/// The content is too large.
pub(crate) fn put(offset: u64, content: &[u8], out: &mut Vec<u8>) -> io::Result<FramePlace> {
    let size = u32::try_from(content.len())
        .ok()
        .filter(|size| *size <= MOST_CONTENT)
        .ok_or_else(|| io::Error::other("a run has more than 1 GiB of one kind"))?;
    let place = FramePlace {
        offset,
        size,
        sum: sum(&[content]),
    };
    out.extend(place.size.to_le_bytes());
    out.extend(place.sum.to_le_bytes());
    out.extend(header_sum(place).to_le_bytes());
    out.extend(content);
    Ok(place)
}

fn sum(parts: &[&[u8]]) -> u32 {
    let mut crc = Crc::new();
    parts.iter().for_each(|part| crc.update(part));
    crc.sum()
}

fn header_sum(place: FramePlace) -> u32 {
    let (offset, size, content) = (
        place.offset.to_le_bytes(),
        place.size.to_le_bytes(),
        place.sum.to_le_bytes(),
    );
    sum(&[&offset, &size, &content])
}

/// Parses a header at `offset`.
///
/// # Errors
/// Its checksum is wrong.
pub(super) fn place_of(offset: u64, bytes: [u8; FRAME_HEADER]) -> Result<FramePlace, FrameFault> {
    let [a, b, c, d, e, f, g, h, i, j, k, l] = bytes;
    let place = FramePlace {
        offset,
        size: u32::from_le_bytes([a, b, c, d]),
        sum: u32::from_le_bytes([e, f, g, h]),
    };
    let is_right = header_sum(place) == u32::from_le_bytes([i, j, k, l]);
    if is_right && place.size <= MOST_CONTENT {
        Ok(place)
    } else {
        Err(FrameFault::Header(offset))
    }
}

/// Reads the frames of a file one after another.
#[derive(Debug)]
pub(crate) struct Frames<R> {
    source: R,
    offset: u64,
    is_torn: bool,
}

impl<R: Read> Frames<R> {
    /// Begins to read a file of a column. An empty file has no frames: its writer was stopped at
    /// once.
    ///
    /// # Errors
    /// It is a file of another kind; the system can't read it.
    pub(crate) fn new(column: SegmentColumn, mut source: R) -> Result<Self, ReadFault> {
        let mut head = [0; HEAD];
        let read = fill(&mut source, &mut head)?;
        if !column.head().starts_with(&head[..read]) {
            return Err(FrameFault::Head.into());
        }
        Ok(Self {
            source,
            offset: read as u64,
            is_torn: read < HEAD,
        })
    }

    /// Begins to read at an offset at which a frame begins.
    ///
    /// # Errors
    /// The system can't find the place.
    pub(crate) fn at(offset: u64, mut source: R) -> io::Result<Self>
    where
        R: Seek,
    {
        source.seek(SeekFrom::Start(offset))?;
        Ok(Self {
            source,
            offset,
            is_torn: false,
        })
    }

    /// Reads the next frame into `content`. Returns `None` at the end.
    ///
    /// # Errors
    /// The frame is damaged; the system can't read it.
    pub(crate) fn next(&mut self, content: &mut Vec<u8>) -> Result<Option<FramePlace>, ReadFault> {
        content.clear();
        if self.is_torn {
            return Ok(None);
        }
        let mut bytes = [0; FRAME_HEADER];
        let read = fill(&mut self.source, &mut bytes)?;
        if read < FRAME_HEADER {
            self.is_torn = read > 0;
            return Ok(None);
        }
        let place = place_of(self.offset, bytes)?;
        let size = u64::from(place.size);
        // The memory grows with the bytes that are read, not with the size that the header claims.
        self.source.by_ref().take(size).read_to_end(content)?;
        if (content.len() as u64) < size {
            self.is_torn = true;
            return Ok(None);
        }
        if sum(&[content]) != place.sum {
            return Err(FrameFault::Content(place.offset).into());
        }
        self.offset = place.end();
        Ok(Some(place))
    }

    /// After the last frame: the offset at which the whole frames end, and whether more bytes
    /// follow, which a writer that was stopped has left.
    pub(crate) fn tail(&self) -> (u64, bool) {
        (self.offset, self.is_torn)
    }
}

/// The whole frames of a damaged file, one after another: a header has the checksum of its own
/// place, so that the next one is found wherever it begins.
#[derive(Debug)]
pub(crate) struct WholeFrames {
    file: File,
    at: u64,
    end: u64,
    /// Bytes of the file from `start` on, in which headers are looked for.
    window: Vec<u8>,
    start: u64,
}

/// Size of the window. Unit: bytes.
const WINDOW: usize = 1 << 16;

impl WholeFrames {
    /// Opens a file.
    ///
    /// # Errors
    /// It is missing, far longer than any that this program writes, or can't be opened.
    pub(crate) fn open(below: &Below, path: &Path) -> io::Result<Self> {
        let file = below.open(path)?;
        let end = file.metadata()?.len();
        if end > LONGEST {
            return Err(io::Error::other(
                "it is far longer than this program writes",
            ));
        }
        Ok(Self {
            file,
            at: HEAD as u64,
            end,
            window: Vec::new(),
            start: 0,
        })
    }

    /// The next frame and its content. Returns `None` at the end.
    ///
    /// # Errors
    /// The system can't read the file.
    pub(crate) fn next(&mut self) -> io::Result<Option<(FramePlace, Vec<u8>)>> {
        while let Some(bytes) = self.header()? {
            let place = place_of(self.at, bytes).ok();
            if let Some(place) = place.filter(|place| place.end() <= self.end) {
                let mut content = vec![0; place.size as usize];
                self.file
                    .read_exact_at(&mut content, place.offset + FRAME_HEADER as u64)?;
                if sum(&[&content]) == place.sum {
                    self.at = place.end();
                    return Ok(Some((place, content)));
                }
            }
            self.at += 1;
            if bytes == [0; FRAME_HEADER] {
                self.skip_zeros();
            }
        }
        Ok(None)
    }

    /// The bytes at the present place. Returns `None` if there are too few for a header.
    fn header(&mut self) -> io::Result<Option<[u8; FRAME_HEADER]>> {
        if self.at + FRAME_HEADER as u64 > self.end {
            return Ok(None);
        }
        let is_in = |start: u64, length: usize| {
            (start..=start + length as u64).contains(&self.at)
                && self.at + FRAME_HEADER as u64 <= start + length as u64
        };
        if !is_in(self.start, self.window.len()) {
            let left = usize::try_from(self.end - self.at).unwrap_or(WINDOW);
            self.window.resize(left.min(WINDOW), 0);
            self.start = self.at;
            self.file.read_exact_at(&mut self.window, self.start)?;
        }
        let from = (self.at - self.start) as usize;
        Ok(self.window[from..].first_chunk().copied())
    }

    /// Goes on where a header can begin that is not all zeros, as in the holes of a file.
    fn skip_zeros(&mut self) {
        let from = (self.at - self.start) as usize;
        let rest = &self.window[from.min(self.window.len())..];
        let zeros = rest.iter().take_while(|byte| **byte == 0).count();
        self.at += zeros.saturating_sub(FRAME_HEADER - 1) as u64;
    }
}

/// Reads until the buffer is full or the source ends. Returns the number of bytes.
fn fill(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match source.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Checks the bytes of a frame at a known place. Returns its content.
///
/// # Errors
/// The bytes are those of another frame, damaged, or cut.
pub(crate) fn content_of(place: FramePlace, bytes: &[u8]) -> Result<&[u8], FrameFault> {
    let (head, rest) = bytes
        .split_first_chunk::<FRAME_HEADER>()
        .ok_or(FrameFault::Missing(place.offset))?;
    if place_of(place.offset, *head)? != place {
        return Err(FrameFault::Header(place.offset));
    }
    let content = rest
        .get(..place.size as usize)
        .ok_or(FrameFault::Missing(place.offset))?;
    if sum(&[content]) == place.sum {
        Ok(content)
    } else {
        Err(FrameFault::Content(place.offset))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::ScratchFolder;

    /// A file with three frames, and their places.
    fn file() -> (Vec<u8>, Vec<FramePlace>) {
        let mut bytes = SegmentColumn::Runs.head().to_vec();
        let mut places = Vec::new();
        for content in [&b"first"[..], b"", b"the third"] {
            let offset = bytes.len() as u64;
            places.push(put(offset, content, &mut bytes).expect("it is small"));
        }
        (bytes, places)
    }

    /// The frames of a file, or its fault; and whether its tail is torn.
    fn read(bytes: &[u8]) -> Result<(Vec<Vec<u8>>, bool), ReadFault> {
        let mut frames = Frames::new(SegmentColumn::Runs, bytes)?;
        let (mut found, mut content) = (Vec::new(), Vec::new());
        while frames.next(&mut content)?.is_some() {
            found.push(content.clone());
        }
        Ok((found, frames.tail().1))
    }

    #[test]
    fn frames_are_read_as_they_were_written() {
        let (bytes, places) = file();
        let (found, is_torn) = read(&bytes).expect("it is whole");
        assert_eq!(found, [&b"first"[..], b"", b"the third"]);
        assert!(!is_torn);
        for (place, content) in places.iter().zip(&found) {
            let own = &bytes[place.offset as usize..place.end() as usize];
            assert_eq!(content_of(*place, own), Ok(content.as_slice()));
        }
    }

    #[test]
    fn every_flipped_bit_is_found() {
        let (bytes, _) = file();
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                let found = read(&damaged);
                assert!(found.is_err(), "bit {bit} of byte {at}: {found:?}");
            }
        }
    }

    #[test]
    fn a_file_that_ends_within_a_frame_has_a_torn_tail() {
        let (bytes, places) = file();
        let ends: Vec<u64> = places.iter().map(|place| place.end()).collect();
        for length in 0..=bytes.len() {
            let (found, is_torn) = read(&bytes[..length]).expect("it is only cut");
            let whole = ends.iter().filter(|end| **end <= length as u64).count();
            let is_border = length == HEAD || ends.contains(&(length as u64));
            assert_eq!(
                (found.len(), is_torn),
                (whole, !is_border),
                "{length} bytes"
            );
        }
    }

    #[test]
    fn frames_after_a_damaged_one_are_found() {
        let (bytes, places) = file();
        let folder = ScratchFolder::create().expect("a temporary folder");
        let path = folder.path().join("0001.runs");
        let found = |bytes: &[u8]| -> Vec<FramePlace> {
            std::fs::write(&path, bytes).expect("it can be written");
            let frames = WholeFrames::open(&Below::new(folder.path()), &path);
            let (mut frames, mut found) = (frames.expect("it is there"), Vec::new());
            while let Some((place, _)) = frames.next().expect("it can be read") {
                found.push(place);
            }
            found
        };
        assert_eq!(found(&bytes), places);
        for at in HEAD..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1;
            let left: Vec<FramePlace> = places
                .iter()
                .filter(|place| !(place.offset..place.end()).contains(&(at as u64)))
                .copied()
                .collect();
            assert_eq!(found(&damaged), left, "byte {at}");
        }
        assert_eq!(found(b"act"), []);
        // After holes of all lengths, also some longer than the window.
        for hole in (0..30).chain([WINDOW - 7, WINDOW, 3 * WINDOW + 5]) {
            let mut holed = bytes.clone();
            holed.extend(vec![0; hole]);
            let last = put(holed.len() as u64, b"last", &mut holed).expect("it is small");
            assert_eq!(found(&holed).last(), Some(&last), "{hole} zeros");
        }
    }

    #[test]
    fn another_frame_at_a_place_is_noticed() {
        let (bytes, places) = file();
        let [first, second, third] = places[..] else {
            panic!("three frames");
        };
        let at = |place: FramePlace| &bytes[place.offset as usize..];
        assert_eq!(
            content_of(first, at(third)),
            Err(FrameFault::Header(first.offset))
        );
        let moved = FramePlace {
            offset: second.offset,
            ..third
        };
        assert_eq!(
            content_of(moved, at(second)),
            Err(FrameFault::Header(second.offset))
        );
        assert_eq!(
            content_of(third, &at(third)[..20]),
            Err(FrameFault::Missing(third.offset))
        );
        // The same frame in another place of the file.
        let mut swapped = bytes.clone();
        swapped.drain(first.offset as usize..first.end() as usize);
        assert!(read(&swapped).is_err());
    }

    #[test]
    fn files_of_other_columns_and_formats_are_refused() {
        let (bytes, _) = file();
        let heads = SegmentColumn::OF_SEGMENTS.map(SegmentColumn::head);
        assert!((1..heads.len()).all(|n| !heads[..n].contains(&heads[n])));
        let fault =
            Frames::new(SegmentColumn::Details, bytes.as_slice()).expect_err("it holds runs");
        assert!(matches!(fault, ReadFault::Damaged(FrameFault::Head)));
    }

    #[test]
    fn a_large_size_takes_no_memory() {
        let mut bytes = SegmentColumn::Runs.head().to_vec();
        let place = FramePlace {
            offset: HEAD as u64,
            size: MOST_CONTENT,
            sum: 0,
        };
        bytes.extend(place.size.to_le_bytes());
        bytes.extend(place.sum.to_le_bytes());
        bytes.extend(header_sum(place).to_le_bytes());
        let mut frames =
            Frames::new(SegmentColumn::Runs, bytes.as_slice()).expect("its head is right");
        let mut content = Vec::new();
        assert!(frames.next(&mut content).expect("it is cut").is_none());
        assert!(content.capacity() < 4096 && frames.tail().1);
    }
}
