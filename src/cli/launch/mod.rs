//! `actcheck launch`: runs the shards of a campaign side by side, here or where a scheduler starts
//! them, and merges them into one history.
//!
//! Never: runs a scene itself. Each shard is `actcheck run --shard` in a process of its own.

mod args;
mod finish;
mod follow;
mod kubernetes;
mod local;
mod lost;
mod plan;
mod ray;
mod record;
mod resources;
mod scheduler;
mod slurm;
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
use resources::Resources;
use scheduler::{Place, Scheduler};

/// Runs a campaign in shards, merges them and prints its results. Returns the exit code.
pub fn launch(args: &LaunchArgs) -> Result<u8, Diagnostics> {
    // Once shards run, an interrupt must end them too.
    let has_shards = Arc::new(AtomicBool::new(false));
    let is_started = Arc::clone(&has_shards);
    let stop = stop::on_interrupt(move || {
        if !is_started.load(Ordering::Relaxed) {
            stop::end_now();
        }
    });
    let budget = Budget {
        stop: Arc::clone(&stop),
        ..Budget::default()
    };
    let resources = Resources::parse(&args.resources, args.on)?;
    let env = Env::prepare_within(&args.config, &args.overrides(), budget.clone())?;
    plan::check(&env, args.shards)?;
    let cores = u64::try_from(all_cores()).unwrap_or(1);
    let at_once = args.jobs.map_or(cores, u64::from).min(args.shards).max(1);
    let jobs = match args.on {
        On::Local => resources.cpus.unwrap_or((cores / at_once).max(1)),
        On::Slurm | On::Kubernetes | On::Ray => resources.cpus.unwrap_or(1),
    };
    let mut plan = Plan::new(args, &env, jobs);
    let place = place(args, resources)?;
    let mut scheduler = scheduler_of(args.on, &plan, &place)?;
    if args.dry_run {
        plan.find()?;
        let rest = scheduler.as_deref().map_or_else(
            || plan.commands(),
            |one| follow::dry_run(&plan, &place, one),
        );
        output::print(&(plan.dry_run() + &rest));
        return Ok(0);
    }
    let _alone = plan.enter()?;
    record::check_place(&plan, args.on)?;
    has_shards.store(true, Ordering::Relaxed);
    let are_complete = match &mut scheduler {
        None => local(&plan, at_once, args, &stop)?,
        Some(scheduler) => follow::run_all(&plan, &place, scheduler.as_mut(), args.quiet, &stop)?,
    };
    if !are_complete {
        return Ok(stop::INTERRUPTED);
    }
    finish::finish(args, env, &plan, &budget, &stop)
}

/// How often a shard is started before it is given up: with a scheduler, in each job, and this many
/// jobs.
const TRIES: u32 = 4;

/// Where and how the shards run.
fn place(args: &LaunchArgs, resources: Resources) -> Result<Place, Diagnostics> {
    let folder = std::env::current_dir().map_err(|error| {
        Diagnostic::error(
            "X074",
            format!("the current folder can't be found: {error}"),
        )
        .help("change to another folder")
    })?;
    Ok(Place {
        folder,
        resources,
        parallel: args.jobs.map(u64::from),
        tries: TRIES,
    })
}

/// The scheduler; `None` for processes of this machine.
fn scheduler_of(
    on: On,
    plan: &Plan,
    place: &Place,
) -> Result<Option<Box<dyn Scheduler>>, Diagnostics> {
    Ok(match on {
        On::Local => None,
        On::Slurm => Some(Box::new(slurm::Slurm::new(plan, place)?)),
        On::Kubernetes => Some(Box::new(kubernetes::Kubernetes::new(plan, place)?)),
        On::Ray => Some(Box::new(ray::Ray::new(plan, place)?)),
    })
}

/// Runs the shards here. Returns whether all are complete; otherwise Ctrl-C ended them.
fn local(
    plan: &Plan,
    at_once: u64,
    args: &LaunchArgs,
    stop: &AtomicBool,
) -> Result<bool, Diagnostics> {
    let are_complete = local::run_all(plan, at_once, TRIES, args.quiet, stop)?;
    if !are_complete {
        let help = "finished runs are kept; the same command continues";
        output::print_diagnostics(&Diagnostic::error("X030", "interrupted").help(help).into());
    }
    Ok(are_complete)
}
