//! One action of a replay: its messages, its outcomes with explanations, and its events.

use serde_json::{Value, json};

use crate::contacts::strongest;
use crate::html::Explained;
use crate::moment::deciding_moment;
use crate::pressed::pressed_in;
use actcheck_analysis::perceived_sentences;
use actcheck_base::{Outcome, names};
use actcheck_data::{Pose, Trace};
use actcheck_history::RunDetail;

/// Describes an action, given its index in the run.
pub(super) fn action(run: &RunDetail, trace: Option<&Trace>, idx: usize, explained: &[Explained]) -> Value {
    let action = &run.actions[idx];
    let judged = action.judgements.iter().map(|judgement| {
        let why = explained.iter().find(|why| why.step == action.step && why.property == judgement.property);
        let failed = judgement.outcome == Outcome::Failed;
        let pressed = trace.filter(|_| failed).and_then(|trace| pressed_in(trace, idx, &judgement.witness));
        json!({
            "property": judgement.property, "outcome": judgement.outcome.word(), "margin": judgement.margin,
            "witness": judgement.witness, "held": judgement.held_before, "why": why.map(|why| &why.text),
            "pressed": pressed.map(|pressed| pressed.sentence()),
            "decided": trace.filter(|_| failed).map(|trace| deciding_moment(trace, idx, &judgement.witness)),
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

/// Adds the events of an action from the trace: start, phases, contacts, percepts.
fn events(packed: &mut Value, trace: &Trace, idx: usize) {
    let Some(action) = trace.actions.get(idx) else { return };
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    let state = trace.snapshots.get(idx).or(trace.snapshots.last());
    packed["start"] = json!(state.map_or(0.0, |state| state.time_secs - begin));
    packed["phases"] = action.phases.iter().map(|phase| json!([phase.name, phase.start_secs])).collect();
    let contacts = strongest(&action.contacts).into_iter().map(|contact| {
        let [a, b] = &contact.pair;
        json!([a, b, contact.start_secs, contact.end_secs, contact.max_force_n])
    });
    packed["contacts"] = contacts.collect();
    let asked = action.percepts.iter().map(|seen| percept(&seen.id, &seen.pose, seen.size_m));
    let things = action.perceived.iter().flat_map(|perceived| &perceived.things);
    let things =
        things.map(|thing| percept(thing.category.as_deref().map_or("?", names::local), &thing.pose, thing.size_m));
    packed["seen"] = asked.chain(things).collect();
}

/// A perceived object: the pose of its bottom centre, and its size.
fn percept(name: &str, pose: &Pose, size_m: [f64; 3]) -> Value {
    let at: Vec<f64> = pose.position.iter().chain(&pose.rotation).copied().collect();
    json!({ "name": name, "at": at, "size": size_m })
}
