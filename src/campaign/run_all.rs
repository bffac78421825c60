//! Runs a campaign on several workers, which also encode their runs, and writes these in the order
//! of the schedule.

use std::collections::{BTreeMap, VecDeque};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

use crate::broken_runs::BrokenRuns;
use crate::make_run::{MadeRun, Making, make_run};
use crate::tally::Tally;
use crate::workers::workers;
use crate::{
    CampaignResult, Ending, Env, ExhaustedBudget, Planned, RunContext, RunResult, Schedule,
    StoredRuns, schedule_of,
};
use actcheck_base::Diagnostics;
use actcheck_history::{History, RunRecord};

/// Maximum number of runs per worker that are made but not stored yet, because an earlier run is
/// missing.
const AHEAD: usize = 4;

/// Options of [`run_all`]. Neither the number of workers nor the clock changes the runs.
#[derive(Debug, Clone, Copy)]
pub struct CampaignOptions {
    /// Workers, one simulation each.
    pub jobs: usize,
    /// How each run is made.
    pub context: RunContext,
}

/// A planned run and its position in the schedule, from 0.
struct Order {
    position: u64,
    planned: Planned,
}

/// The channels to and from the workers.
struct Channels {
    orders: Sender<Order>,
    made: Receiver<Made>,
}

/// The result of an order.
struct Made {
    position: u64,
    making: Making,
}

/// Makes every run of the schedule, stores each completely or not at all, and then calls `on_run`.
///
/// Runs are stored in the order of the schedule, whatever the number of workers: the history always
/// has a prefix of the schedule. Budgets count the runs in the same order, and runs beyond a budget
/// are discarded. `stop`, or the campaign's time limit, ends it after the runs in flight, which
/// have at most a minute then. If `stop` is also the stop flag of the environment's rule budget,
/// long rule evaluations are interrupted too. `on_run` is called only for runs that are in the
/// history.
pub fn run_all(
    env: &Env,
    history: &History,
    campaign: &str,
    options: &CampaignOptions,
    stop: &AtomicBool,
    on_run: impl FnMut(&RunRecord),
) -> CampaignResult {
    resume_all(
        env,
        history,
        campaign,
        StoredRuns::default(),
        options,
        stop,
        on_run,
    )
}

/// As [`run_all`], for a campaign with runs in the history: these count, but are neither made nor
/// passed to `on_run` again.
pub fn resume_all(
    env: &Env,
    history: &History,
    campaign: &str,
    stored: StoredRuns,
    options: &CampaignOptions,
    stop: &AtomicBool,
    mut on_run: impl FnMut(&RunRecord),
) -> CampaignResult {
    resume_until(env, history, campaign, stored, options, stop, |record| {
        on_run(record);
        ControlFlow::Continue(())
    })
}

/// As [`resume_all`]; `on_run` may end the campaign after the run that it gets, which is the same
/// one for any number of workers.
pub fn resume_until(
    env: &Env,
    history: &History,
    campaign: &str,
    stored: StoredRuns,
    options: &CampaignOptions,
    stop: &AtomicBool,
    mut on_run: impl FnMut(&RunRecord) -> ControlFlow<ExhaustedBudget>,
) -> CampaignResult {
    let jobs = options.jobs.max(1);
    history.use_threads(jobs);
    let halt = AtomicBool::new(false);
    let clock = options.context.clock;
    // Less the time taken before it was interrupted.
    let began_secs = (clock.secs)() - stored.elapsed_secs;
    let mut writer = RunWriter::new(env, history, &mut on_run);
    writer.end.discards = stored.discards;
    let time_up_at = env
        .campaign
        .limits
        .time_secs
        .map_or(f64::INFINITY, |limit| began_secs + limit);
    let pool = match workers(jobs) {
        Ok(pool) => pool,
        Err(faults) => {
            writer.stop(faults);
            return writer.end;
        }
    };
    let mut schedule = schedule_of(env);
    let (orders, taken) = channel();
    let (give, made) = channel();
    let (channels, taken) = (Channels { orders, made }, Mutex::new(taken));
    pool.in_place_scope(|scope| {
        for _ in 0..jobs {
            let (give, taken, halt) = (give.clone(), &taken, &halt);
            scope.spawn(move |_| {
                work(
                    (env, campaign, began_secs),
                    &options.context,
                    taken,
                    &give,
                    &|| {
                        stop.load(Ordering::Relaxed)
                            || halt.load(Ordering::Relaxed)
                            || (clock.secs)() >= time_up_at
                    },
                );
            });
        }
        conduct(
            &mut *schedule,
            stored.runs,
            &mut writer,
            &channels,
            jobs * AHEAD,
        );
        if let (Ending::Interrupted, Some(limit), false) = (
            &writer.end.ending,
            env.campaign.limits.time_secs,
            stop.load(Ordering::Relaxed),
        ) {
            writer.end.ending = Ending::Budget(ExhaustedBudget::Time(limit));
        }
        // Runs still being made are no longer needed. Workers end when the channel of orders is
        // closed.
        halt.store(true, Ordering::Relaxed);
        drop(channels);
    });
    writer.end.rates = schedule.rates();
    writer.finish()
}

