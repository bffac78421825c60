//! Weighted failure rates of a guided search. Raw counts of its runs are not failure rates.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::table::ruled;
use crate::{CampaignSummary, Share};
use actcheck_analysis::Interval;

/// A guided search that chose a campaign's scenes; counts of its runs are not failure rates.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedSearch {
    /// Name of the strategy.
    pub strategy: String,
    /// How often each property of each test fails. Empty if there are too few runs.
    pub lines: Vec<WeightedLine>,
}

/// How often a property fails in scenes sampled as configured.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedLine {
    /// Names of the test's actions, separated by spaces.
    pub test: String,
    /// IRI of the property.
    pub property: String,
    /// Its label.
    pub label: String,
    /// Proportion of scenes in which it fails, with its 95 % interval.
    pub failing: Interval,
    /// Number of scenes that the estimate uses: those of complete generations.
    pub scenes: u64,
    /// Failed runs of all runs of the test. Not a rate, because the search prefers failures.
    pub raw: Option<Share>,
}

impl CampaignSummary {
    /// Failed runs of all runs of a test, for one property. Returns `None` if the test has no runs.
    pub fn raw_failures(&self, test: &str, property: &str) -> Option<Share> {
        let own: Vec<_> = self.runs.iter().filter(|run| run.test == test).collect();
        let failed = own.iter().filter(|run| run.failed_property(property)).count() as u64;
        Share::new(failed, own.len() as u64)
    }
}

/// Writes the weighted rates next to the raw counts. Writes nothing if scenes were sampled at random.
pub(super) fn weighted_text(out: &mut String, summary: &CampaignSummary) {
    let Some(GuidedSearch { strategy, lines }) = &summary.search else { return };
    let _ = writeln!(
        out,
        "scenes chosen by {strategy} search, which looks for failures: counts and shares of these runs are not failure rates"
    );
    if lines.is_empty() {
        let _ = writeln!(out, "no generation of scenes is complete, so there are no weighted rates\n");
        return;
    }
    let mut table = ruled();
    table.force_no_tty();
    table.set_header([
        "test",
        "property",
        "fails in scenes as configured [95 % interval]",
        "runs that failed (not a rate)",
    ]);
    for line in lines {
        let [rate, low, high] = [line.failing.rate, line.failing.low, line.failing.high].map(|share| share * 100.0);
        let failing = format!("{rate:.1} % [{low:.1}–{high:.1}] (weighted, {} scenes)", line.scenes);
        let raw = line.raw.map_or_else(String::new, |raw| format!("{} of {}", raw.count, raw.of));
        table.add_row([line.test.clone(), line.label.clone(), failing, raw]);
    }
    let _ = writeln!(out, "{table}\n");
}

/// Returns the weighted rates as JSON, or `null` if scenes were sampled at random.
pub(super) fn weighted_json(summary: &CampaignSummary) -> Value {
    let Some(GuidedSearch { strategy, lines }) = &summary.search else { return Value::Null };
    let line = |line: &WeightedLine| {
        json!({
            "test": line.test, "property": line.property, "label": line.label,
            "rate": line.failing.rate, "low": line.failing.low, "high": line.failing.high, "scenes": line.scenes,
            "raw_failed": line.raw.map(|raw| raw.count), "raw_runs": line.raw.map(|raw| raw.of),
        })
    };
    json!({
        "strategy": strategy, "counts_are_rates": false,
        "weighted_failure_rates": lines.iter().map(line).collect::<Vec<_>>(),
    })
}
