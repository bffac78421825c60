//! Pass rates of properties.

use std::collections::BTreeMap;

use crate::{Interval, wilson};
use actcheck_base::Outcome;
use actcheck_history::OutcomeRow;

/// Outcomes of one property of one action over some runs.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyRate {
    /// IRI of the action.
    pub action: String,
    /// IRI of the property.
    pub property: String,
    /// Counts in the order of [`Outcome::ALL`].
    pub counts: [u64; 6],
    /// Share of passed among passed and failed. `None` if neither occurred.
    pub passed: Option<Interval>,
}

/// Returns the counts and rates of every property, sorted by action, then property.
pub fn property_rates(rows: &[OutcomeRow]) -> Vec<PropertyRate> {
    let mut counts: BTreeMap<(&str, &str), [u64; 6]> = BTreeMap::new();
    for row in rows {
        let counts = counts.entry((&row.action, &row.property)).or_default();
        for (count, outcome) in counts.iter_mut().zip(Outcome::ALL) {
            *count += u64::from(outcome == row.outcome);
        }
    }
    counts
        .into_iter()
        .map(|((action, property), counts)| {
            let of =
                |wanted| Outcome::ALL.iter().zip(counts).filter(|(o, _)| **o == wanted).map(|(_, n)| n).sum::<u64>();
            let passed = of(Outcome::Passed);
            PropertyRate {
                action: action.to_owned(),
                property: property.to_owned(),
                counts,
                passed: wilson(passed, passed + of(Outcome::Failed)),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_uses_only_passed_and_failed_of_six_outcomes() {
        let row = |property: &str, outcome| OutcomeRow {
            run: "k-1".to_owned(),
            campaign: "k".to_owned(),
            index: 0,
            test: "Pick".to_owned(),
            step: 1,
            action: "Pick".to_owned(),
            property: property.to_owned(),
            outcome,
            margin: None,
        };
        let mut rows: Vec<OutcomeRow> = Outcome::ALL.into_iter().map(|outcome| row("b", outcome)).collect();
        rows.extend([row("b", Outcome::Passed), row("a", Outcome::Broken)]);
        let rates = property_rates(&rows);
        assert_eq!((rates[0].property.as_str(), rates[0].counts, rates[0].passed), ("a", [0, 0, 0, 1, 0, 0], None));
        assert_eq!((rates[1].counts, rates[1].passed), ([2, 1, 1, 1, 1, 1], wilson(2, 3)));
    }
}
