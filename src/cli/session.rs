//! Prepares `actcheck run`: opens a new campaign, a resumed one, or a case.

use std::path::Path;

use crate::options::HistoryArgs;
use crate::run_args::RunArgs;
use crate::{clock, configurations, history_dir, output, regressions, trust};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::{Env, LastFailed, unfinished};
use actcheck_config as config;
use actcheck_config::Overrides;
use actcheck_history::{ActionDetail, CampaignRecord, History, RunDetail, RunFilter};
use actcheck_report::CaseSummary;
use actcheck_rules::Budget;

/// The kind of work that a configuration describes.
pub enum Opened {
    /// One scene.
    Case(Box<Env>),
    /// A campaign; its regressions have been run.
    Campaign(Box<Session>),
    /// No run of this campaign failed, so `--last-failed` has no runs.
    NoneFailed(String),
}

/// A campaign and its history.
pub struct Session {
    /// The campaign, ready to run.
    pub env: Env,
    /// The history that stores its runs.
    pub history: History,
    /// Its id.
    pub id: String,
    /// Whether it is resumed.
    pub goes_on: bool,
    /// The runs of `--last-failed`, which replace the configuration's schedule.
    pub failed: Option<LastFailed>,
    /// Runs that are in the history already, by index.
    pub kept: Vec<RunDetail>,
    /// The results of the project's cases.
    pub regressions: Vec<CaseSummary>,
}

/// Prints the warnings about a history that a campaign is added to.
fn notices(history: &History) -> Result<(), Diagnostics> {
    let mut warnings = Diagnostics::new();
    history
        .tail_warning()?
        .into_iter()
        .for_each(|warning| warnings.push(warning));
    history
        .clock_warning(&(clock::system().now)())?
        .into_iter()
        .for_each(|warning| warnings.push(warning));
    if !warnings.is_empty() {
        output::print_diagnostics(&warnings);
    }
    Ok(())
}

/// Prepares the campaign or case of the arguments, and runs the project's cases. The results of a
/// resumed campaign include those of the cases that ran before it.
pub fn open(args: &RunArgs, budget: &Budget, jobs: usize) -> Result<Opened, Diagnostics> {
    if args.last_failed {
        return open_failed(args, budget);
    }
    let going_on = args
        .resume
        .as_deref()
        .map(|id| find(args, id))
        .transpose()?;
    let env = match &going_on {
        Some((history, record)) => Env::resume(history, record, budget.clone())?,
        None => {
            let config = args
                .config
                .as_deref()
                .ok_or_else(|| configurations::none_given("run"))?;
            Env::prepare_within(config, &overrides(args), budget.clone())?
        }
    };
    if env.campaign.case.is_some() {
        if !args.trust {
            trust::check_case(&env)?;
        }
        return Ok(Opened::Case(Box::new(env)));
    }
    if going_on.is_none() {
        env.check_starts()?;
    }
    check_shard(&env)?;
    let cases = regressions::prepare(&env, budget)?;
    let (history, resumed) = match going_on {
        Some((history, record)) => (history, Some(record)),
        None => (History::open(&env.campaign.history)?, None),
    };
    notices(&history)?;
    if env.campaign.sync_each_run {
        history.sync_each_run();
    }
    let regressions = regressions::run(cases, &history, resumed.as_ref(), jobs)?;
    let kept = resumed.as_ref().map_or_else(
        || Ok(Vec::new()),
        |campaign| stored(&history, &env, &campaign.id),
    )?;
    let (id, goes_on) = match resumed {
        Some(campaign) => (campaign.id, true),
        None => (
            history.next_campaign_id(&env.revision(), env.campaign.seed)?,
            false,
        ),
    };
    Ok(Opened::Campaign(Box::new(Session {
        env,
        history,
        id,
        goes_on,
        failed: None,
        kept,
        regressions,
    })))
}

/// X083: a shard has none of the campaign's runs.
fn check_shard(env: &Env) -> Result<(), Diagnostics> {
    let Some(shard) = env.campaign.shard.filter(|_| env.runs_to_make() == 0) else {
        return Ok(());
    };
    let message = format!(
        "shard {shard} has no runs: the campaign has only {}",
        env.planned_runs()
    );
    Err(Diagnostic::error("X083", message)
        .help("divide it into fewer shards, or let it have more runs")
        .into())
}

