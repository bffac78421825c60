//! An open history: its folder, the campaigns that were read, and the segments that are written.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock};

use crate::campaign_state::CampaignState;
use crate::campaigns::StoredCampaigns;
use crate::folder::Folder;
use crate::ids::{campaign_id, run_id};
use crate::restore::Restore;
use crate::segment::SegmentColumn;
use crate::threads::cores;
use crate::view::View;
use crate::writers::OpenSegments;
use crate::{CampaignEnd, CampaignRecord, CampaignRow, RunDetail, fault};
use actcheck_base::{Diagnostic, Diagnostics, names, nearest};

/// A history that only this process may write, or that it only reads (after
/// [`History::open_to_read`]).
///
/// A run that [`History::commit`] stored survives a kill of the process. Before a power cut, the
/// operating system may not have written the last seconds to the disk; runs stored before
/// [`History::flush`] survive that, too, and all runs after [`History::sync_each_run`].
pub struct History {
    pub(crate) stored: StoredCampaigns,
    pub(crate) segments: OpenSegments,
    /// The statements that queries have needed so far.
    pub(crate) view: Mutex<View>,
    /// Greatest number of threads that read runs for queries.
    threads: AtomicUsize,
    pub(crate) restore: OnceLock<Box<Restore>>,
}

/// Opening.
impl History {
    /// Opens the history in a folder, and creates it if missing.
    ///
    /// # Errors
    /// `H001` the folder can't be used, `H002` another process has it open, `H003` it holds other
    /// files, `H004` it has another format, `H005` the disk is full, `H006`, `H007` it is
    /// damaged.
    pub fn open(dir: &Path) -> Result<Self, Diagnostics> {
        Self::owned(Folder::lock_exclusive(dir, true)?)
    }

    /// Opens the existing history in a folder.
    ///
    /// # Errors
    /// As [`History::open`]; also `H003` if the folder has no history.
    pub fn open_existing(dir: &Path) -> Result<Self, Diagnostics> {
        Self::owned(Folder::lock_exclusive(dir, false)?)
    }

    /// Like [`History::open_existing`], with a number of threads instead of all cores: see
    /// [`History::use_threads`].
    ///
    /// # Errors
    /// As [`History::open_existing`].
    pub fn open_existing_with(dir: &Path, threads: usize) -> Result<Self, Diagnostics> {
        let history = Self::open_existing(dir)?;
        history.use_threads(threads);
        Ok(history)
    }

    /// Opens the state of an existing history at this moment for reading. It needs no permission to
    /// write the folder, and other processes may read and write it at the same time, before and
    /// after.
    ///
    /// # Errors
    /// As [`History::open_existing`], but never `H002`.
    pub fn open_to_read(dir: &Path) -> Result<Self, Diagnostics> {
        Ok(Self::with(StoredCampaigns::to_read(Folder::to_read(dir)?)?))
    }

    fn owned(folder: Folder) -> Result<Self, Diagnostics> {
        Ok(Self::with(StoredCampaigns::own(folder)?))
    }

    pub(crate) fn with(stored: StoredCampaigns) -> Self {
        Self {
            stored,
            segments: OpenSegments::default(),
            view: Mutex::default(),
            threads: AtomicUsize::new(cores()),
            restore: OnceLock::new(),
        }
    }

    /// Shows the present state of the history. Returns whether it has changed since the last one.
    /// Answers that are being read keep theirs. The owner's history is always up to date.
    ///
    /// # Errors
    /// As [`History::open_to_read`]; the earlier state is then kept.
    pub fn refresh(&self) -> Result<bool, Diagnostics> {
        self.stored.refresh()
    }

    /// Whether the history has changed since the state that is shown, or can't be read any more.
    pub fn is_stale(&self) -> bool {
        self.stored.is_stale()
    }

    /// Identifies the state of a reader's history: two that are equal have the same runs and
    /// judgements. `None` for the owner's, which changes.
    pub fn state(&self) -> Option<String> {
        self.stored.digest()
    }

    /// Limits the threads that read runs for queries: otherwise, all cores do.
    pub fn use_threads(&self, threads: usize) {
        self.threads.store(threads.max(1), Ordering::Relaxed);
    }

