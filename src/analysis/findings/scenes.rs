//! Runs of one scene are alike: they don't count as so many scenes.

use std::collections::{BTreeMap, BTreeSet};

use crate::analysis::{OutcomeTable, SceneRuns};

/// Which runs of a table are of the same scene.
pub(super) struct Scenes<'a> {
    campaign: &'a [Option<u32>],
    run: &'a [Option<u32>],
    scene: &'a [f64],
    step: &'a [f64],
}

/// A scene in a table: one that was run several times in a campaign, or a run that is alone.
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
            Some(scene) if !scene.is_nan() => Key::Repeated(self.campaign.get(row).copied().flatten(), scene.to_bits()),
            _ => Key::Alone(self.run.get(row).copied().flatten()),
        }
    }

    /// Of rows of the same scene and step the first.
    pub fn first_rows(&self, rows: &[u32]) -> Vec<u32> {
        let mut seen = BTreeSet::new();
        let is_first = |row: &u32| match self.key(*row as usize) {
            key @ Key::Repeated(..) => seen.insert((key, self.step.get(*row as usize).map(|step| step.to_bits()))),
            Key::Alone(_) => true,
        };
        rows.iter().copied().filter(is_first).collect()
    }

    /// Runs whose scene another run before them has had.
    pub fn further_runs(&self) -> BTreeSet<u32> {
        let mut first = BTreeMap::new();
        let mut further = BTreeSet::new();
        for (row, run) in self.run.iter().enumerate() {
            if let (Some(run), key @ Key::Repeated(..)) = (run, self.key(row))
                && first.entry(key).or_insert(*run) != run
            {
                further.insert(*run);
            }
        }
        further
    }

    /// Which of some rows are of the same scene; nothing where every scene was run once.
    pub fn runs(&self, rows: impl Iterator<Item = usize>) -> Option<SceneRuns> {
        let repeated = self.scene.iter().any(|scene| !scene.is_nan());
        repeated.then(|| SceneRuns::new(rows.map(|row| self.key(row))))
    }
}
