//! Pairs of runs: a run of a campaign, and the same scene with a change.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::{History, beside};
use actcheck_base::{Diagnostics, Outcome};

/// Name prefix of campaigns with the second runs of pairs.
pub const RELATED: &str = "related runs of ";

/// Folder of the pairs in a history.
const FOLDER: &str = "relations";

/// The pairs of a campaign.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RelatedRuns {
    /// Id of the campaign.
    pub campaign: String,
    /// Its pairs, in the order in which they were made.
    pub pairs: Vec<RelatedPair>,
}

/// A run, and the run of the same scene with a change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RelatedPair {
    /// Name of the relation.
    pub relation: String,
    /// Id of the first run.
    pub run: String,
    /// Id of the second run; `None` if the scene can't be changed so.
    pub second: Option<String>,
    /// Whether the relation holds.
    pub outcome: Outcome,
    /// Distance from flipping, if the rules have one; positive if passed.
    pub margin: Option<f64>,
    /// Why it holds, does not hold, or does not apply.
    pub witness: String,
}

impl History {
    /// Stores the pairs of a campaign. They replace earlier ones.
    ///
    /// # Errors
    /// `H006` if they can't be written.
    pub fn store_related(&self, related: &RelatedRuns) -> Result<(), Diagnostics> {
        beside::store(self.dir(), &related_file(&related.campaign), related)
    }

    /// Returns the pairs of a campaign, or `None` if there are none.
    ///
    /// # Errors
    /// `H007` if their file is damaged.
    pub fn related(&self, campaign: &str) -> Result<Option<RelatedRuns>, Diagnostics> {
        let help = "remove it, and give `actcheck relate` again";
        beside::read(self.dir(), &related_file(campaign), help)
    }
}

fn related_file(campaign: &str) -> PathBuf {
    PathBuf::from(FOLDER).join(format!("{campaign}.json"))
}