    /// Greatest number of threads.
    pub(crate) fn threads(&self) -> usize {
        self.threads.load(Ordering::Relaxed)
    }

    /// Whether this program writes files of this path into the folder of a history.
    pub fn writes(path: &Path) -> bool {
        Folder::writes(path)
    }

    /// The folder as the caller gave it.
    pub fn dir(&self) -> &Path {
        self.stored.folder.dir()
    }

    /// Number of runs that are stored in a folder, which need not be a history.
    pub fn count_runs(dir: &Path) -> u64 {
        let counted = || -> Result<u64, Diagnostics> {
            let history = Self::open_to_read(dir)?;
            let mut count = 0;
            for id in history.stored.ids()? {
                count += history.stored.runs_of(&id)?.len() as u64;
            }
            Ok(count)
        };
        counted().unwrap_or_default()
    }
}

/// Reading campaigns.
impl History {
    /// Returns all campaigns, in the order in which they were added to the history.
    ///
    /// # Errors
    /// A file is damaged or can't be read; `H026` an id is not an id.
    pub fn campaigns(&self) -> Result<Vec<CampaignRow>, Diagnostics> {
        let mut rows = Vec::new();
        for state in self.stored.states()? {
            let runs = self.stored.runs_of(&state.record.id)?.len() as u64;
            rows.push(CampaignRow::of(&state, runs));
        }
        Ok(rows)
    }

    /// Returns the record of a campaign.
    ///
    /// # Errors
    /// `H014` the history has no campaign with this id.
    pub fn campaign(&self, id: &str) -> Result<CampaignRecord, Diagnostics> {
        if let Some(state) = self.stored.state_of(id)? {
            return Ok(state.record.clone());
        }
        let known = self.stored.ids()?;
        let help = match nearest(id, known.iter().map(String::as_str)) {
            Some(found) => format!("did you mean `{found}`?"),
            None => "`actcheck list` shows all runs with their campaigns".to_owned(),
        };
        let message = format!(
            "the history `{}` has no campaign `{id}`",
            self.dir().display()
        );
        Err(Diagnostic::error("H014", message).help(help).into())
    }

    /// A warning if campaigns of the history began later than now: the clock was ahead then, or is
    /// behind now.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn clock_warning(&self, now: &str) -> Result<Option<Diagnostic>, Diagnostics> {
        let states = self.stored.states()?;
        let Some(ahead) = states
            .iter()
            .map(|state| &state.record)
            .filter(|record| record.started.as_str() > now)
            .max_by_key(|record| &record.started)
        else {
            return Ok(None);
        };
        let message = format!(
            "campaign {} began at {}, but it is {now} now",
            ahead.id, ahead.started
        );
        let help = "the clock was ahead then, or is behind now: set it; campaigns keep the order in which they were added";
        Ok(Some(Diagnostic::warning("H032", message).help(help)))
    }

    /// Returns the ids of all campaigns except those of [`History::selected_campaigns`], in the
    /// order in which they were added.
    ///
    /// # Errors
    /// A file is damaged or can't be read; `H026` an id is not an id.
    pub fn unselected_campaigns(&self) -> Result<Vec<String>, Diagnostics> {
        let selected = self.selected_campaigns()?;
        let states = self.stored.states()?;
        let ids = states.iter().map(|state| state.record.id.clone());
        Ok(ids.filter(|id| !selected.contains(id)).collect())
    }
}

/// Reading runs.
impl History {
    /// Returns the campaigns of [`History::unselected_campaigns`], each with its run ids, sorted as
    /// strings.
    ///
    /// # Errors
    /// A file is damaged or can't be read; `H026` an id is not an id.
    pub fn run_ids(&self) -> Result<Vec<(String, Vec<String>)>, Diagnostics> {
        let mut found = Vec::new();
        for id in self.unselected_campaigns()? {
            let runs = self.stored.runs_of(&id)?;
            let ids = runs.iter().map(|run| run_id(&id, run.row.index));
            let mut ids: Vec<String> = ids.collect();
            ids.sort();
            found.push((id, ids));
        }
        Ok(found)
    }

