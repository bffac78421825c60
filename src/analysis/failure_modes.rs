//! Runs that fail alike: the same set of failed properties.

use std::collections::BTreeMap;

use polars::prelude::{Column, DataFrame, IntoLazy, ListChunked, PolarsError, SortMultipleOptions, col, len, lit};

use crate::analysis::frame::{AnalysisError, frame};
use crate::analysis::{Interval, SceneRuns};
use crate::history::OutcomeRow;
use crate::verdict::Outcome;

/// Stands between the properties of a signature; no IRI has it.
const BETWEEN: &str = "\n";

/// A set of failed properties and the runs that have just it.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureMode {
    /// IRIs of the properties, sorted. Empty: the runs in which none failed.
    pub failed: Vec<String>,
    /// Ids of the runs, in the order given.
    pub runs: Vec<String>,
    /// Share among the runs that tested anything. Its interval knows which runs are of one scene.
    pub share: Interval,
}

/// Failure modes, the most frequent first, then by their properties.
///
/// A run in which no property passed or failed tested nothing, and is left out. `scenes` tells the scene of a run by its id, where
/// scenes are run more than once.
///
/// # Errors
/// The table library failed.
pub fn failure_modes(rows: &[OutcomeRow], scenes: &BTreeMap<String, u64>) -> Result<Vec<FailureMode>, AnalysisError> {
    let signatures = signatures(&frame(rows)?)?;
    let tested: Vec<String> = signatures.column("run")?.str()?.iter().flatten().map(str::to_owned).collect();
    let places: BTreeMap<&str, usize> = tested.iter().enumerate().map(|(place, run)| (run.as_str(), place)).collect();
    // A run whose scene nobody tells is a scene of its own.
    let of_scenes = SceneRuns::new(tested.iter().map(|run| scenes.get(run).ok_or(run)));
    let modes = signatures
        .lazy()
        .group_by_stable([col("signature")])
        .agg([col("run"), len().alias("times")])
        .sort_by_exprs(
            [col("times"), col("signature")],
            SortMultipleOptions::default().with_order_descending_multi([true, false]),
        )
        .collect()?;
    let (texts, lists) = (modes.column("signature")?.str()?, modes.column("run")?.list()?);
    let mut found = Vec::with_capacity(modes.height());
    for (idx, signature) in texts.iter().enumerate() {
        let runs = texts_of(lists, idx)?;
        let failed = signature.unwrap_or_default().split(BETWEEN).filter(|iri| !iri.is_empty()).map(str::to_owned);
        if let Some(share) = of_scenes.share(runs.iter().filter_map(|run| places.get(run.as_str()).copied())) {
            found.push(FailureMode { failed: failed.collect(), runs, share });
        }
    }
    Ok(found)
}

/// Columns: run, signature. Shape: one row for each run that tested something, in the order given.
fn signatures(outcomes: &DataFrame) -> Result<DataFrame, PolarsError> {
    let is = |outcome: Outcome| col("outcome").eq(lit(outcome.word()));
    let runs = outcomes
        .clone()
        .lazy()
        .filter(is(Outcome::Passed).or(is(Outcome::Failed)))
        .group_by([col("place"), col("run")])
        .agg([col("property").filter(is(Outcome::Failed)).unique().sort(Default::default()).alias("failed")])
        .sort(["place"], SortMultipleOptions::default())
        .collect()?;
    let mut texts = Vec::with_capacity(runs.height());
    let failed = runs.column("failed")?.list()?;
    for idx in 0..runs.height() {
        texts.push(texts_of(failed, idx)?.join(BETWEEN));
    }
    DataFrame::new(runs.height(), vec![runs.column("run")?.clone(), Column::new("signature".into(), texts)])
}

/// The texts of one list of a column of lists.
fn texts_of(lists: &ListChunked, idx: usize) -> Result<Vec<String>, PolarsError> {
    match lists.get_as_series(idx) {
        Some(texts) => Ok(texts.str()?.iter().flatten().map(str::to_owned).collect()),
        None => Ok(Vec::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::wilson;

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
    fn runs_are_grouped_by_what_failed_in_them() {
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
        let modes = failure_modes(&rows, &BTreeMap::new()).expect("a table");
        let plain: Vec<(Vec<&str>, Vec<&str>)> = modes
            .iter()
            .map(|mode| {
                (mode.failed.iter().map(String::as_str).collect(), mode.runs.iter().map(String::as_str).collect())
            })
            .collect();
        assert_eq!(plain, [(vec!["a", "b"], vec!["k-1", "k-3"]), (vec![], vec!["k-2"]), (vec!["a"], vec!["k-5"])]);
        assert_eq!(modes[0].share, wilson(2, 4).expect("four runs"));
        // As one scene they are worth fewer runs than they are: the share stays, and its interval is wider.
        let scenes = [("k-1", 1), ("k-3", 1), ("k-2", 2), ("k-5", 2)].map(|(run, scene)| (run.to_owned(), scene));
        let alike = failure_modes(&rows, &scenes.into()).expect("a table");
        let (alone, alike) = (modes[0].share, alike[0].share);
        assert!(alike.rate == alone.rate && alike.low < alone.low && alike.high > alone.high, "{alike:?} {alone:?}");
        assert!(failure_modes(&[], &BTreeMap::new()).expect("an empty table").is_empty());
        assert!(failure_modes(&rows[7..9], &BTreeMap::new()).expect("an empty table").is_empty());
    }
}
