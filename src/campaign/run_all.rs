//! Runs a campaign on several workers and commits each run as it comes.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use crate::base::{Choices, Diagnostic, Diagnostics};
use crate::campaign::line::crashed;
use crate::campaign::{CampaignEnd, Ending, Env, Failure, Manner, run_line};
use crate::history::{History, RunRecord};

/// Scenes drawn for one run before the campaign is given up.
///
/// A space of which one scene in five can be built leaves a run without one once in 70,000 runs.
const SCENES_PER_RUN: u64 = 50;

/// The store is brought to the disk at least this often. Unit: seconds.
const FLUSH_SECS: f64 = 1.0;

/// How a campaign is run. The number of workers and the clock change nothing of what comes out.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Workers, one simulation each.
    pub jobs: usize,
    /// How each run is made.
    pub manner: Manner,
}

/// What a worker sends.
enum Message {
    Run(Box<RunRecord>),
    Discard(u64, String),
    Impossible(Diagnostics),
}

/// Makes every planned run, commits each in a transaction of its own, and then tells `on_run` of it.
///
/// `stop` ends the campaign after the runs in flight; where it is the stop of the environment's budget too, a run whose
/// rules take long is given up. A run is told only when it is in the history.
pub fn run_all(
    env: &Env,
    history: &History,
    campaign: &str,
    options: &Options,
    stop: &AtomicBool,
    mut on_run: impl FnMut(&RunRecord),
) -> CampaignEnd {
    let jobs = options.jobs.max(1);
    let next = AtomicU64::new(0);
    let halt = AtomicBool::new(false);
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(jobs).build() {
        Ok(pool) => pool,
        Err(error) => return nothing_done(Diagnostic::error("X010", format!("workers can't be started: {error}"))),
    };
    let (sender, receiver) = sync_channel(jobs * 2);
    pool.in_place_scope(|scope| {
        for _ in 0..jobs {
            let sender = sender.clone();
            let (next, halt) = (&next, &halt);
            scope.spawn(move |_| {
                work(
                    env,
                    campaign,
                    options,
                    next,
                    &|| stop.load(Ordering::Relaxed) || halt.load(Ordering::Relaxed),
                    &sender,
                );
            });
        }
        // The workers hold the only senders now: the receiver ends when they do.
        drop(sender);
        let mut end = collect(history, options, receiver, &halt, &mut on_run);
        if matches!(end.ending, Ending::Finished) && end.committed < env.planned_runs() {
            end.ending = Ending::Interrupted;
        }
        end
    })
}

fn nothing_done(fault: Diagnostic) -> CampaignEnd {
    CampaignEnd { ending: Ending::Stopped(fault.into()), committed: 0, discards: Vec::new() }
}

/// One worker: takes the next index until there is none.
fn work(
    env: &Env,
    campaign: &str,
    options: &Options,
    next: &AtomicU64,
    stopped: &dyn Fn() -> bool,
    sender: &SyncSender<Message>,
) {
    while !stopped() {
        let index = next.fetch_add(1, Ordering::Relaxed);
        if index >= env.planned_runs() {
            return;
        }
        for message in make_run(env, campaign, index, options) {
            if sender.send(message).is_err() {
                return;
            }
        }
    }
}

/// The run of an index, after the scenes that had to be discarded for it.
fn make_run(env: &Env, campaign: &str, index: u64, options: &Options) -> Vec<Message> {
    let mut messages = Vec::new();
    for attempt in 0..SCENES_PER_RUN {
        // Attempts have streams of their own, so that a discard moves no other run's decisions.
        let choices = || Choices::random(env.campaign.seed, index | (attempt << 48));
        let made = catch_unwind(AssertUnwindSafe(|| run_line(env, campaign, index, choices(), &options.manner)));
        match made {
            Ok(Ok(record)) => {
                messages.push(Message::Run(Box::new(record)));
                return messages;
            }
            Ok(Err(Failure::Discard(reason))) => messages.push(Message::Discard(index, reason)),
            Ok(Err(Failure::Interrupted)) => return messages,
            Err(panic) => {
                let reason = format!("simulation crashed: {}", panic_text(panic.as_ref()));
                let redone = catch_unwind(AssertUnwindSafe(|| crashed(env, campaign, index, choices(), &reason)));
                messages.push(match redone {
                    Ok(Some(record)) => Message::Run(Box::new(record)),
                    _ => Message::Impossible(Diagnostic::error("S031", reason).into()),
                });
                return messages;
            }
        }
    }
    let last = messages.iter().rev().find_map(|message| match message {
        Message::Discard(_, reason) => Some(reason.clone()),
        _ => None,
    });
    let fault = Diagnostic::error(
        "S030",
        format!(
            "no scene could be built for run {} in {SCENES_PER_RUN} draws; the last one: {}",
            index + 1,
            last.unwrap_or_default()
        ),
    )
    .at(&env.campaign.source, 0..0)
    .help("put fewer objects on the surface (`[surfaceObjects] count`), smaller ones, or a larger surface");
    messages.push(Message::Impossible(fault.into()));
    messages
}

/// What a panic said.
pub(super) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}

/// Commits what comes in; the only place that writes.
fn collect(
    history: &History,
    options: &Options,
    receiver: Receiver<Message>,
    halt: &AtomicBool,
    on_run: &mut dyn FnMut(&RunRecord),
) -> CampaignEnd {
    let mut end = CampaignEnd { ending: Ending::Finished, committed: 0, discards: Vec::new() };
    let mut flushed_at = (options.manner.clock.secs)();
    for message in receiver {
        let result = match message {
            Message::Discard(index, reason) => {
                end.discards.push((index, reason));
                Ok(())
            }
            Message::Impossible(faults) => Err(faults),
            // After a fault the remaining messages are only drained, so that no worker waits for ever.
            Message::Run(_) if halt.load(Ordering::Relaxed) => Ok(()),
            Message::Run(record) => history.commit(&record).map(|()| {
                end.committed += 1;
                on_run(&record);
            }),
        };
        let result = result.and_then(|()| {
            let now = (options.manner.clock.secs)();
            if now - flushed_at < FLUSH_SECS || halt.load(Ordering::Relaxed) {
                return Ok(());
            }
            flushed_at = now;
            history.flush()
        });
        if let Err(faults) = result {
            halt.store(true, Ordering::Relaxed);
            if !matches!(end.ending, Ending::Stopped(_)) {
                end.ending = Ending::Stopped(faults);
            }
        }
    }
    if let Err(faults) = history.flush()
        && !matches!(end.ending, Ending::Stopped(_))
    {
        end.ending = Ending::Stopped(faults);
    }
    end.discards.sort();
    end
}
