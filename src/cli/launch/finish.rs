//! The end of a launch: merges its shards, and prints the campaign as `actcheck run` does.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::launch::LaunchArgs;
use crate::launch::plan::Plan;
use crate::session::{self, Session};
use crate::work::all_cores;
use crate::{clock, output, regressions, run, stop};
use actcheck_analysis::Mirror;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::Env;
use actcheck_history::History;
use actcheck_history::merge::{MergeOptions, carry_out, plan as plan_merge};
use actcheck_rules::Budget;

/// Merges the complete shards into the history, prints the campaign's results and removes the
/// shards. Returns the exit code.
pub(super) fn finish(
    args: &LaunchArgs,
    env: Env,
    plan: &Plan,
    budget: &Budget,
    stop: &Arc<AtomicBool>,
) -> Result<u8, Diagnostics> {
    let cases = regressions::prepare(&env, budget)?;
    let history = History::open(&env.campaign.history)?;
    let Some(id) = merged(plan, &history, stop)? else {
        stop::tell();
        return Ok(stop::INTERRUPTED);
    };
    // The first shard ran the cases; it may have begun later than the others.
    let mut record = history.campaign(&id)?;
    record.started = (clock::system().now)();
    let regressions = regressions::run(cases, &history, Some(&record), all_cores())?;
    let kept = session::stored(&history, &env, &id)?;
    let session = Session {
        env,
        history,
        id,
        goes_on: true,
        failed: None,
        kept,
        regressions,
    };
    let code = run::campaign(&args.of_whole(), session, stop, |_| ())?;
    if code != stop::INTERRUPTED {
        let left = plan.remove().map_err(|error| plan.unwritable(&error))?;
        if let Some(first) = left.first() {
            let message = format!(
                "{} files remain that the launch did not write, the first is `{}`",
                left.len(),
                first.display()
            );
            output::print_diagnostics(
                &Diagnostic::warning("X073", message)
                    .help("move or remove them")
                    .into(),
            );
        }
    }
    Ok(code)
}

/// Merges the shards. Returns the id of the whole campaign, or `None` after an interrupt.
fn merged(
    plan: &Plan,
    history: &History,
    stop: &AtomicBool,
) -> Result<Option<String>, Diagnostics> {
    let mut sources = Vec::new();
    for number in 1..=plan.shards {
        let source = History::open_to_read(&plan.shard_dir(number))?;
        sources.push(source);
    }
    let planned = plan_merge(&sources, Some(history), &MergeOptions::default())?;
    if carry_out(&planned, &sources, history, stop, || ())?.interrupted {
        return Ok(None);
    }
    // Tables that are missing are made when they are needed.
    let _ = Mirror::adopt(&planned, &sources, history);
    let first = format!(
        "{}#{}",
        plan.shard_dir(1).display(),
        plan.done(1).unwrap_or_default()
    );
    let whole = planned
        .campaigns
        .into_iter()
        .find(|campaign| campaign.from.contains(&first));
    let whole = whole.ok_or_else(|| {
        Diagnostic::error(
            "X073",
            format!(
                "the merged history lacks the campaign of shard 1 in `{}`",
                first
            ),
        )
        .help(format!(
            "remove the folder `{}`, and launch again",
            plan.folder.display()
        ))
    })?;
    Ok(Some(whole.id))
}
