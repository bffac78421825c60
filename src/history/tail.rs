//! The end of a journal that no process writes any more: whether a part of it is lost.
//!
//! A process writes the trace of a run before its statements, one run after another, so that a kill
//! leaves one trace without a run at most, and mostly a complete journal.

use std::collections::BTreeSet;

use crate::folder::Folder;
use crate::{History, journal};
use actcheck_base::{Diagnostic, Diagnostics};

/// Number of runs that a message names.
const MOST_NAMED: usize = 3;

/// The end of a journal when the history was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tail {
    /// There was no journal, or another process was writing it.
    Closed,
    /// It ended with a complete record.
    Whole,
    /// It ended within a record.
    Cut,
    /// The folder is marked to have one, but there was none.
    Missing,
}

impl Tail {
    /// The end of a folder's journal, of which `bytes` were read.
    pub(super) fn of(folder: &Folder, bytes: &[u8]) -> Self {
        match folder.has_journal() {
            (false, true) => Self::Missing,
            (false, false) => Self::Closed,
            (true, _) if journal::is_cut(bytes) => Self::Cut,
            (true, _) => Self::Whole,
        }
    }
}

impl History {
    /// A warning if the end of the journal is lost, which a killed process left, or runs that were
    /// reported.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn journal_warning(&self) -> Result<Option<Diagnostic>, Diagnostics> {
        if self.tail == Tail::Closed {
            return Ok(None);
        }
        let lost = self.without_statements()?;
        let named: Vec<&str> = lost.iter().take(MOST_NAMED).map(String::as_str).collect();
        let more = if lost.len() > MOST_NAMED {
            ", \u{2026}"
        } else {
            ""
        };
        let runs = match lost.len() {
            0 => String::new(),
            1 => format!("; run {} has a file, but no statements", named.join(", ")),
            several => format!(
                "; {several} runs have files, but no statements: {}{more}",
                named.join(", ")
            ),
        };
        let dir = self.dir().display();
        let message = match self.tail {
            Tail::Cut => format!("the journal of the history `{dir}` ends within a record{runs}"),
            // A process may be killed between the removal of its journal and the change of the
            // version.
            Tail::Missing if lost.is_empty() => return Ok(None),
            Tail::Missing => format!("the journal of the history `{dir}` is missing{runs}"),
            // Most probably the run that a killed process was writing.
            Tail::Whole | Tail::Closed if lost.len() <= 1 => return Ok(None),
            Tail::Whole | Tail::Closed => {
                format!("the end of the journal of the history `{dir}` is missing{runs}")
            }
        };
        let help = "a process was killed while it wrote, or a disk or a copy lost the rest: restore `journal` from a backup, or \
                    `actcheck run --resume ID` makes missing runs again";
        Ok(Some(Diagnostic::warning("H029", message).help(help)))
    }

    /// The runs that have a file, and no statements, sorted.
    pub(super) fn without_statements(&self) -> Result<Vec<String>, Diagnostics> {
        let known: BTreeSet<String> = self.ids("act:Run")?.into_iter().collect();
        let campaigns: BTreeSet<String> = self.campaign_ids()?.into_iter().collect();
        let is_of_none = |run: &&String| {
            run.rsplit_once('-')
                .is_none_or(|(campaign, _)| !campaigns.contains(campaign))
        };
        let outlines = self.outlined_ids(None)?;
        let mut lost: Vec<String> = self
            .folder
            .traced()
            .into_iter()
            .filter(|run| !known.contains(run))
            .collect();
        lost.extend(outlines.iter().filter(is_of_none).cloned());
        lost.sort();
        Ok(lost)
    }
}
