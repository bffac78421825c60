//! Compares the files of a history with their checksums and with each other.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::campaign::{CampaignRuns, RunAt};
use crate::campaign_state::CampaignState;
use crate::campaigns::StoredCampaigns;
use crate::folder::{CampaignExtent, Folder};
use crate::ids::run_id;
use crate::segment::{ReadFault, Segment, SegmentColumn, salvage_judgements};
use crate::trace_codec::{decode_head, decode_motion};
use crate::{History, fault};
use actcheck_base::Diagnostics;

/// A damaged or missing part of a history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The file, relative to the folder of the history.
    pub file: PathBuf,
    /// The run that it concerns; `None` if it concerns all.
    pub run: Option<String>,
    /// The kind of damage.
    pub reason: String,
}

/// The result of an examination.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Integrity {
    /// Damaged parts; empty if the history is intact.
    pub damage: Vec<Damage>,
    /// Number of runs.
    pub runs: usize,
    /// Segments whose last run was not written completely, which only a killed process leaves: the
    /// campaign makes this run again when it is resumed.
    pub unfinished: Vec<PathBuf>,
}

impl History {
    /// Examines a history, also a damaged one, without changing it: reads every frame of every
    /// file, and compares the values of each run. Returns the result, and the history as far as it
    /// can be read.
    ///
    /// # Errors
    /// `H003` or `H004` if this program can't read the history.
    pub fn examine(dir: &Path) -> Result<(Integrity, Self), Diagnostics> {
        let history = Self::open_to_read(dir)?;
        let mut found = Integrity::default();
        let extent = history.stored.extent()?;
        for (id, extent) in &extent.campaigns {
            history.examine_campaign(id, extent, &mut found)?;
        }
        found
            .damage
            .sort_by(|one, other| (&one.file, &one.run).cmp(&(&other.file, &other.run)));
        found
            .damage
            .dedup_by(|one, other| (&one.file, &one.run) == (&other.file, &other.run));
        if found.damage.is_empty() {
            return Ok((found, history));
        }
        let (salvaged, _) = Self::open_to_salvage(dir)?;
        Ok((found, salvaged))
    }

    fn examine_campaign(
        &self,
        id: &str,
        extent: &CampaignExtent,
        found: &mut Integrity,
    ) -> Result<(), Diagnostics> {
        let (below, folder) = (self.stored.folder.below(), self.stored.folder.campaign(id));
        let relative = |file: &Path| fault::relative(self.dir(), file).to_path_buf();
        let state = match CampaignState::read(&below, &folder, id) {
            Ok(state) => Some(state),
            Err(why) => {
                found.damage.push(Damage {
                    file: relative(&folder.join(SegmentColumn::Campaign.extension())),
                    run: None,
                    reason: why.to_string(),
                });
                None
            }
        };
        let damage = &mut found.damage;
        let runs = CampaignRuns::read_with(&self.stored.folder, id, extent, |file, why| {
            damage.push(Damage {
                file: relative(file),
                run: None,
                reason: why.to_string(),
            });
            Ok(())
        })?;
        found.runs += runs.len();
        for run in runs.iter() {
            for column in SegmentColumn::OF_RUNS {
                let reason = examine_run(run, column);
                found.damage.extend(reason.map(|reason| Damage {
                    file: relative(&run.segment.file(column)),
                    run: Some(run_id(id, run.row.index)),
                    reason,
                }));
            }
        }
        let recorded = state.as_ref().map(|state| &state.segments);
        if let Some(file) = recorded.and_then(|recorded| runs.shortened(recorded)) {
            found.damage.push(Damage {
                file: relative(&folder.join(file)),
                run: None,
                reason: "it is shorter than it was".to_owned(),
            });
        }
        // The file of a campaign that has ended says how many runs it has.
        if state.as_ref().is_some_and(|state| state.end.is_some()) {
            return Ok(());
        }
        let is_locked = self.stored.folder.is_locked();
        for tail in self.torn_tails(&runs)? {
            let file = relative(&tail.file);
            let count = tail.without_row.len();
            if count > 1 && !is_locked {
                found.damage.push(Damage {
                    file,
                    run: None,
                    reason: format!("its end is missing: {count} runs have values, but no row"),
                });
            } else {
                found.unfinished.push(file);
            }
        }
        Ok(())
    }

