//! Contacts, percepts and outcomes, each at its time.

use std::collections::BTreeMap;

use crate::bag::cdr::{Cdr, Stamp};
use crate::bag::markers::{self, Marker};
use crate::bag::motion::MAP;
use crate::bag::recorder::Recorder;
use crate::bag::types::{CONTACTS, DIAGNOSTICS, MARKERS, PERCEPTS};
use actcheck_base::{Judgement, Outcome, names};
use actcheck_data::{ActionTrace, ContactEpisode, Pose, Samples, Trace};
use actcheck_history::{ActionDetail, RunDetail};

/// Adds markers that are shown from a time on.
pub(super) fn record_markers(recorder: &mut Recorder, at: Stamp, markers: &[Marker]) {
    if markers.is_empty() {
        return;
    }
    let mut message = Cdr::new();
    message.each(markers, |message, marker| marker.write(message, at));
    recorder.add(MARKERS, at, message);
}

/// Adds the forces between bodies in each control tick that has some, and the first one without; and
/// marks of the robot's contacts.
pub(super) fn record_contacts(recorder: &mut Recorder, trace: &Trace) {
    let actions = trace.actions.iter().zip(&trace.snapshots);
    let mut n_marks = 0;
    for ((action, state), course) in actions.zip(&trace.robot_courses) {
        let begin = state.time_secs;
        forces(recorder, begin, &course.samples, &action.contacts);
        for contact in &action.contacts {
            let of_robot = contact
                .pair
                .iter()
                .filter(|body| body.starts_with("robot/"));
            if of_robot.count() != 1 {
                continue;
            }
            let label = format!(
                "{}, {:.1} N",
                contact.pair.join(" on "),
                contact.max_force_n
            );
            let lasts = Stamp::of_secs((contact.end_secs - contact.start_secs).max(0.1));
            let mark = markers::contact(n_marks, contact.point_m, lasts, label);
            n_marks += 1;
            record_markers(
                recorder,
                Stamp::of_secs(begin + contact.start_secs),
                &[mark],
            );
        }
    }
}

/// A force between two bodies. Unit: newtons.
struct Force<'a> {
    pair: [&'a str; 2],
    newtons: f64,
}

fn forces(recorder: &mut Recorder, begin: f64, samples: &Samples, contacts: &[ContactEpisode]) {
    let mut ticks: BTreeMap<usize, Vec<Force<'_>>> = BTreeMap::new();
    let series = samples
        .series
        .iter()
        .filter(|series| series.quantity == "contactForce");
    for series in series {
        for (tick, newtons) in series
            .values()
            .enumerate()
            .filter(|(_, force)| *force > 0.0)
        {
            ticks.entry(tick).or_default().push(Force {
                pair: [&series.thing, &series.other],
                newtons,
            });
        }
    }
    let ends: Vec<usize> = ticks.keys().map(|tick| tick + 1).collect();
    for end in ends.into_iter().filter(|tick| *tick < samples.count) {
        ticks.entry(end).or_default();
    }
    for (tick, forces) in ticks {
        let secs = tick as f64 * samples.period_secs;
        let at = Stamp::of_secs(begin + secs);
        let mut message = Cdr::new();
        message.header(at, MAP);
        message.each(&forces, |message, force| {
            message.text(force.pair[0]);
            message.text(force.pair[1]);
            message.vector(point(contacts, force.pair, secs));
            message.f64(force.newtons);
        });
        recorder.add(CONTACTS, at, message);
    }
}

/// The point at which two bodies pressed on each other most, in the contact that a time is in or
/// nearest to; NaN if it is unknown. Unit: metres. Frame: world.
fn point(contacts: &[ContactEpisode], pair: [&str; 2], secs: f64) -> [f64; 3] {
    let is_pair = |contact: &&ContactEpisode| {
        let [first, second] = contact.pair.each_ref().map(String::as_str);
        [first, second] == pair || [second, first] == pair
    };
    let off = |contact: &ContactEpisode| {
        (contact.start_secs - secs)
            .max(secs - contact.end_secs)
            .max(0.0)
    };
    let nearest = contacts
        .iter()
        .filter(is_pair)
        .min_by(|a, b| off(a).total_cmp(&off(b)));
    nearest.map_or([f64::NAN; 3], |contact| contact.point_m)
}

