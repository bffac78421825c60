//! Submits the shards of a launch to a scheduler, and follows them until they are complete.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::launch::lost::lost;
use crate::launch::plan::Plan;
use crate::launch::record::Record;
use crate::launch::scheduler::{Job, Look, Place, Scheduler};
use crate::output;
use crate::progress::Progress;
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};

/// Interval between checks for Ctrl-C.
const TICK: Duration = Duration::from_millis(100);
/// Intervals between looks at the folder and the scheduler: short at first, then kind to both.
const SHORTEST: Duration = Duration::from_millis(200);
const LONGEST: Duration = Duration::from_secs(5);
/// Files of other machines are seen this long after the end of a job at the latest.
const GRACE: Duration = Duration::from_secs(5);
/// The time for which a scheduler may not answer.
const PATIENCE: Duration = Duration::from_secs(300);
/// Maximum number of lost shards in messages.
const MOST_NAMED: usize = 10;

/// How following ended.
enum Followed {
    /// The job has ended, or all its shards have.
    Ended,
    Interrupted,
}

/// Follows the launch's job, submits one for shards that were lost, up to `tries` jobs, and returns
/// whether all shards are complete; otherwise Ctrl-C ended it. The job of a scheduler goes on then.
///
/// # Errors
/// `X074`, `X075`, `X077`, `X078`, `X079`.
pub(super) fn run_all(
    plan: &Plan,
    place: &Place,
    scheduler: &mut dyn Scheduler,
    quiet: bool,
    stop: &AtomicBool,
) -> Result<bool, Diagnostics> {
    let progress = if quiet {
        Progress::hidden()
    } else {
        Progress::new(plan.planned, None)
    };
    let done = follow_all(
        plan,
        place,
        scheduler,
        &View {
            progress: &progress,
            quiet,
        },
        stop,
    );
    progress.finish();
    scheduler.end();
    done
}

/// The one progress view.
struct View<'a> {
    progress: &'a Progress,
    quiet: bool,
}

impl View<'_> {
    fn say(&self, sentence: &str) {
        if !self.quiet {
            self.progress.tell(&format!("{sentence}\n"));
        }
    }

    fn warn(&self, fault: Diagnostic) {
        self.progress
            .bar()
            .suspend(|| output::print_diagnostics(&fault.into()));
    }

    fn show(&self, plan: &Plan, title: &str, look: &Look) {
        let done = plan.complete();
        let state = match look {
            Look::Active {
                running: 0,
                waiting: 0,
                ..
            }
            | Look::Ended => String::new(),
            Look::Active {
                running,
                waiting,
                reason,
                ..
            } => {
                let reason = reason
                    .as_ref()
                    .map_or_else(String::new, |reason| format!(" ({reason})"));
                format!(", {running} running, {waiting} waiting{reason}")
            }
            Look::Unanswered(_) => format!(", {title} doesn't answer"),
        };
        let bar = self.progress.bar();
        bar.set_message(format!("{}/{} shards{state}", done.len(), plan.shards));
        bar.set_position(plan.stored_runs(&done).min(plan.planned));
    }
}

fn follow_all(
    plan: &Plan,
    place: &Place,
    scheduler: &mut dyn Scheduler,
    view: &View<'_>,
    stop: &AtomicBool,
) -> Result<bool, Diagnostics> {
    let mut record = Record::read(plan);
    let mut jobs = 0;
    while !plan.missing().is_empty() {
        let current = match record.take().filter(|record| !record.has_ended) {
            // A job that is followed again doesn't count.
            Some(Record {
                id: Some(id),
                round,
                ..
            }) => {
                view.say(&format!(
                    "job {id} of {} is followed again",
                    scheduler.title()
                ));
                recorded(scheduler, round, Some(id), false)
            }
            _ if jobs == place.tries => break,
            unfinished => {
                jobs += 1;
                submit(plan, place, scheduler, unfinished, view)?
            }
        };
        let id = current.id.clone().unwrap_or_default();
        if let Followed::Interrupted = follow(plan, scheduler, &id, view, stop)? {
            interrupted(scheduler, &id);
            return Ok(false);
        }
        Record {
            has_ended: true,
            ..current
        }
        .write(plan)?;
        let lost = plan.missing().len();
        if lost > 0 && jobs < place.tries {
            view.say(&format!(
                "job {id} ended with {lost} incomplete shards, which are submitted again"
            ));
        }
    }
    all_lost(plan, jobs).or(true)
}

/// The record of a job. One that ends with this process is never followed again.
fn recorded(scheduler: &dyn Scheduler, round: u64, id: Option<String>, has_ended: bool) -> Record {
    let cancel = id.as_deref().and_then(|id| scheduler.cancel(id));
    let has_ended = has_ended || !scheduler.outlives();
    Record {
        on: scheduler.on().name().to_owned(),
        round,
        id,
        cancel,
        has_ended,
    }
}

