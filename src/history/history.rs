//! An open history: its folder, the campaigns that were read, and the segments that are written.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock};

use crate::campaign::{CampaignRuns, RunAt};
use crate::campaign_state::CampaignState;
use crate::folder::{CampaignExtent, Folder, FolderExtent};
use crate::restore::Restore;
use crate::segment::{JudgementWriter, SegmentColumn, SegmentWriter, whole_length};
use crate::threads::cores;
use crate::view::View;
use crate::{
    CampaignEnd, CampaignRecord, CampaignRow, Cancel, Judgements, OutcomeRow, QueryAnswer,
    RunDetail, RunFilter, RunRow, Wish, fault, query,
};
use actcheck_base::{Diagnostic, Diagnostics, Digest, Source, names, nearest};

/// A history that only this process may write, or that it only reads (after
/// [`History::open_to_read`]).
///
/// A run that [`History::commit`] stored survives a kill of the process. Before a power cut, the
/// operating system may not have written the last seconds to the disk; runs stored before
/// [`History::flush`] survive that, too, and all runs after [`History::sync_each_run`].
pub struct History {
    pub(crate) folder: Folder,
    /// The state that a reader shows. `None` for the owner, who sees each change.
    shown: Option<RwLock<Arc<FolderExtent>>>,
    /// The campaigns of a damaged history, as far as they are readable.
    salvaged: Option<BTreeMap<String, (Arc<CampaignState>, Arc<CampaignRuns>)>>,
    states: Mutex<HashMap<String, ([u64; 3], Arc<CampaignState>)>>,
    runs: Mutex<HashMap<String, (CampaignExtent, Arc<CampaignRuns>)>>,
    writers: Mutex<HashMap<String, Writers>>,
    /// The statements that queries have needed so far.
    pub(crate) view: Mutex<View>,
    /// Greatest number of threads that read runs for queries.
    threads: AtomicUsize,
    syncs: AtomicBool,
    pub(crate) restore: OnceLock<Box<Restore>>,
}

/// The segments of a campaign that this process writes.
#[derive(Default)]
struct Writers {
    runs: Option<SegmentWriter>,
    judgements: Option<JudgementWriter>,
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
        let folder = Folder::to_read(dir)?;
        let extent = Arc::new(folder.extent()?);
        let mut history = Self::with(folder);
        history.shown = Some(RwLock::new(extent));
        Ok(history)
    }

    fn owned(folder: Folder) -> Result<Self, Diagnostics> {
        // Links and special files are refused before anything is written.
        folder.extent()?;
        let history = Self::with(folder);
        // Damage is refused before anything is added.
        for campaign in history.extent()?.campaigns.keys() {
            history.state_of(campaign)?;
        }
        Ok(history)
    }

    fn with(folder: Folder) -> Self {
        Self {
            folder,
            shown: None,
            salvaged: None,
            states: Mutex::default(),
            runs: Mutex::default(),
            writers: Mutex::default(),
            view: Mutex::default(),
            threads: AtomicUsize::new(cores()),
            syncs: AtomicBool::new(false),
            restore: OnceLock::new(),
        }
    }

    /// A history of the campaigns that are readable in a damaged one.
    pub(crate) fn of_salvaged(
        folder: Folder,
        campaigns: BTreeMap<String, (Arc<CampaignState>, Arc<CampaignRuns>)>,
    ) -> Self {
        let mut history = Self::with(folder);
        history.shown = Some(RwLock::default());
        history.salvaged = Some(campaigns);
        history
    }

    /// Whether it shows the readable part of a damaged history.
    pub(crate) fn is_salvaged(&self) -> bool {
        self.salvaged.is_some()
    }

    /// Shows the present state of the history. Returns whether it has changed since the last one.
    /// Answers that are being read keep theirs. The owner's history is always up to date.
    ///
    /// # Errors
    /// As [`History::open_to_read`]; the earlier state is then kept.
    pub fn refresh(&self) -> Result<bool, Diagnostics> {
        let Some(shown) = self.shown.as_ref().filter(|_| self.salvaged.is_none()) else {
            return Ok(false);
        };
        let new = self.folder.extent()?;
        let mut shown = shown.write().unwrap_or_else(PoisonError::into_inner);
        let has_changed = **shown != new;
        if has_changed {
            *shown = Arc::new(new);
        }
        Ok(has_changed)
    }

    /// Whether the history has changed since the state that is shown, or can't be read any more.
    pub fn is_stale(&self) -> bool {
        self.shown.as_ref().is_some_and(|shown| {
            let shown = shown.read().unwrap_or_else(PoisonError::into_inner);
            self.salvaged.is_none() && self.folder.extent().is_ok_and(|new| **shown != new)
        })
    }

    /// Identifies the state of a reader's history: two that are equal have the same runs and
    /// judgements. `None` for the owner's, which changes.
    pub fn state(&self) -> Option<String> {
        let shown = self.shown.as_ref()?.read();
        Some(shown.unwrap_or_else(PoisonError::into_inner).digest())
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
        self.folder.dir()
    }

    /// Number of runs that are stored in a folder, which need not be a history.
    pub fn count_runs(dir: &Path) -> u64 {
        let counted = || -> Result<u64, Diagnostics> {
            let history = Self::open_to_read(dir)?;
            let mut count = 0;
            for id in history.campaign_ids()? {
                count += history.runs_of(&id)?.len() as u64;
            }
            Ok(count)
        };
        counted().unwrap_or_default()
    }
}

