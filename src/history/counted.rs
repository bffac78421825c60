//! The runs that count in rates: each trace once, and no run whose scene was selected because it failed.

use std::collections::BTreeSet;

use oxigraph::sparql::QueryEvaluationError;
use oxigraph::store::Store;

use crate::{History, RunFilter, RunRow, lists};
use actcheck_base::Diagnostics;

/// Returns the ids of the runs that count in rates over `runs`, which are sorted by time: of runs with bit-identical
/// traces only the newest counts, because the others add no evidence.
pub fn newest_of_alike(runs: &[RunRow]) -> BTreeSet<String> {
    let mut seen = BTreeSet::new();
    // A run without a hash (broken before its first state) is never a duplicate.
    let newest = runs.iter().rev().filter(|run| run.trace_hash.is_empty() || seen.insert(&run.trace_hash));
    newest.map(|run| run.run.clone()).collect()
}

/// Returns the ids of the runs of a store that count in rates over all of its campaigns.
pub(super) fn counted_runs(store: &Store) -> Result<BTreeSet<String>, QueryEvaluationError> {
    let selected = lists::selected_campaigns(store)?;
    let mut runs = lists::runs(store, &RunFilter::default())?;
    runs.retain(|run| !selected.contains(&run.campaign));
    Ok(newest_of_alike(&runs))
}

impl History {
    /// Returns the ids of the runs that count in rates over all campaigns: not those of
    /// [`History::selected_campaigns`], and of runs with bit-identical traces only the newest.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn counted_runs(&self) -> Result<BTreeSet<String>, Diagnostics> {
        let selected = self.selected_campaigns()?;
        let mut runs = self.runs(&RunFilter::default())?;
        runs.retain(|run| !selected.contains(&run.campaign));
        Ok(newest_of_alike(&runs))
    }
}
