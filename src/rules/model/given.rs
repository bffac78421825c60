//! The given predicates: the snapshots, the designators, the ontology.

use crate::model::program::{Predicate, PredicateId, Predicates};
use actcheck_base::{Term, TermId, Terms, names};

/// Name, signature and arity of each given predicate.
pub(crate) const GIVEN: [(&str, &str, usize); 7] = [
    ("state", "state(phase, subject, property, object)", 4),
    ("before", "before(subject, property, object)", 3),
    ("after", "after(subject, property, object)", 3),
    ("during", "during(subject, property, object)", 3),
    ("ontology", "ontology(subject, property, object)", 3),
    ("parameter", "parameter(designator, value)", 2),
    ("course", "course(subject, property, seconds, value)", 4),
];

/// The predicates of a property's file that determine the verdict: name and meaning.
pub(crate) const VERDICT: [(&str, &str); 5] = [
    ("success", "its tuples prove that the property holds"),
    (
        "violation",
        "its tuples prove that the property does not hold",
    ),
    (
        "margin",
        "how far the outcome is from flipping, in the property's unit",
    ),
    (
        "applicable",
        "if it is defined and has no tuples, the property is inapplicable",
    ),
    ("because", "the author's words for the outcome"),
];

/// Returns the index of the property argument. Returns `None` for predicates that are not split by
/// property.
pub(crate) fn property_place(name: &str) -> Option<usize> {
    match name {
        "state" => Some(2),
        "ontology" | "course" => Some(1),
        _ => None,
    }
}

/// Returns the IRI of the phase for a shorthand predicate such as `before`. Returns `None` for
/// other predicates.
pub(crate) fn phase_of(shorthand: &str) -> Option<String> {
    matches!(shorthand, "before" | "after" | "during").then(|| names::act(shorthand))
}

/// Ids of the three phases.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Phases {
    pub(crate) before: TermId,
    pub(crate) after: TermId,
    pub(crate) during: TermId,
}

impl Phases {
    pub(crate) fn intern(terms: &mut Terms) -> Self {
        let mut id = |name: &str| terms.intern(Term::iri(names::act(name)));
        Self {
            before: id("before"),
            after: id("after"),
            during: id("during"),
        }
    }
}

/// Adds the given predicate of a name, for one property or for any.
pub(crate) fn add_given(
    predicates: &mut Predicates,
    name: &str,
    property: Option<TermId>,
) -> PredicateId {
    let arity = GIVEN
        .iter()
        .find(|(given, ..)| *given == name)
        .map_or(0, |(_, _, arity)| *arity);
    let width = arity - usize::from(property.is_some());
    predicates.add(Predicate {
        name: name.to_owned(),
        scope: 0,
        property,
        arity,
        width,
        given: true,
    })
}