/// Reading campaigns.
impl History {
    /// The files that are shown.
    pub(crate) fn extent(&self) -> Result<Arc<FolderExtent>, Diagnostics> {
        match &self.shown {
            Some(shown) => Ok(Arc::clone(
                &shown.read().unwrap_or_else(PoisonError::into_inner),
            )),
            None => Ok(Arc::new(self.folder.extent()?)),
        }
    }

    fn campaign_extent(&self, id: &str) -> Result<Option<CampaignExtent>, Diagnostics> {
        match &self.shown {
            Some(_) => Ok(self.extent()?.campaigns.get(id).cloned()),
            None if names::is_id(id) => self.folder.campaign_extent(id),
            None => Ok(None),
        }
    }

    /// A campaign without its runs. Returns `None` if there is no such campaign.
    pub(crate) fn state_of(&self, id: &str) -> Result<Option<Arc<CampaignState>>, Diagnostics> {
        if let Some(salvaged) = &self.salvaged {
            return Ok(salvaged.get(id).map(|(state, _)| Arc::clone(state)));
        }
        let Some(extent) = self.campaign_extent(id)? else {
            return Ok(None);
        };
        let mut known = self.states.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, state)) = known.get(id)
            && *of == extent.state
        {
            return Ok(Some(Arc::clone(state)));
        }
        let folder = self.folder.campaign(id);
        let state = CampaignState::read(&self.folder.below(), &folder, id)
            .map_err(|fault| fault::segment(&self.folder, &folder.join("campaign"), &fault))?;
        let state = Arc::new(state);
        known.insert(id.to_owned(), (extent.state, Arc::clone(&state)));
        Ok(Some(state))
    }

    /// The runs of a campaign; of an unknown one, none.
    pub(crate) fn runs_of(&self, id: &str) -> Result<Arc<CampaignRuns>, Diagnostics> {
        if let Some(salvaged) = &self.salvaged {
            let found = salvaged.get(id).map(|(_, runs)| Arc::clone(runs));
            return Ok(found.unwrap_or_default());
        }
        let Some(extent) = self.campaign_extent(id)? else {
            return Ok(Arc::default());
        };
        let known = |runs: &HashMap<String, (CampaignExtent, Arc<CampaignRuns>)>| {
            let (of, runs) = runs.get(id)?;
            (*of == extent).then(|| Arc::clone(runs))
        };
        let lock = || self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runs) = known(&lock()) {
            return Ok(runs);
        }
        let runs = CampaignRuns::read(&self.folder, id, &extent)?;
        self.check_lengths(id, &runs)?;
        let runs = Arc::new(runs);
        lock().insert(id.to_owned(), (extent, Arc::clone(&runs)));
        Ok(runs)
    }

    /// Checks that the segments of a campaign are not shorter than its own file says.
    fn check_lengths(&self, id: &str, runs: &CampaignRuns) -> Result<(), Diagnostics> {
        let Some(state) = self.state_of(id)? else {
            return Ok(());
        };
        if runs.shortened(&state.segments).is_none() {
            return Ok(());
        }
        // The file may have been replaced since the state that is shown.
        let extent = self.folder.campaign_extent(id)?.unwrap_or_default();
        let present = CampaignRuns::read(&self.folder, id, &extent)?;
        match present.shortened(&state.segments) {
            Some(file) => Err(fault::shortened(&self.folder, &self.folder.campaign(id).join(file))),
            None => Ok(()),
        }
    }

    /// Ids of all campaigns, sorted as strings.
    pub(crate) fn campaign_ids(&self) -> Result<Vec<String>, Diagnostics> {
        match &self.salvaged {
            Some(salvaged) => Ok(salvaged.keys().cloned().collect()),
            None => Ok(self.extent()?.campaigns.keys().cloned().collect()),
        }
    }

    /// All campaigns, in the order in which they were added to the history: clocks may be wrong.
    pub(crate) fn campaign_states(&self) -> Result<Vec<Arc<CampaignState>>, Diagnostics> {
        let mut states = Vec::new();
        for id in self.campaign_ids()? {
            states.extend(self.state_of(&id)?);
        }
        states.sort_by(|a, b| {
            let key = |state: &CampaignState| {
                let record = &state.record;
                (state.number, record.started.clone(), record.id.clone())
            };
            key(a).cmp(&key(b))
        });
        Ok(states)
    }

    /// Returns all campaigns, in the order in which they were added to the history.
    ///
    /// # Errors
    /// A file is damaged or can't be read; `H026` an id is not an id.
    pub fn campaigns(&self) -> Result<Vec<CampaignRow>, Diagnostics> {
        let mut rows = Vec::new();
        for state in self.campaign_states()? {
            let runs = self.runs_of(&state.record.id)?.len() as u64;
            rows.push(CampaignRow::of(&state, runs));
        }
        Ok(rows)
    }

    /// Returns the record of a campaign.
    ///
    /// # Errors
    /// `H014` there is no such campaign.
    pub fn campaign(&self, id: &str) -> Result<CampaignRecord, Diagnostics> {
        if let Some(state) = self.state_of(id)? {
            return Ok(state.record.clone());
        }
        let known = self.campaign_ids()?;
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
        let states = self.campaign_states()?;
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
        let states = self.campaign_states()?;
        let ids = states.iter().map(|state| state.record.id.clone());
        Ok(ids.filter(|id| !selected.contains(id)).collect())
    }
}

