//! Judgements made after the run, beside the campaign's own.
//!
//! The campaign's own outcomes never change, so that queries over them get each outcome once. A
//! later judgement is written only if it differs from the newest one, which it supersedes.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, PoisonError, RwLock};

use crate::campaign::CampaignRuns;
use crate::ids::place_of;
use crate::judged::newest;
use crate::segment::{LaterJudgement, SegmentColumn};
use crate::{History, RunDetail, fault};
use actcheck_base::{Diagnostics, Judgement};
use actcheck_verdict::{action_score, run_score};

/// A judgement in the history.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredJudgement {
    /// The judgement.
    pub judgement: Judgement,
}

/// One property in one action of a stored run, judged again.
#[derive(Debug, Clone, PartialEq)]
pub struct Recheck {
    /// Id of the run.
    pub run: String,
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// The newest judgement in the history; `None` if the property was never judged there.
    pub before: Option<StoredJudgement>,
    /// The judgement by the current rules.
    pub now: Judgement,
}

/// Reader of the newest judgements of many runs, each of which it reads before its new judgements
/// are written.
///
/// Judgements that the owner stores after the first reading of a campaign are not read.
pub struct NewestJudgements<'h> {
    history: &'h History,
    known: RwLock<HashMap<String, Arc<CampaignRuns>>>,
}

impl<'h> NewestJudgements<'h> {
    /// A reader that knows nothing yet.
    pub fn of(history: &'h History) -> Self {
        Self {
            history,
            known: RwLock::default(),
        }
    }

    /// Returns the newest judgements of properties (IRIs) in one action of a run, sorted by
    /// property. `step` counts from 1.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn read(
        &self,
        run: &str,
        step: u32,
        properties: &[String],
    ) -> Result<Vec<StoredJudgement>, Diagnostics> {
        let Some((campaign, index)) = place_of(run) else {
            return Ok(Vec::new());
        };
        let known = self.campaign(campaign)?;
        let Some(at) = known.find(index) else {
            return Ok(Vec::new());
        };
        let mut newest: BTreeMap<&str, Judgement> = BTreeMap::new();
        // A row says which properties were judged; reading the judgements themselves takes longer.
        let is_judged = at.row.outcomes.iter().any(|own| {
            own.action + 1 == step && {
                let property = at.segment.text(own.property);
                properties.iter().any(|wanted| **wanted == *property)
            }
        });
        if is_judged {
            let stored = at.segment.run(at.row).map_err(|why| {
                fault::run(
                    self.history.dir(),
                    run,
                    &at.segment.file(SegmentColumn::Details),
                    &why,
                )
            })?;
            let action = stored.actions.into_iter().nth(step as usize - 1);
            for judgement in action.into_iter().flat_map(|action| action.judgements) {
                if let Some(property) = properties.iter().find(|own| **own == judgement.property) {
                    newest.insert(property, judgement);
                }
            }
        }
        for later in known.later_of(index) {
            let property = properties
                .iter()
                .find(|own| later.step == step && **own == later.judgement.property);
            if let Some(property) = property {
                newest.insert(property, later.judgement.clone());
            }
        }
        let stored = newest.into_values();
        Ok(stored
            .map(|judgement| StoredJudgement { judgement })
            .collect())
    }

    fn campaign(&self, id: &str) -> Result<Arc<CampaignRuns>, Diagnostics> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = known.get(id) {
            return Ok(Arc::clone(known));
        }
        drop(known);
        let runs = self.history.stored.runs_of(id)?;
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        Ok(Arc::clone(known.entry(id.to_owned()).or_insert(runs)))
    }
}

impl Recheck {
    /// Whether it differs from the newest judgement in the history.
    pub fn is_news(&self) -> bool {
        !self
            .before
            .as_ref()
            .is_some_and(|before| before.judgement.same_as(&self.now))
    }
}

impl History {
    /// Returns all details of a run as [`History::run`] does, with its newest judgements: later
    /// ones replace those of the campaign, and properties that were judged only later are added.
    /// Scores follow from these judgements.
    ///
    /// # Errors
    /// As [`History::run`].
    pub fn newest_run(&self, name: &str) -> Result<RunDetail, Diagnostics> {
        let mut run = self.run(name)?;
        let runs = self.stored.runs_of(&run.row.campaign)?;
        let later = newest(runs.later_of(run.row.index));
        if later.is_empty() {
            return Ok(run);
        }
        for action in &mut run.actions {
            let later: Vec<&Judgement> = later
                .iter()
                .filter(|later| later.step == action.step)
                .map(|later| &later.judgement)
                .collect();
            if later.is_empty() {
                continue;
            }
            let is_older =
                |own: &Judgement| later.iter().any(|later| later.property == own.property);
            action.judgements.retain(|own| !is_older(own));
            action.judgements.extend(later.into_iter().cloned());
            action
                .judgements
                .sort_by(|a, b| a.property.cmp(&b.property));
            action.score =
                action_score(action.judgements.iter().map(|judgement| judgement.outcome));
        }
        let scores: Vec<f64> = run.actions.iter().map(|action| action.score).collect();
        run.row.score = run_score(&scores);
        Ok(run)
    }

    /// Returns the number of judgements made after the runs of each campaign, by its id. A campaign
    /// without any is left out. As judgements are only ever added, an equal number means equal
    /// judgements.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn later_counts(&self) -> Result<BTreeMap<String, u64>, Diagnostics> {
        let mut counts = BTreeMap::new();
        for id in self.stored.ids()? {
            let count = self.stored.runs_of(&id)?.later.len() as u64;
            if count > 0 {
                counts.insert(id, count);
            }
        }
        Ok(counts)
    }

    /// Stores the new judgements: of each campaign all of them or none. `at` is RFC 3339.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`. Data stored before is complete.
    pub fn commit_rechecks(&self, rechecks: &[Recheck], at: &str) -> Result<(), Diagnostics> {
        let mut of_campaigns: BTreeMap<&str, Vec<LaterJudgement>> = BTreeMap::new();
        for recheck in rechecks.iter().filter(|recheck| recheck.is_news()) {
            let Some((campaign, index)) = place_of(&recheck.run) else {
                continue;
            };
            of_campaigns
                .entry(campaign)
                .or_default()
                .push(LaterJudgement {
                    index,
                    step: recheck.step,
                    at: at.to_owned(),
                    judgement: recheck.now.clone(),
                });
        }
        of_campaigns
            .into_iter()
            .try_for_each(|(campaign, judgements)| {
                let folder = &self.stored.folder;
                self.segments
                    .with_judgements(folder, campaign, |column| column.append(&judgements))
            })
    }

    /// Flushes the judgements since the last call to the disk, and records their number.
    ///
    /// # Errors
    /// Writing failed: `H005`, `H006`.
    pub fn finish_rechecks(&self) -> Result<(), Diagnostics> {
        for campaign in self.segments.judged_campaigns() {
            self.segments.close(&self.stored.folder, &campaign)?;
            self.change_state(&campaign, |_| ())?;
        }
        Ok(())
    }
}
