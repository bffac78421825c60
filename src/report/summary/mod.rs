//! Plain data that is printed: summaries of campaigns, comparisons, findings and other results,
//! with exit codes.
//!
//! Never: formats a whole report. `text`, `table` and `json` do, each with a file for each summary.

mod campaign;
mod case;
mod compare;
mod engines;
mod findings;
mod health;
mod labels;
mod oracles;
mod recheck;
mod relations;
mod remarks;
mod repeated;
mod review;
mod shrunk;
mod weighted;

#[cfg(test)]
pub(crate) use campaign::tests as campaign_samples;
pub use campaign::{
    ActionSummary, CampaignSummary, EndedBy, PropertyLine, Proportion, RateBounds, RunSummary,
};
pub use case::CaseSummary;
pub use compare::{CompareSummary, ComparedSide, FlipGroup, KnownIssueRuns, SideChange};
pub(crate) use compare::{compared_name, compared_parts};
pub use engines::EngineSummary;
pub use findings::{Causes, FindingsSummary, PropertyReport};
pub(crate) use findings::{percent, quantity_name};
pub use health::HealthSummary;
pub(crate) use labels::label_word;
pub use labels::{LabelSummary, LabelledProperty};
pub use oracles::OracleSummary;
pub(crate) use oracles::notice_word;
pub(crate) use recheck::reason_text;
pub use recheck::{ChangeReason, RecheckChange, RecheckLine, RecheckSummary};
pub(crate) use relations::RelationSummary;
pub use relations::RelationsSummary;
pub use remarks::{Oddity, Remark};
pub use repeated::RepeatedProperty;
pub use review::{Review, ReviewPair, ReviewRun};
pub(crate) use review::{failures_of, outcomes_of};
pub use shrunk::{PassingValue, ShrunkChoice, ShrunkSummary};
pub use weighted::{GuidedSearch, WeightedLine};
