//! Prepares a campaign, makes its runs and writes them to the history; replays, shrinks and rechecks stored runs.
//!
//! Never: prints, reads the command line or a system clock, or depends on the internals of a stage.

mod replay;

mod budget;
mod case;
mod changes;
mod difference;
mod environment;
mod export;
mod judging;
mod last_failed;
mod line;
mod make_run;
pub mod oracles;
mod outcome;
mod recheck;
mod requirement;
mod resume;
mod rule_set;
mod run_all;
mod scene_facts;
mod schedule;
mod search_space;
mod searching;
pub mod shrink;
mod solids;

pub use replay::{Fit, Misfit, MisfitKind, OutcomeChange, Recalled, Replay, replay_all};

pub use budget::Spent;
pub use case::{CaseRun, run_cases};
pub use changes::{Change, ChangeKind, changes};
pub use difference::{Difference, first_difference};
pub use environment::Env;
pub use export::{export, regressions_folder};
pub use last_failed::LastFailed;
pub use line::{Clock, Disturbance, Failure, Manner, run_line, run_sabotaged};
pub use outcome::{CampaignEnd, Ending, WeightedRate};
pub use recheck::{RecheckEnd, RecheckOptions, recheck};
pub use resume::{Kept, unfinished};
pub use rule_set::RuleSet;
pub use run_all::{Options, resume_all, run_all};
pub use schedule::{Planned, Schedule, Steering, Told, ToldOutcome, schedule_of};
