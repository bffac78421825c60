//! Reads a segment.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::RunRow;
use crate::segment::frame::{
    FrameFault, FramePlace, Frames, HEAD, ReadFault, SegmentColumn, WholeFrames,
};
use crate::segment::packed::{ColumnReader, PackedFrame, path};
use crate::segment::row::{Places, RunEntry, TextTable, decode_row};
use crate::stored_run::StoredRun;
use actcheck_base::Below;

/// The key of the next segment.
static KEYS: AtomicU64 = AtomicU64::new(0);

/// The columns that were read last, each with the key of its segment: most runs are read one after
/// another.
static OPEN: Mutex<Vec<(u64, SegmentColumn, ColumnReader)>> = Mutex::new(Vec::new());
/// Number of columns that stay open.
const MOST_OPEN: usize = 24;

fn open_columns() -> MutexGuard<'static, Vec<(u64, SegmentColumn, ColumnReader)>> {
    OPEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The runs of a segment at one moment. Another process may append further ones.
#[derive(Debug)]
pub(crate) struct Segment {
    folder: PathBuf,
    number: u32,
    below: Below,
    /// Distinguishes it from all others of this process.
    key: u64,
    /// Whether it is the readable part of a damaged one.
    is_damaged: bool,
    texts: TextTable,
    rows: Vec<RunEntry>,
    /// Offset at which its whole rows end. Unit: bytes.
    end: u64,
    is_torn: bool,
}

impl Drop for Segment {
    /// Closes its columns.
    fn drop(&mut self) {
        open_columns().retain(|(of, ..)| *of != self.key);
    }
}

impl Segment {
    /// Reads the rows in the first `length` bytes of a segment's column of runs.
    ///
    /// # Errors
    /// Its column of runs is damaged or can't be read.
    pub(crate) fn open(
        below: &Below,
        folder: &Path,
        number: u32,
        length: u64,
    ) -> Result<Self, ReadFault> {
        let file = below.open(&path(folder, number, SegmentColumn::Runs))?;
        let source = BufReader::with_capacity(1 << 16, file.take(length));
        let mut frames = Frames::new(SegmentColumn::Runs, source)?;
        let (mut texts, mut rows, mut content) = (TextTable::default(), Vec::new(), Vec::new());
        while let Some(place) = frames.next(&mut content)? {
            let row = decode_row(&content, &mut texts);
            rows.push(row.map_err(|_| FrameFault::Content(place.offset))?);
        }
        Ok(Self {
            folder: folder.to_path_buf(),
            number,
            below: below.clone(),
            key: KEYS.fetch_add(1, Ordering::Relaxed),
            is_damaged: false,
            texts,
            rows,
            end: frames.tail().0,
            is_torn: frames.tail().1,
        })
    }

    /// Reads all runs of a damaged segment that are readable: their details and their states are.
    /// Returns it with the indices of the runs that are lost; `None` if it has no runs.
    ///
    /// # Errors
    /// A file can't be read.
    pub(crate) fn salvage(
        below: &Below,
        folder: &Path,
        number: u32,
    ) -> Result<Option<(Self, BTreeSet<u64>)>, ReadFault> {
        if below
            .kind(&path(folder, number, SegmentColumn::Details))
            .is_none()
        {
            return Ok(None);
        }
        let readable = |column| readable_frames(below, folder, number, column);
        let details = readable(SegmentColumn::Details)?;
        let states = readable(SegmentColumn::States)?;
        let motion = readable(SegmentColumn::Motion)?;
        let mut segment = Self {
            folder: folder.to_path_buf(),
            number,
            below: below.clone(),
            key: KEYS.fetch_add(1, Ordering::Relaxed),
            is_damaged: true,
            texts: TextTable::default(),
            rows: Vec::new(),
            end: 0,
            is_torn: false,
        };
        // The rows that are readable show which runs were stored.
        let mut lost: BTreeSet<u64> = states.keys().copied().collect();
        let runs = path(folder, number, SegmentColumn::Runs);
        if below.kind(&runs).is_some() {
            let (mut frames, mut texts) = (WholeFrames::open(below, &runs)?, TextTable::default());
            while let Some((_, content)) = frames.next()? {
                lost.extend(decode_row(&content, &mut texts).map(|row| row.index));
            }
        }
        let column = SegmentColumn::Details;
        let mut reader = ColumnReader::open_damaged(below, folder, number, column)?;
        for (index, place) in details {
            let Ok(stored) = decoded(&mut reader, index, place) else {
                continue;
            };
            let Some(states) = states.get(&index) else {
                continue;
            };
            let places = Places {
                details: place,
                states: *states,
                motion: motion.get(&index).copied(),
            };
            lost.remove(&index);
            let row = RunEntry::of(&stored, places, &mut segment.texts);
            segment.rows.push(row);
        }
        Ok(Some((segment, lost)))
    }

