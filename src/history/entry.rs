//! A run as its history stores it. The worker that made the run encodes it; one thread writes the
//! entries of all workers.

use crate::journal::Record;
use crate::outlines::Outline;
use crate::stored_run::StoredRun;
use crate::write_run::{self, run_node};
use crate::{History, RunRecord, fault, graphs, trace_file, trace_parts};
use actcheck_base::{Diagnostic, Diagnostics};

/// A run that is ready to be stored by [`History::write`].
#[derive(Debug)]
pub struct Entry {
    campaign: String,
    run: String,
    index: u64,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// The content of its trace file, and its statements.
    Whole {
        trace: Vec<u8>,
        statements: Record,
    },
    Outline(Box<Outline>),
}

impl Entry {
    /// Encodes a run that is kept whole.
    ///
    /// # Errors
    /// `H006` it can't be encoded.
    pub fn whole(record: &RunRecord) -> Result<Self, Diagnostics> {
        let content = whole(record).map_err(|why| unencodable(record, &why))?;
        Ok(Self::of(record, content))
    }

    /// Encodes the outline of a run: everything except its motion over time, which comes back when
    /// the run is simulated again.
    ///
    /// # Errors
    /// `H006` it can't be encoded.
    pub fn outline(record: &RunRecord) -> Result<Self, Diagnostics> {
        let outline = Outline::of(record).map_err(|why| unencodable(record, &why))?;
        Ok(Self::of(record, Content::Outline(Box::new(outline))))
    }

    fn of(record: &RunRecord, content: Content) -> Self {
        Self {
            campaign: record.campaign.clone(),
            run: record.id.clone(),
            index: record.index,
            content,
        }
    }
}

fn whole(record: &RunRecord) -> Result<Content, String> {
    let stored = StoredRun::of(record);
    let trace = trace_file::encode(&record.choices, &record.trace)?;
    let parts = (stored.objects(), stored.actions());
    let trace = trace_parts::appended(trace, &record.trace.hash, &parts)?;
    let mut quads = write_run::quads_without_facts(&stored, &record.campaign);
    graphs::write(&record.facts, &run_node(&record.id), &mut quads);
    let statements = Record::of(&quads).map_err(|error| error.to_string())?;
    Ok(Content::Whole { trace, statements })
}

fn unencodable(record: &RunRecord, why: &str) -> Diagnostics {
    Diagnostic::error("H006", format!("writing run {} failed: {why}", record.id)).into()
}

impl History {
    /// Stores a run, completely or (on an error) not at all.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`. Runs stored before are complete.
    pub fn write(&self, entry: &Entry) -> Result<(), Diagnostics> {
        self.check_ids("run", [&entry.run])?;
        let (trace, statements) = match &entry.content {
            Content::Whole { trace, statements } => (trace, statements),
            Content::Outline(outline) => {
                return self.enter_outline(&entry.campaign, entry.index, outline);
            }
        };
        let doing = format!("writing run {}", entry.run);
        let file = self.folder.trace(&entry.run);
        self.folder
            .below()
            .write_atomic(&file, trace)
            .map_err(|error| fault::io(self.dir(), &doing, &error))?;
        self.enter(statements, &doing).inspect_err(|_| {
            // A trace without a run is harmless; if it can't be removed now, the next campaign
            // removes it.
            let _ = self.folder.below().remove(&file);
        })?;
        self.load_long_journal()
    }

    /// Encodes and stores a run, completely or (on an error) not at all.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`. Runs stored before are complete.
    pub fn commit(&self, record: &RunRecord) -> Result<(), Diagnostics> {
        self.write(&Entry::whole(record)?)
    }

    /// Encodes and stores the outline of a run, completely or (on an error) not at all.
    ///
    /// # Errors
    /// As [`History::commit`].
    pub fn commit_outline(&self, record: &RunRecord) -> Result<(), Diagnostics> {
        self.write(&Entry::outline(record)?)
    }
}
