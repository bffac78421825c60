//! Extracts the facts of a whole trace.

use std::collections::{BTreeMap, BTreeSet};

use crate::writer::Writer;
use crate::{course, during, intervals, places, robot_course, snapshot};
use actcheck_base::{RunFacts, Term, TermId, names};
use actcheck_data::{SceneMap, Trace};

/// Extracts the facts of a run: one list for each snapshot, and for each action one list of events
/// and one of designators.
///
/// The same trace gives the same facts with the same term IDs. An action that was never reached or
/// not performed has designators but no events. Every number is the shortest decimal of its f32.
pub fn extract(trace: &Trace) -> RunFacts {
    extract_to(trace, Extent::Rules)
}

/// Extracts the facts of a run like [`extract`], with those that rules don't use: the poses of
/// links, the rotations of the camera, the base's path also without rooms, and all contacts instead
/// of the strongest ones of each pair.
pub fn extract_complete(trace: &Trace) -> RunFacts {
    extract_to(trace, Extent::Complete)
}

/// How much of a trace becomes facts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    /// The facts that rules use.
    Rules,
    /// Everything that the vocabulary describes.
    Complete,
}

fn extract_to(trace: &Trace, extent: Extent) -> RunFacts {
    let mut writer = Writer::new();
    let mut facts = RunFacts::default();
    for state in &trace.snapshots {
        snapshot::write(state, &mut writer);
        if extent == Extent::Complete {
            snapshot::write_links(&state.robot, &mut writer);
        }
        places::write(&trace.map, &mut writer);
        facts.snapshots.push(writer.take());
    }
    let bodies: BTreeSet<&str> = trace
        .snapshots
        .iter()
        .flat_map(|s| s.bodies.iter().map(|b| b.id.as_str()))
        .collect();
    for (idx, action) in trace.actions.iter().enumerate() {
        if action.end.was_begun() {
            let began_secs = trace
                .snapshots
                .get(idx)
                .map_or(0.0, |before| before.time_secs);
            during::write(action, began_secs, extent, &mut writer);
            if extent == Extent::Complete {
                during::write_cameras(action, &mut writer);
            }
            if let Some(base) = &action.base
                && (extent == Extent::Complete || !trace.map.rooms.is_empty())
            {
                during::write_base(base, &mut writer);
            }
            if let Some(course) = trace.robot_courses.get(idx) {
                robot_course::write(course, &mut writer);
                intervals::write(course, &mut writer);
            }
            intervals::write_phases(action, &mut writer);
        }
        facts.during.push(writer.take());
        facts.courses.push(course::of_action(trace, idx));
        facts.parameters.push(parameters(
            &action.parameters,
            &bodies,
            &trace.map,
            &mut writer,
        ));
    }
    facts.terms = writer.terms;
    facts.lacks = trace.lacks.iter().map(|local| names::w(local)).collect();
    leave_out_missing(&mut facts);
    facts
}

/// Removes the facts whose values were not recorded: those of missing properties, and those about
/// missing things.
fn leave_out_missing(facts: &mut RunFacts) {
    let missing: BTreeSet<TermId> = facts
        .lacks
        .iter()
        .filter_map(|iri| facts.terms.id(&Term::iri(iri.as_str())))
        .collect();
    if missing.is_empty() {
        return;
    }
    for triples in facts.snapshots.iter_mut().chain(&mut facts.during) {
        triples.retain(|[subject, property, _]| {
            !missing.contains(property) && !missing.contains(subject)
        });
    }
}

/// Returns designators, as IRIs, with their values. A value is an object if the scene has one of
/// that name, else a location if the map has one, else a string.
fn parameters(
    values: &BTreeMap<String, Vec<String>>,
    bodies: &BTreeSet<&str>,
    map: &SceneMap,
    writer: &mut Writer,
) -> Vec<[TermId; 2]> {
    let mut pairs = Vec::new();
    for (designator, values) in values {
        let designator = writer.terms.intern(Term::iri(names::act(designator)));
        for value in values {
            let value = if bodies.contains(value.as_str()) {
                writer.thing(value)
            } else if map.locations.iter().any(|location| location.name == *value) {
                writer.named("location", value)
            } else {
                writer.terms.intern(Term::string(value))
            };
            pairs.push([designator, value]);
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
