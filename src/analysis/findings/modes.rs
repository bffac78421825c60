//! Failure modes from a table.

use std::collections::{BTreeMap, BTreeSet};

use crate::findings::judged::{failed, outcomes};
use crate::findings::scenes::Scenes;
use crate::{FailureMode, OutcomeTable, wilson};

/// Returns the failure modes of the runs of a table, most frequent first, then sorted by their properties.
///
/// Runs in which no property passed or failed tested nothing and are left out. Of bit-identical runs only the newest
/// counts.
pub fn table_failure_modes(table: &OutcomeTable) -> Vec<FailureMode> {
    let (runs, properties) = (table.text("run"), table.text("property"));
    let counted = table.counted_runs();
    let mut failed_in: BTreeMap<u32, (usize, BTreeSet<u32>)> = BTreeMap::new();
    for (row, outcome) in outcomes(table).into_iter().enumerate() {
        if let (Some(run), Some(property), Some(failed)) = (runs.of_row[row], properties.of_row[row], failed(outcome))
            && counted[run as usize]
        {
            let (_, signature) = failed_in.entry(run).or_insert((row, BTreeSet::new()));
            if failed {
                signature.insert(property);
            }
        }
    }
    let total = failed_in.len() as u64;
    let scenes = Scenes::of(table).runs(failed_in.values().map(|(row, _)| *row));
    let mut modes: BTreeMap<&BTreeSet<u32>, Vec<(usize, u32)>> = BTreeMap::new();
    for (place, (run, (_, signature))) in failed_in.iter().enumerate() {
        modes.entry(signature).or_default().push((place, *run));
    }
    let mut found: Vec<FailureMode> = modes
        .into_iter()
        .filter_map(|(signature, of_them)| {
            let mut failed: Vec<String> = signature.iter().map(|of| properties.texts[*of as usize].clone()).collect();
            failed.sort();
            let share = match &scenes {
                Some(scenes) => scenes.share(of_them.iter().map(|(place, _)| *place))?,
                None => wilson(of_them.len() as u64, total)?,
            };
            let runs = of_them.into_iter().map(|(_, run)| runs.texts[run as usize].clone()).collect();
            Some(FailureMode { failed, runs, share })
        })
        .collect();
    found.sort_by(|a, b| (b.runs.len(), &a.failed).cmp(&(a.runs.len(), &b.failed)));
    found
}
