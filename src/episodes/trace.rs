//! The trace of an episode's actions.

use actcheck_base::Digest;
use actcheck_data::{
    ActionEnd, ActionReport, ActionTrace, Frames, Pose, RobotCourse, SceneMap, Trace,
};

use crate::cast::link_name;
use crate::cuts::{Span, spans};
use crate::forms::forms;
use crate::meters;
use crate::snapshot::Watched;
use crate::{Action, Cast, Episode, Lacks, Quantity};

/// Time between two frames. Unit: seconds. As in our own traces.
const FRAME_SECS: f64 = 0.1;

/// Returns the trace of an episode's actions: of those that are listed, or else of those that the
/// recording program marked.
///
/// A trace without actions means that none is listed and none marked.
pub fn trace(episode: &Episode, cast: &Cast, actions: &[Action]) -> Trace {
    let watched = Watched::new(episode, cast);
    let actions: Vec<Action> = actions
        .iter()
        .map(|action| with_ids(action, &watched))
        .collect();
    let mut spans = spans(&watched, &actions);
    for value in spans
        .iter_mut()
        .flat_map(|span| span.parameters.values_mut().flatten())
    {
        name_thing(value, &watched);
    }
    let mut trace = Trace {
        map: SceneMap::default(),
        forms: forms(episode, cast, &watched.parts),
        frames: frames(&watched),
        hash: digest(episode),
        lacks: lacks(&watched, &spans).facts(),
        ..Trace::default()
    };
    for span in &spans {
        let Some([from, to]) = span.states else {
            trace
                .actions
                .push(ActionTrace::not_reached(&span.action, &span.parameters));
            continue;
        };
        // The state after one action is the state before the next one.
        if trace.snapshots.is_empty() {
            trace
                .snapshots
                .push(watched.snapshot(&episode.states[from]));
        }
        trace.snapshots.push(watched.snapshot(&episode.states[to]));
        let (action, course) = performed(&watched, span, [from, to]);
        trace.actions.push(action);
        trace.robot_courses.push(course);
    }
    trace
}

/// Gives the trace of an episode that repeats a run in another engine the map and the percepts of
/// that run.
pub fn repeat(run: &Trace, trace: &mut Trace) {
    trace.map = run.map.clone();
    for (own, known) in trace.actions.iter_mut().zip(&run.actions) {
        own.percepts.clone_from(&known.percepts);
        own.perceived.clone_from(&known.perceived);
    }
    trace
        .lacks
        .retain(|fact| !Quantity::OF_PERCEPTS.contains(&fact.as_str()));
}

/// An action whose values are ids of things where they were names of bodies.
fn with_ids(action: &Action, watched: &Watched<'_>) -> Action {
    let mut action = action.clone();
    for value in action.parameters.values_mut().flatten() {
        name_thing(value, watched);
    }
    if let Some(handled) = &mut action.handled {
        name_thing(handled, watched);
    }
    action
}

/// Replaces the name of a body by the id of its thing.
fn name_thing(value: &mut String, watched: &Watched<'_>) {
    if let Some(id) = watched.cast.id_of(value, &watched.episode.model) {
        *value = id.to_owned();
    }
}

fn performed(
    watched: &Watched<'_>,
    span: &Span,
    [from, to]: [usize; 2],
) -> (ActionTrace, RobotCourse) {
    let states = &watched.episode.states[from..=to];
    let measured = meters::measure(watched, states);
    let began_secs = states[0].time_secs;
    let action = ActionTrace {
        action: span.action.clone(),
        parameters: span.parameters.clone(),
        end: ActionEnd::Completed,
        report: span
            .report
            .as_ref()
            .map(|(succeeded, message)| ActionReport {
                succeeded: *succeeded,
                message: message.clone(),
            }),
        duration_secs: states[states.len() - 1].time_secs - began_secs,
        contacts: measured.contacts,
        percepts: Vec::new(),
        perceived: None,
        extremes: measured.extremes,
        base: measured.base,
        phases: Vec::new(),
    };
    (action, measured.course)
}

