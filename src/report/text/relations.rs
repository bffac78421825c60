//! The relations between pairs of runs, for the terminal.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::table::relations_table;
use crate::text::{Page, command};
use crate::{RelationsSummary, TableFormat};
use actcheck_history::RelatedRuns;

/// Maximum number of broken pairs of each relation that are listed; `--format json` has all.
const MOST_LISTED: usize = 5;
/// Maximum number of reasons why a relation does not apply that are listed.
const MOST_REASONS: usize = 3;

/// Formats how often each relation holds, and the first pairs in which it does not.
pub fn relations_text(summary: &RelationsSummary, page: Page) -> String {
    let mut out = relations_table(summary).render(TableFormat::Table, page);
    for relation in summary.relations() {
        for pair in relation.violated.iter().take(MOST_LISTED) {
            let second = pair.second.as_deref().unwrap_or_default();
            let _ = writeln!(
                out,
                "\n{} does not hold for {} and {second}: {}",
                relation.name, pair.run, pair.witness
            );
        }
        if let Some(pair) = relation.violated.first() {
            let more = relation.violated.len().saturating_sub(MOST_LISTED);
            if more > 0 {
                let _ = writeln!(out, "\n… and for {more} more pairs");
            }
            let _ = writeln!(out, "smallest scene: {}", command(&summary.shrink(pair)));
        }
        for (reason, number) in reasons(&summary.related, relation.name)
            .into_iter()
            .take(MOST_REASONS)
        {
            let _ = writeln!(
                out,
                "\n{} has no pair for {number} runs: {reason}",
                relation.name
            );
        }
    }
    page.set(&out)
}

/// Why a relation has no second runs, with the number of runs; the most frequent reason first.
fn reasons<'a>(related: &'a RelatedRuns, relation: &str) -> Vec<(&'a str, usize)> {
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    let of_relation = related
        .pairs
        .iter()
        .filter(|pair| pair.relation == relation);
    for pair in of_relation.filter(|pair| pair.second.is_none()) {
        *reasons.entry(&pair.witness).or_default() += 1;
    }
    let mut reasons: Vec<_> = reasons.into_iter().collect();
    reasons.sort_by_key(|(_, number)| std::cmp::Reverse(*number));
    reasons
}
