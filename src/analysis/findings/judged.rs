//! The properties in a table, and the rows that judge them.

use std::collections::{BTreeMap, BTreeSet};

use crate::OutcomeTable;
use actcheck_base::Outcome;
use actcheck_verdict::Counts;

/// One property of one action in a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JudgedProperty {
    /// IRI of the action.
    pub action: String,
    /// IRI of the property.
    pub property: String,
    /// How often each outcome occurred, in the rows that count.
    pub counts: Counts,
    /// Indices of the rows that count, in order: of bit-identical runs only the newest.
    pub rows: Vec<u32>,
    /// Indices of all its rows, in order.
    pub every_row: Vec<u32>,
}

/// Returns every property of every action, sorted by action, then property.
pub fn judged(table: &OutcomeTable) -> Vec<JudgedProperty> {
    let (actions, properties) = (table.text("action"), table.text("property"));
    let outcomes = outcomes(table);
    let mut found: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for row in 0..outcomes.len() {
        if let (Some(action), Some(property)) = (actions.of_row[row], properties.of_row[row]) {
            // A table has far fewer rows than 2^32.
            found
                .entry((action, property))
                .or_default()
                .push(row as u32);
        }
    }
    let mut judged: Vec<JudgedProperty> = found
        .into_iter()
        .map(|((action, property), every_row)| {
            let rows = newest_of_alike(table, &every_row);
            JudgedProperty {
                action: actions.texts[action as usize].clone(),
                property: properties.texts[property as usize].clone(),
                counts: Counts::of(rows.iter().map(|row| outcomes[*row as usize])),
                rows,
                every_row,
            }
        })
        .collect();
    judged.sort_by(|a, b| (&a.action, &a.property).cmp(&(&b.action, &b.property)));
    judged
}

/// Returns the outcome of every row. A missing or unknown outcome counts as broken.
pub(super) fn outcomes(table: &OutcomeTable) -> Vec<Outcome> {
    let column = table.text("outcome");
    let known: Vec<Outcome> = column
        .texts
        .iter()
        .map(|word| Outcome::from_word(word).unwrap_or(Outcome::Broken))
        .collect();
    column
        .of_row
        .iter()
        .map(|of| of.map_or(Outcome::Broken, |of| known[of as usize]))
        .collect()
}

/// Drops rows for which a later row has the same step and a bit-identical run.
pub(super) fn newest_of_alike(table: &OutcomeTable, rows: &[u32]) -> Vec<u32> {
    let (hash, step) = (table.text("trace_hash"), table.number("step"));
    // The steps in which a trace was seen, one bit for each; later ones are in the set.
    let mut seen = vec![0u64; hash.texts.len()];
    let mut seen_late = BTreeSet::new();
    let mut is_new = |of: u32, step: f64| match step {
        step if (0.0..64.0).contains(&step) && step.fract() == 0.0 => {
            let (steps, bit) = (&mut seen[of as usize], 1 << step as u32);
            let is_new = *steps & bit == 0;
            *steps |= bit;
            is_new
        }
        _ => seen_late.insert((of, step.to_bits())),
    };
    let mut kept: Vec<u32> = rows
        .iter()
        .rev()
        .copied()
        .filter(|row| {
            let at = *row as usize;
            match (hash.of_row.get(at).copied().flatten(), step.get(at)) {
                (Some(of), Some(step)) if !hash.texts[of as usize].is_empty() => is_new(of, *step),
                _ => true,
            }
        })
        .collect();
    kept.reverse();
    kept
}

/// Returns whether an outcome is a failure, or `None` if it is undecided.
pub(super) fn failed(outcome: Outcome) -> Option<bool> {
    match outcome {
        Outcome::Failed => Some(true),
        Outcome::Passed => Some(false),
        _ => None,
    }
}