/// The quantities that the trace of an episode lacks.
fn lacks(watched: &Watched<'_>, spans: &[Span]) -> Lacks {
    let mut lacks = watched.episode.lacks.clone();
    // Marks may have reports where the environment states no success.
    lacks.remove(Quantity::Report);
    let cast = watched.cast;
    let mut miss = |quantity: Quantity, is_missing: bool| {
        if is_missing {
            lacks.add(quantity);
        }
    };
    let reached = spans.iter().filter(|span| span.states.is_some());
    miss(
        Quantity::Report,
        reached.clone().next().is_none() || reached.clone().any(|span| span.report.is_none()),
    );
    let model = &watched.episode.model;
    let movable = || {
        cast.things
            .iter()
            .filter(|thing| !thing.fixed)
            .flat_map(|thing| &thing.bodies)
            .map(|body| &model.bodies[*body])
    };
    miss(
        Quantity::Masses,
        movable().any(|body| body.mass_kg.is_none()),
    );
    miss(
        Quantity::Frictions,
        movable()
            .flat_map(|body| &body.shapes)
            .any(|shape| shape.collides && shape.friction.is_none()),
    );
    miss(
        Quantity::Shapes,
        cast.things
            .iter()
            .zip(&watched.parts)
            .any(|(thing, parts)| !thing.fixed && parts.is_empty()),
    );
    miss(Quantity::Robot, cast.base.is_none() && cast.hand.is_none());
    match &cast.hand {
        None => {
            miss(Quantity::Fingers, true);
            miss(Quantity::Opening, true);
        }
        Some(hand) => {
            miss(
                Quantity::Fingers,
                hand.fingers
                    .iter()
                    .any(std::collections::BTreeSet::is_empty),
            );
            miss(Quantity::Opening, hand.opening.is_empty());
        }
    }
    let first = watched.episode.states.first();
    miss(
        Quantity::Joints,
        first.is_none_or(|state| state.positions.is_empty())
            && watched.robot_joints().next().is_some(),
    );
    miss(
        Quantity::JointVelocities,
        first.is_none_or(|state| state.speeds.is_empty()),
    );
    miss(
        Quantity::JointEfforts,
        first.is_none_or(|state| state.efforts.is_empty())
            || watched
                .robot_joints()
                .any(|(_, joint)| joint.max_effort.is_none()),
    );
    miss(
        Quantity::MaxVelocities,
        watched
            .robot_joints()
            .any(|(_, joint)| joint.max_velocity.is_none()),
    );
    miss(
        Quantity::Velocities,
        first.is_none_or(|state| state.velocities.is_empty()),
    );
    lacks
}

/// Returns the poses of movable things and links, for pictures.
fn frames(watched: &Watched<'_>) -> Frames {
    let (cast, states) = (watched.cast, &watched.episode.states);
    let movable: Vec<usize> = (0..cast.things.len())
        .filter(|thing| !cast.things[*thing].fixed)
        .collect();
    let names = movable
        .iter()
        .map(|thing| cast.things[*thing].id.clone())
        .chain(
            cast.links
                .iter()
                .map(|body| link_name(&watched.episode.model.bodies[*body].name)),
        )
        .collect();
    let end_secs = states.last().map_or(0.0, |state| state.time_secs);
    let mut rows = Vec::new();
    let mut number = 0u32;
    loop {
        let at_secs = f64::from(number) * FRAME_SECS;
        // The last state that is not later.
        let idx = states.partition_point(|state| state.time_secs <= at_secs + 1e-9);
        let Some(state) = states.get(idx.saturating_sub(1)) else {
            break;
        };
        let things = movable
            .iter()
            .map(|thing| Pose::from_isometry(&cast.things[*thing].pose(&state.poses)));
        let links = cast
            .links
            .iter()
            .map(|body| state.poses.get(*body).copied().unwrap_or(Pose::IDENTITY));
        #[expect(clippy::cast_possible_truncation, reason = "frames are for pictures")]
        let row = things
            .chain(links)
            .flat_map(|pose| pose.position.into_iter().chain(pose.rotation))
            .map(|value| value as f32)
            .collect();
        rows.push(row);
        if at_secs >= end_secs {
            break;
        }
        number += 1;
    }
    Frames {
        period_secs: FRAME_SECS,
        names,
        rows,
    }
}

/// A digest over the bits of all poses and joint positions.
fn digest(episode: &Episode) -> String {
    let mut digest = Digest::new();
    for state in &episode.states {
        let poses = state
            .poses
            .iter()
            .flat_map(|pose| pose.position.into_iter().chain(pose.rotation));
        let bytes: Vec<u8> = poses
            .chain(state.positions.iter().copied())
            .flat_map(|value| value.to_bits().to_le_bytes())
            .collect();
        digest.update(&bytes);
    }
    digest.finish()
}
