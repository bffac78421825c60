//! Failure modes from a table.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::findings::judged::{failed, outcomes};
use crate::findings::scenes::Scenes;
use crate::{FailureMode, OutcomeTable};

/// Returns the failure modes of the runs of a table, most frequent first, then sorted by their
/// properties.
///
/// Runs in which no property passed or failed tested nothing and are left out. Of bit-identical
/// runs only the newest counts.
pub fn table_failure_modes(table: &OutcomeTable) -> Vec<FailureMode> {
    let (runs, properties) = (table.text("run"), table.text("property"));
    let counted = table.counted_runs();
    let mut sets = Sets::default();
    // The first row and the set of failed properties of each run.
    let mut failed_in: Vec<Option<(usize, u32)>> = vec![None; runs.texts.len()];
    for (row, outcome) in outcomes(table).into_iter().enumerate() {
        if let (Some(run), Some(property), Some(failed)) =
            (runs.of_row[row], properties.of_row[row], failed(outcome))
            && counted[run as usize]
        {
            let (_, signature) = failed_in[run as usize].get_or_insert((row, Sets::EMPTY));
            if failed {
                *signature = sets.with(*signature, property);
            }
        }
    }
    let tested = || {
        (0u32..)
            .zip(&failed_in)
            .filter_map(|(run, found)| Some((run, (*found)?)))
    };
    let total = tested().count() as u64;
    let scenes = Scenes::of(table).runs(tested().map(|(_, (row, _))| row));
    let mut modes: BTreeMap<&BTreeSet<u32>, Vec<(usize, u32)>> = BTreeMap::new();
    for (place, (run, (_, signature))) in tested().enumerate() {
        modes
            .entry(sets.get(signature))
            .or_default()
            .push((place, run));
    }
    let mut found: Vec<FailureMode> = modes
        .into_iter()
        .filter_map(|(signature, of_them)| {
            let mut failed: Vec<String> = signature
                .iter()
                .map(|of| properties.texts[*of as usize].clone())
                .collect();
            failed.sort();
            let share = match &scenes {
                Some(scenes) => {
                    scenes.share(of_them.iter().map(|(place, _)| *place), table.sampling)?
                }
                None => table.sampling.interval(of_them.len() as u64, total)?,
            };
            let runs = of_them
                .into_iter()
                .map(|(_, run)| runs.texts[run as usize].clone())
                .collect();
            Some(FailureMode {
                failed,
                runs,
                share,
            })
        })
        .collect();
    found.sort_by(|a, b| (b.runs.len(), &a.failed).cmp(&(a.runs.len(), &b.failed)));
    found
}

/// Sets of properties, each with a number: most runs have the same ones.
struct Sets {
    all: Vec<BTreeSet<u32>>,
    number: HashMap<BTreeSet<u32>, u32>,
    /// The set after a property is added to a set.
    next: HashMap<(u32, u32), u32>,
}

impl Default for Sets {
    fn default() -> Self {
        let empty = BTreeSet::new();
        Self {
            all: vec![empty.clone()],
            number: HashMap::from([(empty, Self::EMPTY)]),
            next: HashMap::new(),
        }
    }
}

impl Sets {
    const EMPTY: u32 = 0;

    fn get(&self, number: u32) -> &BTreeSet<u32> {
        &self.all[number as usize]
    }

    fn with(&mut self, number: u32, property: u32) -> u32 {
        if let Some(next) = self.next.get(&(number, property)) {
            return *next;
        }
        let mut set = self.get(number).clone();
        set.insert(property);
        let next = *self.number.entry(set).or_insert_with_key(|set| {
            self.all.push(set.clone());
            (self.all.len() - 1) as u32
        });
        self.next.insert((number, property), next);
        next
    }
}
