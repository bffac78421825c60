//! Cascades: failures of one action that lead to failures of a later one.

use std::collections::BTreeMap;

use crate::findings::judged::{failed, outcomes};
use crate::findings::scenes::Scenes;
use crate::{OutcomeTable, TwoByTwo, benjamini_hochberg};

/// A property of an action at a step.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Judged {
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// IRI of the property.
    pub property: String,
}

/// Two failures, of which the later one is more frequent after the earlier one.
#[derive(Debug, Clone, PartialEq)]
pub struct Cascade {
    /// The earlier failure.
    pub first: Judged,
    /// The later failure.
    pub later: Judged,
    /// Counts of the runs in which both were decided. "Within" are those in which the first failed.
    pub table: TwoByTwo,
    /// One-sided p-value of Fisher's exact test.
    pub p: f64,
    /// `p` adjusted for all pairs (Benjamini and Hochberg).
    pub q: f64,
}

/// Finds pairs of failures at different steps of a run that are significantly associated, most
/// significant first.
///
/// A later action that was not reached or could not be judged is not counted. Of bit-identical runs
/// only the newest is counted, of the runs of one scene only the first.
pub fn cascades(table: &OutcomeTable, level: f64) -> Vec<Cascade> {
    let runs = table.text("run");
    let counted = table.counted_runs();
    let further = Scenes::of(table).further_runs(&counted);
    let mut slots: BTreeMap<(u32, u32, u32), usize> = BTreeMap::new();
    let mut counts: BTreeMap<(usize, usize), TwoByTwo> = BTreeMap::new();
    let mut run: Vec<(u32, usize, bool)> = Vec::new();
    for (row, outcome) in outcomes(table).into_iter().enumerate() {
        if row > 0 && runs.of_row[row] != runs.of_row[row - 1] {
            count(&run, &mut counts);
            run.clear();
        }
        if runs.of_row[row].is_some_and(|run| !counted[run as usize] || further.contains(&run)) {
            continue;
        }
        if let (Some(key), Some(failed)) = (key(table, row), failed(outcome)) {
            let next = slots.len();
            run.push((key.0, *slots.entry(key).or_insert(next), failed));
        }
    }
    count(&run, &mut counts);
    let judged: BTreeMap<usize, Judged> = slots
        .into_iter()
        .map(|(key, slot)| (slot, name(table, key)))
        .collect();
    let probabilities: Vec<f64> = counts
        .values()
        .map(|table| table.fisher().greater)
        .collect();
    let adjusted = benjamini_hochberg(&probabilities, probabilities.len() as u64);
    let mut found: Vec<Cascade> = counts
        .into_iter()
        .zip(probabilities.into_iter().zip(adjusted))
        .filter(|(_, (_, q))| *q <= level)
        .map(|(((first, later), table), (p, q))| Cascade {
            first: judged[&first].clone(),
            later: judged[&later].clone(),
            table,
            p,
            q,
        })
        .collect();
    found.sort_by(|a, b| {
        a.p.total_cmp(&b.p)
            .then_with(|| (&a.first, &a.later).cmp(&(&b.first, &b.later)))
    });
    found
}

/// Counts all pairs of one run.
fn count(run: &[(u32, usize, bool)], counts: &mut BTreeMap<(usize, usize), TwoByTwo>) {
    for (step, first, first_failed) in run {
        for (_, later, later_failed) in run.iter().filter(|(later, ..)| later > step) {
            counts
                .entry((*first, *later))
                .or_default()
                .add(*first_failed, *later_failed);
        }
    }
}

fn key(table: &OutcomeTable, row: usize) -> Option<(u32, u32, u32)> {
    let step = table
        .number("step")
        .get(row)
        .filter(|step| !step.is_nan())?;
    Some((
        *step as u32,
        table.text("action").of_row[row]?,
        table.text("property").of_row[row]?,
    ))
}

fn name(table: &OutcomeTable, (step, action, property): (u32, u32, u32)) -> Judged {
    let text = |column: &str, of: u32| table.text(column).texts[of as usize].clone();
    Judged {
        step,
        action: text("action", action),
        property: text("property", property),
    }
}