/// One worker: processes orders until the channel is closed.
fn work(
    (env, campaign, began_secs): (&Env, &str, f64),
    context: &RunContext,
    orders: &Mutex<Receiver<Order>>,
    give: &Sender<Made>,
    stopped: &dyn Fn() -> bool,
) {
    loop {
        let order = orders.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Order { position, planned }) = order else {
            return;
        };
        let making = if stopped() {
            Making::Interrupted
        } else {
            make_run(env, campaign, began_secs, planned, context)
        };
        if give.send(Made { position, making }).is_err() {
            return;
        }
    }
}

/// Sends the planned runs to the workers and stores the results in order. `stored` are the runs in
/// the history already.
fn conduct(
    schedule: &mut dyn Schedule,
    mut stored: BTreeMap<u64, RunResult>,
    writer: &mut RunWriter<'_>,
    channels: &Channels,
    ahead: usize,
) {
    let mut batch = VecDeque::new();
    // Results that arrived before earlier ones of the schedule.
    let mut early = BTreeMap::new();
    let (mut ordered, mut kept) = (0, 0);
    loop {
        if batch.is_empty() && ordered == kept {
            batch = schedule
                .next_batch(&std::mem::take(&mut writer.results))
                .into();
            if batch.is_empty() {
                return;
            }
        }
        while ordered - kept < ahead as u64
            && let Some(planned) = batch.pop_front()
        {
            if let Some(result) = stored.remove(&planned.index) {
                early.insert(ordered, Making::Stored(result));
            } else if channels
                .orders
                .send(Order {
                    position: ordered,
                    planned,
                })
                .is_err()
            {
                return;
            }
            ordered += 1;
        }
        if let Some(making) = early.remove(&kept) {
            if writer.write(making).is_break() {
                return;
            }
            kept += 1;
            continue;
        }
        let Ok(Made { position, making }) = channels.made.recv() else {
            return;
        };
        early.insert(position, making);
    }
}

/// Takes each run that is in the history, and may end the campaign after it.
type OnRun<'a> = dyn FnMut(&RunRecord) -> ControlFlow<ExhaustedBudget> + 'a;

/// Writes the runs in the order of the schedule, and decides when the campaign ends.
struct RunWriter<'a> {
    history: &'a History,
    on_run: &'a mut OnRun<'a>,
    end: CampaignResult,
    tally: Tally,
    broken: BrokenRuns,
    /// Summaries of the batch's runs for the schedule.
    results: Vec<RunResult>,
}

impl<'a> RunWriter<'a> {
    fn new(env: &Env, history: &'a History, on_run: &'a mut OnRun<'a>) -> Self {
        let end = CampaignResult {
            ending: Ending::Finished,
            committed: 0,
            discards: Vec::new(),
            rates: Vec::new(),
        };
        let tally = Tally::new(env);
        Self {
            history,
            on_run,
            end,
            tally,
            broken: BrokenRuns::new(&env.campaign.launcher),
            results: Vec::new(),
        }
    }

    /// Stores the next run of the schedule. Breaks if it is the last one.
    fn write(&mut self, making: Making) -> ControlFlow<()> {
        match making {
            Making::Run(made) => {
                let MadeRun { record, entry } = *made;
                if let Err(faults) = self.history.write(&entry) {
                    self.stop(faults);
                    return ControlFlow::Break(());
                }
                self.end.discards.extend(
                    record
                        .discards
                        .iter()
                        .map(|reason| (record.index, reason.clone())),
                );
                let spent = (self.on_run)(&record).break_value();
                self.count(RunResult::of(&record))?;
                if let Some(spent) = spent {
                    self.end.ending = Ending::Budget(spent);
                    return ControlFlow::Break(());
                }
                match self.broken.count(&record, self.history.dir()) {
                    Some(fault) => {
                        self.stop(fault.into());
                        ControlFlow::Break(())
                    }
                    None => ControlFlow::Continue(()),
                }
            }
            Making::Stored(result) => {
                self.broken.resume();
                self.count(result)
            }
            Making::Interrupted => {
                self.end.ending = Ending::Interrupted;
                ControlFlow::Break(())
            }
            Making::Impossible(faults) => {
                self.stop(faults);
                ControlFlow::Break(())
            }
        }
    }

    /// Counts a run that is in the history.
    fn count(&mut self, result: RunResult) -> ControlFlow<()> {
        self.end.committed += 1;
        let spent = self.tally.count(&result);
        self.results.push(result);
        match spent {
            Some(spent) => {
                self.end.ending = Ending::Budget(spent);
                ControlFlow::Break(())
            }
            None => ControlFlow::Continue(()),
        }
    }

    fn stop(&mut self, faults: Diagnostics) {
        self.end.ending = Ending::Stopped(faults);
    }

    fn finish(mut self) -> CampaignResult {
        if let Err(faults) = self.history.flush()
            && !matches!(self.end.ending, Ending::Stopped(_))
        {
            self.stop(faults);
        }
        self.end.discards.sort();
        self.end
    }
}
