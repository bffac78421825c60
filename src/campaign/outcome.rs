//! How a campaign ended.

use crate::base::Diagnostics;
use crate::campaign::Spent;

/// What there is to say when no more runs come.
#[derive(Debug)]
pub struct CampaignEnd {
    /// Why there are no more.
    pub ending: Ending,
    /// Runs that are in the history.
    pub committed: u64,
    /// Scenes that could not be used for the runs that are in the history, with the reason, by index of the run.
    pub discards: Vec<(u64, String)>,
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
