//! One segment on disk: its writer and its reader.

use std::fs::File;
use std::io::{self, BufReader, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

use crate::inflate::most_expanded;
use crate::segment::encode::{
    Places, RunEntry, TextTable, decode, decode_row, encode_details, encode_row,
};
use crate::segment::frame::{
    FRAME_HEADER, FrameFault, FramePlace, Frames, HEAD, ReadFault, SegmentColumn, content_of, put,
};
use crate::stored_run::StoredRun;
use actcheck_base::{Below, ByteReader, put_varint};

/// Compression level: higher ones take many times as long and save some percent.
const LEVEL: i32 = 6;

/// The parts of a run.
#[derive(Debug)]
pub(crate) struct RunContent<'a> {
    pub run: &'a StoredRun,
    /// Its choices and states, encoded.
    pub states: &'a [u8],
    /// Its motion, encoded and compressed, if it is kept.
    pub motion: Option<&'a [u8]>,
}

/// Path of a column of a segment.
fn path(folder: &Path, number: u32, column: SegmentColumn) -> PathBuf {
    folder.join(format!("{number:04}.{}", column.extension()))
}

/// A column that one process writes.
#[derive(Debug)]
struct ColumnWriter {
    file: File,
    end: u64,
    /// RunContent of the first frame: the dictionary by which the others are compressed. Runs of a
    /// campaign are much alike.
    first: Option<Vec<u8>>,
}

impl ColumnWriter {
    fn create(below: &Below, path: &Path, column: SegmentColumn) -> io::Result<Self> {
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
            first: None,
        })
    }

    /// Appends a frame, completely or not at all.
    fn append(&mut self, content: &[u8]) -> io::Result<FramePlace> {
        let mut bytes = Vec::with_capacity(FRAME_HEADER + content.len());
        let place = put(self.end, content, &mut bytes)?;
        if let Err(error) = self.file.write_all(&bytes) {
            self.cut(self.end)?;
            return Err(error);
        }
        self.end = place.end();
        Ok(place)
    }

    /// Appends a frame that is compressed by the first one.
    fn append_alike(&mut self, content: &[u8]) -> io::Result<FramePlace> {
        let dictionary = self.first.as_deref().unwrap_or_default();
        let mut compressed = Vec::new();
        put_varint(&mut compressed, content.len() as u64);
        let packed = zstd::bulk::Compressor::with_dictionary(LEVEL, dictionary)?;
        compressed.extend({ packed }.compress(content)?);
        let place = self.append(&compressed)?;
        if self.first.is_none() {
            self.first = Some(content.to_vec());
        }
        Ok(place)
    }

    /// Removes the frames of a run that was not written completely.
    fn cut(&mut self, end: u64) -> io::Result<()> {
        self.file.set_len(end)?;
        self.end = end;
        Ok(())
    }
}

/// Writes the runs of one process into a new segment.
#[derive(Debug)]
pub(crate) struct SegmentWriter {
    below: Below,
    folder: PathBuf,
    number: u32,
    runs: ColumnWriter,
    details: ColumnWriter,
    states: ColumnWriter,
    motion: Option<ColumnWriter>,
    texts: TextTable,
}

impl SegmentWriter {
    /// Begins a segment in an existing folder.
    ///
    /// # Errors
    /// The number is taken; the files can't be created.
    pub(crate) fn create(below: &Below, folder: &Path, number: u32) -> io::Result<Self> {
        let new = |column| ColumnWriter::create(below, &path(folder, number, column), column);
        Ok(Self {
            runs: new(SegmentColumn::Runs)?,
            details: new(SegmentColumn::Details)?,
            states: new(SegmentColumn::States)?,
            motion: None,
            texts: TextTable::default(),
            below: below.clone(),
            folder: folder.to_path_buf(),
            number,
        })
    }

    /// Stores a run, completely or (on an error) not at all.
    ///
    /// # Errors
    /// Writing failed.
    pub(crate) fn append(&mut self, content: &RunContent<'_>) -> io::Result<()> {
        let ends = [self.details.end, self.states.end];
        let motion_end = self.motion.as_ref().map(|motion| motion.end);
        let (texts, firsts) = (
            self.texts.len(),
            [self.details.first.is_some(), self.states.first.is_some()],
        );
        self.append_columns(content).inspect_err(|_| {
            // If this fails, too, the frames that nothing refers to are harmless.
            let columns = [&mut self.details, &mut self.states];
            for ((column, end), had_first) in columns.into_iter().zip(ends).zip(firsts) {
                let _ = column.cut(end);
                column.first.take_if(|_| !had_first);
            }
            if let Some(motion) = &mut self.motion {
                let _ = motion.cut(motion_end.unwrap_or(HEAD as u64));
            }
            self.texts.truncate(texts);
        })
    }

