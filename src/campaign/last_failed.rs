//! Runs the failed runs of a configuration's last campaign again.
//!
//! Their choices are those of the history; configuration, ontology, rules, models and skills are
//! the present ones. The new runs form a campaign of their own, which statistics leave out: its
//! scenes were selected because they failed.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::attempt::{Attempt, time_limit};
use crate::finished_run::{FinishedRun, RunPlace};
use crate::resume::{config_of, is_same_file};
use crate::shrink::SHRUNK;
use crate::workers::workers;
use crate::{CampaignOptions, CampaignResult, Ending, Env};
use actcheck_base::{Diagnostic, Diagnostics, Outcome};
use actcheck_config as config;
use actcheck_config::Overrides;
use actcheck_data::{Choice, Choices};
use actcheck_history::{
    CampaignRecord, FAILED_AGAIN, History, RELATED, Repetition, RunFilter, RunRecord,
};
use actcheck_rules::Budget;
use actcheck_search::Strategy;

/// The failed runs of a campaign, ready to be run again.
#[derive(Debug)]
pub struct LastFailed {
    /// Id of the campaign.
    pub campaign: String,
    runs: Vec<FailedRun>,
}

#[derive(Debug)]
struct FailedRun {
    id: String,
    /// An index in the present configuration with the same test.
    index: u64,
    repetition: Option<Repetition>,
    choices: Vec<Choice>,
}

impl LastFailed {
    /// Finds the newest campaign of a configuration in a history, and its runs in which a property
    /// failed; prepares the configuration to run them again. Campaigns that ran failed runs again
    /// count; shrunk runs don't.
    ///
    /// # Errors
    /// `X038` if the history has no campaign of the configuration, `S040` if the configuration no
    /// longer has the test of a failed run; else as [`Env::prepare`].
    pub fn find(
        history: &History,
        config: &Path,
        rule_budget: Budget,
    ) -> Result<(Env, Self), Diagnostics> {
        let record = last_campaign(history, config)?;
        let overrides = Overrides {
            seed: Some(record.seed),
            history: Some(history.dir().to_path_buf()),
            ..Overrides::default()
        };
        let mut campaign = config::load(config, &overrides)?;
        // The runs are given: neither a strategy nor a budget of the campaign chooses them.
        campaign.search = Strategy::Random;
        (campaign.test_count, campaign.repeat, campaign.shard) = (1, 1, None);
        let limits = &mut campaign.limits;
        (limits.time_secs, limits.until_width, limits.max_failures) = (None, None, None);
        let env = Env::of(campaign, rule_budget)?;
        let runs = failed_runs(history, &env, &record.id)?;
        Ok((
            env,
            Self {
                campaign: record.id,
                runs,
            },
        ))
    }

    /// Number of failed runs.
    pub fn len(&self) -> u64 {
        self.runs.len() as u64
    }

    /// Whether no run failed.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// The record of the new campaign.
    pub fn record(&self, env: &Env, id: String, started: String) -> CampaignRecord {
        let mut record = env.record(id, format!("{FAILED_AGAIN}{}", self.campaign), started);
        record.planned_runs = self.len();
        record
    }

