//! Runs with their outcomes, one after the other: the lists of a history with a million runs don't
//! fit in memory.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use crate::lists::{self, LaterOutcome};
use crate::outlines::Outlined;
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
    /// Calls `each` with the runs that match a filter, sorted by the start of their campaign, then
    /// by index. Outlines are read a few at a time. Returns the digests of the rules of later
    /// judgements.
    ///
    /// # Errors
    /// The store can't be read; `H007` a file is damaged; `H026` an id is not an id.
    pub fn each_judged(
        &self,
        filter: &RunFilter,
        wish: Wish,
        each: &mut dyn FnMut(JudgedRun),
    ) -> Result<LaterRules, Diagnostics> {
        let mut reading = Reading::begin(self, filter, wish)?;
        let store = self.store_with(lists::of_runs)?;
        let whole = lists::runs(&store, filter, self.threads())
            .map_err(|error| self.query_fault(&error))?;
        self.check_ids(
            "run",
            whole.iter().flat_map(|run| [&run.run, &run.campaign]),
        )?;
        let mut order = lists::campaign_ids(&store).map_err(|error| self.query_fault(&error))?;
        order.retain(|id| {
            filter
                .campaign
                .as_ref()
                .is_none_or(|campaign| campaign == id)
        });
        self.check_ids("campaign", &order)?;
        let known: HashSet<String> = order.iter().cloned().collect();
        let scenes = if wish.scenes {
            self.whole_scenes(&whole)?
        } else {
            BTreeMap::new()
        };
        let mut of_campaign: HashMap<String, Vec<RunRow>> = HashMap::new();
        for row in whole {
            // A campaign without a start has no place in the order.
            if known.contains(&row.campaign) {
                of_campaign
                    .entry(row.campaign.clone())
                    .or_default()
                    .push(row);
            } else {
                each(reading.whole(row, &scenes)?);
            }
        }
        let mut fault = Ok(());
        for campaign in &order {
            let mut whole = of_campaign
                .remove(campaign)
                .unwrap_or_default()
                .into_iter()
                .peekable();
            let of_campaign = RunFilter {
                campaign: Some(campaign.clone()),
                ..filter.clone()
            };
            self.each_outlined(&of_campaign, &mut |outlined| {
                let mut pass = || -> Result<(), Diagnostics> {
                    while let Some(row) = whole.next_if(|row| row.index <= outlined.row.index) {
                        each(reading.whole(row, &scenes)?);
                    }
                    each(reading.outlined(&outlined)?);
                    Ok(())
                };
                if fault.is_ok() {
                    fault = pass();
                }
            })?;
            fault?;
            fault = Ok(());
            for row in whole {
                each(reading.whole(row, &scenes)?);
            }
        }
        Ok(reading.rules)
    }
}

/// The state of one reading.
struct Reading<'h> {
    history: &'h History,
    wish: Wish,
    texts: HashSet<Arc<str>>,
    /// Outcomes of runs that are kept whole, by run.
    whole: HashMap<String, Vec<OutcomeRow>>,
    /// Later judgements by run.
    later: HashMap<String, Vec<LaterOutcome>>,
    rules: LaterRules,
}

impl<'h> Reading<'h> {
    fn begin(history: &'h History, filter: &RunFilter, wish: Wish) -> Result<Self, Diagnostics> {
        let mut whole: HashMap<String, Vec<OutcomeRow>> = HashMap::new();
        let mut later: HashMap<String, Vec<LaterOutcome>> = HashMap::new();
        if wish.judgements != Judgements::None {
            let store = history.store_with(lists::of_outcomes)?;
            for row in
                lists::outcomes(&store, filter).map_err(|error| history.query_fault(&error))?
            {
                whole.entry(row.run.clone()).or_default().push(row);
            }
        }
        if wish.judgements == Judgements::Newest {
            let store = history.store_with(lists::of_rechecked)?;
            for outcome in lists::rechecked(&store).map_err(|error| history.query_fault(&error))? {
                later.entry(outcome.run.clone()).or_default().push(outcome);
            }
        }
        Ok(Self {
            history,
            wish,
            texts: HashSet::new(),
            whole,
            later,
            rules: LaterRules::new(),
        })
    }

    fn text(&mut self, text: &str) -> Arc<str> {
        if let Some(known) = self.texts.get(text) {
            return Arc::clone(known);
        }
        let new: Arc<str> = Arc::from(text);
        self.texts.insert(Arc::clone(&new));
        new
    }

    fn whole(
        &mut self,
        row: RunRow,
        scenes: &BTreeMap<String, SceneDigest>,
    ) -> Result<JudgedRun, Diagnostics> {
        let own = self.whole.remove(&row.run).unwrap_or_default();
        let outcomes = own.into_iter().map(|own| JudgedOutcome {
            step: own.step,
            action: self.text(&own.action),
            property: self.text(&own.property),
            outcome: own.outcome,
            margin: own.margin,
        });
        let mut outcomes: Vec<JudgedOutcome> = outcomes.collect();
        let scene = scenes.get(&row.run).cloned();
        self.add_later(&row.run, &mut outcomes)?;
        Ok(JudgedRun {
            row,
            scene,
            outcomes,
        })
    }

    fn outlined(&mut self, outlined: &Outlined<'_>) -> Result<JudgedRun, Diagnostics> {
        let row = outlined.as_run();
        let mut outcomes = Vec::new();
        if self.wish.judgements != Judgements::None {
            for (step, [action, property], outcome, margin) in outlined.outcomes() {
                let (action, property) = (self.text(action), self.text(property));
                outcomes.push(JudgedOutcome {
                    step,
                    action,
                    property,
                    outcome,
                    margin,
                });
            }
            sort(&mut outcomes);
            self.add_later(&row.run, &mut outcomes)?;
        }
        let scene = self.wish.scenes.then(|| outlined.row.scene.clone());
        Ok(JudgedRun {
            row,
            scene,
            outcomes,
        })
    }

    /// Replaces outcomes by later ones.
    fn add_later(
        &mut self,
        run: &str,
        outcomes: &mut Vec<JudgedOutcome>,
    ) -> Result<(), Diagnostics> {
        let Some(later) = self.later.remove(run) else {
            return Ok(());
        };
        for later in later {
            let of_step = outcomes
                .iter()
                .find(|own| own.step == later.step)
                .map(|own| Arc::clone(&own.action));
            let action = match of_step {
                Some(action) => action,
                None => {
                    let actions = self.history.run(run)?.actions;
                    let of_step = actions.into_iter().find(|action| action.step == later.step);
                    self.text(&of_step.map_or_else(String::new, |action| action.action))
                }
            };
            self.rules
                .entry(later.property.clone())
                .or_default()
                .insert(later.rule);
            let new = JudgedOutcome {
                step: later.step,
                action,
                property: self.text(&later.property),
                outcome: later.outcome,
                margin: later.margin,
            };
            match outcomes
                .iter_mut()
                .find(|own| own.step == new.step && own.property == new.property)
            {
                Some(own) => *own = new,
                None => outcomes.push(new),
            }
        }
        sort(outcomes);
        Ok(())
    }
}

fn sort(outcomes: &mut [JudgedOutcome]) {
    outcomes.sort_by(|a, b| (a.step, &a.property).cmp(&(b.step, &b.property)));
}