/// Reading runs.
impl History {
    /// Calls `read` with a run, by its id. Returns `None` if there is no such run.
    pub(crate) fn with_run<T>(
        &self,
        id: &str,
        read: impl FnOnce(&str, RunAt<'_>) -> Result<T, Diagnostics>,
    ) -> Result<Option<T>, Diagnostics> {
        let Some((campaign, index)) = place_of(id) else {
            return Ok(None);
        };
        let runs = self.runs_of(campaign)?;
        runs.find(index).map(|run| read(campaign, run)).transpose()
    }

    /// Returns the runs that match a filter, sorted by the start of their campaign, then by index.
    /// An unknown campaign has no runs.
    ///
    /// # Errors
    /// A file is damaged or can't be read; `H026` an id is not an id.
    pub fn runs(&self, filter: &RunFilter) -> Result<Vec<RunRow>, Diagnostics> {
        let mut runs = Vec::new();
        let wish = Wish {
            judgements: Judgements::None,
            ..Wish::default()
        };
        self.each_judged(filter, wish, &mut |run| runs.push(run.row))?;
        Ok(runs)
    }

    /// Returns the campaigns of [`History::unselected_campaigns`], each with its run ids, sorted as
    /// strings.
    ///
    /// # Errors
    /// A file is damaged or can't be read; `H026` an id is not an id.
    pub fn run_ids(&self) -> Result<Vec<(String, Vec<String>)>, Diagnostics> {
        let mut found = Vec::new();
        for id in self.unselected_campaigns()? {
            let runs = self.runs_of(&id)?;
            let ids = runs.iter().map(|run| run_id(&id, run.row.index));
            let mut ids: Vec<String> = ids.collect();
            ids.sort();
            found.push((id, ids));
        }
        Ok(found)
    }

    /// Returns the outcomes of the runs that match a filter, in the order of [`History::runs`],
    /// then by step and property.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn outcomes(&self, filter: &RunFilter) -> Result<Vec<OutcomeRow>, Diagnostics> {
        let mut outcomes = Vec::new();
        self.each_judged(filter, Wish::default(), &mut |run| {
            outcomes.extend(run.outcome_rows())
        })?;
        Ok(outcomes)
    }

