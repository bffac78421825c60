//! The trace of one action, from its states and events, and its facts.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_base::{RunFacts, Term};
use actcheck_data::{Form, Trace};
use actcheck_facts as facts;

use crate::during::During;
use crate::lacks::{Lacks, class_iri};
use crate::snapshot::State;

/// Returns the trace of an action, and whether the classes of objects are missing.
pub(crate) fn trace(
    action: &str,
    parameters: &BTreeMap<String, Vec<String>>,
    [before, after]: [&State; 2],
    during: During,
) -> (Trace, bool) {
    let mut lacks = Lacks::default();
    for some in [&before.lacks, &after.lacks, &during.lacks] {
        lacks.add_all(some);
    }
    let without_classes = lacks.classes;
    let bodies = before.snapshot.bodies.iter().zip(&before.known);
    let forms = bodies
        .filter(|(_, known)| !known.parts.is_empty())
        .map(|(body, known)| Form {
            name: body.id.clone(),
            parts: known.parts.clone(),
        });
    let mut performed = during.action;
    performed.action = action.to_owned();
    performed.parameters = parameters.clone();
    let mut trace = Trace {
        snapshots: vec![before.snapshot.clone(), after.snapshot.clone()],
        actions: vec![performed],
        map: before.map.clone(),
        forms: forms.collect(),
        robot_courses: vec![during.course],
        ..Trace::default()
    };
    lacks.note(&mut trace);
    (trace, without_classes)
}

/// Returns the facts of a trace, without the classes of objects if some are missing.
pub(crate) fn facts_of(trace: &Trace, without_classes: bool) -> RunFacts {
    let mut facts = facts::extract(trace);
    if without_classes {
        let iri = class_iri();
        let class = facts.terms.id(&Term::iri(iri.as_str()));
        for triples in &mut facts.snapshots {
            triples.retain(|[_, property, _]| Some(*property) != class);
        }
        facts.lacks.push(iri);
        facts.lacks.sort();
    }
    facts
}

/// Returns the ids that only one of two states has.
pub(crate) fn differing<'s>(before: &'s State, after: &'s State) -> Vec<&'s str> {
    let ids = |state: &'s State| -> BTreeSet<&'s str> {
        let bodies = state.snapshot.bodies.iter();
        bodies.map(|body| body.id.as_str()).collect()
    };
    let (before, after) = (ids(before), ids(after));
    before.symmetric_difference(&after).copied().collect()
}
