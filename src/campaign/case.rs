//! Cases: configurations with one fixed scene. Checks that the scene can be built as written, and runs it.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::make_run::cut_of;
use crate::replay::rerun;
use crate::{Env, RunContext};
use actcheck_base::{Diagnostic, Diagnostics, Outcome, nearest};
use actcheck_config::{Campaign, Case};
use actcheck_data::{Choice, ChoiceKind, Choices, Scene};
use actcheck_history::{CampaignEnd, History, RunRecord, RunStatus};
use actcheck_scenario as scenario;
use actcheck_scenario::Space;
use actcheck_verdict::{Counts, Recurrence};

/// Names of the choices that are made only during a run: sensor noise, and the seeds of planner and skill. The choices
/// of single objects are in `SENSES_OF_OBJECT`.
const SENSES: [&str; 14] = [
    "sense.localisation.x",
    "sense.localisation.y",
    "sense.localisation.heading",
    "sense.gripper",
    "sense.camera.frame",
    "sense.odometry.along",
    "sense.odometry.across",
    "sense.odometry.turning",
    "sense.odometry.veering",
    "sense.odometry.landmark.x",
    "sense.odometry.landmark.y",
    "sense.odometry.landmark.heading",
    "motion.samples",
    "skill.seed",
];
/// Sensor noise of one object.
const SENSES_OF_OBJECT: [&str; 7] = ["x", "y", "z", "yaw", "width", "depth", "height"];

/// The result of a case.
#[derive(Debug, Clone)]
pub struct CaseRun {
    /// The run.
    pub record: RunRecord,
    /// Whether it fails as the case expects.
    pub recurrence: Recurrence,
    /// Whether all states are bitwise identical; `None` if the case has no trace digest.
    pub same_trace: Option<bool>,
}

/// Runs cases on several workers and stores each run as a campaign of its own with the case's name. Calls `on_case` for
/// each in the order of `cases`, with its position.
///
/// # Errors
/// `S064` if a scene can't be built or does not settle, `X010` if workers can't be started; or writing failed.
pub fn run_cases(
    cases: &[(String, Env)],
    history: &History,
    jobs: usize,
    context: &RunContext,
    on_case: &mut dyn FnMut(usize, CaseRun),
) -> Result<(), Diagnostics> {
    let jobs = jobs.clamp(1, cases.len().max(1));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| Diagnostic::error("X010", format!("workers can't be started: {error}")))?;
    let mut faults = Diagnostics::new();
    // At most one trace for each worker is in memory.
    for (number, some) in cases.chunks(jobs).enumerate() {
        let made: Vec<_> = pool.install(|| some.par_iter().map(|(_, env)| make(env, context)).collect());
        for (at, ((name, env), made)) in some.iter().zip(made).enumerate() {
            match made {
                Ok(record) => on_case(number * jobs + at, keep(env, history, name, record, context)?),
                Err(found) => faults.extend(found),
            }
        }
    }
    faults.or(())
}

fn make(env: &Env, context: &RunContext) -> Result<RunRecord, Diagnostics> {
    let none = BTreeMap::new();
    let choices = env.campaign.case.as_ref().map_or(&none, |case| &case.choices);
    rerun(env, "case", (0, &|| Choices::named(choices)), context, cut_of(env, context)).map_err(|why| {
        env.campaign
            .fault("S064", "case", format!("the scene of this case can't be built: {why}"))
            .help("models, robot or program may have changed, or a value was edited: move the objects in the way")
            .into()
    })
}

fn keep(
    env: &Env,
    history: &History,
    name: &str,
    mut record: RunRecord,
    context: &RunContext,
) -> Result<CaseRun, Diagnostics> {
    let id = history.next_campaign_id(&actcheck_base::digest_of(&env.campaign.source.text), env.campaign.seed)?;
    record.id = format!("{id}-1");
    record.campaign.clone_from(&id);
    // The record of a crash has no start time.
    let started = if record.started.is_empty() { (context.clock.now)() } else { record.started.clone() };
    let mut campaign = env.record(id.clone(), name.to_owned(), started);
    campaign.planned_runs = 1;
    history.begin_campaign(&campaign)?;
    history.commit(&record)?;
    history.finish_campaign(&id, &end_of(&record, (context.clock.now)()))?;
    let case = env.campaign.case.clone().unwrap_or_default();
    let recurrence = Recurrence::of(&case.expect.into_iter().collect(), record.judgements.iter().flatten());
    let same_trace = case.trace.map(|trace| trace == record.trace.hash);
    Ok(CaseRun { record, recurrence, same_trace })
}

/// The end of a campaign of one run.
pub(super) fn end_of(record: &RunRecord, ended: String) -> CampaignEnd {
    let counts = Counts::of(record.judgements.iter().flatten().map(|judgement| judgement.outcome));
    CampaignEnd {
        ended,
        score: Some(record.score),
        score_without_broken: (record.status != RunStatus::Broken).then_some(record.score),
        outcomes: Outcome::ALL.into_iter().map(|outcome| (outcome, counts.get(outcome))).collect(),
        discards: 0,
        ended_by: None,
        interrupted: false,
    }
}

