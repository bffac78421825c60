//! Outcomes as they were last judged.

use std::collections::{BTreeMap, BTreeSet};

use crate::base::Diagnostics;
use crate::history::{History, OutcomeRow, RunFilter, lists};

/// The newest outcomes of some runs: those of the campaign itself where nothing later says otherwise.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NewestOutcomes {
    /// In the order of [`History::outcomes`].
    pub rows: Vec<OutcomeRow>,
    /// Digests of the rules behind the later ones, by the IRI of the property.
    pub rules: BTreeMap<String, BTreeSet<String>>,
}

impl History {
    /// The newest outcomes of the runs that a filter lets through.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn newest_outcomes(&self, filter: &RunFilter) -> Result<NewestOutcomes, Diagnostics> {
        let mut newest = NewestOutcomes { rows: self.outcomes(filter)?, rules: BTreeMap::new() };
        let key = |row: &OutcomeRow| (row.index, row.run.clone(), row.step, row.property.clone());
        let mut known: BTreeMap<_, usize> = newest.rows.iter().enumerate().map(|(at, row)| (key(row), at)).collect();
        for (row, rule) in lists::rechecked(&self.store()?, filter).map_err(|error| self.query_fault(&error))? {
            newest.rules.entry(row.property.clone()).or_default().insert(rule);
            match known.get(&key(&row)) {
                Some(at) => newest.rows[*at] = row,
                None => {
                    known.insert(key(&row), newest.rows.len());
                    newest.rows.push(row);
                }
            }
        }
        // Stable, so that campaigns stay in their order.
        let order: BTreeMap<String, usize> =
            newest.rows.iter().enumerate().rev().map(|(at, row)| (row.campaign.clone(), at)).collect();
        newest.rows.sort_by_key(|row| (order.get(&row.campaign).copied(), key(row)));
        Ok(newest)
    }

    /// Ids of the campaigns that hold the smaller form of a run of another, as shrinking writes them.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn shrunk_campaigns(&self) -> Result<BTreeSet<String>, Diagnostics> {
        lists::shrunk_campaigns(&self.store()?).map_err(|error| self.query_fault(&error))
    }
}
