//! Groups runs by scene, because runs of one scene are not independent.

use std::collections::{BTreeMap, BTreeSet};

use crate::{OutcomeTable, SceneRuns};

/// The scenes of a table's runs.
pub(super) struct Scenes<'a> {
    campaign: &'a [Option<u32>],
    run: &'a [Option<u32>],
    scene: &'a [f64],
    step: &'a [f64],
}

/// A scene in a table: a repeated scene of a campaign, or a single run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    Repeated(Option<u32>, u64),
    Alone(Option<u32>),
}

impl<'a> Scenes<'a> {
    pub fn of(table: &'a OutcomeTable) -> Self {
        Self {
            campaign: &table.text("campaign").of_row,
            run: &table.text("run").of_row,
            scene: table.number("scene"),
            step: table.number("step"),
        }
    }

    fn key(&self, row: usize) -> Key {
        match self.scene.get(row) {
            Some(scene) if !scene.is_nan() => {
                Key::Repeated(self.campaign.get(row).copied().flatten(), scene.to_bits())
            }
            _ => Key::Alone(self.run.get(row).copied().flatten()),
        }
    }

    /// Keeps the first of the rows with the same scene and step.
    pub fn first_rows(&self, rows: &[u32]) -> Vec<u32> {
        let mut seen = BTreeSet::new();
        let is_first = |row: &u32| match self.key(*row as usize) {
            key @ Key::Repeated(..) => {
                seen.insert((key, self.step.get(*row as usize).map(|step| step.to_bits())))
            }
            Key::Alone(_) => true,
        };
        rows.iter().copied().filter(is_first).collect()
    }

    /// Returns the runs whose scene an earlier run has had, among those that count.
    pub fn further_runs(&self, counted: &[bool]) -> BTreeSet<u32> {
        let mut first = BTreeMap::new();
        let mut further = BTreeSet::new();
        for (row, run) in self.run.iter().enumerate() {
            if let (Some(run), key @ Key::Repeated(..)) = (run, self.key(row))
                && counted[*run as usize]
                && first.entry(key).or_insert(*run) != run
            {
                further.insert(*run);
            }
        }
        further
    }

    /// Groups rows by scene. Returns `None` if every scene was run once.
    pub fn runs(&self, rows: impl Iterator<Item = usize>) -> Option<SceneRuns> {
        let repeated = self.scene.iter().any(|scene| !scene.is_nan());
        repeated.then(|| SceneRuns::new(rows.map(|row| self.key(row))))
    }
}
