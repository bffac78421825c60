//! One run from start to end: choices → scene → world → trace → facts → findings → verdict.

use crate::Env;
use crate::judging::judge_action;
use actcheck_actions as actions;
use actcheck_actions::{ActionCall, Cut, ExternalSkill, Interference, Saboteur};
use actcheck_base::{Judgement, RunFacts};
use actcheck_data::{ActionEnd, Choices, Quality, Scene, Trace};
use actcheck_facts as facts;
use actcheck_history::{RunRecord, RunStatus};
use actcheck_protocol::{Performance, RunName};
use actcheck_scenario as scenario;
use actcheck_verdict::{action_score, run_score};
use actcheck_world as world;
use actcheck_world::World;

/// The caller's clock: the stages have none of their own.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    /// Now, as RFC 3339.
    pub now: fn() -> String,
    /// Seconds since an arbitrary fixed moment; monotonic.
    pub secs: fn() -> f64,
}

/// Injects a fault into the settled world of the run with this index. For tests of fault detection.
pub type Disturbance = fn(u64, &mut World);

/// How runs are made, apart from their choices.
#[derive(Debug, Clone, Copy)]
pub struct Manner {
    /// The caller's clock.
    pub clock: Clock,
    /// A fault to inject into worlds.
    pub disturb: Option<Disturbance>,
}

/// The reason why a scene gave no run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The scene could not be generated or did not settle; another one may.
    #[error("{0}")]
    Discard(String),
    /// The run was interrupted while rules were evaluated.
    #[error("interrupted")]
    Interrupted,
}

/// Makes one run, from choices to verdict.
///
/// The same `choices` give the same record, except for its times. `campaign` is the campaign's id.
///
/// # Errors
/// [`Failure::Discard`] if the scene could not be generated or did not settle, [`Failure::Interrupted`] if
/// [`Env::rule_budget`] was stopped during a long rule. Simulation faults are not errors: the record is `broken`.
pub fn run_line(
    env: &Env,
    campaign: &str,
    index: u64,
    choices: Choices,
    manner: &Manner,
) -> Result<RunRecord, Failure> {
    run_line_with(env, campaign, (index, choices), manner, Interference::default())
}

/// As [`run_line`], but the run ends at `cut`.
///
/// # Errors
/// As [`run_line`].
pub(super) fn run_line_until(
    env: &Env,
    campaign: &str,
    run: (u64, Choices),
    manner: &Manner,
    cut: Cut,
) -> Result<RunRecord, Failure> {
    run_line_with(env, campaign, run, manner, Interference { cut, ..Interference::default() })
}

/// As [`run_line`], with a fault injected on purpose.
///
/// The record does not count as a run of the robot and must not be stored in a history.
///
/// # Errors
/// As [`run_line`].
pub fn run_sabotaged(
    env: &Env,
    campaign: &str,
    run: (u64, Choices),
    manner: &Manner,
    saboteur: &mut Saboteur,
) -> Result<RunRecord, Failure> {
    run_line_with(env, campaign, run, manner, Interference { saboteur: Some(saboteur), ..Interference::default() })
}

fn run_line_with(
    env: &Env,
    campaign: &str,
    (index, mut choices): (u64, Choices),
    manner: &Manner,
    interference: Interference<'_>,
) -> Result<RunRecord, Failure> {
    let (started, start_secs) = ((manner.clock.now)(), (manner.clock.secs)());
    let scene = scenario::draw(&env.space, env.test_of(index), &mut choices)
        .map_err(|discard| Failure::Discard(discard.to_string()))?;
    let test = test_to_perform(env, index, &mut choices);
    let disturb = |world: &mut World| {
        if let Some(disturb) = manner.disturb {
            disturb(index, world);
        }
    };
    choices.begin_noise();
    let mut program = env.programs.as_ref().map(|programs| {
        let seed = choices.index(SKILL_SEED, SEEDS) as u64;
        let run = RunName { run: format!("{campaign}-{}", index + 1), index, seed };
        Performance::new(programs, run, manner.clock.secs)
    });
    let outside = program.as_mut().map(|program| program as &mut dyn ExternalSkill);
    let interference = Interference { cut: interference.cut, saboteur: interference.saboteur, outside };
    let (mut trace, quality) = perform((env, interference), test, &scene, &mut choices, disturb)?;
    trace.map = scene.map.clone();
    let mut record = record(env, campaign, index, scene, trace)?;
    record.choices = choices.into_made();
    record.quality = quality;
    record.program_output = program.as_ref().and_then(Performance::output).map(|lines| lines.join("\n"));
    record.started = started;
    record.wall_secs = (manner.clock.secs)() - start_secs;
    Ok(record)
}

/// The choice that seeds all randomness of a program, and the number of seeds: every language can represent them.
const SKILL_SEED: &str = "skill.seed";
const SEEDS: usize = 1 << 32;

/// The choice of how many of the last actions are left out.
pub(super) const TEST_LEFT_OUT: &str = "test.left_out";