    /// Returns all details of a run, named as in [`History::resolve`].
    ///
    /// # Errors
    /// `H008` there is no such run.
    pub fn run(&self, name: &str) -> Result<RunDetail, Diagnostics> {
        let id = self.resolve(name)?;
        let detail = self.with_run(&id, |campaign, run| {
            let stored = run.segment.run(run.row);
            let details = SegmentColumn::Details;
            let stored =
                stored.map_err(|fault| fault::run(&self.folder, &id, run, details, &fault))?;
            Ok(stored.detail(campaign))
        })?;
        detail.ok_or_else(|| fault::no_run(self.dir(), &id))
    }

    pub(crate) fn has_run(&self, id: &str) -> Result<bool, Diagnostics> {
        Ok(self.with_run(id, |_, _| Ok(()))?.is_some())
    }

    /// Whether a run is kept whole, by its id.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn is_whole(&self, id: &str) -> Result<bool, Diagnostics> {
        let is_whole = self.with_run(id, |_, run| Ok(run.row.is_whole()))?;
        Ok(is_whole.unwrap_or_default())
    }

    /// Ids of all runs, sorted as strings.
    pub(crate) fn all_run_ids(&self) -> Result<Vec<String>, Diagnostics> {
        let mut ids = Vec::new();
        for campaign in self.campaign_ids()? {
            let runs = self.runs_of(&campaign)?;
            ids.extend(runs.iter().map(|run| run_id(&campaign, run.row.index)));
        }
        ids.sort();
        Ok(ids)
    }

    /// Answers a SPARQL query. The prefixes of [`actcheck_base::names::PREFIXES`] need no
    /// declaration.
    ///
    /// The default graph holds campaigns, runs, executions, scenes and outcomes; facts are in the
    /// graphs that `act:before`, `act:after` and `act:during` name.
    ///
    /// # Errors
    /// `H010` the text is not a query, `H011` it is an update, `H012` the evaluation failed, `H030`
    /// it needs too many statements.
    pub fn query(&self, sparql: &str) -> Result<QueryAnswer, Diagnostics> {
        self.query_from(&Source::new("query", sparql), &Cancel::new())
    }

    /// Like [`History::query`], for a source text with a name, and with a handle that stops the
    /// query.
    ///
    /// # Errors
    /// As [`History::query`]; `H013` the query was stopped.
    pub fn query_from(&self, text: &Source, cancel: &Cancel) -> Result<QueryAnswer, Diagnostics> {
        query::answer(self, text, cancel)
    }
}

/// Writing.
impl History {
    /// Makes each stored run survive a power cut, which costs a sync of the disk for each.
    pub fn sync_each_run(&self) {
        self.syncs.store(true, Ordering::Relaxed);
    }