/// Submits a job for shards, or finds it if its submission was interrupted.
fn submit(
    plan: &Plan,
    place: &Place,
    scheduler: &mut dyn Scheduler,
    unfinished: Option<Record>,
    view: &View<'_>,
) -> Result<Record, Diagnostics> {
    let last = Record::read(plan).map_or(0, |record| record.round);
    let round = unfinished.as_ref().map_or(last + 1, |record| record.round);
    let job = Job {
        plan,
        name: Record::name(plan, round),
        shards: plan.missing(),
        place,
    };
    let number = job.shards.len();
    let found = if unfinished.is_some() {
        scheduler.find(&job.name)?
    } else {
        None
    };
    let id = match found {
        Some(id) => id,
        None => {
            recorded(scheduler, round, None, false).write(plan)?;
            for (name, text) in scheduler.files(&job) {
                let written = plan
                    .below()
                    .write_atomic(&plan.folder.join(name), text.as_bytes());
                written.map_err(|error| plan.unwritable(&error))?;
            }
            match scheduler.submit(&job) {
                Ok(id) => id,
                Err(faults) => {
                    recorded(scheduler, round, None, true).write(plan)?;
                    return Err(faults);
                }
            }
        }
    };
    let record = recorded(scheduler, round, Some(id), false);
    record.write(plan)?;
    if let Some((id, cancel)) = record.id.as_ref().zip(record.cancel.as_ref()) {
        view.say(&format!(
            "{number} shards are job {id} of {}; `{cancel}` ends it",
            scheduler.title()
        ));
    }
    Ok(record)
}

/// Follows a job until it has ended, or all shards have.
fn follow(
    plan: &Plan,
    scheduler: &mut dyn Scheduler,
    id: &str,
    view: &View<'_>,
    stop: &AtomicBool,
) -> Result<Followed, Diagnostics> {
    let (mut interval, mut answered, mut ended) = (SHORTEST, Instant::now(), None);
    let mut warned: Option<String> = None;
    loop {
        if plan.missing().is_empty() {
            return Ok(Followed::Ended);
        }
        let look = scheduler.look(id)?;
        view.show(plan, scheduler.title(), &look);
        match look {
            Look::Ended => {
                interval = SHORTEST;
                if ended.get_or_insert_with(Instant::now).elapsed() > GRACE {
                    return Ok(Followed::Ended);
                }
            }
            Look::Active { trouble, .. } => {
                (answered, ended) = (Instant::now(), None);
                if let Some(trouble) = trouble.filter(|trouble| warned.as_ref() != Some(trouble)) {
                    view.warn(needs_user(scheduler, id, &trouble));
                    warned = Some(trouble);
                }
            }
            Look::Unanswered(words) if answered.elapsed() > PATIENCE => {
                return Err(unanswered(scheduler, id, &words));
            }
            Look::Unanswered(_) => {}
        }
        let looked = Instant::now();
        while looked.elapsed() < interval {
            if stop.load(Ordering::Relaxed) {
                return Ok(Followed::Interrupted);
            }
            thread::sleep(TICK);
        }
        interval = (interval * 2).min(LONGEST);
    }
}

/// X030: how the user comes back.
fn interrupted(scheduler: &dyn Scheduler, id: &str) {
    let help = match scheduler.cancel(id) {
        Some(cancel) => {
            format!(
                "job {id} of {} goes on; the same command follows it again, and `{cancel}` ends it",
                scheduler.title()
            )
        }
        None => "finished runs are kept; the same command continues".to_owned(),
    };
    output::print_diagnostics(&Diagnostic::error("X030", "interrupted").help(help).into());
}

/// X081: tasks that wait for a user.
fn needs_user(scheduler: &dyn Scheduler, id: &str, trouble: &str) -> Diagnostic {
    let cancel = scheduler.cancel(id).unwrap_or_default();
    Diagnostic::warning("X081", format!("{} doesn't start shards of job {id}: {trouble}", scheduler.title())).help(
        format!("remove the cause; or end the job with `{cancel}`, and give the same command with other resources"),
    )
}

/// X079: the scheduler doesn't answer.
fn unanswered(scheduler: &dyn Scheduler, id: &str, words: &str) -> Diagnostics {
    let message = format!(
        "{} hasn't answered for {} minutes: {words}",
        scheduler.title(),
        PATIENCE.as_secs() / 60
    );
    Diagnostic::error("X079", message)
        .help(format!(
            "job {id} may go on; the same command follows it again"
        ))
        .into()
}

/// X075 for each shard that isn't complete.
fn all_lost(plan: &Plan, tries: u32) -> Diagnostics {
    let mut faults = Diagnostics::new();
    let faulty = plan
        .faulty()
        .into_iter()
        .map(|number| (number, "could not be completed".to_owned()));
    let missing = plan
        .missing()
        .into_iter()
        .map(|number| (number, format!("was lost in {tries} jobs")));
    let all: Vec<(u64, String)> = faulty.chain(missing).collect();
    for (number, how) in all.iter().take(MOST_NAMED) {
        faults.push(lost(plan, *number, how));
    }
    if all.len() > MOST_NAMED {
        let message = format!(
            "{} more shards could not be completed",
            all.len() - MOST_NAMED
        );
        let help = format!(
            "the same command tries again; their output is in `{}`",
            plan.folder.join("logs").display()
        );
        faults.push(Diagnostic::error("X075", message).help(help));
    }
    faults
}

/// The files and the command of the next job.
pub(super) fn dry_run(plan: &Plan, place: &Place, scheduler: &dyn Scheduler) -> String {
    let round = Record::read(plan).map_or(1, |record| record.round + 1);
    let job = Job {
        plan,
        name: Record::name(plan, round),
        shards: plan.missing(),
        place,
    };
    let files = scheduler.files(&job).into_iter();
    let files = files.map(|(name, text)| format!("# {}\n{text}", plan.folder.join(name).display()));
    let command = format!(
        "# submitted with\n{}\n",
        scheduler.command(&job).iter().collect::<ShellLine>()
    );
    files.collect::<String>() + &command
}