    fn append_columns(&mut self, content: &RunContent<'_>) -> io::Result<()> {
        let fault = |error: postcard::Error| io::Error::other(error.to_string());
        let motion = match content.motion {
            Some(bytes) => Some(self.motion()?.append(bytes)?),
            None => None,
        };
        let states = self.states.append_alike(content.states)?;
        let details = encode_details(content.run).map_err(fault)?;
        let places = Places {
            details: self.details.append_alike(&details)?,
            states,
            motion,
        };
        let row = encode_row(content.run, places, &mut self.texts).map_err(fault)?;
        self.runs.append(&row).map(|_| ())
    }

    fn motion(&mut self) -> io::Result<&mut ColumnWriter> {
        let motion = match self.motion.take() {
            Some(motion) => motion,
            None => ColumnWriter::create(
                &self.below,
                &path(&self.folder, self.number, SegmentColumn::Motion),
                SegmentColumn::Motion,
            )?,
        };
        Ok(self.motion.insert(motion))
    }

    /// Makes the runs so far survive a power cut.
    ///
    /// # Errors
    /// The system can't write them to the disk.
    pub(crate) fn sync(&self) -> io::Result<()> {
        let columns = [&self.states, &self.details, &self.runs];
        self.motion
            .iter()
            .chain(columns)
            .try_for_each(|column| column.file.sync_data())
    }
}

/// The runs of a segment at one moment. Another process may append further ones.
#[derive(Debug)]
pub(crate) struct Segment {
    folder: PathBuf,
    number: u32,
    below: Below,
    texts: TextTable,
    rows: Vec<RunEntry>,
    is_torn: bool,
}

impl Segment {
    /// Reads the rows of a segment.
    ///
    /// # Errors
    /// Its column of runs is damaged or can't be read.
    pub(crate) fn open(below: &Below, folder: &Path, number: u32) -> Result<Self, ReadFault> {
        let file = below.open(&path(folder, number, SegmentColumn::Runs))?;
        let mut frames = Frames::new(SegmentColumn::Runs, BufReader::new(file))?;
        let (mut texts, mut rows, mut content) = (TextTable::default(), Vec::new(), Vec::new());
        while let Some(place) = frames.next(&mut content)? {
            let row = decode_row(&content, &mut texts);
            rows.push(row.map_err(|_| FrameFault::Content(place.offset))?);
        }
        Ok(Self {
            folder: folder.to_path_buf(),
            number,
            below: below.clone(),
            texts,
            rows,
            is_torn: frames.tail().1,
        })
    }

    /// The runs in the order in which they were stored.
    pub(crate) fn rows(&self) -> &[RunEntry] {
        &self.rows
    }

    /// The texts that rows give by number.
    pub(crate) fn texts(&self) -> &TextTable {
        &self.texts
    }

    /// Whether its writer was stopped within a run, which is not stored.
    pub(crate) fn is_torn(&self) -> bool {
        self.is_torn
    }

    /// All values of a run.
    ///
    /// # Errors
    /// The run is damaged or can't be read.
    pub(crate) fn run(&self, row: &RunEntry) -> Result<StoredRun, ReadFault> {
        let place = row.places.details;
        let details = self.read_alike(SegmentColumn::Details, place)?;
        let run = decode(row, &details, &self.texts);
        run.ok_or_else(|| FrameFault::Content(place.offset).into())
    }

    /// The encoded choices and states of a run.
    ///
    /// # Errors
    /// They are damaged or can't be read.
    pub(crate) fn states(&self, row: &RunEntry) -> Result<Vec<u8>, ReadFault> {
        self.read_alike(SegmentColumn::States, row.places.states)
    }

    /// The encoded motion of a run; `None` if it is not kept.
    ///
    /// # Errors
    /// It is damaged or can't be read.
    pub(crate) fn motion(&self, row: &RunEntry) -> Result<Option<Vec<u8>>, ReadFault> {
        row.places
            .motion
            .map(|place| {
                let file =
                    self.below
                        .open(&path(&self.folder, self.number, SegmentColumn::Motion))?;
                read_at(&file, place)
            })
            .transpose()
    }

    /// Reads a frame that is compressed by the first one of its column.
    fn read_alike(&self, column: SegmentColumn, place: FramePlace) -> Result<Vec<u8>, ReadFault> {
        let file = self.below.open(&path(&self.folder, self.number, column))?;
        let dictionary = if place.offset == HEAD as u64 {
            Vec::new()
        } else {
            let first = match column {
                SegmentColumn::States => self.rows.first().map(|row| row.places.states),
                _ => self.rows.first().map(|row| row.places.details),
            };
            let first = first.ok_or(FrameFault::Missing(HEAD as u64))?;
            expanded(&read_at(&file, first)?, &[], first)?
        };
        expanded(&read_at(&file, place)?, &dictionary, place)
    }
}

/// Reads the content of the frame at a place.
fn read_at(file: &File, place: FramePlace) -> Result<Vec<u8>, ReadFault> {
    // Damage to the row is found by its checksum; a file that was cut has no such frame.
    if file.metadata()?.len() < place.end() {
        return Err(FrameFault::Missing(place.offset).into());
    }
    let mut bytes = vec![0; FRAME_HEADER + place.size as usize];
    file.read_exact_at(&mut bytes, place.offset)?;
    content_of(place, &bytes)?;
    bytes.drain(..FRAME_HEADER);
    Ok(bytes)
}

