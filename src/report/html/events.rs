//! One action of a replay: its messages, its outcomes with explanations, and its events.

use serde_json::{Value, json};

use crate::contacts::strongest;
use crate::html::Explained;
use crate::html::signals::{deciding, grip, hand};
use crate::moment::{Event, deciding_moment, stated_moment};
use crate::pressed::pressed_in;
use actcheck_analysis::perceived_sentences;
use actcheck_base::{Outcome, names};
use actcheck_data::{Look, Pose, Trace};
use actcheck_history::RunDetail;

/// Describes an action, given its index in the run.
pub(super) fn action(
    run: &RunDetail,
    trace: Option<&Trace>,
    idx: usize,
    explained: &[Explained],
) -> Value {
    let action = &run.actions[idx];
    let judged = action.judgements.iter().map(|judgement| {
        let why = explained.iter().find(|why| why.step == action.step && why.property == judgement.property);
        let failed = judgement.outcome == Outcome::Failed;
        let pressed = trace.filter(|_| failed).and_then(|trace| pressed_in(trace, idx, &judgement.witness));
        let signals = why.map_or(&[][..], |why| why.deciding.as_slice());
        let started = trace.map_or(0.0, |trace| began(trace, idx));
        // A formula over time says itself when it was decided.
        let stated = match signals.first() {
            Some(signal) if failed && trace.is_some() => Some((started + signal.at_secs(), None)),
            _ => trace.filter(|_| failed).map(|trace| stated_moment(trace, idx, &judgement.witness)),
        };
        let decided = match signals.first() {
            Some(_) => stated.map(|(secs, _)| secs),
            None => trace.filter(|_| failed).map(|trace| deciding_moment(trace, idx, &judgement.witness)),
        };
        json!({
            "signals": signals.iter().map(deciding).collect::<Vec<Value>>(),
            "stated": stated.map(|(secs, _)| secs), "event": stated.and_then(|(_, event)| event).map(Event::words),
            "property": judgement.property, "outcome": judgement.outcome.word(), "margin": judgement.margin,
            "witness": judgement.witness, "held": judgement.held_before, "why": why.map(|why| &why.text),
            "pressed": pressed.map(|pressed| pressed.sentence()),
            "decided": decided,
        })
    });
    let perceived = trace.and_then(|trace| perceived_sentences(run, trace).remove(&action.step));
    let mut packed = json!({
        "action": action.action, "perceived": perceived, "step": action.step, "reported": action.reported, "message": action.message,
        "seconds": action.duration_secs, "end": action.end, "parameters": action.parameters,
        "judged": judged.collect::<Vec<Value>>(),
    });
    if let Some(trace) = trace {
        events(&mut packed, trace, idx);
    }
    packed
}

/// When an action began. Unit: seconds since the run began.
fn began(trace: &Trace, idx: usize) -> f64 {
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    trace
        .snapshots
        .get(idx)
        .or(trace.snapshots.last())
        .map_or(0.0, |state| state.time_secs - begin)
}

/// Adds the events of an action from the trace: start, phases, contacts, percepts.
fn events(packed: &mut Value, trace: &Trace, idx: usize) {
    let Some(action) = trace.actions.get(idx) else {
        return;
    };
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    packed["start"] = json!(began(trace, idx));
    packed["phases"] = action
        .phases
        .iter()
        .map(|phase| json!([phase.name, phase.start_secs]))
        .collect();
    let contacts = strongest(&action.contacts).into_iter().map(|contact| {
        let [a, b] = &contact.pair;
        json!([
            a,
            b,
            contact.start_secs,
            contact.end_secs,
            contact.max_force_n
        ])
    });
    packed["contacts"] = contacts.collect();
    let since = |look: Option<Look>| look.map(|look| look.time_secs - begin);
    let asked = action
        .percepts
        .iter()
        .map(|seen| percept(&seen.id, &seen.pose, seen.size_m, since(seen.look)));
    let looks = action
        .perceived
        .iter()
        .map(|perceived| (since(perceived.look), &perceived.things));
    let things = looks.flat_map(|(secs, things)| things.iter().map(move |thing| (secs, thing)));
    let things = things.map(|(secs, thing)| {
        percept(
            thing.category.as_deref().map_or("?", names::local),
            &thing.pose,
            thing.size_m,
            secs,
        )
    });
    packed["seen"] = asked.chain(things).collect();
    packed["hand"] = hand(trace, idx);
    packed["grip"] = trace
        .robot_courses
        .get(idx)
        .map_or(Value::Null, |course| grip(&course.motion));
}

/// A perceived object: the pose of its bottom centre, its size, and when it was perceived, since
/// the run began.
fn percept(name: &str, pose: &Pose, size_m: [f64; 3], secs: Option<f64>) -> Value {
    let at: Vec<f64> = pose
        .position
        .iter()
        .chain(&pose.rotation)
        .copied()
        .collect();
    json!({ "name": name, "at": at, "size": size_m, "secs": secs })
}
