//! Judgements that were made after the runs, in the order in which they were made.

use std::io::{self, BufReader, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::segment::frame::{FrameFault, Frames, ReadFault, SegmentColumn, WholeFrames};
use crate::segment::packed::{ColumnWriter, packed, path, unpacked};
use actcheck_base::{Below, Judgement};

/// A judgement made after its run. It supersedes the one before it of the same property and action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LaterJudgement {
    /// Position of the run in its campaign, from 0.
    pub index: u64,
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// Time at which it was made: RFC 3339.
    pub at: String,
    pub judgement: Judgement,
}

/// Writes judgements into a new segment.
pub(crate) struct JudgementWriter {
    column: ColumnWriter,
}

impl JudgementWriter {
    /// Begins a segment in an existing folder.
    ///
    /// # Errors
    /// The number is taken; the file can't be created.
    pub(crate) fn create(below: &Below, folder: &Path, number: u32) -> io::Result<Self> {
        let column = SegmentColumn::Judgements;
        Ok(Self {
            column: ColumnWriter::create(below, &path(folder, number, column), column)?,
        })
    }

    /// Stores judgements: all of them or (on an error) none.
    ///
    /// # Errors
    /// Writing failed.
    pub(crate) fn append(&mut self, judgements: &[LaterJudgement]) -> io::Result<()> {
        let bytes = postcard::to_stdvec(judgements).map_err(io::Error::other)?;
        self.column.append(&packed(&bytes)?).map(drop)
    }

    /// Makes the judgements so far survive a power cut.
    ///
    /// # Errors
    /// The system can't write them to the disk.
    pub(crate) fn sync(&self) -> io::Result<()> {
        self.column.sync()
    }
}

/// The judgements of a segment, of whose file the first `length` bytes are read; its number of
/// batches; and whether the rest was not written completely.
///
/// # Errors
/// A batch is damaged; the file can't be read.
pub(crate) fn read_judgements(
    below: &Below,
    folder: &Path,
    number: u32,
    length: u64,
) -> Result<(Vec<LaterJudgement>, u64, bool), ReadFault> {
    let file = below.open(&path(folder, number, SegmentColumn::Judgements))?;
    let source = BufReader::new(file.take(length));
    let mut frames = Frames::new(SegmentColumn::Judgements, source)?;
    let (mut all, mut batches, mut content) = (Vec::new(), 0, Vec::new());
    while let Some(place) = frames.next(&mut content)? {
        let batch = decode_judgements(&content).ok_or(FrameFault::Content(place.offset))?;
        all.extend(batch);
        batches += 1;
    }
    Ok((all, batches, frames.tail().1))
}

/// The readable judgements of a damaged file.
///
/// # Errors
/// The file can't be read.
pub(crate) fn salvage_judgements(
    below: &Below,
    folder: &Path,
    number: u32,
) -> io::Result<Vec<LaterJudgement>> {
    let file = path(folder, number, SegmentColumn::Judgements);
    let (mut frames, mut found) = (WholeFrames::open(below, &file)?, Vec::new());
    while let Some((_, content)) = frames.next()? {
        found.extend(decode_judgements(&content).into_iter().flatten());
    }
    Ok(found)
}

/// The judgements of a frame. Returns `None` if its content is none of this program.
fn decode_judgements(content: &[u8]) -> Option<Vec<LaterJudgement>> {
    postcard::from_bytes(&unpacked(content)?).ok()
}
