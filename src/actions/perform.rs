//! Performs a list of actions and records the trace.

use crate::cut::{self, Cut};
use crate::memory::Memory;
use crate::operator::{Interrupt, Operator};
use crate::skills::skill;
use crate::{ActionCall, ExternalFault, ExternalSkill, Saboteur};
use actcheck_data::{
    ActionEnd, ActionReport, ActionTrace, Budget, Choices, ContactEpisode, Extremes, Form, Frames,
    RobotCourse, SceneMap, SkillLog, Snapshot, Trace,
};
use actcheck_world::{OtherEngine, Playback, World, keep_playback, move_by};

/// Performs the actions in order with the reference skills.
///
/// Faults and exhausted budgets end the run but are returned as data: later actions are recorded as
/// not reached. An action that reports "failed" does not end the run, as with a real robot.
pub fn perform(
    calls: &[ActionCall],
    world: &mut World,
    choices: &mut Choices,
    budget: &Budget,
) -> Trace {
    perform_with(calls, world, choices, budget, Interference::default())
}

/// External interference with a run. The default is none.
#[derive(Default)]
pub struct Interference<'a> {
    /// Limit at which the run is cut off.
    pub cut: Cut,
    /// Injects faults on purpose.
    pub saboteur: Option<&'a mut Saboteur>,
    /// Performs the actions it knows, instead of the reference skills.
    pub external: Option<&'a mut dyn ExternalSkill>,
    /// Decides before each action whether it may be performed.
    pub gate: Option<&'a mut dyn Gate>,
    /// Takes the robot's part of the run for another engine.
    pub playback: Option<&'a mut Option<Playback>>,
    /// Steps the bodies instead of the physics engine.
    pub other_engine: Option<Box<dyn OtherEngine>>,
}

/// Decides whether an action may be performed.
pub trait Gate {
    /// Returns the reason why an action must not be performed in this state of the world; `None` if
    /// it may be.
    fn reason_not_to_perform(&mut self, call: &ActionCall, state: &Snapshot) -> Option<String>;
}

/// Performs the actions as [`perform`] does, with interference.
///
/// An action that the gate refuses is not performed; the run goes on with the next one.
///
/// The trace records the calls as given, not as sabotaged.
pub fn perform_with(
    calls: &[ActionCall],
    world: &mut World,
    choices: &mut Choices,
    budget: &Budget,
    mut interference: Interference<'_>,
) -> Trace {
    world.localise(choices);
    if interference.playback.is_some() {
        keep_playback(world);
    }
    if let Some(engine) = interference.other_engine.take() {
        move_by(world, engine);
    }
    let mut snapshots = vec![world.snapshot()];
    let mut memory = Memory::default();
    let mut actions: Vec<ActionTrace> = Vec::with_capacity(calls.len());
    let mut robot_courses = Vec::with_capacity(calls.len());
    let mut begun = interference
        .external
        .as_deref_mut()
        .map_or(Ok(()), |skill| skill.begin_run(world));
    // The last action that the external skill performed.
    let mut last_external = None;
    for call in calls {
        let stopped = actions
            .last()
            .is_some_and(|last| !last.end.lets_run_go_on());
        if stopped {
            actions.push(ActionTrace::not_reached(&call.action, &call.parameters));
            continue;
        }
        let state = snapshots.last();
        let refused = interference.gate.as_deref_mut().zip(state);
        let refused = refused.and_then(|(gate, state)| gate.reason_not_to_perform(call, state));
        let (action, course) = match (std::mem::replace(&mut begun, Ok(())), refused) {
            (Err(fault), _) => (never_begun(call, ended_by(fault)), RobotCourse::default()),
            (Ok(()), Some(reason)) => (
                never_begun(call, ActionEnd::NotPerformed(reason)),
                RobotCourse::default(),
            ),
            (Ok(()), None) => {
                if interference
                    .external
                    .as_deref()
                    .is_some_and(|skill| skill.performs(&call.action))
                {
                    last_external = Some(actions.len());
                }
                perform_one(
                    call,
                    (world, choices, &mut memory),
                    budget,
                    &mut interference,
                )
            }
        };
        actions.push(action);
        robot_courses.push(course);
        snapshots.push(world.snapshot());
    }
    if let (Some(skill), Some(last)) = (interference.external.as_deref_mut(), last_external) {
        let is_decided = actions
            .last()
            .is_some_and(|last| !last.end.lets_run_go_on());
        if let Err(fault) = skill.end_run(is_decided) {
            (actions[last].end, actions[last].report) = (ended_by(fault), None);
        }
    }
    if let Some(playback) = interference.playback {
        *playback = world.recorder().playback().cloned();
    }
    let tracks = world.recorder().tracks();
    let frames = Frames {
        period_secs: tracks.period_secs,
        names: tracks.names,
        rows: tracks.rows,
    };
    let forms = world
        .forms()
        .into_iter()
        .map(|(name, parts)| Form { name, parts })
        .collect();
    Trace {
        snapshots,
        actions,
        frames,
        hash: world.recorder().state_digest(),
        map: SceneMap::default(),
        forms,
        robot_courses,
        lacks: Vec::new(),
        skill: SkillLog::default(),
    }
}

