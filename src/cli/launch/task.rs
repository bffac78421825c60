//! One shard: begins or resumes it, so that it may be started any number of times.

use std::io::Read as _;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use crate::launch::LaunchTaskArgs;
use crate::launch::plan::Plan;
use crate::{output, run, stop};
use actcheck_analysis::Mirror;
use actcheck_base::{Diagnostic, Diagnostics, Shard, program_digest};
use actcheck_history::History;

/// Time in which an earlier process of the same shard must have ended.
const WAIT: Duration = Duration::from_secs(120);
const INTERVAL: Duration = Duration::from_millis(500);

/// Exit code if another process runs the shard. Unlike 2, a later start may succeed.
pub const BUSY: u8 = 75;

/// How far a shard is.
enum State {
    /// It has no campaign yet.
    New,
    /// Its campaign lacks runs.
    Begun(String),
    /// Its campaign is complete.
    Done(String),
}

/// Begins or resumes a shard. Returns 0 when it is complete, whether or not a property failed.
pub fn task(args: &LaunchTaskArgs) -> Result<u8, Diagnostics> {
    if args.with_parent {
        thread::spawn(end_with_parent);
    }
    let plan = Plan::read(&args.folder)?;
    plan.check_plain()?;
    let shard = plan.shard(args.number).ok_or_else(|| {
        Diagnostic::error(
            "X073",
            format!(
                "the launch has {} shards, and no shard {}",
                plan.shards, args.number
            ),
        )
        .help("name a number from 1 to that")
    })?;
    match alone(&plan, shard) {
        Err(faults) if is_open_elsewhere(&faults) => {
            output::print_diagnostics(&faults);
            Ok(BUSY)
        }
        Err(faults) => {
            let text: String = faults
                .iter()
                .map(|fault| format!("{}: {}\n", fault.code, fault.message))
                .collect();
            // The exit code says it too.
            let _ = plan
                .below()
                .write_atomic(&plan.fault_file(args.number), text.as_bytes());
            Err(faults)
        }
        done => done,
    }
}

/// Runs a shard that no other process runs.
fn alone(plan: &Plan, shard: Shard) -> Result<u8, Diagnostics> {
    if plan.program != program_digest() {
        let message = "this is not the version of actcheck that planned the launch";
        let help =
            "use the same program everywhere, or remove the folder of the launch and launch again";
        return Err(Diagnostic::error("X082", message).help(help).into());
    }
    let number = shard.number();
    let Some(_held) = plan.hold(number, WAIT)? else {
        return Ok(BUSY);
    };
    let dir = plan.shard_dir(number);
    let mut options = plan.run_args(&dir);
    match state(&dir)? {
        State::Done(_) => {}
        State::Begun(id) => {
            (options.resume, options.runs, options.seed) = (Some(id), None, None);
            run::run(&options).and_then(ended)?;
        }
        State::New => {
            options.shard = Some(shard);
            run::run(&options).and_then(ended)?;
        }
    }
    match state(&dir)? {
        State::Done(id) => {
            // The merge takes them over. Tables that are missing are made when they are needed.
            let _ =
                History::open_to_read(&dir).and_then(|history| Mirror::update(&history).map(drop));
            plan.below()
                .write_atomic(&plan.done_file(number), id.as_bytes())
                .map_err(|error| plan.unwritable(&error))?;
            Ok(0)
        }
        State::New | State::Begun(_) => Ok(stop::INTERRUPTED),
    }
}

/// A shard whose properties failed is as complete as any other.
fn ended(code: u8) -> Result<u8, Diagnostics> {
    Ok(if code <= 1 { 0 } else { code })
}

/// The state of a shard's history. Waits until no other process writes it: one that lost its
/// scheduler may live on.
fn state(dir: &Path) -> Result<State, Diagnostics> {
    if !dir.join("VERSION").exists() {
        return Ok(State::New);
    }
    let asked = Instant::now();
    let history = loop {
        match History::open_existing(dir) {
            Ok(history) => break history,
            Err(faults) if asked.elapsed() < WAIT && is_open_elsewhere(&faults) => {
                thread::sleep(INTERVAL)
            }
            Err(faults) => return Err(faults),
        }
    };
    for row in history.campaigns()? {
        if !history.campaign(&row.id)?.shards.is_empty() {
            let is_done = row.ended.is_some() && !row.interrupted;
            return Ok(if is_done {
                State::Done(row.id)
            } else {
                State::Begun(row.id)
            });
        }
    }
    Ok(State::New)
}

fn is_open_elsewhere(faults: &Diagnostics) -> bool {
    faults.iter().any(|fault| fault.code == "H002")
}

/// Ends the process when the parent is gone, and with it the other end of standard input. Stored
/// runs are complete.
fn end_with_parent() {
    let mut rest = Vec::new();
    // An input that can't be read is as good as closed.
    let _ = std::io::stdin().read_to_end(&mut rest);
    std::process::exit(i32::from(stop::INTERRUPTED));
}
