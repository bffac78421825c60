//! What `actcheck run` has in hand before the first run: a new campaign, or one that goes on.

use std::path::Path;

use crate::base::{Diagnostics, digest_of};
use crate::campaign::{Env, unfinished};
use crate::cli::args::{HistoryArgs, RunArgs};
use crate::cli::history_dir;
use crate::config::{self, Overrides};
use crate::history::{ActionDetail, History, RunDetail, RunFilter};
use crate::rules::Budget;

/// A campaign and its history.
pub struct Session {
    /// The campaign, ready to run.
    pub env: Env,
    /// Where its runs are kept.
    pub history: History,
    /// Its id.
    pub id: String,
    /// Runs that are in the history already, by index.
    pub kept: Vec<RunDetail>,
}

/// A new campaign; nothing of it is in the history yet.
pub fn prepare(args: &RunArgs, budget: Budget) -> Result<Session, Diagnostics> {
    // clap asks for a configuration where no campaign is resumed.
    let config = args.config.as_deref().unwrap_or(Path::new(""));
    let env = Env::prepare_within(config, &overrides(args), budget)?;
    let history = History::open(&env.campaign.history)?;
    let id = history.next_campaign_id(&digest_of(&env.campaign.source.text), env.campaign.seed)?;
    Ok(Session { env, history, id, kept: Vec::new() })
}

/// A campaign that goes on: the one with an id, or the newest unfinished one.
pub fn resume(args: &RunArgs, id: Option<&String>, budget: Budget) -> Result<Session, Diagnostics> {
    let folder = match (&args.history, &args.config) {
        (Some(folder), _) => Some(folder.clone()),
        (None, Some(config)) => Some(config::load(config, &overrides(args))?.history),
        (None, None) => None,
    };
    let history = history_dir::open(&HistoryArgs { history: folder })?;
    let record = unfinished(&history, id.map(String::as_str), args.config.as_deref())?;
    let env = Env::resume(&history, &record, budget)?;
    let rows = history.runs(&RunFilter { campaign: Some(record.id.clone()), ..RunFilter::default() })?;
    let mut kept: Vec<RunDetail> = rows.iter().map(|row| history.run(&row.run)).collect::<Result<_, _>>()?;
    kept.iter_mut().flat_map(|run| &mut run.actions).for_each(|action| order(action, &env));
    Ok(Session { env, history, id: record.id, kept })
}

/// Puts the outcomes of an action as a new run has them: in the order of its success properties.
fn order(action: &mut ActionDetail, env: &Env) {
    if let Some(known) = env.ontology.actions.values().find(|known| known.iri == action.action) {
        let place = |property: &str| known.success_properties.iter().position(|iri| iri == property);
        action.judgements.sort_by_key(|judgement| place(&judgement.property));
    }
}

fn overrides(args: &RunArgs) -> Overrides {
    Overrides {
        runs: args.runs,
        seed: args.seed,
        repeat: args.repeat,
        shard: args.shard,
        time_secs: args.time,
        until_width: args.until_width,
        max_failures: args.max_failures,
        history: args.history.clone(),
    }
}

/// What the history calls a campaign: its configuration's file name without the ending.
pub fn name(env: &Env) -> String {
    let stem = Path::new(&*env.campaign.source.name).file_stem();
    stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}