    /// Its number in the campaign.
    pub(crate) fn number(&self) -> u32 {
        self.number
    }

    /// The runs in the order in which they were stored.
    pub(crate) fn rows(&self) -> &[RunEntry] {
        &self.rows
    }

    /// A text that rows give by number.
    pub(crate) fn text(&self, number: u32) -> Arc<str> {
        self.texts.text(number)
    }

    /// A run as in a list.
    pub(crate) fn as_run(&self, row: &RunEntry, campaign: &str) -> RunRow {
        row.as_run(campaign, &self.texts)
    }

    /// Whether its writer was stopped within a run, which is not stored.
    pub(crate) fn is_torn(&self) -> bool {
        self.is_torn
    }

    /// Path of a column.
    pub(crate) fn file(&self, column: SegmentColumn) -> PathBuf {
        path(&self.folder, self.number, column)
    }

    /// Offset at which the frames of its runs end in a column. Returns `None` if it has no motion.
    pub(crate) fn end_of(&self, column: SegmentColumn) -> Option<u64> {
        let ends = self.rows.iter().map(|row| match column {
            SegmentColumn::Details => Some(row.places.details.end()),
            SegmentColumn::States => Some(row.places.states.end()),
            SegmentColumn::Motion => row.places.motion.map(FramePlace::end),
            _ => Some(self.end),
        });
        ends.flatten().max()
    }

    /// All values of a run.
    ///
    /// # Errors
    /// The run is damaged or can't be read.
    pub(crate) fn run(&self, row: &RunEntry) -> Result<StoredRun, ReadFault> {
        self.with_column(SegmentColumn::Details, |details| {
            decoded(details, row.index, row.places.details)
        })
    }

    /// The encoded choices and states of a run.
    ///
    /// # Errors
    /// They are damaged or can't be read.
    pub(crate) fn states(&self, row: &RunEntry) -> Result<Vec<u8>, ReadFault> {
        self.with_column(SegmentColumn::States, |states| {
            states.read(row.index, row.places.states)
        })
    }

    /// The encoded motion of a run; `None` if it is not kept.
    ///
    /// # Errors
    /// It is damaged or can't be read.
    pub(crate) fn motion(&self, row: &RunEntry) -> Result<Option<Vec<u8>>, ReadFault> {
        let Some(place) = row.places.motion else {
            return Ok(None);
        };
        self.with_column(SegmentColumn::Motion, |motion| {
            motion.read(row.index, place).map(Some)
        })
    }

    /// Calls `read` with an open column.
    fn with_column<T>(
        &self,
        column: SegmentColumn,
        read: impl FnOnce(&mut ColumnReader) -> Result<T, ReadFault>,
    ) -> Result<T, ReadFault> {
        let known = {
            let mut open = open_columns();
            let place = open
                .iter()
                .position(|(of, kind, _)| *of == self.key && *kind == column);
            place.map(|place| open.remove(place).2)
        };
        let open = if self.is_damaged {
            ColumnReader::open_damaged
        } else {
            ColumnReader::open
        };
        let mut reader = match known {
            Some(reader) => reader,
            None => open(&self.below, &self.folder, self.number, column)?,
        };
        let value = read(&mut reader)?;
        let mut open = open_columns();
        if open.len() >= MOST_OPEN {
            open.remove(0);
        }
        open.push((self.key, column, reader));
        Ok(value)
    }

    /// The encoded and packed motion of a run; `None` if it is not kept.
    ///
    /// # Errors
    /// As [`Segment::motion`].
    pub(crate) fn packed_motion(&self, row: &RunEntry) -> Result<Option<Vec<u8>>, ReadFault> {
        let Some(place) = row.places.motion else {
            return Ok(None);
        };
        self.with_column(SegmentColumn::Motion, |motion| {
            motion.read_packed(row.index, place).map(Some)
        })
    }

