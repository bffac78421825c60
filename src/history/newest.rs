//! The newest outcomes.

use std::collections::{BTreeMap, BTreeSet};

use crate::open::OpenStore;
use crate::{History, OutcomeRow, RunFilter, lists};
use actcheck_base::Diagnostics;

/// The newest outcomes of runs: later judgements where they exist, otherwise those of the campaign itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NewestOutcomes {
    /// In the order of [`History::outcomes`].
    pub rows: Vec<OutcomeRow>,
    /// Digests of the rules of later judgements, by the IRI of the property.
    pub rules: BTreeMap<String, BTreeSet<String>>,
}

impl History {
    /// Returns the newest outcomes of the runs that match a filter.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn newest_outcomes(&self, filter: &RunFilter) -> Result<NewestOutcomes, Diagnostics> {
        let mut newest = NewestOutcomes { rows: self.outcomes(filter)?, rules: BTreeMap::new() };
        let key = |row: &OutcomeRow| (row.index, row.run.clone(), row.step, row.property.clone());
        let mut known: BTreeMap<_, usize> = newest.rows.iter().enumerate().map(|(at, row)| (key(row), at)).collect();
        let store = self.store_with(lists::of_rechecked)?;
        let mut later = lists::rechecked(&store, filter).map_err(|error| self.query_fault(&error))?;
        later.extend(self.rechecked_outlines(&store, &newest.rows)?);
        for (row, rule) in later {
            newest.rules.entry(row.property.clone()).or_default().insert(rule);
            match known.get(&key(&row)) {
                Some(at) => newest.rows[*at] = row,
                None => {
                    known.insert(key(&row), newest.rows.len());
                    newest.rows.push(row);
                }
            }
        }
        // Keeps campaigns in their order.
        let order: BTreeMap<String, usize> =
            newest.rows.iter().enumerate().rev().map(|(at, row)| (row.campaign.clone(), at)).collect();
        newest.rows.sort_by_key(|row| (order.get(&row.campaign).copied(), key(row)));
        Ok(newest)
    }

    /// The judgements made after the runs of which `rows` are outcomes, if these runs have only an outline; each with the
    /// digest of its rule.
    fn rechecked_outlines(
        &self,
        store: &OpenStore,
        rows: &[OutcomeRow],
    ) -> Result<Vec<(OutcomeRow, String)>, Diagnostics> {
        if !self.shelf().exists() {
            return Ok(Vec::new());
        }
        let mut of_runs: BTreeMap<&str, Vec<&OutcomeRow>> = BTreeMap::new();
        rows.iter().for_each(|row| of_runs.entry(&row.run).or_default().push(row));
        let mut found = Vec::new();
        for later in lists::rechecked_alone(store).map_err(|error| self.query_fault(&error))? {
            let Some(own) = of_runs.get(later.run.as_str()) else { continue };
            if !self.is_outline(&later.run)? {
                continue;
            }
            let of_step = own.iter().find(|row| row.step == later.step);
            let action = match of_step {
                Some(row) => row.action.clone(),
                None => {
                    let actions = self.run(&later.run)?.actions;
                    let of_step = actions.into_iter().find(|action| action.step == later.step);
                    of_step.map_or_else(String::new, |action| action.action)
                }
            };
            let row = OutcomeRow {
                step: later.step,
                action,
                property: later.property,
                outcome: later.outcome,
                margin: later.margin,
                ..own[0].clone()
            };
            found.push((row, later.rule));
        }
        Ok(found)
    }

    /// Returns the ids of the campaigns whose scenes were selected because they fail: those that hold a shrunk run, those
    /// that ran the failed runs of another campaign again, and cases. Statistics leave them out.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn selected_campaigns(&self) -> Result<BTreeSet<String>, Diagnostics> {
        lists::selected_campaigns(&*self.store_with(lists::of_selected_campaigns)?)
            .map_err(|error| self.query_fault(&error))
    }
}
