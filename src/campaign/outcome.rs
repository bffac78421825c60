//! How a campaign ended.

use crate::base::Diagnostics;
use crate::campaign::Spent;
use crate::search::Estimate;

/// What there is to say when no more runs come.
#[derive(Debug)]
pub struct CampaignEnd {
    /// Why there are no more.
    pub ending: Ending,
    /// Runs that are in the history.
    pub committed: u64,
    /// Scenes that could not be used for the runs that are in the history, with the reason, by index of the run.
    pub discards: Vec<(u64, String)>,
    /// Of a guided search: how often each property of each test fails.
    pub rates: Vec<WeightedRate>,
}

/// How often a property fails in scenes as the configuration draws them, whichever a search looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedRate {
    /// Names of the test's actions, joined by a space.
    pub test: String,
    /// IRI of the property.
    pub property: String,
    /// Share of the scenes in which it fails in at least one action of the test.
    pub failing: Estimate,
    /// Scenes that this is known from.
    pub scenes: u64,
}

/// Why a campaign ended.
#[derive(Debug)]
pub enum Ending {
    /// Every planned run was made.
    Finished,
    /// A budget was spent; its runs up to there are in the history.
    Budget(Spent),
    /// Somebody asked it to stop.
    Interrupted,
    /// The history could not be written, or no scene could be built.
    Stopped(Diagnostics),
}
