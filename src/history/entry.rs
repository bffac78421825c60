//! A run as its history stores it. The worker that made the run encodes it; one thread writes the
//! entries of all workers.

use std::io;

use crate::segment::{RunContent, packed};
use crate::stored_run::StoredRun;
use crate::trace_codec::{CodecFault, encode_head, encode_motion};
use crate::{History, RunRecord};
use actcheck_base::{Diagnostic, Diagnostics};

/// A run that is ready to be stored by [`History::write`].
#[derive(Debug)]
pub struct Entry {
    campaign: String,
    run: StoredRun,
    states: Vec<u8>,
    motion: Option<Vec<u8>>,
}

/// The reason why a run can't be encoded.
#[derive(Debug, thiserror::Error)]
enum EncodeFault {
    #[error(transparent)]
    Codec(#[from] CodecFault),
    #[error("its motion can't be compressed: {0}")]
    Compression(#[from] io::Error),
}

impl Entry {
    /// Encodes a run that is kept whole.
    ///
    /// # Errors
    /// `H006` it can't be encoded.
    pub fn whole(record: &RunRecord) -> Result<Self, Diagnostics> {
        Self::of(record, true).map_err(|why| unencodable(record, &why))
    }

    /// Encodes a run of which everything is kept except its motion over time, which comes back when
    /// the run is simulated again.
    ///
    /// # Errors
    /// `H006` it can't be encoded.
    pub fn outcomes(record: &RunRecord) -> Result<Self, Diagnostics> {
        Self::of(record, false).map_err(|why| unencodable(record, &why))
    }

    fn of(record: &RunRecord, is_whole: bool) -> Result<Self, EncodeFault> {
        let motion = match is_whole {
            true => Some(packed(&encode_motion(&record.trace)?)?),
            false => None,
        };
        Ok(Self {
            campaign: record.campaign.clone(),
            run: StoredRun::of(record),
            states: encode_head(&record.choices, &record.trace)?,
            motion,
        })
    }
}

fn unencodable(record: &RunRecord, why: &EncodeFault) -> Diagnostics {
    Diagnostic::error("H006", format!("writing run {} failed: {why}", record.id)).into()
}

impl History {
    /// Stores a run, completely or (on an error) not at all.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`. Runs stored before are complete.
    pub fn write(&self, entry: &Entry) -> Result<(), Diagnostics> {
        let doing = format!("writing run {}", entry.run.id_in(&entry.campaign));
        let folder = &self.stored.folder;
        self.segments
            .with_segment(folder, &entry.campaign, &doing, |segment| {
                segment.append(&RunContent {
                    run: &entry.run,
                    states: &entry.states,
                    motion: entry.motion.as_deref(),
                })
            })
    }

    /// Encodes and stores a run, completely or (on an error) not at all.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`. Runs stored before are complete.
    pub fn commit(&self, record: &RunRecord) -> Result<(), Diagnostics> {
        self.write(&Entry::whole(record)?)
    }

    /// Encodes and stores a run without its motion, completely or (on an error) not at all.
    ///
    /// # Errors
    /// As [`History::commit`].
    pub fn commit_outcomes(&self, record: &RunRecord) -> Result<(), Diagnostics> {
        self.write(&Entry::outcomes(record)?)
    }
}
