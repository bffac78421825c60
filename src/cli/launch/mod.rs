//! `actcheck launch`: runs the shards of a campaign side by side, and merges them into one history.
//!
//! Never: runs a scene itself. Each shard is `actcheck run --shard` in a process of its own.

mod args;
mod finish;
mod local;
mod plan;
mod task;

pub use args::{LaunchArgs, LaunchTaskArgs};
pub use task::task;

use std::sync::{Arc, OnceLock};

use indicatif::ProgressBar;

use crate::work::all_cores;
use crate::{output, stop};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign::Env;
use actcheck_rules::Budget;
use plan::Plan;

/// Runs a campaign in shards, merges them and prints its results. Returns the exit code.
pub fn launch(args: &LaunchArgs) -> Result<u8, Diagnostics> {
    let cores = u64::try_from(all_cores()).unwrap_or(1);
    let at_once = args.parallel.map_or(cores, u64::from).min(args.shards).max(1);
    let bar = Arc::new(OnceLock::<ProgressBar>::new());
    let shown = Arc::clone(&bar);
    let stop = stop::on_interrupt(move || match shown.get() {
        Some(bar) => bar.println("stopping; Ctrl-C again stops at once"),
        None => stop::end_now(),
    });
    let budget = Budget { stop: Arc::clone(&stop), ..Budget::default() };
    let env = Env::prepare_within(&args.config, &args.overrides(), budget.clone())?;
    plan::check(&env, args.shards)?;
    let plan = Plan::new(args, &env, (cores / at_once).max(1));
    if args.dry_run {
        output::print(&plan.dry_run());
        return Ok(0);
    }
    plan.enter()?;
    let _ = bar.set(ProgressBar::hidden());
    let ended = local::run_all(&plan, at_once, args.tries, args.quiet, &stop);
    if !ended? {
        let help = "finished runs are kept; the same command continues";
        output::print_diagnostics(&Diagnostic::error("X030", "interrupted").help(help).into());
        return Ok(stop::INTERRUPTED);
    }
    finish::finish(args, env, &plan, &budget, &stop)
}