fn perform_one(
    call: &ActionCall,
    (world, choices, memory): (&mut World, &mut Choices, &mut Memory),
    budget: &Budget,
    interference: &mut Interference<'_>,
) -> (ActionTrace, RobotCourse) {
    let began = world.time_secs();
    world.begin_record();
    let misled = interference
        .saboteur
        .as_deref_mut()
        .map(|saboteur| saboteur.begin(call, world));
    let understood = misled.as_ref().unwrap_or(call);
    let disturbed = (interference.cut, interference.saboteur.as_deref_mut());
    let mut operator = Operator::new(world, choices, memory, budget.action_secs, disturbed);
    let external = interference
        .external
        .as_deref_mut()
        .filter(|skill| skill.performs(&call.action));
    let outcome = match (external, skill(&call.action)) {
        (Some(external), _) => operator.act(|operator| external.perform(understood, operator)),
        (None, Ok(skill)) => operator.act(|operator| skill(understood, operator)),
        (None, Err(unknown)) => {
            return (
                never_begun(call, ActionEnd::Broken(unknown.to_string())),
                RobotCourse::default(),
            );
        }
    };
    let (phases, percepts, perceived) = (operator.phases, operator.percepts, operator.perceived);
    let (end, report) = ended(outcome, world, budget);
    let record = world.end_record();
    let contacts = record.contacts.into_iter().map(|contact| ContactEpisode {
        pair: contact.pair,
        start_secs: contact.start_secs,
        end_secs: contact.end_secs,
        max_force_n: contact.max_force_n,
        point_m: contact.point_m,
    });
    let extremes = record.courses.into_iter().map(|course| Extremes {
        id: course.id,
        max_tilt_rad: course.max_tilt_rad,
        max_speed: course.max_speed,
        max_rise_m: course.max_rise_m,
        max_displacement_m: course.max_displacement_m,
    });
    let trace = ActionTrace {
        action: call.action.clone(),
        parameters: call.parameters.clone(),
        end,
        report,
        duration_secs: world.time_secs() - began,
        contacts: contacts.collect(),
        percepts,
        perceived,
        extremes: extremes.collect(),
        base: record.base,
        phases,
    };
    (trace, record.robot)
}

/// An action that never began, with the reason.
fn never_begun(call: &ActionCall, end: ActionEnd) -> ActionTrace {
    ActionTrace {
        end,
        ..ActionTrace::not_reached(&call.action, &call.parameters)
    }
}

fn ended_by(fault: ExternalFault) -> ActionEnd {
    if fault.late {
        ActionEnd::Timeout(fault.reason)
    } else {
        ActionEnd::Broken(fault.reason)
    }
}

fn ended(
    outcome: Result<ActionReport, Interrupt>,
    world: &World,
    budget: &Budget,
) -> (ActionEnd, Option<ActionReport>) {
    match (outcome, world.fault()) {
        (_, Some(fault)) => (ActionEnd::Broken(fault.to_string()), None),
        (Ok(report), None) => (ActionEnd::Completed, Some(report)),
        (Err(Interrupt::Cut), None) => (ActionEnd::Cut(cut::REASON.to_owned()), None),
        (Err(Interrupt::Requests(reason)), None) => (ActionEnd::Timeout(reason), None),
        (Err(Interrupt::Stopped), None) => (
            ActionEnd::Cut("the campaign was interrupted".to_owned()),
            None,
        ),
        (Err(Interrupt::ExternalSkill(fault)), None) => (ended_by(fault), None),
        (Err(_), None) => {
            let reason = format!(
                "the action took longer than its budget of {} s",
                budget.action_secs
            );
            (ActionEnd::Timeout(reason), None)
        }
    }
}
