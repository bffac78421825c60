//! Orders runs by how much they are worth watching.

use std::collections::{BTreeMap, BTreeSet};

use crate::FindingsSummary;
use actcheck_analysis::OutcomeTable;
use actcheck_base::Outcome;

/// Largest number of failed runs in the order. A page of the usual size has room for a hundred.
const MOST: usize = 2_000;

/// Returns run ids in the order in which they should be included as replays. Failed runs come
/// first, taken in turn from each failure mode and each property, so that the first few cover all
/// of them. Then come runs that did not complete, then one run of each test in which nothing
/// failed, for comparison.
pub fn replay_order(findings: &FindingsSummary, table: &OutcomeTable) -> Vec<String> {
    let runs = table.text("run");
    let mut queues: Vec<Vec<&str>> = findings
        .modes
        .iter()
        .filter(|mode| !mode.failed.is_empty())
        .map(|mode| mode.runs.iter().map(String::as_str).collect())
        .collect();
    queues.extend(findings.properties.iter().map(|report| {
        let failed =
            |row: &&u32| table.text("outcome").get(**row as usize) == Some(Outcome::Failed.word());
        let subject = report
            .findings
            .examples
            .iter()
            .map(|example| &example.row)
            .filter(failed);
        subject.filter_map(|row| runs.get(*row as usize)).collect()
    }));
    // Failure modes may include properties that are not displayed. If so, use only the queues of
    // displayed properties.
    let asked: BTreeSet<&str> = findings
        .properties
        .iter()
        .map(|report| report.findings.property.as_str())
        .collect();
    let mut order = in_turn(&queues);
    if !findings
        .modes
        .iter()
        .flat_map(|mode| &mode.failed)
        .all(|property| asked.contains(property.as_str()))
    {
        order = in_turn(&queues[queues.len() - findings.properties.len()..]);
    }
    order.extend(incomplete(table));
    order.extend(one_of_each_test(findings, table));
    let mut seen = BTreeSet::new();
    order
        .into_iter()
        .filter(|run| seen.insert(*run))
        .map(str::to_owned)
        .collect()
}

/// Takes the next unseen run of each queue in turn, until all are empty or there are more than a
/// page has room for.
fn in_turn<'a>(queues: &[Vec<&'a str>]) -> Vec<&'a str> {
    let mut seen = BTreeSet::new();
    let mut order = Vec::new();
    let mut rest: Vec<_> = queues.iter().map(|queue| queue.iter()).collect();
    loop {
        let before = order.len();
        for queue in &mut rest {
            order.extend(queue.find(|run| seen.insert(**run)));
        }
        if order.len() == before || order.len() >= MOST {
            return order;
        }
    }
}

fn incomplete(table: &OutcomeTable) -> impl Iterator<Item = &str> {
    let (runs, status) = (table.text("run"), table.text("status"));
    (0..table.len())
        .filter(|row| status.get(*row) != Some("completed"))
        .filter_map(|row| runs.get(row))
}

fn one_of_each_test<'a>(findings: &'a FindingsSummary, table: &'a OutcomeTable) -> Vec<&'a str> {
    let passed: BTreeSet<&str> = findings
        .modes
        .iter()
        .filter(|mode| mode.failed.is_empty())
        .flat_map(|mode| &mode.runs)
        .map(String::as_str)
        .collect();
    let (runs, tests) = (table.text("run"), table.text("test"));
    let mut first = BTreeMap::new();
    for row in 0..table.len() {
        if let (Some(run), Some(test)) = (runs.get(row), tests.get(row))
            && passed.contains(run)
        {
            first.entry(test).or_insert(run);
        }
    }
    first.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queues_take_turns_without_duplicates() {
        let queues = [vec!["a", "b", "c"], vec!["b", "d"], vec!["e"]];
        assert_eq!(in_turn(&queues), ["a", "b", "e", "c", "d"]);
        assert!(in_turn(&[]).is_empty());
    }
}
