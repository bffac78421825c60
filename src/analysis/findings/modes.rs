//! Runs of a table that fail alike.

use std::collections::{BTreeMap, BTreeSet};

use crate::analysis::findings::judged::{failed, outcomes};
use crate::analysis::{FailureMode, OutcomeTable, wilson};

/// Failure modes of the runs of a table, the most frequent first, then by their properties.
///
/// A run in which no property passed or failed tested nothing, and is left out.
pub fn table_failure_modes(table: &OutcomeTable) -> Vec<FailureMode> {
    let (runs, properties) = (table.text("run"), table.text("property"));
    let mut failed_in: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for (row, outcome) in outcomes(table).into_iter().enumerate() {
        if let (Some(run), Some(property), Some(failed)) = (runs.of_row[row], properties.of_row[row], failed(outcome)) {
            let signature = failed_in.entry(run).or_default();
            if failed {
                signature.insert(property);
            }
        }
    }
    let total = failed_in.len() as u64;
    let mut modes: BTreeMap<BTreeSet<u32>, Vec<String>> = BTreeMap::new();
    for (run, signature) in failed_in {
        modes.entry(signature).or_default().push(runs.texts[run as usize].clone());
    }
    let mut found: Vec<FailureMode> = modes
        .into_iter()
        .filter_map(|(signature, runs)| {
            let mut failed: Vec<String> = signature.iter().map(|of| properties.texts[*of as usize].clone()).collect();
            failed.sort();
            wilson(runs.len() as u64, total).map(|share| FailureMode { failed, runs, share })
        })
        .collect();
    found.sort_by(|a, b| (b.runs.len(), &a.failed).cmp(&(a.runs.len(), &b.failed)));
    found
}
