//! Turns the rules' findings into outcomes with witness and margin, and outcomes into scores and
//! rates.
//!
//! Never: reads a trace, or reduces the six outcomes to pass and fail.

mod action;
mod judge;
mod recurrence;
mod score;
mod wilson;

pub use action::{Interrupted, judge_action};
pub use judge::{Fate, judge, reason_not_to_perform};
pub use recurrence::Recurrence;
pub use score::{Counts, action_score, mean, run_score};
pub use wilson::{Interval, trials_for_width, wilson, wilson_share};
