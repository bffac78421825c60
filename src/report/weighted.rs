//! What a guided search says of failure rates: raw counts of its runs are none.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::analysis::Interval;
use crate::report::table::ruled;
use crate::report::{CampaignSummary, Share};

/// How a campaign's scenes were chosen, where counts of its runs are no rates.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedSearch {
    /// Name of the strategy.
    pub strategy: String,
    /// How often each property of each test fails; empty where too few runs were made.
    pub lines: Vec<WeightedLine>,
}

/// How often a property fails in scenes as the configuration draws them.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedLine {
    /// Names of the test's actions, joined by a space.
    pub test: String,
    /// IRI of the property.
    pub property: String,
    /// Its label.
    pub label: String,
    /// Share of the scenes in which it fails, with its 95 % interval.
    pub failing: Interval,
    /// Scenes that this is known from: those of whole generations.
    pub scenes: u64,
    /// Runs of the test in which it failed, of all: chosen for failing, so no rate.
    pub raw: Option<Share>,
}

impl CampaignSummary {
    /// Runs of a test in which a property failed, of all its runs.
    pub fn raw_failures(&self, test: &str, property: &str) -> Option<Share> {
        let own: Vec<_> = self.runs.iter().filter(|run| run.test == test).collect();
        let failed = own.iter().filter(|run| run.failed_property(property)).count() as u64;
        Share::new(failed, own.len() as u64)
    }
}

/// The weighted rates beside the raw counts; nothing where scenes were drawn at random.
pub(super) fn weighted_text(out: &mut String, summary: &CampaignSummary) {
    let Some(GuidedSearch { strategy, lines }) = &summary.search else { return };
    let _ = writeln!(
        out,
        "scenes chosen by {strategy} search, which looks for failures: counts and shares of these runs are no rates"
    );
    if lines.is_empty() {
        let _ = writeln!(out, "no generation of scenes is whole, so there are no weighted rates\n");
        return;
    }
    let mut table = ruled();
    table.force_no_tty();
    table.set_header([
        "test",
        "property",
        "fails in scenes as configured [95 % interval]",
        "runs that failed (no rate)",
    ]);
    for line in lines {
        let [rate, low, high] = [line.failing.rate, line.failing.low, line.failing.high].map(|share| share * 100.0);
        let failing = format!("{rate:.1} % [{low:.1}–{high:.1}] (weighted, {} scenes)", line.scenes);
        let raw = line.raw.map_or_else(String::new, |raw| format!("{} of {}", raw.count, raw.of));
        table.add_row([line.test.clone(), line.label.clone(), failing, raw]);
    }
    let _ = writeln!(out, "{table}\n");
}

/// The same as JSON; `null` where scenes were drawn at random.
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
