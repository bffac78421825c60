//! Intervals of an action: as facts of simulated runs, and Allen's relations over random ones.

use std::collections::BTreeSet;

use actcheck::base::{Outcome, Term, names};
use actcheck::rules::{Facts, Rules, When};

use crate::support::planted::Dice;
use crate::support::{actcheck, made_history, root, stderr, stdout};

/// Allen's relations, as the library names them.
const RELATIONS: [&str; 13] = [
    "before",
    "after",
    "meets",
    "met_by",
    "overlaps",
    "overlapped_by",
    "during",
    "contains",
    "starts",
    "started_by",
    "finishes",
    "finished_by",
    "equals",
];

/// The relation of two intervals by the definition: starts and ends as whole ticks.
fn naive([s0, e0]: [u64; 2], [s1, e1]: [u64; 2]) -> &'static str {
    use std::cmp::Ordering::{Equal, Greater, Less};
    match (s0.cmp(&s1), e0.cmp(&e1)) {
        _ if e0 < s1 => "before",
        _ if s0 > e1 => "after",
        _ if e0 == s1 => "meets",
        _ if s0 == e1 => "met_by",
        (Equal, Equal) => "equals",
        (Equal, Less) => "starts",
        (Equal, Greater) => "started_by",
        (Greater, Equal) => "finishes",
        (Less, Equal) => "finished_by",
        (Less, Less) => "overlaps",
        (Greater, Greater) => "overlapped_by",
        (Greater, Less) => "during",
        (Less, Greater) => "contains",
    }
}

fn library() -> String {
    std::fs::read_to_string(root().join("rules/lib/intervals.rls"))
        .expect("the library is readable")
}

fn rules(text: &str) -> Rules {
    Rules::builder()
        .library("intervals.rls", &library())
        .build("property.rls", text)
        .unwrap_or_else(|found| panic!("{text}: {found}"))
}

/// Adds a hold of an object; its ends in ticks of 1/60 s, as single-precision decimals like those
/// of facts.
fn add(facts: &mut Facts, name: &str, object: &str, ends: [u64; 2]) {
    let subject = Term::iri(names::w(name));
    let mut set = |property: &str, value: Term| {
        facts.add(
            When::During,
            [subject.clone(), Term::iri(names::w(property)), value],
        );
    };
    set("heldObject", Term::iri(names::obj(object)));
    for (property, tick) in ["start", "end"].into_iter().zip(ends) {
        let secs: f64 = (tick as f32 / 60.0)
            .to_string()
            .parse()
            .expect("it is a number");
        set(property, Term::Double(secs));
    }
}

#[test]
fn exactly_one_of_allens_relations_holds_for_each_pair_of_intervals() {
    let mut dice = Dice::new(5);
    let text: Vec<String> = RELATIONS
        .iter()
        .map(|name| format!("violation(?a, ?b, \"{name}\") :- interval_{name}(?a, ?b) ."))
        .collect();
    let rules = rules(&text.join("\n"));
    let mut seen = BTreeSet::new();
    for _ in 0..400 {
        let mut interval = || {
            let start = dice.below(7);
            [start, start + 1 + dice.below(6)]
        };
        let (a, b) = (interval(), interval());
        let mut facts = Facts::new();
        add(&mut facts, "hold/a", "cup", a);
        add(&mut facts, "hold/b", "cup", b);
        let decision = rules.judge(&facts);
        let [first, second] = ["hold/a", "hold/b"].map(|name| Term::iri(names::w(name)));
        let found: Vec<String> = decision
            .witness()
            .iter()
            .filter(|row| row.values[0].1 == first && row.values[1].1 == second)
            .map(|row| row.values[2].1.to_string())
            .collect();
        let wanted = naive(a, b);
        assert_eq!(found, [Term::string(wanted).to_string()], "{a:?} {b:?}");
        seen.insert(wanted);
    }
    assert_eq!(seen.len(), RELATIONS.len(), "{seen:?}");
}

#[test]
fn the_last_hold_before_an_interval_and_the_length_of_an_interval_are_known() {
    let mut facts = Facts::new();
    for (name, ends) in [
        ("hold/1", [0, 10]),
        ("hold/2", [20, 50]),
        ("hold/3", [60, 70]),
        ("hold/4", [200, 300]),
    ] {
        add(&mut facts, name, "cup", ends);
    }
    let holds = |condition: &str| {
        let condition = condition.replace("<hold/", &format!("<{}hold/", names::W));
        rules(&format!("success(1) :- {condition} ."))
            .judge(&facts)
            .outcome
            == Outcome::Passed
    };
    assert!(holds("last_hold_before(<hold/3>, _, <hold/2>)"));
    assert!(!holds("last_hold_before(<hold/3>, _, <hold/1>)"));
    assert!(!holds("last_hold_before(<hold/1>, _, _)"));
    // 30 samples are half a second, although their ends are rounded.
    assert!(holds("lasts(<hold/2>, ?d), ?d >= 0.5"));
    assert!(!holds("lasts(<hold/2>, ?d), ?d > 0.5"));
}

/// The intervals of a simulated pick, for queries.
#[test]
fn queries_see_holds_motions_and_phases_in_the_history() {
    let history = made_history();
    let ask = |query: &str| {
        let output = actcheck(
            history.path(),
            &["query", query, "--history", ".", "--format", "csv"],
        );
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let phases = ask(
        "SELECT ?name ?start ?end WHERE { GRAPH ?g { ?phase w:phaseName ?name ; w:start ?start ; w:end ?end } }",
    );
    assert!(
        phases.lines().count() > 4 && phases.contains("lift"),
        "{phases}"
    );
    for kind in ["heldObject", "movedObject"] {
        let query = format!(
            "SELECT ?object ?start ?end WHERE {{ GRAPH ?g {{ ?i w:{kind} ?object ; w:start ?start ; w:end ?end
             FILTER (?start < ?end && ?start >= 0) }} }}"
        );
        assert!(ask(&query).lines().count() > 1, "{kind}");
    }
}
