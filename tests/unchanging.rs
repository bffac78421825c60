//! Success properties that no action can change, and the facts that they read.

use std::collections::{BTreeMap, BTreeSet};

use actcheck::base::{CONSTANT_PROPERTIES, Files, Source, names};
use actcheck::campaign::Env;
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::ontology::{self, Ontology, Property, RuleFile};
use actcheck::rules::RuleBook;

use crate::support::{line, root};

const TESTED: &str = "http://actions#Tested";

fn shipped() -> Ontology {
    ontology::load(&Files::Disk, &root().join("ontology/extra.ttl")).unwrap()
}

/// The codes of the warnings about a property with this rule.
fn codes(ontology: &Ontology) -> Vec<&'static str> {
    RuleBook::prepare(ontology)
        .unwrap()
        .warnings()
        .iter()
        .map(|warning| warning.code)
        .collect()
}

/// The shipped ontology with one more property.
fn with_rule(body: &str) -> Ontology {
    let prefixes =
        "@prefix act: <http://actions#> .\n@prefix w: <https://w3id.org/actcheck/world#> .\n";
    let rule = RuleFile::new(Source::new("rules.rls", format!("{prefixes}{body}\n")));
    let mut ontology = shipped();
    ontology
        .properties
        .insert(TESTED.to_owned(), Property::new(TESTED, rule));
    ontology
}

#[test]
fn a_success_property_that_reads_only_constants_and_the_state_before_is_reported() {
    for (body, reported) in [
        (
            "success(?o) :- parameter(act:pickObject, ?o), before(?o, w:z, ?z), ?z > 0.3 .",
            true,
        ),
        (
            "success(?o) :- parameter(act:pickObject, ?o), after(?o, w:mass, ?m), ?m > 0.3 .",
            true,
        ),
        (
            "success(?o) :- state(act:before, ?o, w:upright, true) .",
            true,
        ),
        (
            "violation(?o) :- movable(?o), ~before(?o, w:fixed, false) .",
            true,
        ),
        (
            "success(?c) :- ontology(?c, <http://www.w3.org/2000/01/rdf-schema#subClassOf>, act:Cup) .",
            true,
        ),
        (
            "success(?n) :- count(?n), ?n > 2 .\ncount(#count(?o)) :- before(?o, w:mass, _) .",
            true,
        ),
        (
            "success(?o) :- parameter(act:pickObject, ?o), after(?o, w:z, ?z), ?z > 0.3 .",
            false,
        ),
        (
            "success(?o) :- parameter(act:pickObject, ?o), displacement(?o, ?d), ?d > 0.02 .",
            false,
        ),
        (
            "success(?o) :- during(?o, w:sizeX, ?size), ?size > 0.02 .",
            false,
        ),
        (
            "success(?o, ?phase) :- state(?phase, ?o, w:mass, ?m), ?m > 0.3 .",
            false,
        ),
        (
            "success(?o) :- state(act:after, ?o, w:upright, true) .",
            false,
        ),
        (
            "success(?o) :- parameter(act:pickObject, ?o), eventually(w:rise(?o) > 0.02) .",
            false,
        ),
        (
            "success(?o) :- before(?o, w:mass, _), course(?o, w:z, ?t, ?z), ?t > 1.0, ?z > 0.3 .",
            false,
        ),
        (
            "success(?o, ?property) :- after(?o, ?property, 1.0) .",
            false,
        ),
        (
            "success(?o) :- before(?o, w:mass, _) .\napplicable(?r) :- during(w:action, w:reported, ?r) .",
            false,
        ),
    ] {
        let mut ontology = with_rule(body);
        assert_eq!(
            codes(&ontology),
            [""; 0],
            "a property that no action has: {body}"
        );
        let pick = ontology.actions.get_mut("Pick").unwrap();
        pick.success_properties.push(TESTED.to_owned());
        assert_eq!(codes(&ontology).contains(&"R046"), reported, "{body}");
        ontology
            .actions
            .get_mut("Place")
            .unwrap()
            .preconditions
            .push(TESTED.to_owned());
        assert!(
            !codes(&ontology).contains(&"R046"),
            "a precondition reads the state before: {body}"
        );
    }
}

#[test]
fn actions_can_change_every_shipped_property() {
    assert_eq!(codes(&shipped()), [""; 0]);
}

/// The lint relies on it.
#[test]
fn constant_properties_have_the_same_values_before_and_after_an_action() {
    let env = Env::prepare(&root().join("configs/quick.toml"), &Overrides::default()).unwrap();
    let run = line::run(&env, Choices::random(5, 0), None);
    let constant: BTreeSet<String> = CONSTANT_PROPERTIES.into_iter().map(names::w).collect();
    let of = |snapshot: &[[actcheck::base::TermId; 3]]| -> BTreeMap<String, BTreeSet<String>> {
        let mut values: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for [s, p, o] in snapshot
            .iter()
            .map(|triple| triple.map(|id| run.facts.terms.term(id).to_string()))
        {
            values.entry(p).or_default().insert(format!("{s} {o}"));
        }
        values.retain(|property, _| {
            constant.iter().any(|iri| names::shorten(iri) == *property) || property == "rdf:type"
        });
        values
    };
    let snapshots: Vec<_> = run
        .facts
        .snapshots
        .iter()
        .map(|triples| of(triples))
        .collect();
    assert!(
        snapshots.len() > 2 && snapshots[0].len() > 8,
        "{:?}",
        snapshots[0].keys()
    );
    for later in &snapshots[1..] {
        assert_eq!(*later, snapshots[0]);
    }
    let vocabulary = shipped().vocabulary;
    assert!(constant.iter().all(|iri| {
        vocabulary
            .terms
            .get(iri)
            .is_some_and(|term| term.is_property)
    }));
}