/// Finds the choices of a case that can't have their written values: S061 the scene has no such choice, S062 the value
/// is out of bounds, S063 another object is in the way, S060 the scene can't be built at all.
pub(super) fn check_case(campaign: &Campaign, space: &Space) -> Diagnostics {
    let mut found = Diagnostics::new();
    let Some(case) = &campaign.case else { return found };
    let mut choices = Choices::named(&case.choices);
    let drawn = scenario::draw(space, 0, &mut choices);
    let mut made: BTreeMap<&str, Vec<&Choice>> = BTreeMap::new();
    for choice in choices.made() {
        made.entry(&choice.name).or_default().push(choice);
    }
    for (name, values) in &case.choices {
        let fault = match made.get(name.as_str()) {
            Some(made) => misplaced(campaign, name, values, made),
            None if is_of_senses(name, drawn.as_ref().ok()) || is_of_left_out(name, case) => None,
            None => Some(unknown(campaign, name, drawn.as_ref().ok(), made.keys().copied())),
        };
        fault.into_iter().for_each(|fault| found.push(fault));
    }
    if let (Err(discard), false) = (drawn, found.has_errors()) {
        let message = format!("the scene of this case can't be built: {discard}");
        found.push(campaign.fault("S060", "case", message).help("move the objects in the way, or remove them"));
    }
    found
}

/// Returns the fault of a choice whose value differs from the written one, or whose values are too many or too few.
fn misplaced(campaign: &Campaign, name: &str, written: &[f64], made: &[&Choice]) -> Option<Diagnostic> {
    let place = Case::place_of(name);
    let moved = written.iter().zip(made).find(|(written, made)| written.to_bits() != made.value.to_bits());
    if let Some((written, made)) = moved {
        let (is, bounds) = match made.kind {
            ChoiceKind::Index { .. } if let Some((least, most)) = campaign.other_counts.of_choice(name) => {
                (format!("{}", written + f64::from(least)), format!("{least} to {most}"))
            }
            ChoiceKind::Index { of } => (format!("{written}"), format!("whole numbers from 0 to {}", of - 1)),
            ChoiceKind::Real { low, high, .. } => (format!("{written}"), format!("{low} to {high}")),
            ChoiceKind::Normal { .. } => return None,
        };
        let message = format!("`{name}` is {is}, which is out of bounds here");
        return Some(campaign.fault("S062", &place, message).help(format!("allowed: {bounds}")));
    }
    if written.len() > made.len() {
        let message = format!("`{name}` has {} values, but the scene needs {}", written.len(), made.len());
        return Some(campaign.fault("S061", &place, message).help("remove the extra values"));
    }
    let thing = name.strip_suffix(".x")?;
    (made.len() > written.len()).then(|| {
        campaign
            .fault("S063", &place, format!("`{thing}` can't be placed there: another object is in the way"))
            .help("move one of the two, or remove one")
    })
}

/// Whether a choice is made only during the run of this scene.
fn is_of_senses(name: &str, scene: Option<&Scene>) -> bool {
    let of_object = |rest: &str| {
        let (id, what) = rest.rsplit_once('.')?;
        let is_there = scene.is_none_or(|scene| scene.objects.iter().any(|object| object.id == id));
        Some(is_there && SENSES_OF_OBJECT.contains(&what))
    };
    SENSES.contains(&name) || name.strip_prefix("sense.").and_then(of_object).unwrap_or(false)
}

/// Whether a choice belongs to an object that the case leaves out.
fn is_of_left_out(name: &str, case: &Case) -> bool {
    let of = name.rsplit_once('.').and_then(|(of, _)| case.choices.get(&format!("{of}.left_out")));
    of.is_some_and(|left_out| left_out.first().is_some_and(|value| *value != 0.0))
}

fn unknown<'a>(
    campaign: &Campaign,
    name: &str,
    scene: Option<&'a Scene>,
    made: impl Iterator<Item = &'a str>,
) -> Diagnostic {
    let objects = scene.map_or(&[][..], |scene| &scene.objects);
    let of_objects =
        objects.iter().flat_map(|object| SENSES_OF_OBJECT.map(|what| format!("sense.{}.{what}", object.id)));
    let known: Vec<String> = made.map(str::to_owned).chain(SENSES.map(str::to_owned)).chain(of_objects).collect();
    campaign
        .fault("S061", &Case::place_of(name), format!("the scene of this case has no choice `{name}`"))
        // There are too many choices to list.
        .help(match nearest(name, known.iter().map(String::as_str)) {
            Some(found) => format!("did you mean `{found}`?"),
            None => "remove it; `actcheck export` writes a case with every choice of its scene".to_owned(),
        })
}
