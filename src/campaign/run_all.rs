//! Runs a campaign on several workers and commits its runs in the order of the schedule.

use std::collections::{BTreeMap, VecDeque};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

use crate::budget::Tally;
use crate::make_run::{Making, make_run};
use crate::{CampaignEnd, Ending, Env, Kept, Manner, Planned, Schedule, Spent, Told, schedule_of};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_config::Launcher;
use actcheck_history::{History, RunRecord};

/// Maximum time between flushes of the store to disk. Unit: seconds.
const FLUSH_SECS: f64 = 1.0;

/// Maximum number of runs per worker that are made but not stored yet, because an earlier run is missing.
const AHEAD: usize = 4;

/// Options of [`run_all`]. Neither the number of workers nor the clock changes the runs.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Workers, one simulation each.
    pub jobs: usize,
    /// How each run is made.
    pub manner: Manner,
}

/// A planned run and its position in the schedule, from 0.
struct Order {
    place: u64,
    planned: Planned,
}

/// The result of an order.
struct Made {
    place: u64,
    making: Making,
}

/// Makes every run of the schedule, commits each in a transaction of its own, and then calls `on_run`.
///
/// Runs are stored in the order of the schedule, whatever the number of workers: the history always has a prefix of the
/// schedule. Budgets count the runs in the same order, and runs beyond a budget are discarded. `stop`, or the
/// campaign's time limit, ends it after the runs in flight. If `stop` is also the stop flag of the environment's rule
/// budget, long rule evaluations are interrupted too. `on_run` is called only for runs that are in the history.
pub fn run_all(
    env: &Env,
    history: &History,
    campaign: &str,
    options: &Options,
    stop: &AtomicBool,
    on_run: impl FnMut(&RunRecord),
) -> CampaignEnd {
    resume_all(env, (history, Kept::default()), campaign, options, stop, on_run)
}

/// As [`run_all`], for a campaign with runs in the history: these count, but are neither made nor passed to `on_run`
/// again.
pub fn resume_all(
    env: &Env,
    (history, mut kept): (&History, Kept),
    campaign: &str,
    options: &Options,
    stop: &AtomicBool,
    mut on_run: impl FnMut(&RunRecord),
) -> CampaignEnd {
    let jobs = options.jobs.max(1);
    let halt = AtomicBool::new(false);
    let secs = options.manner.clock.secs;
    let began_secs = secs() - kept.elapsed_secs;
    let mut keeper = Keeper::new(env, history, (options.manner, began_secs), &mut on_run);
    keeper.end.discards = std::mem::take(&mut kept.discards);
    let time_up_at = env.campaign.limits.time_secs.map_or(f64::INFINITY, |limit| began_secs + limit);
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(jobs).build() {
        Ok(pool) => pool,
        Err(error) => {
            keeper.stop(Diagnostic::error("X010", format!("workers can't be started: {error}")).into());
            return keeper.end;
        }
    };
    let mut schedule = schedule_of(env);
    let (orders, taken) = channel();
    let (give, made) = channel();
    let taken = Mutex::new(taken);
    pool.in_place_scope(|scope| {
        for _ in 0..jobs {
            let (give, taken, halt) = (give.clone(), &taken, &halt);
            scope.spawn(move |_| {
                work(env, campaign, &options.manner, taken, &give, &|| {
                    stop.load(Ordering::Relaxed) || halt.load(Ordering::Relaxed) || secs() >= time_up_at
                });
            });
        }
        conduct((&mut *schedule, kept.runs), &mut keeper, (&orders, &made), jobs * AHEAD);
        if let (Ending::Interrupted, Some(limit), false) =
            (&keeper.end.ending, env.campaign.limits.time_secs, stop.load(Ordering::Relaxed))
        {
            keeper.end.ending = Ending::Budget(Spent::Time(limit));
        }
        // Runs still being made are no longer needed. Workers end when the channel of orders is closed.
        halt.store(true, Ordering::Relaxed);
        drop(orders);
    });
    keeper.end.rates = schedule.rates();
    keeper.finish()
}

/// One worker: processes orders until the channel is closed.
fn work(
    env: &Env,
    campaign: &str,
    manner: &Manner,
    orders: &Mutex<Receiver<Order>>,
    give: &Sender<Made>,
    stopped: &dyn Fn() -> bool,
) {
    loop {
        let order = orders.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Order { place, planned }) = order else { return };
        let making = if stopped() { Making::Interrupted } else { make_run(env, campaign, &planned, manner) };
        if give.send(Made { place, making }).is_err() {
            return;
        }
    }
}

