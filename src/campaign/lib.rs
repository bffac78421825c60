//! Prepares a campaign, makes its runs and writes them to the history; replays, shrinks and
//! rechecks stored runs.
//!
//! Never: prints, reads the command line or a system clock, or depends on the internals of a stage.

mod appearance;
mod attempt;
mod broken_runs;
mod budget;
mod case;
mod changes;
mod cross_check;
mod difference;
mod environment;
mod episode;
mod episode_checks;
mod export;
mod failure;
mod finished_run;
mod forecast;
mod forecast_cup;
mod import;
mod last_failed;
mod line;
mod make_run;
pub mod mining;
mod mjcf;
pub mod oracles;
mod outcome;
mod pictures;
mod plausible;
mod playable;
mod preconditions;
mod recheck;
mod relations;
mod replay;
mod requirement;
mod restore;
mod resume;
mod rule_set;
mod run_all;
mod run_cases;
mod scene_facts;
mod schedule;
mod search_space;
mod searching;
mod setpoints;
pub mod shrink;
mod solids;
mod starts;
mod tally;
mod workers;

pub use actcheck_protocol::LineSink;
pub use actcheck_world::{EngineContact, EngineState, MovedObject, Setpoint};
pub use actcheck_world::{FingerJoint, Proposal, UnknownHand};
pub use appearance::{appearances, stored_robot};
pub use budget::ExhaustedBudget;
pub use changes::{ChangeKind, InputChange, changes, made_by_other_physics, other_physics};
pub use cross_check::{judge_played, mapping_of, rules_of};
pub use difference::TraceDifference;
pub use environment::Env;
pub use episode::EpisodeFile;
pub use episode_checks::{AuditedEpisode, CheckedPremises, audit_episode, check_premises};
pub use export::{export, regressions_folder};
pub use failure::Failure;
pub use import::{ImportEnd, ImportOptions, ImportedCampaign, import, name_of_import};
pub use last_failed::LastFailed;
pub use line::{Clock, Disturbance, RunContext, RunInput, run_line, run_sabotaged};
pub use outcome::{CampaignResult, Ending, WeightedRate};
pub use pictures::{CampaignPictures, RunPicture, RunPictures};
pub use playable::{EngineLink, Playable, PlayableRun, PlayedAction, playable, played_in};
pub use recheck::{RecheckEnd, RecheckOptions, judge_stored, recheck};
pub use relations::{RelateOptions, relate};
pub use replay::{
    Fit, Misfit, MisfitKind, OutcomeChange, Replay, ReplayOptions, StoredCampaign, replay_all,
};
pub use restore::{MayRun, restorer};
pub use resume::{StoredRuns, unfinished};
pub use rule_set::RuleSet;
pub use run_all::{CampaignOptions, resume_all, resume_until, run_all};
pub use run_cases::{CaseRun, run_cases};
pub use schedule::{Planned, PropertyOutcome, RunResult, Schedule, Steering, schedule_of};
pub use solids::proposed_robot;
pub use workers::{on_workers, side_by_side};
