//! Shards as processes of this machine.

use std::collections::VecDeque;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::launch::lost::lost;
use crate::launch::plan::Plan;
use crate::progress::Progress;
use actcheck_base::{Diagnostic, Diagnostics};

/// Interval between looks at the processes.
const INTERVAL: Duration = Duration::from_millis(100);
/// The shards' folders are counted once in this many looks.
const COUNT_EVERY: u64 = 10;

/// A shard that runs.
struct Running {
    number: u64,
    tries: u32,
    child: Child,
}

/// Runs all incomplete shards, lost ones again. Returns whether all are complete; otherwise Ctrl-C
/// ended them.
///
/// # Errors
/// `X052`, `X074`, `X075` a shard was lost `tries` times; the other shards are complete then.
pub(super) fn run_all(
    plan: &Plan,
    at_once: u64,
    tries: u32,
    quiet: bool,
    stop: &AtomicBool,
) -> Result<bool, Diagnostics> {
    let mut waiting: VecDeque<(u64, u32)> = (1..=plan.shards)
        .filter(|&number| plan.done(number).is_none())
        .map(|number| (number, 0))
        .collect();
    let mut running: Vec<Running> = Vec::new();
    let progress = if quiet {
        Progress::hidden()
    } else {
        Progress::new(plan.planned, None)
    };
    let mut faults = Diagnostics::new();
    let (mut looks, mut again) = (0_u64, 0_u64);
    while !(waiting.is_empty() && running.is_empty()) {
        if stop.load(Ordering::Relaxed) {
            running.into_iter().for_each(|shard| end(shard.child));
            progress.finish();
            return Ok(false);
        }
        while (running.len() as u64) < at_once
            && let Some((number, tried)) = waiting.pop_front()
        {
            running.push(Running {
                number,
                tries: tried + 1,
                child: start(plan, number)?,
            });
        }
        let mut left = Vec::new();
        for mut shard in running {
            match shard
                .child
                .try_wait()
                .map_err(|error| plan.unwritable(&error))?
            {
                None => left.push(shard),
                Some(_) if plan.done(shard.number).is_some() => {}
                Some(_) if shard.tries < tries => {
                    again += 1;
                    waiting.push_back((shard.number, shard.tries));
                }
                Some(_) => {
                    let how = format!("ended {} times before it was complete", shard.tries);
                    faults.push(lost(plan, shard.number, &how));
                }
            }
        }
        running = left;
        if looks.is_multiple_of(COUNT_EVERY) {
            show(&progress, plan, again);
        }
        looks += 1;
        std::thread::sleep(INTERVAL);
    }
    progress.finish();
    faults.or(true)
}

/// Starts the process of a shard. It ends when this process does, for its standard input is a pipe
/// from here.
fn start(plan: &Plan, number: u64) -> Result<Child, Diagnostics> {
    let program = std::env::current_exe().map_err(|error| {
        Diagnostic::error(
            "X052",
            format!("the path of this program can't be found: {error}"),
        )
        .help("start actcheck by its full path")
    })?;
    let log = plan
        .below()
        .append(&plan.log(number))
        .and_then(|log| Ok((log.try_clone()?, log)));
    let (out, errors) = log.map_err(|error| plan.unwritable(&error))?;
    let mut command = Command::new(program);
    command
        .arg("launch-task")
        .arg(&plan.folder)
        .arg(number.to_string())
        .arg("--with-parent");
    command.stdin(Stdio::piped()).stdout(out).stderr(errors);
    // Ctrl-C at the terminal reaches only this process, which then ends the others.
    command
        .process_group(0)
        .spawn()
        .map_err(|error| plan.unwritable(&error))
}

/// Ends a shard's process by closing its standard input.
fn end(mut child: Child) {
    drop(child.stdin.take());
    // Waiting fails only if the process is gone.
    let _ = child.wait();
}

fn show(progress: &Progress, plan: &Plan, again: u64) {
    let lost = if again > 0 {
        format!(", {again} started again")
    } else {
        String::new()
    };
    let bar = progress.bar();
    let done = plan.complete();
    bar.set_message(format!("{}/{} shards{lost}", done.len(), plan.shards));
    bar.set_position(plan.stored_runs(&done).min(plan.planned));
}