/// Sends the planned runs to the workers and stores the results in order. `stored` are the runs in the history already.
fn conduct(
    (schedule, mut stored): (&mut dyn Schedule, BTreeMap<u64, Told>),
    keeper: &mut Keeper<'_>,
    (orders, made): (&Sender<Order>, &Receiver<Made>),
    ahead: usize,
) {
    let mut batch = VecDeque::new();
    // Results that arrived before earlier ones of the schedule.
    let mut early = BTreeMap::new();
    let (mut ordered, mut kept) = (0, 0);
    loop {
        if batch.is_empty() && ordered == kept {
            batch = schedule.next_batch(&std::mem::take(&mut keeper.told)).into();
            if batch.is_empty() {
                return;
            }
        }
        while ordered - kept < ahead as u64
            && let Some(planned) = batch.pop_front()
        {
            if let Some(told) = stored.remove(&planned.index) {
                early.insert(ordered, Making::Stored(told));
            } else if orders.send(Order { place: ordered, planned }).is_err() {
                return;
            }
            ordered += 1;
        }
        if let Some(making) = early.remove(&kept) {
            if keeper.keep(making).is_break() {
                return;
            }
            kept += 1;
            continue;
        }
        let Ok(Made { place, making }) = made.recv() else { return };
        early.insert(place, making);
    }
}

/// Writes the runs; nothing else does.
struct Keeper<'a> {
    history: &'a History,
    manner: Manner,
    /// Start of the campaign on the manner's clock, less the time taken before it was interrupted.
    began_secs: f64,
    on_run: &'a mut dyn FnMut(&RunRecord),
    end: CampaignEnd,
    tally: Tally,
    /// Number of latest runs in a row that the program broke by a fault of its own.
    broken_in_a_row: u64,
    /// Limit on `broken_in_a_row`.
    most_broken: Option<u64>,
    /// Summaries of the batch's runs for the schedule.
    told: Vec<Told>,
    flushed_at: f64,
}

impl<'a> Keeper<'a> {
    fn new(
        env: &Env,
        history: &'a History,
        (manner, began_secs): (Manner, f64),
        on_run: &'a mut dyn FnMut(&RunRecord),
    ) -> Self {
        let end = CampaignEnd { ending: Ending::Finished, committed: 0, discards: Vec::new(), rates: Vec::new() };
        let flushed_at = (manner.clock.secs)();
        let most_broken = match &env.campaign.launcher {
            Launcher::Reference => None,
            Launcher::Program(skill) => Some(skill.max_broken),
        };
        let tally = Tally::new(env);
        Self {
            history,
            manner,
            began_secs,
            on_run,
            end,
            tally,
            broken_in_a_row: 0,
            most_broken,
            told: Vec::new(),
            flushed_at,
        }
    }

    /// Stores the next run of the schedule. Breaks if it is the last one.
    fn keep(&mut self, making: Making) -> ControlFlow<()> {
        match making {
            Making::Run(mut record) => {
                record.elapsed_secs = (self.manner.clock.secs)() - self.began_secs;
                if let Err(faults) = self.commit(&record) {
                    self.stop(faults);
                    return ControlFlow::Break(());
                }
                self.end.discards.extend(record.discards.iter().map(|reason| (record.index, reason.clone())));
                (self.on_run)(&record);
                self.count(Told::of(&record))?;
                self.bear(&record)
            }
            Making::Stored(told) => self.count(told),
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

    /// Stops the campaign if the program has broken too many runs in a row. Runs are counted in the order of the
    /// schedule, so that the last one is the same whatever the number of workers. A resumed campaign starts counting
    /// from 0.
    fn bear(&mut self, record: &RunRecord) -> ControlFlow<()> {
        self.broken_in_a_row = if record.program_output.is_some() { self.broken_in_a_row + 1 } else { 0 };
        match self.most_broken {
            Some(most) if self.broken_in_a_row >= most => {
                self.stop(hopeless(most, record).into());
                ControlFlow::Break(())
            }
            _ => ControlFlow::Continue(()),
        }
    }

    /// Counts a run that is in the history.
    fn count(&mut self, told: Told) -> ControlFlow<()> {
        self.end.committed += 1;
        let spent = self.tally.count(&told);
        self.told.push(told);
        match spent {
            Some(spent) => {
                self.end.ending = Ending::Budget(spent);
                ControlFlow::Break(())
            }
            None => ControlFlow::Continue(()),
        }
    }

    fn commit(&mut self, record: &RunRecord) -> Result<(), Diagnostics> {
        self.history.commit(record)?;
        let now = (self.manner.clock.secs)();
        if now - self.flushed_at >= FLUSH_SECS {
            self.flushed_at = now;
            self.history.flush()?;
        }
        Ok(())
    }

    fn stop(&mut self, faults: Diagnostics) {
        self.end.ending = Ending::Stopped(faults);
    }

    fn finish(mut self) -> CampaignEnd {
        if let Err(faults) = self.history.flush()
            && !matches!(self.end.ending, Ending::Stopped(_))
        {
            self.stop(faults);
        }
        self.end.discards.sort();
        self.end
    }
}

/// The error of a campaign whose program broke `most` runs in a row.
fn hopeless(most: u64, last: &RunRecord) -> Diagnostic {
    let reason = last.reason.as_deref().unwrap_or_default();
    let runs = if most == 1 { "a run was".to_owned() } else { format!("{most} runs in a row were") };
    let message = format!("{runs} broken by the program that performs actions; the last one, {}: {reason}", last.id);
    Diagnostic::error("S033", message).help(format!(
        "`actcheck show {}` shows its output; `[skill] max_broken` is the allowed number of such runs in a row",
        last.id
    ))
}
