//! Makes the motion of runs whose motion is not kept: simulates them again from their recorded
//! choices.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::attempt::Attempt;
use crate::replay::cut_secs;
use crate::{Env, RunContext, StoredCampaign};
use actcheck_actions::Cut;
use actcheck_base::Diagnostic;
use actcheck_config::Starts;
use actcheck_data::Choices;
use actcheck_history::Restore;

/// Decides whether runs of a campaign, by its id, may be simulated again with the programs that
/// this starts.
pub type MayRun = dyn Fn(&str, &Starts) -> bool + Send + Sync;

/// Returns the function that simulates runs again for `History::restore_with`. `may_run` is asked
/// once for each campaign; `on_start` is called with the id of each run before.
pub fn restorer(
    context: RunContext,
    may_run: Box<MayRun>,
    on_start: impl Fn(&str) + Send + Sync + 'static,
) -> Box<Restore> {
    // Preparing a campaign takes longer than a run.
    let known: Mutex<BTreeMap<String, Option<Arc<StoredCampaign>>>> = Mutex::default();
    Box::new(move |history, run| {
        let detail = history.run(run)?;
        let (choices, was) = history.traces().recorded(run)?;
        let campaign = {
            let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
            match known.get(&detail.row.campaign) {
                Some(campaign) => campaign.clone(),
                None => {
                    let id = &detail.row.campaign;
                    let may = may_run(id, &Env::starts_from_history(history, id)?);
                    let campaign = if may {
                        Some(Arc::new(Env::from_history(history, id, None)?))
                    } else {
                        None
                    };
                    known.insert(id.clone(), campaign.clone());
                    campaign
                }
            }
        };
        let Some(campaign) = campaign else {
            return Ok(None);
        };
        on_start(run);
        let (env, record) = &*campaign;
        let index = env.index_of(&detail.row.test, &choices)?;
        // The wall clock is not part of a run's choices: the run is cut off at the same simulated
        // time.
        let cut = cut_secs(&was).map_or(Cut::Never, |at_secs| Cut::Simulated { at_secs });
        let attempt = Attempt {
            campaign: &record.id,
            index,
            choices: &|| Choices::recorded(&choices),
            cut,
        };
        let made = attempt.make(env, &context).map_err(|why| {
            Diagnostic::error("H031", format!("run {run} can't be simulated again: {why}"))
        })?;
        Ok(Some((made.choices, made.trace)))
    })
}