    /// Returns an id for a new campaign: short, unique in this history, and the same for the same
    /// history, configuration and seed.
    ///
    /// # Errors
    /// The folder can't be read.
    pub fn next_campaign_id(&self, config_digest: &str, seed: u64) -> Result<String, Diagnostics> {
        let known: BTreeSet<String> = self.campaign_ids()?.into_iter().collect();
        let first = known.len() as u64;
        let free = (first..)
            .map(|counter| campaign_id(config_digest, seed, counter))
            .find(|id| !known.contains(id));
        // There are nearly a million short ids; when all are used, a long one follows.
        Ok(free.unwrap_or_else(|| config_digest.to_owned()))
    }

    /// Writes a campaign before its first run.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H026` its id is not an id.
    pub fn begin_campaign(&self, record: &CampaignRecord) -> Result<(), Diagnostics> {
        let number = self.campaign_ids()?.len() as u64;
        self.write_state(&CampaignState {
            record: record.clone(),
            number,
            first_id: None,
            end: None,
            segments: BTreeMap::new(),
        })
    }

    /// Removes the end of a campaign that is resumed, and what a killed process left of a run.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H014` there is no such campaign.
    pub fn reopen_campaign(&self, id: &str) -> Result<(), Diagnostics> {
        self.remove_torn_tails(id)?;
        self.change_state(id, |state| state.end = None)
    }

    /// Writes the end of a campaign, and flushes everything to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`; `H014` there is no such campaign.
    pub fn finish_campaign(&self, id: &str, end: &CampaignEnd) -> Result<(), Diagnostics> {
        self.close_writers(id)?;
        self.change_state(id, |state| state.end = Some(end.clone()))
    }

    /// Writes the file of a campaign itself, and creates its folder if it is missing.
    pub(crate) fn write_state(&self, state: &CampaignState) -> Result<(), Diagnostics> {
        let id = &state.record.id;
        if !names::is_id(id) {
            return Err(fault::foreign_id(self.dir(), "campaign", id));
        }
        let (below, folder) = (self.folder.below(), self.folder.campaign(id));
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
        let Some(known) = self.state_of(id)? else {
            return self.campaign(id).map(drop);
        };
        let mut state = (*known).clone();
        state.segments = self.runs_of(id)?.lengths();
        change(&mut state);
        self.write_state(&state)
    }

    /// Cuts the segments of a campaign, which no other process writes, after their last whole runs.
    fn remove_torn_tails(&self, id: &str) -> Result<(), Diagnostics> {
        let below = self.folder.below();
        below.remove_leftovers(&self.folder.campaign(id));
        for file in &self.runs_of(id)?.torn {
            let cut = || -> std::io::Result<()> {
                let length = whole_length(&below, file)?;
                below.append(file)?.set_len(length)
            };
            cut().map_err(|error| fault::io(self.dir(), "reopening the campaign", &error))?;
        }
        Ok(())
    }

    /// Calls `write` with the segment of a campaign that this process writes.
    pub(crate) fn with_segment<T>(
        &self,
        campaign: &str,
        doing: &str,
        write: impl FnOnce(&mut SegmentWriter) -> std::io::Result<T>,
    ) -> Result<T, Diagnostics> {
        let mut writers = self.writers();
        let known = writers.entry(campaign.to_owned()).or_default();
        let segment = match &mut known.runs {
            Some(segment) => segment,
            none => none.insert(
                SegmentWriter::create(
                    &self.folder.below(),
                    &self.folder.campaign(campaign),
                    self.next_segment(campaign)?,
                )
                .map_err(|error| fault::io(self.dir(), doing, &error))?,
            ),
        };
        let written = write(segment).and_then(|value| {
            if self.syncs.load(Ordering::Relaxed) {
                segment.sync()?;
            }
            Ok(value)
        });
        written.map_err(|error| fault::io(self.dir(), doing, &error))
    }

