//! What a scene itself says of its things and of what makes sensing wrong: facts for its requirement alone. No action has them, as
//! no verdict may depend on what a thing is there for.

use std::collections::BTreeMap;

use crate::base::{Term, names};
use crate::facts::{RunFacts, Triple, thing_iri};
use crate::history;
use crate::ontology::VocabularyTerm;
use crate::scenario::Scene;

/// Local names of what is said of things and worlds, as in histories.
const NAMED: [&str; 3] = ["role", "model", "worldName"];

/// The terms of these facts, all of the namespace `act:`, for the rules to use.
pub(super) fn vocabulary() -> BTreeMap<String, VocabularyTerm> {
    let term = || VocabularyTerm { is_property: true, ..VocabularyTerm::default() };
    NAMED.into_iter().chain(history::NOISE_TERMS).map(|local| (names::act(local), term())).collect()
}

/// Adds them to the facts of the scene's first moment: of each thing its role and its model, of the robot its world and its noise.
pub(super) fn add(scene: &Scene, facts: &mut RunFacts) {
    let RunFacts { terms, snapshots, .. } = facts;
    let Some(state) = snapshots.first_mut() else { return };
    let mut say = |subject: &str, local: &str, value: Term| {
        let triple: Triple = [Term::iri(subject), Term::iri(names::act(local)), value].map(|term| terms.intern(term));
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