    /// Returns all details of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// `H008` the history has no run with this name.
    pub fn run(&self, name: &str) -> Result<RunDetail, Diagnostics> {
        let id = self.resolve(name)?;
        let detail = self.stored.with_run(&id, |campaign, run| {
            let stored = run.segment.run(run.row);
            let file = run.segment.file(SegmentColumn::Details);
            let stored = stored.map_err(|fault| fault::run(self.dir(), &id, &file, &fault))?;
            Ok(stored.detail(campaign))
        })?;
        detail.ok_or_else(|| fault::no_run(self.dir(), &id))
    }

    pub(crate) fn has_run(&self, id: &str) -> Result<bool, Diagnostics> {
        Ok(self.stored.with_run(id, |_, _| Ok(()))?.is_some())
    }

    /// Whether a run is kept whole, by its id.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn is_whole(&self, id: &str) -> Result<bool, Diagnostics> {
        let is_whole = self.stored.with_run(id, |_, run| Ok(run.row.is_whole()))?;
        Ok(is_whole.unwrap_or_default())
    }
}

/// Writing.
impl History {
    /// Makes each stored run survive a power cut, which costs a sync of the disk for each.
    pub fn sync_each_run(&self) {
        self.segments.syncs.store(true, Ordering::Relaxed);
    }

    /// Returns an id for a new campaign: short, unique in this history, and the same for the same
    /// history, revision and seed. `revision` is a digest of the campaign's inputs.
    ///
    /// # Errors
    /// The folder can't be read.
    pub fn next_campaign_id(&self, revision: &str, seed: u64) -> Result<String, Diagnostics> {
        let known: BTreeSet<String> = self.stored.ids()?.into_iter().collect();
        let first = known.len() as u64;
        let free = (first..)
            .map(|counter| campaign_id(revision, seed, counter))
            .find(|id| !known.contains(id));
        // There are nearly a million short ids; when all are used, a long one follows.
        Ok(free.unwrap_or_else(|| revision.to_owned()))
    }

    /// Writes a campaign before its first run.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H026` its id is not an id.
    pub fn begin_campaign(&self, record: &CampaignRecord) -> Result<(), Diagnostics> {
        let number = self.stored.ids()?.len() as u64;
        self.write_state(&CampaignState {
            record: record.clone(),
            number,
            first_id: None,
            end: None,
            segments: BTreeMap::new(),
        })
    }

    /// Removes the end of a campaign that is resumed, and the half of a run that a killed process
    /// left.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H014` the history has no campaign with this id.
    pub fn reopen_campaign(&self, id: &str) -> Result<(), Diagnostics> {
        self.stored.remove_torn_tails(id)?;
        self.change_state(id, |state| state.end = None)
    }

    /// Writes the end of a campaign, and flushes everything to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H014` the history has no campaign with this id.
    pub fn finish_campaign(&self, id: &str, end: &CampaignEnd) -> Result<(), Diagnostics> {
        self.segments.close(&self.stored.folder, id)?;
        self.change_state(id, |state| state.end = Some(end.clone()))
    }

    /// Writes the file of a campaign itself, and creates its folder if it is missing.
    pub(crate) fn write_state(&self, state: &CampaignState) -> Result<(), Diagnostics> {
        let id = &state.record.id;
        if !names::is_id(id) {
            return Err(fault::foreign_id(self.dir(), "campaign", id));
        }
        let (below, folder) = (self.stored.folder.below(), self.stored.folder.campaign(id));
        below
            .create_folder(&folder)
            .and_then(|()| state.write(&below, &folder))
            .and_then(|()| below.sync_folder(&folder))
            .map_err(|error| fault::io(self.dir(), "writing the campaign", &error))
    }

    /// Writes a changed state of a campaign, with the present lengths of its segments.
    pub(crate) fn change_state(
        &self,
        id: &str,
        change: impl FnOnce(&mut CampaignState),
    ) -> Result<(), Diagnostics> {
        let Some(known) = self.stored.state_of(id)? else {
            return self.campaign(id).map(drop);
        };
        let mut state = (*known).clone();
        state.segments = self.stored.runs_of(id)?.lengths();
        change(&mut state);
        self.write_state(&state)
    }

    /// Flushes all committed data to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn flush(&self) -> Result<(), Diagnostics> {
        self.segments.flush(&self.stored.folder)
    }
}
