//! Resumes an interrupted campaign: finds it, checks that its inputs are unchanged, and reads its
//! stored runs.
//!
//! A resumed campaign follows the schedule from its beginning. Stored runs are read from the
//! history instead of being made, so that budgets and guided schedules see the same runs in the
//! same order as without the interruption.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::environment::recorded_overrides;
use crate::shrink::SHRUNK;
use crate::{Env, InputChange, RunResult, changes};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_config as config;
use actcheck_history::{CampaignRecord, CampaignRow, FAILED_AGAIN, History, RELATED, RunDetail};
use actcheck_rules::Budget;

/// The stored part of a resumed campaign.
#[derive(Debug, Clone, Default)]
pub struct StoredRuns {
    /// Runs by index.
    pub(super) runs: BTreeMap<u64, RunResult>,
    /// Scenes discarded for them: index of the run, and the reason.
    pub(super) discards: Vec<(u64, String)>,
    /// Wall-clock time that the campaign has taken so far. Unit: seconds.
    pub(super) elapsed_secs: f64,
}

impl StoredRuns {
    /// Creates it from the runs of the history.
    pub fn of(runs: &[RunDetail]) -> Self {
        let discards = runs.iter().flat_map(|run| {
            run.discards
                .iter()
                .map(|reason| (run.row.index, reason.clone()))
        });
        Self {
            runs: runs
                .iter()
                .map(|run| (run.row.index, RunResult::from_stored(run)))
                .collect(),
            discards: discards.collect(),
            elapsed_secs: runs.iter().map(|run| run.elapsed_secs).fold(0.0, f64::max),
        }
    }
}

/// Returns the campaign to resume: the one with this id, or else the newest unfinished one, of
/// `config` if given.
///
/// # Errors
/// `H014` if there is no such campaign, `X050` if it is finished or none is unfinished.
pub fn unfinished(
    history: &History,
    id: Option<&str>,
    config: Option<&Path>,
) -> Result<CampaignRecord, Diagnostics> {
    if let Some(id) = id {
        let record = history.campaign(id)?;
        let finished = history
            .campaigns()?
            .iter()
            .any(|row| row.id == id && is_finished(row));
        return match finished {
            true => Err(finished_already(id)),
            false if record.name.starts_with(FAILED_AGAIN) || record.name.starts_with(RELATED) => {
                Err(not_resumable(id))
            }
            false => Ok(record),
        };
    }
    for row in history.campaigns()?.iter().rev() {
        let is_made_otherwise = row.name.starts_with(SHRUNK)
            || row.name.starts_with(FAILED_AGAIN)
            || row.name.starts_with(RELATED)
            || row.imported_from.is_some();
        if is_finished(row) || is_made_otherwise {
            continue;
        }
        let record = history.campaign(&row.id)?;
        if config.is_none_or(|config| is_same_file(&config_of(history, &record), config)) {
            return Ok(record);
        }
    }
    let of = config.map_or_else(String::new, |config| format!(" of {}", config.display()));
    Err(Diagnostic::error(
        "X050",
        format!(
            "the history `{}` has no unfinished campaign{of}",
            history.dir().display()
        ),
    )
    .help("`actcheck run CONFIG` begins one; `--history DIR` selects another history")
    .into())
}

fn is_finished(row: &CampaignRow) -> bool {
    row.ended.is_some() && !row.interrupted
}

fn finished_already(id: &str) -> Diagnostics {
    Diagnostic::error(
        "X050",
        format!("campaign {id} is finished and can't be resumed"),
    )
    .help(format!("`actcheck list --campaign {id}` shows its runs"))
    .into()
}

/// X050: the campaign ran failed runs again, whose schedule is not in its record.
fn not_resumable(id: &str) -> Diagnostics {
    Diagnostic::error(
        "X050",
        format!("campaign {id} ran failed runs again and can't be resumed"),
    )
    .help("run all failed runs again: `actcheck run CONFIG --last-failed`")
    .into()
}

/// The path of a campaign's configuration.
pub(super) fn config_of(history: &History, record: &CampaignRecord) -> PathBuf {
    config::resolve_path(history.dir(), &record.config_path)
}

pub(super) fn is_same_file(one: &Path, other: &Path) -> bool {
    match (std::fs::canonicalize(one), std::fs::canonicalize(other)) {
        (Ok(one), Ok(other)) => one == other,
        _ => one == other,
    }
}

impl Env {
    /// Prepares a campaign for resumption: with the present configuration, ontology, rules and
    /// models, and the command-line overrides with which it began.
    ///
    /// # Errors
    /// As [`Env::prepare`]; `X051` if an input has changed since the campaign began.
    pub fn resume(
        history: &History,
        record: &CampaignRecord,
        rule_budget: Budget,
    ) -> Result<Self, Diagnostics> {
        let mut campaign = config::load(
            &config_of(history, record),
            &recorded_overrides(history, record),
        )?;
        campaign.test_count = Self::scenes_of_a_test(&campaign, record);
        let env = Self::of(campaign, rule_budget)?;
        let now = env.record(
            record.id.clone(),
            record.name.clone(),
            record.started.clone(),
        );
        match changes(record, &now).as_slice() {
            [] => Ok(env),
            changed => Err(changed_since(record, changed)),
        }
    }
}

fn changed_since(record: &CampaignRecord, changed: &[InputChange]) -> Diagnostics {
    let mut faults = Diagnostics::new();
    let gone = |digest: &Option<String>| digest.clone().unwrap_or_else(|| "not there".to_owned());
    for change in changed {
        let (kind, name, was, is) = (
            change.kind.word(),
            &change.name,
            gone(&change.was),
            gone(&change.is),
        );
        faults.push(
            Diagnostic::error(
                "X051",
                format!("campaign {} can't be resumed: the {kind} `{name}` was {was}, is {is}", record.id),
            )
            .help("restore the original, or begin a new campaign: the runs so far stay in the history"),
        );
    }
    faults
}
