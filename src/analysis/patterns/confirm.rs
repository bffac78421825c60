//! Confirmation of patterns on held-out runs.

use crate::patterns::condition::all_hold;
use crate::patterns::{Condition, PatternInput};
use crate::{TwoByTwo, holm};

/// Counts failures within and outside a pattern, among the selected runs.
pub(super) fn count(
    input: &PatternInput,
    within: &[bool],
    among: impl Fn(usize) -> bool,
) -> TwoByTwo {
    let mut table = TwoByTwo::default();
    (0..input.len())
        .filter(|run| among(*run))
        .for_each(|run| table.add(within[run], input.failed[run]));
    table
}

/// Counts each pattern among the held-out runs that no earlier pattern contains, with the one-sided
/// p-value of Fisher's test, adjusted by Holm.
pub(super) fn confirm(patterns: &[Vec<Condition>], input: &PatternInput) -> Vec<(TwoByTwo, f64)> {
    let mut explained = vec![false; input.len()];
    let tables: Vec<TwoByTwo> = patterns
        .iter()
        .map(|conditions| {
            let within = all_hold(conditions, input);
            let table = count(input, &within, |run| input.held_out[run] && !explained[run]);
            explained
                .iter_mut()
                .zip(&within)
                .for_each(|(explained, within)| *explained |= within);
            table
        })
        .collect();
    let adjusted = holm(
        &tables
            .iter()
            .map(|table| table.fisher().greater)
            .collect::<Vec<f64>>(),
    );
    tables.into_iter().zip(adjusted).collect()
}