    /// Calls `write` with the judgements of a campaign that this process writes.
    pub(crate) fn with_judgements(
        &self,
        campaign: &str,
        write: impl FnOnce(&mut JudgementWriter) -> std::io::Result<()>,
    ) -> Result<(), Diagnostics> {
        let doing = "writing outcomes";
        let mut writers = self.writers();
        let known = writers.entry(campaign.to_owned()).or_default();
        let column = match &mut known.judgements {
            Some(column) => column,
            none => none.insert(
                JudgementWriter::create(
                    &self.folder.below(),
                    &self.folder.campaign(campaign),
                    self.next_segment(campaign)?,
                )
                .map_err(|error| fault::io(self.dir(), doing, &error))?,
            ),
        };
        write(column).map_err(|error| fault::io(self.dir(), doing, &error))
    }

    /// The number of the next segment of a campaign.
    pub(crate) fn next_segment(&self, campaign: &str) -> Result<u32, Diagnostics> {
        let extent = self.folder.campaign_extent(campaign)?.unwrap_or_default();
        Ok(extent.segments.keys().last().map_or(1, |last| last + 1))
    }

    /// Flushes all committed data to the disk.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn flush(&self) -> Result<(), Diagnostics> {
        self.writers()
            .values()
            .try_for_each(Writers::sync)
            .map_err(|error| fault::io(self.dir(), "writing to the disk", &error))
    }

    /// Ends the segments of a campaign that this process writes, after flushing them.
    pub(crate) fn close_writers(&self, campaign: &str) -> Result<(), Diagnostics> {
        let Some(writers) = self.writers().remove(campaign) else {
            return Ok(());
        };
        let folder = self.folder.campaign(campaign);
        writers
            .sync()
            .and_then(|()| self.folder.below().sync_folder(&folder))
            .map_err(|error| fault::io(self.dir(), "writing to the disk", &error))
    }

    /// The campaigns to which this process has added judgements.
    pub(crate) fn judged_campaigns(&self) -> Vec<String> {
        let writers = self.writers();
        let judged = writers.iter().filter(|(_, own)| own.judgements.is_some());
        judged.map(|(campaign, _)| campaign.clone()).collect()
    }

    fn writers(&self) -> MutexGuard<'_, HashMap<String, Writers>> {
        self.writers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Writers {
    fn sync(&self) -> std::io::Result<()> {
        self.runs.as_ref().map_or(Ok(()), SegmentWriter::sync)?;
        self.judgements
            .as_ref()
            .map_or(Ok(()), JudgementWriter::sync)
    }
}

/// The id of a run from its campaign and its index.
pub(crate) fn run_id(campaign: &str, index: u64) -> String {
    format!("{campaign}-{}", index + 1)
}

/// The campaign and the index of a run, from its id.
pub(crate) fn place_of(run: &str) -> Option<(&str, u64)> {
    let (campaign, number) = run.rsplit_once('-')?;
    let index = number.parse::<u64>().ok()?.checked_sub(1)?;
    // Only the number as this program writes it.
    (run == run_id(campaign, index)).then_some((campaign, index))
}

/// Computes a campaign's id: a letter and three letters or digits, without characters that look
/// alike.
pub(crate) fn campaign_id(config_digest: &str, seed: u64, counter: u64) -> String {
    const LETTERS: &[u8] = b"abcdefghjkmnpqrstvwxyz";
    const ALL: &[u8] = b"abcdefghjkmnpqrstvwxyz23456789";
    let mut digest = Digest::new();
    digest.update(config_digest.as_bytes());
    digest.update(&seed.to_le_bytes());
    digest.update(&counter.to_le_bytes());
    let bytes = digest.finish().into_bytes();
    let number = |at: usize| {
        bytes[at..at + 4]
            .iter()
            .fold(0usize, |sum, byte| sum * 256 + usize::from(*byte))
    };
    [(LETTERS, 0), (ALL, 4), (ALL, 8), (ALL, 12)]
        .map(|(set, at)| char::from(set[number(at) % set.len()]))
        .iter()
        .collect()
}
