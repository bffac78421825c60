//! One run from start to end: choices → scene → world → trace → facts → findings → verdict.

use std::sync::Arc;

use crate::finished_run::{FinishedRun, RunPlace};
use crate::preconditions::Preconditions;
use crate::{Env, Failure};
use actcheck_actions as actions;
use actcheck_actions::{ActionCall, ExternalSkill, Interference, Saboteur};
use actcheck_base::{Judgement, RunFacts};
use actcheck_config::Step;
use actcheck_data::{ActionEnd, ChoiceName, Choices, Decor, Quality, Scene, Trace};
use actcheck_facts as facts;
use actcheck_history::{RunRecord, RunStatus};
use actcheck_protocol::{Performance, RunName};
use actcheck_scenario as scenario;
use actcheck_verdict::{action_score, judge_action, run_score};
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
pub struct RunContext {
    /// The caller's clock.
    pub clock: Clock,
    /// A fault to inject into worlds.
    pub disturb: Option<Disturbance>,
}

impl Clock {
    /// The present as the start of a run.
    pub(super) fn start(&self) -> Start {
        Start {
            now: (self.now)(),
            secs: (self.secs)(),
        }
    }
}

/// The start of a run.
#[derive(Debug, Clone)]
pub(super) struct Start {
    /// RFC 3339.
    now: String,
    /// On the caller's clock.
    secs: f64,
}

/// A run to make.
#[derive(Debug)]
pub struct RunInput<'a> {
    /// Id of its campaign.
    pub campaign: &'a str,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// The choices of its scene and of its noise.
    pub choices: Choices,
}

/// Makes one run, from choices to verdict.
///
/// The same `choices` give the same record, except for its times. `campaign` is the campaign's id.
///
/// # Errors
/// [`Failure::Discard`] if the scene could not be generated or did not settle, [`Failure::Overlap`]
/// if the robot overlaps something in it, [`Failure::Interrupted`] if [`Env::rule_budget`] was
/// stopped during a long rule or an action of an external program. Simulation faults are not
/// errors: the record is `broken`.
pub fn run_line(
    env: &Env,
    campaign: &str,
    index: u64,
    choices: Choices,
    context: &RunContext,
) -> Result<RunRecord, Failure> {
    let input = RunInput {
        campaign,
        index,
        choices,
    };
    let run = simulate(
        env,
        input,
        context,
        context.clock.start(),
        Interference::default(),
    )?;
    Ok(run.into_record(RunPlace::alone(campaign)))
}

/// As [`run_line`], with a fault injected on purpose.
///
/// The record does not count as a run of the robot and must not be stored in a history.
///
/// # Errors
/// As [`run_line`].
pub fn run_sabotaged(
    env: &Env,
    input: RunInput<'_>,
    context: &RunContext,
    saboteur: &mut Saboteur,
) -> Result<RunRecord, Failure> {
    let place = RunPlace::alone(input.campaign);
    let interference = Interference {
        saboteur: Some(saboteur),
        ..Interference::default()
    };
    Ok(simulate(env, input, context, context.clock.start(), interference)?.into_record(place))
}