/// The actions of a run. Only shrunk runs leave the last ones out.
fn test_to_perform<'a>(env: &'a Env, index: u64, choices: &mut Choices) -> &'a [String] {
    let test = &env.campaign.tests[env.test_of(index)];
    let left_out = choices.exception(TEST_LEFT_OUT, test.len());
    &test[..test.len() - left_out]
}

/// Returns the record of a run whose simulation crashed: every property is `broken`, for the given reason.
///
/// Returns `None` if the scene can't be drawn again.
pub(super) fn crashed(env: &Env, campaign: &str, index: u64, mut choices: Choices, reason: &str) -> Option<RunRecord> {
    let scene = scenario::draw(&env.space, env.test_of(index), &mut choices).ok()?;
    let trace = never_performed(test_to_perform(env, index, &mut choices), &scene, reason);
    let mut record = record(env, campaign, index, scene, trace).ok()?;
    record.choices = choices.into_made();
    Some(record)
}

/// Computes facts, findings, verdicts and scores of a trace. The caller sets choices and times.
fn record(env: &Env, campaign: &str, index: u64, scene: Scene, trace: Trace) -> Result<RunRecord, Failure> {
    let facts = facts::extract(&trace);
    let judgements = judge_all(env, &trace, &facts)?;
    let action_scores: Vec<f64> = judgements.iter().map(|list| action_score(list.iter().map(|j| j.outcome))).collect();
    let (status, reason) = status_of(&trace);
    Ok(RunRecord {
        id: format!("{campaign}-{}", index + 1),
        campaign: campaign.to_owned(),
        shrunk_from: None,
        index,
        repetition: None,
        weight: None,
        test: trace.actions.iter().map(|action| action.action.as_str()).collect::<Vec<_>>().join(" "),
        seed: env.campaign.seed,
        status,
        reason,
        program_output: None,
        score: run_score(&action_scores),
        action_scores,
        discards: Vec::new(),
        choices: Vec::new(),
        scene,
        actions: trace.actions.iter().map(|action| env.ontology.actions[&action.action].iri.clone()).collect(),
        trace,
        facts,
        judgements,
        quality: None,
        started: String::new(),
        wall_secs: 0.0,
        elapsed_secs: 0.0,
    })
}

/// Builds the scene, lets it settle and performs the test in it. Returns the trace, and the simulation's quality
/// figures if a world could be built.
fn perform(
    (env, interference): (&Env, Interference<'_>),
    test: &[String],
    scene: &Scene,
    choices: &mut Choices,
    disturb: impl FnOnce(&mut World),
) -> Result<(Trace, Option<Quality>), Failure> {
    let mut world = match world::build(scene) {
        Ok(world) => world,
        Err(error) => return Ok((never_performed(test, scene, &error.to_string()), None)),
    };
    let settling = world.settle();
    if !settling.left.is_empty() {
        return Err(Failure::Discard(format!("fell from its initial position: {}", settling.left.join(", "))));
    }
    if !settling.settled {
        return Err(Failure::Discard(format!("did not come to rest: {}", settling.unsettled.join(", "))));
    }
    if let Some(requirement) = &env.requirement {
        requirement.check(scene, &world, &env.rule_budget)?;
    }
    disturb(&mut world);
    let calls = calls(test, scene);
    let trace = actions::perform_with(&calls, &mut world, choices, &env.campaign.budget, interference);
    Ok((trace, Some(world.quality())))
}

fn calls(test: &[String], scene: &Scene) -> Vec<ActionCall> {
    test.iter().map(|action| ActionCall { action: action.clone(), parameters: scene.designators.clone() }).collect()
}

/// The trace of a run that ended with a fault before its first action.
fn never_performed(test: &[String], scene: &Scene, reason: &str) -> Trace {
    let actions = calls(test, scene)
        .into_iter()
        .map(|call| actcheck_data::ActionTrace {
            end: ActionEnd::Broken(reason.to_owned()),
            ..actcheck_data::ActionTrace::not_reached(&call.action, &call.parameters)
        })
        .collect();
    Trace {
        snapshots: Vec::new(),
        actions,
        frames: actcheck_data::Frames::default(),
        hash: String::new(),
        map: scene.map.clone(),
        forms: Vec::new(),
        robot_courses: Vec::new(),
    }
}

/// Judges every action of a trace; one list for each.
fn judge_all(env: &Env, trace: &Trace, facts: &RunFacts) -> Result<Vec<Vec<Judgement>>, Failure> {
    trace
        .actions
        .iter()
        .enumerate()
        .map(|(step, performed)| {
            let action = &env.ontology.actions[&performed.action];
            let facts = facts.action(step);
            judge_action(&env.ontology, &env.rules, action, &performed.end, facts, &env.rule_budget)
        })
        .collect()
}

/// The status and its reason, from the first action that did not complete.
fn status_of(trace: &Trace) -> (RunStatus, Option<String>) {
    for action in &trace.actions {
        match &action.end {
            ActionEnd::Broken(reason) => return (RunStatus::Broken, Some(reason.clone())),
            ActionEnd::Timeout(reason) | ActionEnd::Cut(reason) => {
                return (RunStatus::Timeout, Some(reason.clone()));
            }
            ActionEnd::Completed | ActionEnd::NotReached => {}
        }
    }
    (RunStatus::Completed, None)
}
