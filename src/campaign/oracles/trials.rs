//! Runs every scene of a campaign without a fault and with each fault, from the same choices.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::line::judge_all;
use crate::make_run::SCENES_PER_RUN;
use crate::oracles::{COURSE_FAULTS, CourseFault, Fault};
use crate::workers::workers;
use crate::{Env, Planned, RunContext, RunInput, run_line, run_sabotaged};
use actcheck_actions::Saboteur;
use actcheck_base::{Diagnostics, Judgement, Outcome};
use actcheck_data::{Choice, Choices};
use actcheck_history::{RunRecord, RunStatus};

/// Campaign id of the records, which are never stored.
const NO_CAMPAIGN: &str = "check-oracles";

/// Options of [`try_faults`].
#[derive(Debug, Clone, Copy)]
pub struct TrialOptions {
    /// Workers, one simulation each.
    pub jobs: usize,
    /// How each run is made.
    pub context: RunContext,
}

/// One scene with one fault or without a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Position of the run in the campaign, from 0.
    pub index: u64,
    /// Name of the fault; `None` for the run without a fault.
    pub fault: Option<&'static str>,
    /// Whether the fault occurred.
    pub came_about: bool,
    /// Outcome of each property by IRI; the worst one if several actions have the property. Empty
    /// if the run was not judged: no scene, a simulation crash, or a spent budget.
    pub outcomes: BTreeMap<String, Outcome>,
}

/// A scene with the choices to run it again.
struct Scene {
    index: u64,
    choices: Vec<Choice>,
}

/// Runs every planned scene without a fault, and then with each fault that concerns its test, on
/// several workers. Calls `on_done` after each. If rules read the course of actions, every run
/// without a fault is judged with each fault of the course, too.
///
/// The results are sorted by index, the run without a fault first. They depend neither on the
/// number of workers nor on the clock. Runs that have not begun when `stop` is set are left out.
///
/// # Errors
/// `X010` if workers can't be started.
pub fn try_faults(
    env: &Env,
    faults: &[Fault],
    options: &TrialOptions,
    stop: &AtomicBool,
    on_done: impl Fn() + Sync,
) -> Result<Vec<Trial>, Diagnostics> {
    let pool = workers(options.jobs)?;
    let going = || !stop.load(Ordering::Relaxed);
    let sound = |index: u64| {
        let made = if going() {
            without_fault(env, index, &options.context)
        } else {
            None
        };
        on_done();
        made
    };
    let concerns = |scene: &Scene, fault: &Fault| {
        let test = env.campaign.tests.get(env.test_of(scene.index));
        test.is_some_and(|test| fault.concerns(test, &env.campaign.robot.core))
    };
    let with_fault = |(scene, fault): &(&Scene, &Fault)| {
        let made = if going() && concerns(scene, fault) {
            with_fault(env, scene, fault, &options.context)
        } else {
            None
        };
        on_done();
        made
    };
    Ok(pool.install(|| {
        let sound: Vec<(Scene, Vec<Trial>)> = (0..env.planned_runs())
            .into_par_iter()
            .filter_map(sound)
            .collect();
        let pairs: Vec<(&Scene, &Fault)> = sound
            .iter()
            .flat_map(|(scene, _)| faults.iter().map(move |fault| (scene, fault)))
            .collect();
        let spoilt: Vec<Trial> = pairs.par_iter().filter_map(with_fault).collect();
        let mut trials: Vec<Trial> = sound
            .iter()
            .flat_map(|(_, trials)| trials.clone())
            .chain(spoilt)
            .collect();
        trials.sort_by_key(|trial| trial.index);
        trials
    }))
}

