//! Confirmation of patterns on held-out runs.

use crate::patterns::condition::all_hold;
use crate::patterns::{Condition, Subject};
use crate::{TwoByTwo, holm};

/// Counts failures within and outside a pattern, among the selected runs.
pub(super) fn count(subject: &Subject, within: &[bool], among: impl Fn(usize) -> bool) -> TwoByTwo {
    let mut table = TwoByTwo::default();
    (0..subject.len()).filter(|run| among(*run)).for_each(|run| table.add(within[run], subject.failed[run]));
    table
}

/// Counts each pattern among the held-out runs that no earlier pattern contains, with the one-sided p-value of Fisher's
/// test, adjusted by Holm.
pub(super) fn confirm(patterns: &[Vec<Condition>], subject: &Subject) -> Vec<(TwoByTwo, f64)> {
    let mut explained = vec![false; subject.len()];
    let tables: Vec<TwoByTwo> = patterns
        .iter()
        .map(|conditions| {
            let within = all_hold(conditions, subject);
            let table = count(subject, &within, |run| subject.held_out[run] && !explained[run]);
            explained.iter_mut().zip(&within).for_each(|(explained, within)| *explained |= within);
            table
        })
        .collect();
    let adjusted = holm(&tables.iter().map(|table| table.fisher().greater).collect::<Vec<f64>>());
    tables.into_iter().zip(adjusted).collect()
}