/// Decompresses the content of the frame at a place.
fn expanded(bytes: &[u8], dictionary: &[u8], place: FramePlace) -> Result<Vec<u8>, ReadFault> {
    let fault = || FrameFault::Content(place.offset);
    let mut reader = ByteReader { bytes };
    let size = reader.varint().ok_or_else(fault)?;
    let compressed = reader.bytes;
    if size > most_expanded(compressed.len()) {
        return Err(fault().into());
    }
    let whole = zstd::bulk::Decompressor::with_dictionary(dictionary)
        .and_then(|mut decompressor| decompressor.decompress(compressed, size as usize));
    match whole {
        Ok(whole) if whole.len() as u64 == size => Ok(whole),
        _ => Err(fault().into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stored_run::tests::sample;
    use actcheck_base::ScratchFolder;

    fn states(index: u64) -> Vec<u8> {
        (0..13_000u64)
            .map(|n| {
                if n % 50 == 7 {
                    (n * index % 251) as u8
                } else {
                    (n % 97) as u8
                }
            })
            .collect()
    }

    /// A segment with runs, of which every second one is kept whole.
    fn written(count: u64) -> (ScratchFolder, Below) {
        let folder = ScratchFolder::create().expect("a temporary folder");
        let below = Below::new(folder.path());
        let mut writer = SegmentWriter::create(&below, folder.path(), 1).expect("it is new");
        for index in 0..count {
            let (run, states) = (sample(index), states(index));
            let motion = (index % 2 == 0).then(|| vec![index as u8; 100]);
            let content = RunContent {
                run: &run,
                states: &states,
                motion: motion.as_deref(),
            };
            writer.append(&content).expect("there is room");
        }
        writer.sync().expect("it is on a disk");
        (folder, below)
    }

    /// Reads everything. Returns the number of runs, or the fault.
    fn checked(folder: &Path, below: &Below) -> Result<usize, ReadFault> {
        let segment = Segment::open(below, folder, 1)?;
        for (index, row) in (0..).zip(segment.rows()) {
            assert_eq!(segment.run(row)?, sample(index));
            assert_eq!(row.scene(), sample(index).scene_digest());
            assert_eq!(segment.states(row)?, states(index));
            let motion = (index % 2 == 0).then(|| vec![index as u8; 100]);
            assert_eq!(segment.motion(row)?, motion);
            assert_eq!(segment.texts().text(row.test), "Pick");
        }
        Ok(segment.rows().len())
    }

    #[test]
    fn runs_are_read_as_they_were_written() {
        let (folder, below) = written(5);
        assert_eq!(checked(folder.path(), &below).expect("it is whole"), 5);
        let again = SegmentWriter::create(&below, folder.path(), 1);
        assert_eq!(
            again.expect_err("it is there").kind(),
            io::ErrorKind::AlreadyExists
        );
    }

    #[test]
    fn runs_that_are_alike_take_few_bytes() {
        let (folder, _) = written(40);
        let size = |column| {
            let file = path(folder.path(), 1, column);
            file.metadata().expect("it is there").len() / 40
        };
        let sizes = [
            SegmentColumn::Runs,
            SegmentColumn::Details,
            SegmentColumn::States,
        ]
        .map(size);
        assert!(sizes.iter().sum::<u64>() < 1_500, "{sizes:?} bytes a run");
    }

    /// Damage of every file, wherever it is, changes no value.
    #[test]
    fn flipped_bits_are_found() {
        let (folder, below) = written(4);
        for column in SegmentColumn::ALL {
            let file = path(folder.path(), 1, column);
            let whole = std::fs::read(&file).expect("it is there");
            for at in (0..whole.len()).step_by(1 + whole.len() / 150) {
                let mut damaged = whole.clone();
                damaged[at] ^= 1 << (at % 8);
                std::fs::write(&file, damaged).expect("it can be written");
                let found = checked(folder.path(), &below);
                // The first bytes of columns whose frames are found by their place are not read.
                let is_head = column != SegmentColumn::Runs && at < HEAD;
                assert!(found.is_err() || is_head, "byte {at} of {}", file.display());
            }
            std::fs::write(&file, whole).expect("it can be written");
        }
    }

    /// A process that is killed leaves each file cut anywhere, but never a run without its parts.
    #[test]
    fn the_runs_before_a_kill_are_whole() {
        let (folder, below) = written(4);
        let file = path(folder.path(), 1, SegmentColumn::Runs);
        let whole = std::fs::read(&file).expect("it is there");
        for length in 0..whole.len() {
            std::fs::write(&file, &whole[..length]).expect("it can be written");
            let found = checked(folder.path(), &below).expect("it is only cut");
            assert!(found < 4);
            let segment = Segment::open(&below, folder.path(), 1).expect("it can be read");
            assert!(segment.is_torn() || found < 4);
        }
    }
}
