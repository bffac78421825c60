//! Facts about a scene's objects and its sensor noise, only for the scene requirement. Actions
//! don't have them, because no verdict may depend on the role of an object.

use std::collections::BTreeMap;

use actcheck_base::{RunFacts, Term, Triple, names};
use actcheck_data::Scene;
use actcheck_facts::thing_iri;
use actcheck_history as history;
use actcheck_ontology::VocabularyTerm;

/// Local names of the terms for objects and worlds, as in histories.
const NAMED: [&str; 3] = ["role", "model", "worldName"];

/// The terms of these facts for rules; all are in the namespace `act:`.
pub(super) fn vocabulary() -> BTreeMap<String, VocabularyTerm> {
    NAMED
        .into_iter()
        .chain(history::NOISE_TERMS)
        .map(|local| (names::act(local), VocabularyTerm::property()))
        .collect()
}

/// Adds the facts to the first state: role and model of each object, world and noise of the robot.
pub(super) fn add(scene: &Scene, facts: &mut RunFacts) {
    let RunFacts {
        terms, snapshots, ..
    } = facts;
    let Some(state) = snapshots.first_mut() else {
        return;
    };
    let mut say = |subject: &str, local: &str, value: Term| {
        let triple: Triple = [Term::iri(subject), Term::iri(names::act(local)), value]
            .map(|term| terms.intern(term));
        state.push(triple);
    };
    for object in &scene.objects {
        let thing = thing_iri(&object.id);
        say(&thing, "role", Term::string(object.role.word()));
        say(&thing, "model", Term::string(&object.model.name));
    }
    let robot = thing_iri("robot");
    say(&robot, "worldName", Term::string(&scene.world));
    for (local, value) in history::noise(scene) {
        say(&robot, local, Term::Double(value));
    }
    state.sort_unstable();
    state.dedup();
}
