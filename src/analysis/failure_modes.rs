//! Failure modes: runs with the same set of failed properties.

use std::collections::{BTreeMap, BTreeSet};

use crate::{Interval, Sampling, SceneRuns};
use actcheck_base::Outcome;
use actcheck_history::OutcomeRow;

/// A set of failed properties, and the runs with exactly this set.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureMode {
    /// IRIs of the properties, sorted. Empty for the runs in which none failed.
    pub failed: Vec<String>,
    /// IDs of the runs, in the order given.
    pub runs: Vec<String>,
    /// Share among the runs that tested anything. Its interval accounts for runs of the same scene.
    pub share: Interval,
}

/// Returns the failure modes, most frequent first, then sorted by their properties.
///
/// Runs in which no property passed or failed tested nothing and are left out. `scenes` maps the
/// IDs of runs to their scenes, if scenes are repeated. `sampling`: how the number of runs was
/// decided.
pub fn failure_modes(
    rows: &[OutcomeRow],
    scenes: &BTreeMap<String, u64>,
    sampling: Sampling,
) -> Vec<FailureMode> {
    let tested = signatures(rows);
    // A run without a known scene counts as a scene of its own.
    let of_scenes = SceneRuns::new(tested.iter().map(|(run, _)| scenes.get(*run).ok_or(*run)));
    let mut modes: BTreeMap<&BTreeSet<&str>, Vec<usize>> = BTreeMap::new();
    for (place, (_, failed)) in tested.iter().enumerate() {
        modes.entry(failed).or_default().push(place);
    }
    let mut found: Vec<FailureMode> = modes
        .into_iter()
        .filter_map(|(failed, places)| {
            Some(FailureMode {
                failed: failed.iter().map(|iri| (*iri).to_owned()).collect(),
                runs: places
                    .iter()
                    .map(|place| tested[*place].0.to_owned())
                    .collect(),
                share: of_scenes.share(places, sampling)?,
            })
        })
        .collect();
    // The sort is stable: modes of equal size stay sorted by their properties.
    found.sort_by_key(|mode| std::cmp::Reverse(mode.runs.len()));
    found
}

/// Returns the runs with decided properties, in the order given, each with its failed properties.
fn signatures(rows: &[OutcomeRow]) -> Vec<(&str, BTreeSet<&str>)> {
    let mut runs: Vec<(&str, BTreeSet<&str>)> = Vec::new();
    for row in rows
        .iter()
        .filter(|row| matches!(row.outcome, Outcome::Passed | Outcome::Failed))
    {
        // The rows of a run are contiguous.
        if runs.last().is_none_or(|(run, _)| *run != row.run) {
            runs.push((&row.run, BTreeSet::new()));
        }
        if let (Outcome::Failed, Some((_, failed))) = (row.outcome, runs.last_mut()) {
            failed.insert(&row.property);
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wilson;

    fn row(run: &str, property: &str, outcome: Outcome) -> OutcomeRow {
        OutcomeRow {
            run: run.to_owned(),
            campaign: "k".to_owned(),
            index: 0,
            test: "Pick".to_owned(),
            step: 1,
            action: "http://actions#Pick".to_owned(),
            property: property.to_owned(),
            outcome,
            margin: None,
        }
    }

    #[test]
    fn runs_are_grouped_by_their_failed_properties() {
        use Outcome::{Broken, Failed, Inapplicable, Passed};
        let rows = [
            row("k-1", "b", Failed),
            row("k-1", "a", Failed),
            row("k-2", "b", Passed),
            row("k-2", "a", Inapplicable),
            row("k-3", "a", Failed),
            row("k-3", "b", Failed),
            row("k-3", "b", Failed),
            row("k-4", "a", Broken),
            row("k-4", "b", Broken),
            row("k-5", "a", Failed),
        ];
        let modes = failure_modes(&rows, &BTreeMap::new(), Sampling::Fixed);
        let plain: Vec<(Vec<&str>, Vec<&str>)> = modes
            .iter()
            .map(|mode| {
                (
                    mode.failed.iter().map(String::as_str).collect(),
                    mode.runs.iter().map(String::as_str).collect(),
                )
            })
            .collect();
        assert_eq!(
            plain,
            [
                (vec!["a", "b"], vec!["k-1", "k-3"]),
                (vec![], vec!["k-2"]),
                (vec!["a"], vec!["k-5"])
            ]
        );
        assert_eq!(modes[0].share, wilson(2, 4).expect("four runs"));
        // Runs of one scene have a smaller effective sample size: the share stays, and its interval
        // is wider.
        let scenes = [("k-1", 1), ("k-3", 1), ("k-2", 2), ("k-5", 2)]
            .map(|(run, scene)| (run.to_owned(), scene));
        let alike = failure_modes(&rows, &scenes.into(), Sampling::Fixed);
        let (alone, alike) = (modes[0].share, alike[0].share);
        assert!(
            alike.rate == alone.rate && alike.low < alone.low && alike.high > alone.high,
            "{alike:?} {alone:?}"
        );
        assert!(failure_modes(&[], &BTreeMap::new(), Sampling::Fixed).is_empty());
        assert!(failure_modes(&rows[7..9], &BTreeMap::new(), Sampling::Fixed).is_empty());
    }
}
