//! The campaigns of a history as they are stored: which there are, and those that were read.

use std::collections::{BTreeMap, HashMap};
use std::io;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use crate::campaign::{CampaignRuns, RunAt};
use crate::campaign_state::CampaignState;
use crate::fault;
use crate::folder::{CampaignExtent, Folder, FolderExtent};
use crate::ids::{place_of, run_id};
use crate::segment::whole_length;
use actcheck_base::{Diagnostics, names};

/// The readable campaigns of a damaged history, by id.
pub(crate) type Salvaged = BTreeMap<String, (Arc<CampaignState>, Arc<CampaignRuns>)>;
/// A value of each campaign that was read, with the files that it was read from.
type Known<F, T> = Mutex<HashMap<String, (F, Arc<T>)>>;

/// The stored campaigns.
pub(crate) struct StoredCampaigns {
    pub folder: Folder,
    /// The state that a reader shows. `None` for the owner, who sees each change.
    shown: Option<RwLock<Arc<FolderExtent>>>,
    /// The campaigns of a damaged history, as far as they are readable.
    salvaged: Option<Salvaged>,
    known_states: Known<[u64; 3], CampaignState>,
    known_runs: Known<CampaignExtent, CampaignRuns>,
}

impl StoredCampaigns {
    /// The campaigns of a history that this process owns.
    ///
    /// # Errors
    /// `H007` a campaign is damaged: nothing is added to such a history.
    pub(crate) fn own(folder: Folder) -> Result<Self, Diagnostics> {
        let campaigns = Self::with(folder, None, None);
        for id in campaigns.ids()? {
            campaigns.state_of(&id)?;
        }
        Ok(campaigns)
    }

    /// The present campaigns of a history that this process reads.
    ///
    /// # Errors
    /// A folder can't be read.
    pub(crate) fn to_read(folder: Folder) -> Result<Self, Diagnostics> {
        let extent = Arc::new(folder.extent()?);
        Ok(Self::with(folder, Some(RwLock::new(extent)), None))
    }

    /// The readable campaigns of a damaged history.
    pub(crate) fn of_salvaged(folder: Folder, salvaged: Salvaged) -> Self {
        Self::with(folder, Some(RwLock::default()), Some(salvaged))
    }

    fn with(
        folder: Folder,
        shown: Option<RwLock<Arc<FolderExtent>>>,
        salvaged: Option<Salvaged>,
    ) -> Self {
        Self {
            folder,
            shown,
            salvaged,
            known_states: Mutex::default(),
            known_runs: Mutex::default(),
        }
    }

    /// Whether these are the readable campaigns of a damaged history.
    pub(crate) fn is_salvaged(&self) -> bool {
        self.salvaged.is_some()
    }

    /// Shows the present state to a reader. Returns whether it has changed since the last one.
    ///
    /// # Errors
    /// A folder can't be read; the earlier state is then kept.
    pub(crate) fn refresh(&self) -> Result<bool, Diagnostics> {
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

    /// Whether the history has changed since the state that a reader shows.
    pub(crate) fn is_stale(&self) -> bool {
        self.shown.as_ref().is_some_and(|shown| {
            let shown = shown.read().unwrap_or_else(PoisonError::into_inner);
            self.salvaged.is_none() && self.folder.extent().is_ok_and(|new| **shown != new)
        })
    }

    /// Identifies the state that a reader shows. `None` for the owner's, which changes.
    pub(crate) fn digest(&self) -> Option<String> {
        let shown = self.shown.as_ref()?.read();
        Some(shown.unwrap_or_else(PoisonError::into_inner).digest())
    }

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

    /// A campaign without its runs. Returns `None` if the history has none with this id.
    pub(crate) fn state_of(&self, id: &str) -> Result<Option<Arc<CampaignState>>, Diagnostics> {
        if let Some(salvaged) = &self.salvaged {
            return Ok(salvaged.get(id).map(|(state, _)| Arc::clone(state)));
        }
        let Some(extent) = self.campaign_extent(id)? else {
            return Ok(None);
        };
        let mut known = self
            .known_states
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some((of, state)) = known.get(id)
            && *of == extent.state
        {
            return Ok(Some(Arc::clone(state)));
        }
        let folder = self.folder.campaign(id);
        let state = CampaignState::read(&self.folder.below(), &folder, id)
            .map_err(|fault| fault::segment(self.folder.dir(), &folder.join("campaign"), &fault))?;
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
        let lock = || {
            self.known_runs
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        };
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
            Some(file) => Err(fault::shortened(
                self.folder.dir(),
                &self.folder.campaign(id).join(file),
            )),
            None => Ok(()),
        }
    }

    /// Ids of all campaigns, sorted as strings.
    pub(crate) fn ids(&self) -> Result<Vec<String>, Diagnostics> {
        match &self.salvaged {
            Some(salvaged) => Ok(salvaged.keys().cloned().collect()),
            None => Ok(self.extent()?.campaigns.keys().cloned().collect()),
        }
    }

    /// All campaigns, in the order in which they were added to the history: clocks may be wrong.
    pub(crate) fn states(&self) -> Result<Vec<Arc<CampaignState>>, Diagnostics> {
        let mut states = Vec::new();
        for id in self.ids()? {
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

    /// Calls `read` with a run, by its id. Returns `None` if the history has none with
    /// this id.
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

    /// Ids of all runs, sorted as strings.
    pub(crate) fn run_ids(&self) -> Result<Vec<String>, Diagnostics> {
        let mut ids = Vec::new();
        for campaign in self.ids()? {
            let runs = self.runs_of(&campaign)?;
            ids.extend(runs.iter().map(|run| run_id(&campaign, run.row.index)));
        }
        ids.sort();
        Ok(ids)
    }

    /// Cuts the segments of a campaign, which no other process writes, after their last whole runs.
    pub(crate) fn remove_torn_tails(&self, id: &str) -> Result<(), Diagnostics> {
        let below = self.folder.below();
        below.remove_leftovers(&self.folder.campaign(id));
        for file in &self.runs_of(id)?.torn {
            let cut = || -> io::Result<()> {
                let length = whole_length(&below, file)?;
                below.append(file)?.set_len(length)
            };
            cut()
                .map_err(|error| fault::io(self.folder.dir(), "reopening the campaign", &error))?;
        }
        Ok(())
    }
}
