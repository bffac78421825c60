//! Files of outlines that were read last: runs are mostly read in order, and each file has many.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use oxigraph::model::Quad;

use crate::outlines::file::Opened;
use crate::outlines::row::Rows;

/// Number of files that are kept. Each takes up to 20 MB.
const MOST: usize = 4;

/// A file whose parts are decoded when they are needed.
#[derive(Debug)]
pub(crate) struct Loaded {
    campaign: String,
    pub(super) path: PathBuf,
    bytes: Vec<u8>,
    indices: Vec<u64>,
    rows: OnceLock<Rows>,
    statements: OnceLock<Vec<Vec<Quad>>>,
    heads: OnceLock<Vec<Vec<u8>>>,
}

impl Loaded {
    /// # Errors
    /// A message that names the damage.
    pub(super) fn new(campaign: &str, path: PathBuf, bytes: Vec<u8>) -> Result<Self, String> {
        let indices = Opened::new(&bytes)?.indices()?;
        Ok(Self {
            campaign: campaign.to_owned(),
            path,
            bytes,
            indices,
            rows: OnceLock::new(),
            statements: OnceLock::new(),
            heads: OnceLock::new(),
        })
    }

    /// The position of a run.
    pub(super) fn position(&self, index: u64) -> Option<usize> {
        self.indices.iter().position(|other| *other == index)
    }

    /// The values of the runs in lists.
    pub(super) fn rows(&self) -> Result<&Rows, String> {
        part(&self.rows, || Opened::new(&self.bytes)?.rows())
    }

    /// The statements about a run.
    pub(super) fn statements(&self, at: usize) -> Result<&[Quad], String> {
        let all = part(&self.statements, || Opened::new(&self.bytes)?.statements())?;
        Ok(all.get(at).map_or(&[], Vec::as_slice))
    }

    /// Choices and states of a run, encoded.
    pub(super) fn head(&self, at: usize) -> Result<&[u8], String> {
        let all = part(&self.heads, || Opened::new(&self.bytes)?.heads())?;
        Ok(all.get(at).map_or(&[], Vec::as_slice))
    }
}

/// A decoded part. Two threads may decode it at the same time, to the same value.
fn part<T>(known: &OnceLock<T>, decode: impl FnOnce() -> Result<T, String>) -> Result<&T, String> {
    if known.get().is_none() {
        // A thread that was faster set the same.
        let _ = known.set(decode()?);
    }
    known.get().ok_or_else(String::new)
}

/// The files that were read last.
#[derive(Debug, Default)]
pub(crate) struct LoadedFiles(Mutex<Vec<Arc<Loaded>>>);

impl LoadedFiles {
    /// The file that has a run.
    pub(super) fn with(&self, campaign: &str, index: u64) -> Option<Arc<Loaded>> {
        let mut files = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let has = |file: &Arc<Loaded>| file.campaign == campaign && file.position(index).is_some();
        let at = files.iter().position(has)?;
        let found = files.remove(at);
        files.push(Arc::clone(&found));
        Some(found)
    }

    pub(super) fn add(&self, file: Loaded) {
        let mut files = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if files.len() >= MOST {
            files.remove(0);
        }
        files.push(Arc::new(file));
    }
}
