//! Weighted failure rates of a guided search. Raw counts of its runs are not failure rates.

use crate::{CampaignSummary, Proportion};
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
    pub raw: Option<Proportion>,
}

impl CampaignSummary {
    /// Failed runs of all runs of a test, for one property. Returns `None` if the test has no runs.
    pub fn raw_failures(&self, test: &str, property: &str) -> Option<Proportion> {
        let own: Vec<_> = self.runs.iter().filter(|run| run.test == test).collect();
        let failed = own
            .iter()
            .filter(|run| run.failed_property(property))
            .count() as u64;
        Proportion::new(failed, own.len() as u64)
    }
}
