//! How a campaign ended.

use crate::ExhaustedBudget;
use actcheck_base::Diagnostics;
use actcheck_search::Estimate;

/// The result of a campaign.
#[derive(Debug)]
pub struct CampaignResult {
    /// Why it ended.
    pub ending: Ending,
    /// Number of runs in the history.
    pub committed: u64,
    /// Scenes discarded for the runs in the history: index of the run, and the reason.
    pub discards: Vec<(u64, String)>,
    /// Failure rates of each property of each test; empty if the search is not guided.
    pub rates: Vec<WeightedRate>,
}

/// Failure rate of a property over scenes as the configuration draws them, corrected for the scenes
/// that the search chose.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedRate {
    /// Names of the test's actions, joined by a space.
    pub test: String,
    /// IRI of the property.
    pub property: String,
    /// Share of the scenes in which it fails in at least one action of the test.
    pub failing: Estimate,
    /// Number of scenes in the estimate.
    pub scenes: u64,
}

/// Why a campaign ended.
#[derive(Debug)]
pub enum Ending {
    /// Every planned run was made.
    Finished,
    /// A budget was spent; the runs up to then are in the history.
    Budget(ExhaustedBudget),
    /// It was interrupted.
    Interrupted,
    /// An error stopped it, for example a history that could not be written, or a scene that could
    /// not be built.
    Stopped(Diagnostics),
}
