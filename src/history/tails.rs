//! The ends of segments that no process writes any more: whether a part of them is lost.
//!
//! A run's other values are written before its row, one run after another, so that a kill leaves
//! the values of one run without a row at most.

use std::path::PathBuf;

use crate::campaign::CampaignRuns;
use crate::ids::run_id;
use crate::segment::{ReadFault, SegmentColumn, indices_after};
use crate::{History, fault};
use actcheck_base::{Diagnostic, Diagnostics};

/// Number of runs that a message names.
const MOST_NAMED: usize = 3;

/// The end of a segment of a campaign.
#[derive(Debug)]
pub(crate) struct TornTail {
    /// Its column that ends within a frame, or lacks rows.
    pub file: PathBuf,
    /// Whether it ends within a frame.
    pub is_cut: bool,
    /// Ids of the runs that have values, but no row.
    pub without_row: Vec<String>,
}

impl TornTail {
    /// Whether runs may be lost that were reported: more than the one that a killed process was
    /// writing.
    pub(crate) fn may_lose_runs(&self) -> bool {
        self.is_cut || self.without_row.len() > 1
    }
}

impl History {
    /// A warning if the end of a segment is lost, which a killed process left, or runs that were
    /// reported.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn tail_warning(&self) -> Result<Option<Diagnostic>, Diagnostics> {
        // Another process may be writing.
        if self.stored.is_salvaged()
            || (!self.stored.folder.is_own() && self.stored.folder.is_locked())
        {
            return Ok(None);
        }
        for state in self.stored.states()? {
            // The file of a campaign that has ended says how many runs it has.
            if state.end.is_some() {
                continue;
            }
            let runs = self.stored.runs_of(&state.record.id)?;
            let tails = self.torn_tails(&runs)?;
            if let Some(tail) = tails.iter().find(|tail| tail.may_lose_runs()) {
                return Ok(Some(self.lost(tail)));
            }
        }
        Ok(None)
    }

    fn lost(&self, tail: &TornTail) -> Diagnostic {
        let TornTail { without_row, .. } = tail;
        let named: Vec<&str> = without_row
            .iter()
            .take(MOST_NAMED)
            .map(String::as_str)
            .collect();
        let more = if without_row.len() > MOST_NAMED {
            ", …"
        } else {
            ""
        };
        let runs = match without_row.len() {
            0 => String::new(),
            1 => format!("; run {} has values, but no row", named.join(", ")),
            several => format!(
                "; {several} runs have values, but no row: {}{more}",
                named.join(", ")
            ),
        };
        let (file, dir) = (
            fault::relative(self.dir(), &tail.file).display(),
            self.dir().display(),
        );
        let message = if tail.is_cut {
            format!("`{file}` of the history `{dir}` ends within a frame{runs}")
        } else {
            format!("the end of `{file}` of the history `{dir}` is missing{runs}")
        };
        let help = "a process was killed while it wrote, or a disk or a copy lost the rest: restore the file from a backup, or \
                    `actcheck run --resume ID` makes missing runs again";
        Diagnostic::warning("H029", message).help(help)
    }

    /// The ends of a campaign's segments that are not as a finished process leaves them.
    pub(crate) fn torn_tails(&self, runs: &CampaignRuns) -> Result<Vec<TornTail>, Diagnostics> {
        let (below, folder) = (
            self.stored.folder.below(),
            self.stored.folder.campaign(&runs.id),
        );
        let mut tails: Vec<TornTail> = runs
            .torn
            .iter()
            .map(|file| TornTail {
                file: file.clone(),
                is_cut: true,
                without_row: Vec::new(),
            })
            .collect();
        let extent = self
            .stored
            .folder
            .campaign_extent(&runs.id)?
            .unwrap_or_default();
        for number in extent.segments.keys() {
            let segment = runs.segments.iter().find(|own| own.number() == *number);
            let end = segment
                .and_then(|segment| segment.rows().last())
                .map(|row| row.places.details.end());
            let found = match indices_after(&below, &folder, *number, end) {
                Ok(indices) => indices,
                // It is found when the run is read.
                Err(ReadFault::Damaged(_)) => continue,
                Err(ReadFault::Io(error)) if error.kind() == std::io::ErrorKind::NotFound => {
                    continue;
                }
                Err(ReadFault::Io(error)) => {
                    return Err(fault::io(self.dir(), "reading a segment", &error));
                }
            };
            if found.is_empty() {
                continue;
            }
            let mut without_row: Vec<String> =
                found.iter().map(|index| run_id(&runs.id, *index)).collect();
            without_row.sort();
            let file = folder.join(format!("{number:04}.{}", SegmentColumn::Runs.extension()));
            match tails.iter_mut().find(|tail| tail.file == file) {
                Some(tail) => tail.without_row = without_row,
                None => tails.push(TornTail {
                    file,
                    is_cut: false,
                    without_row,
                }),
            }
        }
        Ok(tails)
    }
}