    /// Makes the runs again on several workers, stores them in the campaign `id` in their old
    /// order, numbered from 1, and then calls `on_run`. `stop` ends it after the runs in flight.
    ///
    /// Returns also the faults (`S041`) of runs whose scenes can no longer be built.
    pub fn run(
        &self,
        (env, history, id): (&Env, &History, &str),
        options: &CampaignOptions,
        stop: &AtomicBool,
        mut on_run: impl FnMut(&RunRecord),
    ) -> (CampaignResult, Diagnostics) {
        let mut end = CampaignResult {
            ending: Ending::Finished,
            committed: 0,
            discards: Vec::new(),
            rates: Vec::new(),
        };
        let mut faults = Diagnostics::new();
        let secs = options.context.clock.secs;
        let began_secs = secs();
        let jobs = options.jobs.max(1);
        let pool = match workers(jobs) {
            Ok(pool) => pool,
            Err(fault) => {
                end.ending = Ending::Stopped(fault);
                return (end, faults);
            }
        };
        let make = |run: &FailedRun| {
            let choices = || Choices::recorded(&run.choices);
            let cut = time_limit(env, &options.context);
            let attempt = Attempt {
                campaign: id,
                index: run.index,
                choices: &choices,
                cut,
            };
            attempt.make(env, &options.context)
        };
        let numbered: Vec<(u64, &FailedRun)> = (0..).zip(&self.runs).collect();
        // At most one trace for each worker is in memory.
        for some in numbered.chunks(jobs) {
            if stop.load(Ordering::Relaxed) {
                end.ending = Ending::Interrupted;
                break;
            }
            let made: Vec<_> = pool.install(|| some.par_iter().map(|(_, run)| make(run)).collect());
            for ((number, run), made) in some.iter().zip(made) {
                match made {
                    Ok(made) => {
                        let record = renumbered(made, id, (*number, run), secs() - began_secs);
                        if let Err(found) = history.commit(&record) {
                            end.ending = Ending::Stopped(found);
                            return (end, faults);
                        }
                        end.committed += 1;
                        on_run(&record);
                    }
                    // The evaluation of a rule was interrupted.
                    Err(_) if stop.load(Ordering::Relaxed) => end.ending = Ending::Interrupted,
                    Err(why) => faults.push(unbuildable(&run.id, &why.to_string())),
                }
            }
        }
        if let (Err(found), false) = (history.flush(), matches!(end.ending, Ending::Stopped(_))) {
            end.ending = Ending::Stopped(found);
        }
        (end, faults)
    }
}

fn renumbered(
    made: FinishedRun,
    id: &str,
    (number, run): (u64, &FailedRun),
    elapsed_secs: f64,
) -> RunRecord {
    let place = RunPlace {
        repetition: run.repetition,
        elapsed_secs,
        ..RunPlace::alone(id)
    };
    FinishedRun {
        index: number,
        ..made
    }
    .into_record(place)
}

fn last_campaign(history: &History, config: &Path) -> Result<CampaignRecord, Diagnostics> {
    for row in history
        .campaigns()?
        .iter()
        .rev()
        .filter(|row| !row.name.starts_with(SHRUNK) && !row.name.starts_with(RELATED))
    {
        let record = history.campaign(&row.id)?;
        if is_same_file(&config_of(history, &record), config) {
            return Ok(record);
        }
    }
    let message = format!(
        "the history `{}` has no campaign of {}",
        history.dir().display(),
        config.display()
    );
    Err(Diagnostic::error("X038", message)
        .help("run it once without `--last-failed`; `--history DIR` selects another history")
        .into())
}

/// The runs of a campaign in which a property failed, in order.
fn failed_runs(
    history: &History,
    env: &Env,
    campaign: &str,
) -> Result<Vec<FailedRun>, Diagnostics> {
    let filter = RunFilter {
        campaign: Some(campaign.to_owned()),
        ..RunFilter::default()
    };
    let outcomes = history.outcomes(&filter)?;
    let failed: BTreeSet<&str> = outcomes
        .iter()
        .filter(|row| row.outcome == Outcome::Failed)
        .map(|row| row.run.as_str())
        .collect();
    let rows = history.runs(&filter)?;
    let failed_run = |row: &actcheck_history::RunRow| {
        let choices = history.traces().choices(&row.run)?;
        let index = env.index_of(&row.test, &choices)?;
        Ok(FailedRun {
            id: row.run.clone(),
            index,
            repetition: row.repetition,
            choices,
        })
    };
    rows.iter()
        .filter(|row| failed.contains(row.run.as_str()))
        .map(failed_run)
        .collect()
}

fn unbuildable(run: &str, why: &str) -> Diagnostic {
    Diagnostic::error("S041", format!("run {run} can't be run again: {why}"))
        .help("the configuration, a model or the program changed; `actcheck show` prints the run as it was")
}
