//! The segments that this process writes.

use std::collections::HashMap;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::fault;
use crate::folder::Folder;
use crate::segment::{JudgementWriter, SegmentWriter};
use actcheck_base::Diagnostics;

/// The segments that this process writes, by campaign.
#[derive(Default)]
pub(crate) struct OpenSegments {
    writers: Mutex<HashMap<String, CampaignWriters>>,
    /// Whether each run is on the disk before it is reported.
    pub syncs: AtomicBool,
}

/// The segments of a campaign.
#[derive(Default)]
struct CampaignWriters {
    runs: Option<SegmentWriter>,
    judgements: Option<JudgementWriter>,
}

impl OpenSegments {
    /// Calls `write` with the segment of a campaign that this process writes.
    pub(crate) fn with_segment<T>(
        &self,
        folder: &Folder,
        campaign: &str,
        doing: &str,
        write: impl FnOnce(&mut SegmentWriter) -> io::Result<T>,
    ) -> Result<T, Diagnostics> {
        let mut writers = self.lock();
        let known = writers.entry(campaign.to_owned()).or_default();
        let segment = match &mut known.runs {
            Some(segment) => segment,
            none => none.insert(
                SegmentWriter::create(
                    &folder.below(),
                    &folder.campaign(campaign),
                    next_segment(folder, campaign)?,
                )
                .map_err(|error| fault::io(folder.dir(), doing, &error))?,
            ),
        };
        let written = write(segment).and_then(|value| {
            if self.syncs.load(Ordering::Relaxed) {
                segment.sync()?;
            }
            Ok(value)
        });
        written.map_err(|error| fault::io(folder.dir(), doing, &error))
    }

    /// Calls `write` with the judgements of a campaign that this process writes.
    pub(crate) fn with_judgements(
        &self,
        folder: &Folder,
        campaign: &str,
        write: impl FnOnce(&mut JudgementWriter) -> io::Result<()>,
    ) -> Result<(), Diagnostics> {
        let doing = "writing outcomes";
        let mut writers = self.lock();
        let known = writers.entry(campaign.to_owned()).or_default();
        let column = match &mut known.judgements {
            Some(column) => column,
            none => none.insert(
                JudgementWriter::create(
                    &folder.below(),
                    &folder.campaign(campaign),
                    next_segment(folder, campaign)?,
                )
                .map_err(|error| fault::io(folder.dir(), doing, &error))?,
            ),
        };
        write(column).map_err(|error| fault::io(folder.dir(), doing, &error))
    }

    /// Flushes all committed data to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub(crate) fn flush(&self, folder: &Folder) -> Result<(), Diagnostics> {
        self.lock()
            .values()
            .try_for_each(CampaignWriters::sync)
            .map_err(|error| fault::io(folder.dir(), "writing to the disk", &error))
    }

    /// Ends the segments of a campaign that this process writes, after flushing them.
    pub(crate) fn close(&self, folder: &Folder, campaign: &str) -> Result<(), Diagnostics> {
        let Some(writers) = self.lock().remove(campaign) else {
            return Ok(());
        };
        let path = folder.campaign(campaign);
        writers
            .sync()
            .and_then(|()| folder.below().sync_folder(&path))
            .map_err(|error| fault::io(folder.dir(), "writing to the disk", &error))
    }

    /// The campaigns to which this process has added judgements.
    pub(crate) fn judged_campaigns(&self) -> Vec<String> {
        let writers = self.lock();
        let judged = writers.iter().filter(|(_, own)| own.judgements.is_some());
        judged.map(|(campaign, _)| campaign.clone()).collect()
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, CampaignWriters>> {
        self.writers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl CampaignWriters {
    fn sync(&self) -> io::Result<()> {
        self.runs.as_ref().map_or(Ok(()), SegmentWriter::sync)?;
        self.judgements
            .as_ref()
            .map_or(Ok(()), JudgementWriter::sync)
    }
}

/// The number of the next segment of a campaign.
///
/// # Errors
/// The folder can't be read.
pub(crate) fn next_segment(folder: &Folder, campaign: &str) -> Result<u32, Diagnostics> {
    let extent = folder.campaign_extent(campaign)?.unwrap_or_default();
    Ok(extent.segments.keys().last().map_or(1, |last| last + 1))
}