/// Makes one run as [`run_line`] does, with interference. `start` is its start on the context's
/// clock.
///
/// # Errors
/// As [`run_line`].
pub(super) fn simulate(
    env: &Env,
    input: RunInput<'_>,
    context: &RunContext,
    start: Start,
    interference: Interference<'_>,
) -> Result<FinishedRun, Failure> {
    let RunInput {
        campaign,
        index,
        mut choices,
    } = input;
    let scene = scenario::draw(&env.space, env.test_of(index), &mut choices)
        .map_err(|discard| Failure::Discard(discard.to_string()))?;
    let test = test_to_perform(env, index, &mut choices);
    let disturb = |world: &mut World| {
        if let Some(disturb) = context.disturb {
            disturb(index, world);
        }
    };
    choices.begin_noise();
    let mut program = env.programs.as_ref().map(|programs| {
        let seed = choices.index(ChoiceName::SkillSeed, SEEDS) as u64;
        let run = RunName {
            run: format!("{campaign}-{}", index + 1),
            index,
            seed,
        };
        Performance::new(
            programs,
            run,
            context.clock.secs,
            Arc::clone(&env.rule_budget.stop),
        )
    });
    let external = program
        .as_mut()
        .map(|program| program as &mut dyn ExternalSkill);
    let interference = Interference {
        cut: interference.cut,
        saboteur: interference.saboteur,
        external,
        gate: None,
        playback: interference.playback,
        other_engine: interference.other_engine,
    };
    let (mut trace, quality) = perform(env, test, &scene, &mut choices, disturb, interference)?;
    if program.as_ref().is_some_and(Performance::was_stopped) {
        return Err(Failure::Interrupted);
    }
    if let Some(program) = &mut program {
        trace.skill = program.take_log();
    }
    let program_output = program
        .as_ref()
        .and_then(Performance::output)
        .map(|lines| lines.join("\n"));
    finish(
        env,
        Simulated {
            index,
            test,
            scene,
            trace,
            quality,
            choices,
            program_output,
        },
        context,
        start,
    )
}

/// Number of seeds of a program: every language can represent them.
const SEEDS: usize = 1 << 32;

/// The actions of a run. Only shrunk runs leave the last ones out.
fn test_to_perform<'a>(env: &'a Env, index: u64, choices: &mut Choices) -> &'a [Step] {
    let test = &env.campaign.tests[env.test_of(index)];
    let left_out = choices.exception(ChoiceName::ActionsLeftOut, test.len());
    &test[..test.len() - left_out]
}

/// Returns a run whose simulation crashed: every property is `broken`, for the given reason.
///
/// Returns `None` if the scene can't be drawn again.
pub(super) fn crashed(
    env: &Env,
    input: RunInput<'_>,
    context: &RunContext,
    start: Start,
    reason: &str,
) -> Option<FinishedRun> {
    let RunInput {
        index, mut choices, ..
    } = input;
    let scene = scenario::draw(&env.space, env.test_of(index), &mut choices).ok()?;
    let test = test_to_perform(env, index, &mut choices);
    let trace = never_performed(test, &scene, reason);
    let simulated = Simulated {
        index,
        test,
        scene,
        trace,
        quality: None,
        choices,
        program_output: None,
    };
    finish(env, simulated, context, start).ok()
}

/// A simulated run that is not judged yet.
struct Simulated<'a> {
    index: u64,
    test: &'a [Step],
    scene: Scene,
    trace: Trace,
    quality: Option<Quality>,
    choices: Choices,
    program_output: Option<String>,
}

/// Computes facts, findings, verdicts and scores of a simulated run.
fn finish(
    env: &Env,
    simulated: Simulated<'_>,
    context: &RunContext,
    start: Start,
) -> Result<FinishedRun, Failure> {
    let Simulated {
        index,
        test,
        scene,
        trace,
        quality,
        choices,
        program_output,
    } = simulated;
    let facts = facts::extract(&trace);
    let judgements = judge_all(env, &trace, &facts)?;
    let action_scores: Vec<f64> = judgements
        .iter()
        .map(|list| action_score(list.iter().map(|j| j.outcome)))
        .collect();
    let (status, reason) = status_of(&trace);
    Ok(FinishedRun {
        index,
        test: Step::test_name(test),
        seed: env.campaign.seed,
        status,
        reason,
        program_output,
        score: run_score(&action_scores),
        action_scores,
        choices: choices.into_made(),
        scene,
        actions: trace
            .actions
            .iter()
            .map(|action| env.ontology.actions[&action.action].iri.clone())
            .collect(),
        trace,
        facts,
        judgements,
        quality,
        started: start.now,
        wall_secs: (context.clock.secs)() - start.secs,
    })
}

