//! A whole trace as facts.

use std::collections::{BTreeMap, BTreeSet};

use crate::actions::{ActionEnd, Trace};
use crate::base::{Term, TermId, names};
use crate::facts::writer::{Writer, thing_iri};
use crate::facts::{RunFacts, during, snapshot};

/// The facts of a run: one list for each snapshot, and one list of what happened and one of designators for each action.
///
/// The same trace gives the same facts with the same numbers. An action that was never reached has no facts of its own;
/// its designators are there. Every number is the shortest decimal of its f32.
pub fn extract(trace: &Trace) -> RunFacts {
    let mut writer = Writer::default();
    let mut facts = RunFacts::default();
    for state in &trace.snapshots {
        snapshot::write(state, &mut writer);
        facts.snapshots.push(writer.take());
    }
    let bodies: BTreeSet<&str> = trace.snapshots.iter().flat_map(|s| s.bodies.iter().map(|b| b.id.as_str())).collect();
    for action in &trace.actions {
        if action.end != ActionEnd::NotReached {
            during::write(action, &mut writer);
        }
        facts.during.push(writer.take());
        facts.parameters.push(parameters(&action.parameters, &bodies, &mut writer));
    }
    facts.terms = writer.terms;
    facts
}

/// Designators by their IRIs: the value is an object where the scene has one of that name, otherwise a text.
fn parameters(
    values: &BTreeMap<String, Vec<String>>,
    bodies: &BTreeSet<&str>,
    writer: &mut Writer,
) -> Vec<[TermId; 2]> {
    let mut pairs = Vec::new();
    for (designator, values) in values {
        let designator = writer.terms.intern(Term::iri(names::act(designator)));
        for value in values {
            let term = if bodies.contains(value.as_str()) { Term::iri(thing_iri(value)) } else { Term::string(value) };
            pairs.push([designator, writer.terms.intern(term)]);
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