/// Runs the scene of an index as a campaign would, and judges it without a fault and with each
/// fault of its course. Returns `None` if no scene can be built.
fn without_fault(env: &Env, index: u64, context: &RunContext) -> Option<(Scene, Vec<Trial>)> {
    let repeat = u64::from(env.campaign.repeat);
    let repetition = (repeat > 1).then_some(index % repeat);
    let planned = Planned {
        index,
        scene: index / repeat,
        repetition,
        steering: None,
    };
    (0..SCENES_PER_RUN).find_map(|attempt| {
        let choices = planned.choices(env.campaign.seed, attempt);
        let record = run(env, index, choices, context, None)?;
        let sound = Trial {
            index,
            fault: None,
            came_about: true,
            outcomes: outcomes(&record),
        };
        let trials = std::iter::once(sound)
            .chain(with_course_faults(env, &record))
            .collect();
        Some((
            Scene {
                index,
                choices: record.choices,
            },
            trials,
        ))
    })
}

/// Judges a run without a fault again with each fault of its course.
fn with_course_faults(env: &Env, record: &RunRecord) -> Vec<Trial> {
    let Some(test) = env.campaign.tests.get(env.test_of(record.index)) else {
        return Vec::new();
    };
    let judged = |fault: &CourseFault| {
        let mut trace = record.trace.clone();
        let came_about = fault.put_into(&mut trace);
        let facts = actcheck_facts::extract(&trace);
        let judgements = judge_all(env, &trace, &facts).ok()?;
        let outcomes = if came_about {
            worst(&judgements)
        } else {
            BTreeMap::new()
        };
        Some(Trial {
            index: record.index,
            fault: Some(fault.name),
            came_about,
            outcomes,
        })
    };
    let is_complete = record.status == RunStatus::Completed;
    let concerned = COURSE_FAULTS
        .iter()
        .filter(|fault| is_complete && fault.concerns(test, env));
    concerned.filter_map(judged).collect()
}

/// Runs the same scene with a fault. Choices that only arise because of the fault are drawn anew.
fn with_fault(env: &Env, scene: &Scene, fault: &Fault, context: &RunContext) -> Option<Trial> {
    let index = scene.index;
    let choices = Choices::partly_recorded(&scene.choices, env.campaign.seed, index);
    let mut saboteur = Saboteur::new(fault.sabotage);
    let record = run(env, index, choices, context, Some(&mut saboteur));
    let outcomes = record.as_ref().map(outcomes).unwrap_or_default();
    Some(Trial {
        index,
        fault: Some(fault.name),
        came_about: saboteur.came_about(),
        outcomes,
    })
}

/// Makes one run. Returns `None` if the scene was discarded or the simulation crashed.
fn run(
    env: &Env,
    index: u64,
    choices: Choices,
    context: &RunContext,
    saboteur: Option<&mut Saboteur>,
) -> Option<RunRecord> {
    let line = || match saboteur {
        None => run_line(env, NO_CAMPAIGN, index, choices, context),
        Some(saboteur) => run_sabotaged(
            env,
            RunInput {
                campaign: NO_CAMPAIGN,
                index,
                choices,
            },
            context,
            saboteur,
        ),
    };
    catch_unwind(AssertUnwindSafe(line)).ok()?.ok()
}

/// The worst outcome of each property over all actions; empty if the run did not complete.
fn outcomes(record: &RunRecord) -> BTreeMap<String, Outcome> {
    if record.status == RunStatus::Completed {
        worst(&record.judgements)
    } else {
        BTreeMap::new()
    }
}

fn worst(judgements: &[Vec<Judgement>]) -> BTreeMap<String, Outcome> {
    let mut worst: BTreeMap<String, Outcome> = BTreeMap::new();
    for Judgement {
        property, outcome, ..
    } in judgements.iter().flatten()
    {
        let known = worst.entry(property.clone()).or_insert(*outcome);
        if severity(*outcome) > severity(*known) {
            *known = *outcome;
        }
    }
    worst
}

/// Rank of outcomes; the highest one counts if a property is judged for several actions.
fn severity(outcome: Outcome) -> u8 {
    match outcome {
        Outcome::Failed => 3,
        Outcome::Broken | Outcome::Timeout | Outcome::Untested => 2,
        Outcome::Passed => 1,
        Outcome::Inapplicable => 0,
    }
}