/// Builds the scene, lets it settle and performs the test in it. Returns the trace, and the
/// simulation's quality figures if a world could be built.
fn perform(
    env: &Env,
    test: &[Step],
    scene: &Scene,
    choices: &mut Choices,
    disturb: impl FnOnce(&mut World),
    interference: Interference<'_>,
) -> Result<(Trace, Option<Quality>), Failure> {
    let mut world = match world::build_with(scene, &env.robot) {
        Ok(world) => world,
        Err(error) => return Ok((never_performed(test, scene, &error.to_string()), None)),
    };
    if let Some(deepest) = world.overlaps().first() {
        return Err(Failure::Overlap(deepest.to_string()));
    }
    world.show(Arc::clone(env.skins()), Decor::of(choices.made()));
    let settling = world.settle();
    if !settling.left.is_empty() {
        return Err(Failure::Discard(format!(
            "fell from its initial position: {}",
            settling.left.join(", ")
        )));
    }
    if let Some(fault) = world.fault() {
        return Err(Failure::Discard(fault.to_string()));
    }
    if !settling.settled {
        return Err(Failure::Discard(format!(
            "did not come to rest: {}",
            settling.unsettled.join(", ")
        )));
    }
    if let Some(requirement) = &env.requirement {
        requirement.check(scene, &world, &env.rule_budget)?;
    }
    disturb(&mut world);
    let calls = calls(test, scene);
    let mut preconditions = Preconditions::new(env, scene);
    let Interference {
        cut,
        saboteur,
        external,
        playback,
        other_engine,
        ..
    } = interference;
    let external = external.map(|skill| skill as &mut dyn ExternalSkill);
    let interference = Interference {
        cut,
        saboteur,
        external,
        gate: Some(&mut preconditions),
        playback,
        other_engine,
    };
    let trace = actions::perform_with(
        &calls,
        &mut world,
        choices,
        &env.campaign.budget,
        interference,
    );
    if preconditions.interrupted {
        return Err(Failure::Interrupted);
    }
    Ok((
        Trace {
            map: scene.map.clone(),
            ..trace
        },
        Some(world.recorder().quality()),
    ))
}

/// The calls of a test's actions, each with the values that are in force for it.
fn calls(test: &[Step], scene: &Scene) -> Vec<ActionCall> {
    let parameters = |number: usize| {
        scene
            .steps
            .get(number)
            .unwrap_or(&scene.designators)
            .clone()
    };
    let call = |(number, step): (usize, &Step)| ActionCall {
        action: step.action.clone(),
        parameters: parameters(number),
    };
    test.iter().enumerate().map(call).collect()
}

/// The trace of a run that ended with a fault before its first action.
fn never_performed(test: &[Step], scene: &Scene, reason: &str) -> Trace {
    let actions = calls(test, scene)
        .into_iter()
        .map(|call| actcheck_data::ActionTrace {
            end: ActionEnd::Broken(reason.to_owned()),
            ..actcheck_data::ActionTrace::not_reached(&call.action, &call.parameters)
        })
        .collect();
    Trace {
        actions,
        map: scene.map.clone(),
        ..Trace::default()
    }
}

/// Judges every action of a trace; one list for each.
pub(super) fn judge_all(
    env: &Env,
    trace: &Trace,
    facts: &RunFacts,
) -> Result<Vec<Vec<Judgement>>, Failure> {
    trace
        .actions
        .iter()
        .enumerate()
        .map(|(step, performed)| {
            let action = &env.ontology.actions[&performed.action];
            Ok(judge_action(
                &env.ontology,
                &env.rules,
                action,
                &performed.end,
                (facts.start(), facts.action(step)),
                &env.rule_budget,
            )?)
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
            ActionEnd::Completed | ActionEnd::NotReached | ActionEnd::NotPerformed(_) => {}
        }
    }
    (RunStatus::Completed, None)
}
