//! A file of recordings.

use re_log_encoding::{CrateVersion, Encoder, EncodingOptions};
use re_log_types::EntityPath;
use re_sdk_types::archetypes::{RecordingInfo, TextDocument};

use crate::html::Explained;
use crate::recording::stream::{Recording, RecordingFault, place};
use crate::recording::{events, footer, motion, outcomes};
use actcheck_data::Trace;
use actcheck_history::RunDetail;

/// Recordings of the added runs, one for each run.
pub struct Recordings {
    encoder: Encoder<Vec<u8>>,
    runs: usize,
    bytes: u64,
}

impl Recordings {
    /// Creates an empty file.
    ///
    /// # Errors
    /// The file header can't be encoded.
    pub fn new() -> Result<Self, RecordingFault> {
        let options = EncodingOptions::PROTOBUF_COMPRESSED;
        let encoder = Encoder::new_eager(CrateVersion::LOCAL, options, Vec::new())?;
        Ok(Self {
            encoder,
            runs: 0,
            bytes: 0,
        })
    }

    /// Adds a run. A run without a trace has no 3D content, but its outcomes are included.
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
        recording.log_static(EntityPath::properties(), &[&name])?;
        recording.log_static(
            place(["outcomes"]),
            &[&TextDocument::from_markdown(outcomes::document(
                run, explained,
            ))],
        )?;
        if let Some(trace) = trace.filter(|trace| !trace.snapshots.is_empty()) {
            motion::record(&mut recording, run, trace)?;
        }
        events::record(&mut recording, run, trace)?;
        self.runs += 1;
        self.bytes += recording.bytes();
        Ok(())
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Total size in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the file's bytes.
    ///
    /// # Errors
    /// The file footer can't be encoded.
    pub fn finish(mut self) -> Result<Vec<u8>, RecordingFault> {
        self.encoder.finish()?;
        footer::sorted(self.encoder.into_inner()?)
    }
}