    /// Whether the rows of runs agree with their other values.
    pub(crate) fn agrees(&self, row: &RunEntry, stored: &StoredRun) -> bool {
        let mut texts = TextTable::default();
        let again = RunEntry::of(stored, row.places, &mut texts);
        let texts_of = |row: &RunEntry, texts: &TextTable| {
            let actions = row
                .actions
                .iter()
                .flatten()
                .map(|number| texts.text(*number));
            let properties = row
                .outcomes
                .iter()
                .map(|outcome| texts.text(outcome.property));
            let texts: Vec<Arc<str>> = actions.chain(properties).collect();
            texts
        };
        let as_run = |row: &RunEntry, texts: &TextTable| row.as_run("", texts);
        as_run(row, &self.texts) == as_run(&again, &texts)
            && texts_of(row, &self.texts) == texts_of(&again, &texts)
            && row.scene() == again.scene()
            && row.outcomes.len() == again.outcomes.len()
            && row
                .outcomes
                .iter()
                .zip(&again.outcomes)
                .all(|(one, other)| {
                    one.action == other.action
                        && one.outcome == other.outcome
                        && one.margin.map(f64::to_bits) == other.margin.map(f64::to_bits)
                })
    }
}

/// Reads the values of a run from a column of details.
fn decoded(
    details: &mut ColumnReader,
    index: u64,
    place: FramePlace,
) -> Result<StoredRun, ReadFault> {
    let bytes = details.read(index, place)?;
    let run = postcard::from_bytes::<StoredRun>(&bytes).ok();
    let run = run.filter(|run| run.index == index);
    run.ok_or_else(|| FrameFault::Content(place.offset).into())
}

/// Length of a file of a segment without its torn tail. Unit: bytes.
///
/// # Errors
/// It is damaged before, or can't be read.
pub(crate) fn whole_length(below: &Below, file: &Path) -> io::Result<u64> {
    let extension = file.extension().unwrap_or_default();
    let column = SegmentColumn::OF_SEGMENTS
        .into_iter()
        .find(|column| extension == column.extension())
        .ok_or_else(|| io::Error::other("its name is not that of a column"))?;
    let whole = || -> Result<u64, ReadFault> {
        let mut frames = Frames::new(column, BufReader::new(below.open(file)?))?;
        let mut content = Vec::new();
        while frames.next(&mut content)?.is_some() {}
        Ok(frames.tail().0)
    };
    whole().map_err(|fault| match fault {
        ReadFault::Io(error) => error,
        ReadFault::Damaged(fault) => io::Error::other(fault),
    })
}

/// The indices of the runs in a segment's column of details that begin at or after an offset;
/// `None` is the beginning.
///
/// # Errors
/// The column is damaged there, or can't be read.
pub(crate) fn indices_after(
    below: &Below,
    folder: &Path,
    number: u32,
    end: Option<u64>,
) -> Result<Vec<u64>, ReadFault> {
    let file = below.open(&path(folder, number, SegmentColumn::Details))?;
    let start = end.unwrap_or(HEAD as u64);
    if file.metadata()?.len() <= start {
        return Ok(Vec::new());
    }
    let mut frames = Frames::at(start, BufReader::new(file))?;
    let (mut indices, mut content) = (Vec::new(), Vec::new());
    while frames.next(&mut content)?.is_some() {
        indices.extend(PackedFrame::parse(&content).map(|frame| frame.index));
    }
    Ok(indices)
}

/// The last readable frame of each run in a column of a damaged segment.
fn readable_frames(
    below: &Below,
    folder: &Path,
    number: u32,
    column: SegmentColumn,
) -> Result<BTreeMap<u64, FramePlace>, ReadFault> {
    let file = path(folder, number, column);
    if below.kind(&file).is_none() {
        return Ok(BTreeMap::new());
    }
    let mut frames = WholeFrames::open(below, &file)?;
    let mut reader = ColumnReader::open_damaged(below, folder, number, column)?;
    let mut readable = BTreeMap::new();
    while let Some((place, content)) = frames.next()? {
        let Some(frame) = PackedFrame::parse(&content) else {
            continue;
        };
        if reader.read(frame.index, place).is_ok() {
            readable.insert(frame.index, place);
        }
    }
    Ok(readable)
}
