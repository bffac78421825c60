//! The newest outcomes.

use std::collections::{BTreeMap, BTreeSet};

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
        for (row, rule) in lists::rechecked(&*self.store_with(lists::of_rechecked)?, filter)
            .map_err(|error| self.query_fault(&error))?
        {
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