    /// Like [`History::open_to_read`], for a damaged history: reads everything that is readable.
    /// Returns it with the ids of the runs that are lost, sorted.
    ///
    /// # Errors
    /// As [`History::open_to_read`]; a file can't be read.
    pub fn open_to_salvage(dir: &Path) -> Result<(Self, Vec<String>), Diagnostics> {
        let folder = Folder::to_read(dir)?;
        let extent = folder.extent()?;
        let (mut campaigns, mut all_lost) = (BTreeMap::new(), Vec::new());
        for (id, extent) in &extent.campaigns {
            let (runs, lost) = salvaged(&folder, id, extent)?;
            let (below, path) = (folder.below(), folder.campaign(id));
            let state = CampaignState::salvage(&below, &path, id)
                .map_err(|error| fault::io(dir, "reading a campaign", &error))?;
            match state {
                Some(mut state) => {
                    if !lost.is_empty() {
                        // Resuming the campaign makes the lost runs again.
                        state.end = None;
                    }
                    all_lost.extend(lost.iter().map(|index| run_id(id, *index)));
                    campaigns.insert(id.clone(), (Arc::new(state), Arc::new(runs)));
                }
                // Runs without their campaign have no rules, models or configuration.
                None => all_lost.extend(runs.iter().map(|run| run_id(id, run.row.index))),
            }
        }
        all_lost.sort();
        all_lost.dedup();
        let stored = StoredCampaigns::of_salvaged(folder, campaigns);
        Ok((Self::with(stored), all_lost))
    }
}

/// The readable runs of a campaign, and the indices of the others.
fn salvaged(
    folder: &Folder,
    id: &str,
    extent: &CampaignExtent,
) -> Result<(CampaignRuns, Vec<u64>), Diagnostics> {
    let (below, path) = (folder.below(), folder.campaign(id));
    let unread = |why: ReadFault| fault::segment(folder.dir(), &path, &why);
    let (mut runs, mut all_lost) = (CampaignRuns::default(), Vec::new());
    id.clone_into(&mut runs.id);
    for (number, lengths) in &extent.segments {
        if let Some(segment) = Segment::salvage(&below, &path, *number).map_err(unread)? {
            let (segment, lost) = segment;
            all_lost.extend(lost);
            runs.segments.push(segment);
        }
        if lengths.judgements.is_some() {
            let later = salvage_judgements(&below, &path, *number);
            let later = later.map_err(|error| unread(error.into()))?;
            runs.later.extend(later);
        }
    }
    runs.sort();
    all_lost.retain(|index| runs.find(*index).is_none());
    Ok((runs, all_lost))
}

/// The fault of a value of a run, if it has one.
fn examine_run(run: RunAt<'_>, column: SegmentColumn) -> Option<String> {
    let RunAt { segment, row } = run;
    match column {
        SegmentColumn::Details => match segment.run(row) {
            Ok(stored) if segment.agrees(row, &stored) => None,
            Ok(_) => Some("its row has other values".to_owned()),
            Err(why) => Some(why.to_string()),
        },
        SegmentColumn::States => match segment.states(row) {
            Ok(states) => match decode_head(&states) {
                Ok((_, trace)) if trace.hash == row.trace_hash() => None,
                Ok(_) => Some("these are the states of another run".to_owned()),
                Err(why) => Some(why.to_string()),
            },
            Err(why) => Some(why.to_string()),
        },
        SegmentColumn::Motion => match (segment.motion(row), segment.states(row)) {
            (Ok(Some(motion)), Ok(states)) => {
                let (_, mut trace) = decode_head(&states).ok()?;
                let fault = decode_motion(motion, &mut trace).err()?;
                Some(fault.to_string())
            }
            (Err(why), _) => Some(why.to_string()),
            _ => None,
        },
        SegmentColumn::Runs | SegmentColumn::Judgements | SegmentColumn::Campaign => None,
    }
}
