//! The file of a campaign itself: its record, its end, and the lengths of its segments.
//!
//! It is replaced as a whole. It has the state twice, so that one damaged frame loses nothing.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::segment::{
    FrameFault, Frames, HEAD, ReadFault, SegmentColumn, WholeFrames, packed, put, unpacked,
};
use crate::{CampaignEnd, CampaignRecord};
use actcheck_base::Below;

/// Longest file. Unit: bytes. The text of a configuration has some kilobytes.
const LONGEST: u64 = 64 << 20;
/// Number of equal frames.
const COPIES: usize = 2;

/// A campaign without its runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct CampaignState {
    pub record: CampaignRecord,
    /// Position in its history, from 0.
    pub number: u64,
    /// Id that it had when it was run, if a merge has changed it.
    pub first_id: Option<String>,
    /// `None` while it runs, and if the program was killed.
    pub end: Option<CampaignEnd>,
    /// Number of runs and of batches of judgements in each segment when this was written, by the
    /// segment's number. It may have more now.
    pub segments: BTreeMap<u32, [u64; 2]>,
}

/// Path of the file in the folder of a campaign.
fn path(folder: &Path) -> std::path::PathBuf {
    folder.join(SegmentColumn::Campaign.extension())
}

impl CampaignState {
    /// Writes the file in the folder of its campaign.
    ///
    /// # Errors
    /// Writing failed; an existing file is unchanged.
    pub(crate) fn write(&self, below: &Below, folder: &Path) -> io::Result<()> {
        let mut nameless = self.clone();
        nameless.record.id.clear();
        let content = packed(&postcard::to_stdvec(&nameless).map_err(io::Error::other)?)?;
        let mut bytes = SegmentColumn::Campaign.head().to_vec();
        for _ in 0..COPIES {
            put(bytes.len() as u64, &content, &mut bytes)?;
        }
        below.write_atomic(&path(folder), &bytes)
    }

    /// Reads the file in the folder of the campaign with an id.
    ///
    /// # Errors
    /// It is damaged, or can't be read.
    pub(crate) fn read(below: &Below, folder: &Path, id: &str) -> Result<Self, ReadFault> {
        let bytes = below.read(&path(folder), LONGEST)?;
        let mut frames = Frames::new(SegmentColumn::Campaign, bytes.as_slice())?;
        let (mut copies, mut content) = (Vec::new(), Vec::new());
        while frames.next(&mut content)?.is_some() {
            copies.push(content.clone());
        }
        match copies.as_slice() {
            [one, other] if one == other => Self::decode(one, id),
            _ => None,
        }
        .ok_or_else(|| FrameFault::Content(HEAD as u64).into())
    }

    /// Reads a damaged file. Returns `None` if no copy is whole.
    ///
    /// # Errors
    /// The file can't be read.
    pub(crate) fn salvage(below: &Below, folder: &Path, id: &str) -> io::Result<Option<Self>> {
        let mut frames = WholeFrames::open(below, &path(folder))?;
        while let Some((_, content)) = frames.next()? {
            if let Some(state) = Self::decode(&content, id) {
                return Ok(Some(state));
            }
        }
        Ok(None)
    }

    /// Campaigns are known by the names of their folders alone.
    fn decode(content: &[u8], id: &str) -> Option<Self> {
        let mut state: Self = postcard::from_bytes(&unpacked(content)?).ok()?;
        id.clone_into(&mut state.record.id);
        Some(state)
    }
}
