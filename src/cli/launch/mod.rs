//! `actcheck launch`: runs the shards of a campaign side by side, and merges them into one history.
//!
//! Never: runs a scene itself. Each shard is `actcheck run --shard` in a process of its own.

mod args;
mod finish;
mod local;
mod plan;
mod task;

use args::On;
pub use args::{LaunchArgs, LaunchTaskArgs};
pub use task::task;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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
    // Once shards run, an interrupt must end them too.
    let has_shards = Arc::new(AtomicBool::new(false));
    let is_started = Arc::clone(&has_shards);
    let stop = stop::on_interrupt(move || {
        if !is_started.load(Ordering::Relaxed) {
            stop::end_now();
        }
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
    has_shards.store(true, Ordering::Relaxed);
    let are_complete = match args.on {
        On::Local => local::run_all(&plan, at_once, args.tries, args.quiet, &stop)?,
    };
    if !are_complete {
        let help = "finished runs are kept; the same command continues";
        output::print_diagnostics(&Diagnostic::error("X030", "interrupted").help(help).into());
        return Ok(stop::INTERRUPTED);
    }
    finish::finish(args, env, &plan, &budget, &stop)
}