/// Prepares the failed runs of a configuration's last campaign.
fn open_failed(args: &RunArgs, budget: &Budget) -> Result<Opened, Diagnostics> {
    let config = args
        .config
        .as_deref()
        .ok_or_else(|| configurations::none_given("run"))?;
    let loaded = config::load(config, &overrides(args))?;
    if loaded.case.is_some() {
        // A case refuses the option together with all others that don't fit.
        return Ok(Opened::Case(Box::new(Env::prepare_within(
            config,
            &overrides(args),
            budget.clone(),
        )?)));
    }
    let history = History::open_existing(&loaded.history)?;
    if loaded.sync_each_run {
        history.sync_each_run();
    }
    let (env, failed) = LastFailed::find(&history, config, budget.clone())?;
    if failed.is_empty() {
        return Ok(Opened::NoneFailed(failed.campaign));
    }
    let id = history.next_campaign_id(&env.revision(), env.campaign.seed)?;
    let (kept, regressions) = (Vec::new(), Vec::new());
    Ok(Opened::Campaign(Box::new(Session {
        env,
        history,
        id,
        goes_on: false,
        failed: Some(failed),
        kept,
        regressions,
    })))
}

impl Session {
    /// Number of runs to make.
    pub fn runs_to_make(&self) -> u64 {
        self.failed
            .as_ref()
            .map_or_else(|| self.env.runs_to_make(), LastFailed::len)
    }

    /// Writes the beginning of a new campaign, or removes the end of a resumed one.
    pub fn begin(&self, now: String) -> Result<(), Diagnostics> {
        if self.goes_on {
            return self.history.reopen_campaign(&self.id);
        }
        if let Some(failed) = &self.failed {
            return self
                .history
                .begin_campaign(&failed.record(&self.env, self.id.clone(), now));
        }
        let stem = Path::new(&*self.env.campaign.source.name).file_stem();
        let name = stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        self.history
            .begin_campaign(&self.env.record(self.id.clone(), name, now))
    }
}

/// The campaign to resume: the one with the id, or the newest unfinished one if the id is empty.
fn find(args: &RunArgs, id: &str) -> Result<(History, CampaignRecord), Diagnostics> {
    let folder = match (&args.history, &args.config) {
        (Some(folder), _) => Some(folder.clone()),
        (None, Some(config)) => Some(config::load(config, &overrides(args))?.history),
        (None, None) => None,
    };
    let history = history_dir::open(&HistoryArgs { history: folder })?;
    let record = unfinished(
        &history,
        (!id.is_empty()).then_some(id),
        args.config.as_deref(),
    )?;
    Ok((history, record))
}

/// Runs of a campaign that are in the history.
pub fn stored(history: &History, env: &Env, id: &str) -> Result<Vec<RunDetail>, Diagnostics> {
    let rows = history.runs(&RunFilter {
        campaign: Some(id.to_owned()),
        ..RunFilter::default()
    })?;
    let ids: Vec<String> = rows.into_iter().map(|row| row.run).collect();
    let mut kept: Vec<RunDetail> = ids
        .iter()
        .map(|run| history.run(run))
        .collect::<Result<_, _>>()?;
    kept.sort_by_key(|run| run.row.index);
    kept.iter_mut()
        .flat_map(|run| &mut run.actions)
        .for_each(|action| order(action, env));
    Ok(kept)
}

/// Sorts the outcomes of an action as in a new run: in the order of its success properties.
fn order(action: &mut ActionDetail, env: &Env) {
    if let Some(known) = env
        .ontology
        .actions
        .values()
        .find(|known| known.iri == action.action)
    {
        let place = |property: &str| {
            known
                .success_properties
                .iter()
                .position(|iri| iri == property)
        };
        action
            .judgements
            .sort_by_key(|judgement| place(&judgement.property));
    }
}

fn overrides(args: &RunArgs) -> Overrides {
    Overrides {
        runs: args.runs,
        seed: args.seed,
        repeat: args.repeat,
        search: args.strategy,
        shard: args.shard,
        time_secs: args.time,
        until_width: args.until_width,
        max_failures: args.max_failures,
        history: args.history.clone(),
        launcher: None,
    }
}
