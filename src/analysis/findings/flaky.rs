//! Flaky scenes, which sometimes pass and sometimes fail.

use std::collections::BTreeMap;

use crate::findings::judged::{JudgedProperty, failed, outcomes};
use crate::{OutcomeTable, Repeated, consistency};

/// A scene with passed and failed runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FlakyScene {
    /// ID of the campaign.
    pub campaign: String,
    /// Number of the scene in the campaign.
    pub scene: u64,
    /// Number of passed runs.
    pub passed: u64,
    /// Number of decided runs.
    pub of: u64,
}

/// Returns the scenes that are flaky in a property, in the order of the table, and the number of
/// scenes with several runs.
pub fn flaky_scenes(table: &OutcomeTable, of: &JudgedProperty) -> (Vec<FlakyScene>, u64) {
    let outcomes = outcomes(table);
    let (campaign, scene) = (table.text("campaign"), table.number("scene"));
    let mut numbers: BTreeMap<(u32, u64), u64> = BTreeMap::new();
    let mut keys = Vec::new();
    let mut runs = Vec::new();
    for row in of.rows.iter().map(|row| *row as usize) {
        let number = scene.get(row).copied().filter(|scene| !scene.is_nan());
        let (Some(campaign), Some(number), Some(failed)) =
            (campaign.of_row[row], number, failed(outcomes[row]))
        else {
            continue;
        };
        let key = (campaign, number as u64);
        let scene = *numbers.entry(key).or_insert_with(|| {
            keys.push(key);
            keys.len() as u64 - 1
        });
        runs.push(Repeated {
            scene,
            passed: !failed,
            margin: None,
        });
    }
    let found = consistency(&runs, table.sampling);
    let repeated = found.always_passed + found.always_failed + found.flaky.len() as u64;
    let named = |flaky: &crate::SceneCounts| {
        let (of, scene) = keys[flaky.scene as usize];
        FlakyScene {
            campaign: campaign.texts[of as usize].clone(),
            scene,
            passed: flaky.passed,
            of: flaky.of,
        }
    };
    (found.flaky.iter().map(named).collect(), repeated)
}
