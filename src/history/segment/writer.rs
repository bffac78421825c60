//! Writes the runs of one process into a new segment.

use std::io::{self, BufReader, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};

use crate::segment::frame::{FrameFault, Frames, HEAD, ReadFault, SegmentColumn, put};
use crate::segment::packed::{ColumnWriter, path};
use crate::segment::row::{Places, TextTable, encode_row};
use crate::stored_run::StoredRun;
use actcheck_base::Below;

/// The parts of a run.
#[derive(Debug)]
pub(crate) struct RunContent<'a> {
    pub run: &'a StoredRun,
    /// Its choices and states, encoded.
    pub states: &'a [u8],
    /// Its motion, encoded and packed, if it is kept.
    pub motion: Option<&'a [u8]>,
}

/// A segment that this process writes.
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
            // Last, so that a column of runs always has the others.
            details: new(SegmentColumn::Details)?,
            states: new(SegmentColumn::States)?,
            runs: new(SegmentColumn::Runs)?,
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
        let (details, states, texts) = (self.details.end(), self.states.end(), self.texts.len());
        let motion = self.motion.as_ref().map(ColumnWriter::end);
        self.append_columns(content).inspect_err(|_| {
            self.details.cut(details);
            self.states.cut(states);
            if let (Some(column), Some(end)) = (&mut self.motion, motion) {
                column.cut(end);
            }
            self.texts.truncate(texts);
        })
    }

    fn append_columns(&mut self, content: &RunContent<'_>) -> io::Result<()> {
        let fault = |error: postcard::Error| io::Error::other(error.to_string());
        let index = content.run.index;
        let motion = match content.motion {
            Some(bytes) => Some(self.motion()?.append_packed(index, bytes)?),
            None => None,
        };
        let states = self.states.append_alike(index, content.states)?;
        let details = postcard::to_stdvec(content.run).map_err(fault)?;
        let places = Places {
            details: self.details.append_alike(index, &details)?,
            states,
            motion,
        };
        let row = encode_row(content.run, places, &mut self.texts).map_err(fault)?;
        self.runs.append(&row).map(drop)
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
            .try_for_each(ColumnWriter::sync)
    }
}

/// Copies the first `end` bytes of a column, which are whole frames, into a new file. Checks them.
///
/// # Errors
/// The column is missing or damaged, or can't be read; `Ok(Err(…))`: writing failed.
pub(crate) fn copy_column(
    from: &Below,
    old: &Path,
    column: SegmentColumn,
    end: u64,
    new: impl Write,
) -> Result<io::Result<()>, ReadFault> {
    let source = BufReader::new(from.open(old)?.take(end));
    let mut frames = Frames::new(column, source)?;
    let (mut writer, mut written) = (BufWriter::new(new), HEAD as u64);
    let (mut content, mut bytes) = (Vec::new(), column.head().to_vec());
    loop {
        if let Err(error) = writer.write_all(&bytes) {
            return Ok(Err(error));
        }
        bytes.clear();
        if frames.next(&mut content)?.is_none() {
            break;
        }
        match put(written, &content, &mut bytes) {
            Ok(place) => written = place.end(),
            Err(error) => return Ok(Err(error)),
        }
    }
    if written != end {
        return Err(FrameFault::Missing(written).into());
    }
    Ok(writer.flush())
}
