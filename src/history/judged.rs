//! Runs with their outcomes, one after the other.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

use crate::campaign::RunAt;
use crate::segment::LaterJudgement;
use crate::{History, OutcomeRow, RunFilter, RunRow, SceneDigest};
use actcheck_base::{Diagnostics, Outcome};

/// The judgements of runs that a reader needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Judgements {
    /// None: the runs alone.
    None,
    /// Those of the campaign itself.
    #[default]
    Campaign,
    /// Later ones where they exist, otherwise those of the campaign.
    Newest,
}

/// An outcome of a run. Within one reading, equal texts are the same allocation.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedOutcome {
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: Arc<str>,
    /// IRI of the property.
    pub property: Arc<str>,
    /// The outcome.
    pub outcome: Outcome,
    /// How far the outcome was from flipping, in the property's unit.
    pub margin: Option<f64>,
}

/// A run with its outcomes.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedRun {
    /// The run as in a list.
    pub row: RunRow,
    /// Its scene, if the reader needs it.
    pub scene: Option<SceneDigest>,
    /// Its outcomes, sorted by step and property.
    pub outcomes: Vec<JudgedOutcome>,
}

/// Digests of the rules of later judgements, by the IRI of the property.
pub type LaterRules = BTreeMap<String, BTreeSet<String>>;

/// The data that a reader of runs needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wish {
    /// The judgements of the runs.
    pub judgements: Judgements,
    /// Whether it needs the scenes.
    pub scenes: bool,
}

impl JudgedRun {
    /// Its outcomes as rows of a list.
    pub fn outcome_rows(&self) -> impl Iterator<Item = OutcomeRow> {
        self.outcomes.iter().map(|own| OutcomeRow {
            run: self.row.run.clone(),
            campaign: self.row.campaign.clone(),
            index: self.row.index,
            test: self.row.test.clone(),
            step: own.step,
            action: own.action.to_string(),
            property: own.property.to_string(),
            outcome: own.outcome,
            margin: own.margin,
        })
    }
}

impl History {
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

    /// Returns the scenes of runs by run id.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn scenes(&self, runs: &[RunRow]) -> Result<BTreeMap<String, SceneDigest>, Diagnostics> {
        let mut scenes = BTreeMap::new();
        for row in runs {
            let of_campaign = self.stored.runs_of(&row.campaign)?;
            if let Some(run) = of_campaign.find(row.index) {
                scenes.insert(row.run.clone(), run.row.scene());
            }
        }
        Ok(scenes)
    }

    /// Calls `each` with the runs that match a filter, in the order of their campaigns, then by
    /// index. Returns the digests of the rules of later judgements.
    ///
    /// # Errors
    /// `H007` a file is damaged; `H026` an id is not an id.
    pub fn each_judged(
        &self,
        filter: &RunFilter,
        wish: Wish,
        each: &mut dyn FnMut(JudgedRun),
    ) -> Result<LaterRules, Diagnostics> {
        let ids: Vec<String> = match &filter.campaign {
            Some(id) => vec![id.clone()],
            None => {
                let states = self.stored.states()?;
                states.iter().map(|state| state.record.id.clone()).collect()
            }
        };
        let mut reading = Reading {
            wish,
            texts: HashSet::new(),
            rules: LaterRules::new(),
        };
        for id in ids {
            let runs = self.stored.runs_of(&id)?;
            for run in runs.iter().filter(|run| run.matches(filter)) {
                let later = match wish.judgements {
                    Judgements::Newest => newest(runs.later_of(run.row.index)),
                    Judgements::None | Judgements::Campaign => Vec::new(),
                };
                each(reading.run(&id, run, &later));
            }
        }
        Ok(reading.rules)
    }
}

/// The last judgement of each property and action, which supersedes the others.
pub(crate) fn newest(mut later: Vec<&LaterJudgement>) -> Vec<&LaterJudgement> {
    let mut seen = HashSet::new();
    later.reverse();
    later.retain(|later| seen.insert((later.step, later.judgement.property.as_str())));
    later.reverse();
    later
}

/// The state of one reading.
struct Reading {
    wish: Wish,
    texts: HashSet<Arc<str>>,
    rules: LaterRules,
}

impl Reading {
    fn text(&mut self, text: &str) -> Arc<str> {
        if let Some(known) = self.texts.get(text) {
            return Arc::clone(known);
        }
        let new: Arc<str> = Arc::from(text);
        self.texts.insert(Arc::clone(&new));
        new
    }

    fn run(&mut self, campaign: &str, run: RunAt<'_>, later: &[&LaterJudgement]) -> JudgedRun {
        let mut outcomes = Vec::new();
        if self.wish.judgements != Judgements::None {
            for own in &run.row.outcomes {
                let action = self.action(run, own.action);
                outcomes.push(JudgedOutcome {
                    step: own.action + 1,
                    action,
                    property: self.text(&run.segment.text(own.property)),
                    outcome: own.outcome,
                    margin: own.margin,
                });
            }
            for later in later {
                self.add_later(run, later, &mut outcomes);
            }
            outcomes.sort_by(|a, b| (a.step, &a.property).cmp(&(b.step, &b.property)));
        }
        JudgedRun {
            row: run.as_run(campaign),
            scene: self.wish.scenes.then(|| run.row.scene()),
            outcomes,
        }
    }

    /// The IRI of an action by its position, from 0; empty if the run broke before it was known.
    fn action(&mut self, run: RunAt<'_>, position: u32) -> Arc<str> {
        let number = run.row.actions.get(position as usize).copied().flatten();
        let text = number.map(|number| run.segment.text(number));
        self.text(text.as_deref().unwrap_or_default())
    }

    /// Replaces an outcome by a later one, or adds it.
    fn add_later(
        &mut self,
        run: RunAt<'_>,
        later: &LaterJudgement,
        outcomes: &mut Vec<JudgedOutcome>,
    ) {
        let judgement = &later.judgement;
        self.rules
            .entry(judgement.property.clone())
            .or_default()
            .insert(judgement.rule_digest.clone());
        let new = JudgedOutcome {
            step: later.step,
            action: self.action(run, later.step.saturating_sub(1)),
            property: self.text(&judgement.property),
            outcome: judgement.outcome,
            margin: judgement.margin,
        };
        match outcomes
            .iter_mut()
            .find(|own| own.step == new.step && own.property == new.property)
        {
            Some(own) => *own = new,
            None => outcomes.push(new),
        }
    }
}
