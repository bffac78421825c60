//! Recordings of runs in one file.

use re_log_encoding::{CrateVersion, Encoder, EncodingOptions};
use re_log_types::EntityPath;
use re_sdk_types::archetypes::{RecordingInfo, TextDocument};

use crate::history::{RunDetail, Trace};
use crate::report::html::Explained;
use crate::report::recording::stream::{Recording, RecordingFault, place};
use crate::report::recording::{course, events, footer, outcomes};

/// Recordings, one for each run that was added.
pub struct Recordings {
    encoder: Encoder<Vec<u8>>,
    runs: usize,
    bytes: u64,
}

impl Recordings {
    /// None yet.
    ///
    /// # Errors
    /// The beginning of a file can't be encoded.
    pub fn new() -> Result<Self, RecordingFault> {
        let options = EncodingOptions::PROTOBUF_COMPRESSED;
        let encoder = Encoder::new_eager(CrateVersion::LOCAL, options, Vec::new())?;
        Ok(Self { encoder, runs: 0, bytes: 0 })
    }

    /// Adds a run. One without a state has nothing to be seen in 3D; its outcomes are told all the same.
    ///
    /// # Errors
    /// A part of it can't be encoded.
    pub fn add(
        &mut self,
        run: &RunDetail,
        trace: Option<&Trace>,
        explained: &[Explained],
    ) -> Result<(), RecordingFault> {
        let mut recording = Recording::begin(&mut self.encoder, &run.row.run)?;
        let name = RecordingInfo::new().with_name(outcomes::title(run));
        recording.still(EntityPath::properties(), &[&name])?;
        recording.still(place(["outcomes"]), &[&TextDocument::from_markdown(outcomes::document(run, explained))])?;
        if let Some(trace) = trace.filter(|trace| !trace.snapshots.is_empty()) {
            course::record(&mut recording, run, trace)?;
        }
        events::record(&mut recording, run, trace)?;
        self.runs += 1;
        self.bytes += recording.bytes();
        Ok(())
    }

    /// How many runs they are of.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Bytes of all of them.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The file.
    ///
    /// # Errors
    /// The end of a file can't be encoded.
    pub fn finish(mut self) -> Result<Vec<u8>, RecordingFault> {
        self.encoder.finish()?;
        footer::sorted(self.encoder.into_inner()?)
    }
}
