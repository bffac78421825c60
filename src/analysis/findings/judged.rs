//! The properties in a table, and the rows that judge them.

use std::collections::BTreeMap;

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
    /// How often each outcome occurred.
    pub counts: Counts,
    /// Indices of its rows, in order.
    pub rows: Vec<u32>,
}

/// Returns every property of every action, sorted by action, then property.
pub fn judged(table: &OutcomeTable) -> Vec<JudgedProperty> {
    let (actions, properties) = (table.text("action"), table.text("property"));
    let outcomes = outcomes(table);
    let mut found: BTreeMap<(u32, u32), (Counts, Vec<u32>)> = BTreeMap::new();
    for (row, outcome) in outcomes.into_iter().enumerate() {
        if let (Some(action), Some(property)) = (actions.of_row[row], properties.of_row[row]) {
            let (counts, rows) = found.entry((action, property)).or_default();
            counts.add(outcome);
            // A table has far fewer rows than 2^32.
            rows.push(row as u32);
        }
    }
    let mut judged: Vec<JudgedProperty> = found
        .into_iter()
        .map(|((action, property), (counts, rows))| JudgedProperty {
            action: actions.texts[action as usize].clone(),
            property: properties.texts[property as usize].clone(),
            counts,
            rows,
        })
        .collect();
    judged.sort_by(|a, b| (&a.action, &a.property).cmp(&(&b.action, &b.property)));
    judged
}

/// Returns the outcome of every row. A missing or unknown outcome counts as broken.
pub(super) fn outcomes(table: &OutcomeTable) -> Vec<Outcome> {
    let column = table.text("outcome");
    let known: Vec<Outcome> =
        column.texts.iter().map(|word| Outcome::from_word(word).unwrap_or(Outcome::Broken)).collect();
    column.of_row.iter().map(|of| of.map_or(Outcome::Broken, |of| known[of as usize])).collect()
}

/// Returns whether an outcome is a failure, or `None` if it is undecided.
pub(super) fn failed(outcome: Outcome) -> Option<bool> {
    match outcome {
        Outcome::Failed => Some(true),
        Outcome::Passed => Some(false),
        _ => None,
    }
}