/// A believed object.
struct Detection<'a> {
    id: &'a str,
    kind: &'a str,
    foot: Pose,
    size_m: [f64; 3],
}

/// Adds the objects that each action perceived, at the time of its last picture.
pub(super) fn record_percepts(recorder: &mut Recorder, trace: &Trace) {
    for (idx, action) in trace.actions.iter().enumerate() {
        let seen = detections(action);
        let looks = action.percepts.iter().map(|percept| percept.look);
        let looks = looks.chain(action.perceived.iter().map(|perceived| perceived.look));
        let last = looks.flatten().map(|look| look.time_secs).reduce(f64::max);
        let end = trace.snapshots.get(idx + 1).or(trace.snapshots.last());
        let Some(secs) = last.or(end.map(|state| state.time_secs)) else {
            continue;
        };
        if seen.is_empty() {
            continue;
        }
        let at = Stamp::of_secs(secs);
        let boxes = seen.iter().map(|seen| (seen.id, seen.foot, seen.size_m));
        record_markers(recorder, at, &markers::percepts(boxes));
        let mut message = Cdr::new();
        message.header(at, MAP);
        message.each(&seen, |message, seen| detection(message, at, seen));
        recorder.add(PERCEPTS, at, message);
    }
}

fn detections(action: &ActionTrace) -> Vec<Detection<'_>> {
    let asked = action.percepts.iter().map(|percept| Detection {
        id: &percept.id,
        kind: "",
        foot: percept.pose,
        size_m: percept.size_m,
    });
    let things = action
        .perceived
        .iter()
        .flat_map(|perceived| &perceived.things);
    let found = things.map(|thing| {
        let kind = thing.category.as_deref().map_or("", names::local);
        Detection {
            id: kind,
            kind,
            foot: thing.pose,
            size_m: thing.size_m,
        }
    });
    asked.chain(found).collect()
}

/// `vision_msgs/Detection3D`. The pose of its hypothesis is that of the object's foot.
fn detection(message: &mut Cdr, at: Stamp, seen: &Detection<'_>) {
    message.header(at, MAP);
    message.count(1);
    message.text(seen.kind);
    message.f64(1.0);
    message.pose(&seen.foot);
    // The covariance is unknown.
    (0..36).for_each(|_| message.f64(0.0));
    let up = nalgebra::Translation3::new(0.0, 0.0, seen.size_m[2] / 2.0);
    message.pose(&Pose::from_isometry(&(seen.foot.to_isometry() * up)));
    message.vector(seen.size_m);
    message.text(seen.id);
}

/// Adds the outcomes of each action, at its end.
pub(super) fn record_outcomes(recorder: &mut Recorder, run: &RunDetail, trace: &Trace) {
    for (idx, action) in run.actions.iter().enumerate() {
        let end = trace.snapshots.get(idx + 1).or(trace.snapshots.last());
        let at = Stamp::of_secs(end.map_or(0.0, |state| state.time_secs));
        let mut message = Cdr::new();
        message.header(at, "");
        message.each(&action.judgements, |message, judgement| {
            status(message, run, action, judgement);
        });
        recorder.add(DIAGNOSTICS, at, message);
    }
}

/// `diagnostic_msgs/DiagnosticStatus`.
fn status(message: &mut Cdr, run: &RunDetail, action: &ActionDetail, judgement: &Judgement) {
    let property = names::local(&judgement.property);
    let (ok, warning, error, stale) = (0, 1, 2, 3);
    message.u8(match judgement.outcome {
        Outcome::Passed => ok,
        Outcome::Failed => error,
        Outcome::Broken | Outcome::Timeout => warning,
        Outcome::Inapplicable | Outcome::Untested => stale,
    });
    let step = action.step;
    message.text(&format!(
        "{step} {}: {property}",
        names::local(&action.action)
    ));
    let outcome = judgement.outcome.word();
    message.text(&match judgement.witness.as_str() {
        "" => outcome.to_owned(),
        witness => format!("{outcome}: {witness}"),
    });
    message.text(&run.row.run);
    let mut values = vec![
        ("outcome", outcome.to_owned()),
        ("property", judgement.property.clone()),
        ("step", step.to_string()),
    ];
    if let Some(margin) = judgement.margin {
        values.push(("margin", margin.to_string()));
    }
    message.each(&values, |message, (key, value)| {
        message.text(key);
        message.text(value);
    });
}
