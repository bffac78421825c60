//! The runs of a campaign at one moment, from all its segments.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use crate::folder::{CampaignExtent, Folder};
use crate::segment::{
    LaterJudgement, ReadFault, RunEntry, Segment, SegmentColumn, read_judgements,
};
use crate::{RunFilter, RunRow, fault};
use actcheck_base::Diagnostics;

/// The segments of a campaign, with the order of its runs.
#[derive(Debug, Default)]
pub(crate) struct CampaignRuns {
    pub id: String,
    pub segments: Vec<Segment>,
    /// Each run once, by index.
    order: Vec<Slot>,
    /// Judgements made after the runs, in the order in which they were made.
    pub later: Vec<LaterJudgement>,
    /// Places of the judgements of each run.
    later_of: HashMap<u64, Vec<usize>>,
    /// Number of batches of judgements in each segment that has some.
    pub batches: HashMap<u32, u64>,
    /// Paths of files that end within a frame.
    pub torn: Vec<PathBuf>,
}

/// The place of a run.
#[derive(Debug, Clone, Copy)]
struct Slot {
    index: u64,
    segment: u32,
    row: u32,
}

/// A run of a segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RunAt<'c> {
    pub segment: &'c Segment,
    pub row: &'c RunEntry,
}

impl CampaignRuns {
    /// Reads the rows of a campaign.
    ///
    /// # Errors
    /// `H007` a file is damaged; a file can't be read.
    pub(crate) fn read(
        folder: &Folder,
        id: &str,
        extent: &CampaignExtent,
    ) -> Result<Self, Diagnostics> {
        Self::read_with(folder, id, extent, |file, fault| {
            Err(fault::segment(folder.dir(), file, fault))
        })
    }

    /// Reads the rows of a campaign. Calls `on_fault` with each file that can't be read, and goes on
    /// without it unless that returns an error.
    ///
    /// # Errors
    /// Those of `on_fault`.
    pub(crate) fn read_with(
        folder: &Folder,
        id: &str,
        extent: &CampaignExtent,
        mut on_fault: impl FnMut(&Path, &ReadFault) -> Result<(), Diagnostics>,
    ) -> Result<Self, Diagnostics> {
        let (below, dir) = (folder.below(), folder.campaign(id));
        let mut runs = Self {
            id: id.to_owned(),
            ..Self::default()
        };
        for (number, lengths) in &extent.segments {
            let file =
                |column: SegmentColumn| dir.join(format!("{number:04}.{}", column.extension()));
            if let Some(length) = lengths.runs {
                match Segment::open(&below, &dir, *number, length) {
                    Ok(segment) => {
                        runs.torn
                            .extend(segment.is_torn().then(|| file(SegmentColumn::Runs)));
                        runs.segments.push(segment);
                    }
                    Err(fault) => on_fault(&file(SegmentColumn::Runs), &fault)?,
                }
            }
            if let Some(length) = lengths.judgements {
                match read_judgements(&below, &dir, *number, length) {
                    Ok((later, batches, is_torn)) => {
                        runs.later.extend(later);
                        runs.batches.insert(*number, batches);
                        runs.torn
                            .extend(is_torn.then(|| file(SegmentColumn::Judgements)));
                    }
                    Err(fault) => on_fault(&file(SegmentColumn::Judgements), &fault)?,
                }
            }
        }
        runs.sort();
        Ok(runs)
    }

    /// Makes the order of the runs and of their judgements: if two have the same index, the first one counts.
    pub(crate) fn sort(&mut self) {
        self.order = (0..)
            .zip(&self.segments)
            .flat_map(|(segment, of)| {
                (0..).zip(of.rows()).map(move |(row, entry)| Slot {
                    index: entry.index,
                    segment,
                    row,
                })
            })
            .collect();
        // The sort is stable.
        self.order.sort_by_key(|slot| slot.index);
        self.order.dedup_by_key(|slot| slot.index);
        self.later_of.clear();
        for (place, later) in self.later.iter().enumerate() {
            self.later_of.entry(later.index).or_default().push(place);
        }
    }

    /// The file of a segment that has fewer runs or judgements than it had when the campaign's own
    /// file was written.
    pub(crate) fn shortened(&self, recorded: &BTreeMap<u32, [u64; 2]>) -> Option<String> {
        recorded.iter().find_map(|(number, [runs, batches])| {
            let segment = self
                .segments
                .iter()
                .find(|segment| segment.number() == *number);
            let has = segment.map_or(0, |segment| segment.rows().len() as u64);
            let name = |column: SegmentColumn| Some(format!("{number:04}.{}", column.extension()));
            if has < *runs {
                return name(SegmentColumn::Runs);
            }
            if self.batches.get(number).copied().unwrap_or_default() < *batches {
                return name(SegmentColumn::Judgements);
            }
            None
        })
    }

    /// Number of its runs.
    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }

    /// Its runs by index.
    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = RunAt<'_>> + Clone {
        self.order.iter().map(|slot| self.at(*slot))
    }

    fn at(&self, slot: Slot) -> RunAt<'_> {
        let segment = &self.segments[slot.segment as usize];
        RunAt {
            segment,
            row: &segment.rows()[slot.row as usize],
        }
    }

    /// The run with an index.
    pub(crate) fn find(&self, index: u64) -> Option<RunAt<'_>> {
        let place = self.order.binary_search_by_key(&index, |slot| slot.index);
        place.ok().map(|place| self.at(self.order[place]))
    }

    /// The judgements made after a run, in the order in which they were made.
    pub(crate) fn later_of(&self, index: u64) -> Vec<&LaterJudgement> {
        let places = self.later_of.get(&index).into_iter().flatten();
        places.map(|place| &self.later[*place]).collect()
    }

    /// Number of runs and of batches of judgements in each segment.
    pub(crate) fn lengths(&self) -> BTreeMap<u32, [u64; 2]> {
        let mut lengths: BTreeMap<u32, [u64; 2]> = self
            .segments
            .iter()
            .map(|segment| (segment.number(), [segment.rows().len() as u64, 0]))
            .collect();
        for (number, batches) in &self.batches {
            lengths.entry(*number).or_default()[1] = *batches;
        }
        lengths
    }
}

impl RunAt<'_> {
    /// The run as in a list.
    pub(crate) fn as_run(&self, campaign: &str) -> RunRow {
        self.segment.as_run(self.row, campaign)
    }

    /// Whether a filter selects it, apart from the campaign.
    pub(crate) fn matches(&self, filter: &RunFilter) -> bool {
        filter.status.is_none_or(|status| status == self.row.status)
            && filter
                .test
                .as_ref()
                .is_none_or(|test| *test == *self.segment.text(self.row.test))
    }
}
