//! Rules that make new things (`!x`): against a naive chase in another order, and by hand.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use actcheck::base::{Source, Term};
use actcheck::ontology::{Ontology, Property, RuleFile};
use actcheck::rules::standalone::{Engine, Program};
use actcheck::rules::{Budget, Facts as Triples, RuleBook};
use proptest::prelude::*;

use crate::support::nulls::{Facts, are_isomorphic, maps_into};

/// An atom: a predicate with two arguments, each a variable (`?x`), a new thing (`!v`) or a
/// constant.
type Atom = (usize, [&'static str; 2]);

#[derive(Debug, Clone)]
struct Rule {
    heads: Vec<Atom>,
    body: Vec<Atom>,
}

fn shown(atoms: &[Atom]) -> String {
    let one = |(predicate, [a, b]): &Atom| format!("p{predicate}({a}, {b})");
    atoms.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn rules() -> impl Strategy<Value = Vec<Rule>> {
    let known = || prop_oneof![4 => Just("?x"), 4 => Just("?y"), 2 => Just("?z"), 1 => Just("1")];
    let in_head =
        || prop_oneof![3 => Just("?x"), 3 => Just("?y"), 3 => Just("!v"), 1 => Just("!w")];
    let body = proptest::collection::vec((0..5usize, [known(), known()]), 1..3);
    let heads = proptest::collection::vec((1..5usize, [in_head(), in_head()]), 1..3);
    let rule = (heads, body).prop_map(|(mut heads, body)| {
        // Only variables of the body.
        let bound: Vec<&str> = body.iter().flat_map(|(_, args)| *args).collect();
        for arg in heads.iter_mut().flat_map(|(_, args)| args) {
            if arg.starts_with('?') && !bound.contains(arg) {
                *arg = "2";
            }
        }
        Rule { heads, body }
    });
    proptest::collection::vec(rule, 1..6)
}

fn facts() -> impl Strategy<Value = Vec<(usize, [i64; 2])>> {
    proptest::collection::vec((0..3usize, [0..4_i64, 0..4_i64]), 1..6)
}

type Binding = BTreeMap<&'static str, String>;

/// Appends every extension of a binding under which all atoms are facts.
fn matches(atoms: &[Atom], facts: &Facts, binding: &Binding, found: &mut Vec<Binding>) {
    let Some(((predicate, args), rest)) = atoms.split_first() else {
        return found.push(binding.clone());
    };
    for (_, row) in facts
        .iter()
        .filter(|(name, _)| *name == format!("p{predicate}"))
    {
        let mut next = binding.clone();
        let fits = args
            .iter()
            .zip(row)
            .all(|(arg, value)| match arg.starts_with(['?', '!']) {
                true => next.entry(arg).or_insert_with(|| value.clone()) == value,
                false => arg == value,
            });
        if fits {
            matches(rest, facts, &next, found);
        }
    }
}

/// Returns the first match of a rule whose heads no facts satisfy.
fn unsatisfied(rule: &Rule, facts: &Facts) -> Option<Binding> {
    let mut found = Vec::new();
    matches(&rule.body, facts, &Binding::new(), &mut found);
    found.into_iter().find(|binding| {
        let mut extensions = Vec::new();
        matches(&rule.heads, facts, binding, &mut extensions);
        extensions.is_empty()
    })
}

/// The restricted chase, one match after another: rules without new things first, and the last rule
/// of the text first. Returns `None` after many steps.
fn chase(rules: &[Rule], mut facts: Facts) -> Option<Facts> {
    let makes = |rule: &&Rule| {
        rule.heads
            .iter()
            .any(|(_, args)| args.iter().any(|arg| arg.starts_with('!')))
    };
    let (makers, others): (Vec<&Rule>, Vec<&Rule>) = rules.iter().rev().partition(makes);
    for step in 0..150 {
        let next = others
            .iter()
            .chain(&makers)
            .find_map(|rule| Some((*rule, unsatisfied(rule, &facts)?)));
        let Some((rule, mut binding)) = next else {
            return Some(facts);
        };
        for (predicate, args) in &rule.heads {
            let row = args.iter().map(|arg| match arg.as_bytes()[0] {
                b'!' => binding
                    .entry(arg)
                    .or_insert_with(|| format!("_:{step}{}", &arg[1..]))
                    .clone(),
                b'?' => binding[arg].clone(),
                _ => (*arg).to_owned(),
            });
            let row = row.collect();
            facts.insert((format!("p{predicate}"), row));
        }
    }
    None
}

fn load(text: &str) -> Program {
    Program::load(&Source::new("things.rls", text), Path::new(""))
        .unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

/// The tuples of all predicates.
fn closed(program: &Program, engine: Engine, budget: &Budget) -> Option<Facts> {
    let closure = program.close(engine, budget).ok()?;
    let rows = |name: &str| {
        let values = |tuple: Vec<Term>| tuple.iter().map(Term::to_string).collect();
        closure
            .tuples(name)
            .into_iter()
            .map(|tuple| (name.to_owned(), values(tuple)))
            .collect::<Vec<_>>()
    };
    Some(closure.predicates().flat_map(rows).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// The result is a model of the rules, and as general as that of a chase in another order: each
    /// maps into the other.
    #[test]
    fn the_result_is_a_universal_model(rules in rules(), facts in facts()) {
        let mut text: String = facts.iter().map(|(p, [a, b])| format!("p{p}({a}, {b}) .\n")).collect();
        for rule in &rules {
            text.push_str(&format!("{} :- {} .\n", shown(&rule.heads), shown(&rule.body)));
        }
        let program = load(&text);
        let budget = Budget { new_things: 60, tuples: 2_000, secs: 20.0, ..Budget::default() };
        let Some(fast) = closed(&program, Engine::Fast, &budget) else { return Ok(()) };
        let naive = closed(&program, Engine::Naive, &budget);
        prop_assert_eq!(Some(&fast), naive.as_ref(), "naive evaluation of\n{}", text);
        for rule in &rules {
            prop_assert!(unsatisfied(rule, &fast).is_none(), "{} is not satisfied in\n{}", shown(&rule.heads), text);
        }
        let stated = facts.iter().map(|(p, row)| (format!("p{p}"), row.iter().map(i64::to_string).collect())).collect();
        if let Some(other) = chase(&rules, stated)
            && other.len() + fast.len() < 80
        {
            prop_assert!(maps_into(&fast, &other), "{:?} is not general in\n{}", fast, text);
            prop_assert!(maps_into(&other, &fast), "{:?} lacks tuples in\n{}", fast, text);
        }
    }

    /// Rules in another order give the same up to the labels of new things, if no rule reads the
    /// things of another one.
    #[test]
    fn rules_that_do_not_meet_give_the_same_in_any_order(facts in facts()) {
        let stated: String = facts.iter().map(|(p, [a, b])| format!("p{p}({a}, {b}) .\n")).collect();
        let rules = ["a(?x, !v), b(!v, ?y) :- p0(?x, ?y) .\n", "c(!v, !w) :- p1(?x, _) .\n", "d(?x, !v) :- p2(?x, ?x) .\n"];
        let budget = Budget::default();
        let one = closed(&load(&format!("{stated}{}", rules.concat())), Engine::Fast, &budget).unwrap();
        let turned = rules.iter().rev().copied().collect::<String>();
        let other = closed(&load(&format!("{turned}{stated}")), Engine::Fast, &budget).unwrap();
        prop_assert!(are_isomorphic(&one, &other));
    }
}

/// Asserts the tuples of a predicate, written as in rules.
#[track_caller]
fn gives(text: &str, predicate: &str, tuples: &[&str]) {
    let program = load(text);
    for engine in [Engine::Fast, Engine::Naive] {
        let facts = closed(&program, engine, &Budget::default()).unwrap();
        let rows: Vec<String> = facts
            .iter()
            .filter(|(name, _)| name == predicate)
            .map(|(_, row)| row.join(", "))
            .collect();
        assert_eq!(rows, tuples, "{engine:?}");
    }
}

#[test]
fn heads_with_one_name_share_the_new_thing() {
    let text =
        "touch(1, 2) . touch(3, 4) .\nevent(!e), first(!e, ?a), second(!e, ?b) :- touch(?a, ?b) .";
    gives(text, "event", &["_:0", "_:1"]);
    gives(text, "first", &["_:0, 1", "_:1, 3"]);
    gives(text, "second", &["_:0, 2", "_:1, 4"]);
}

#[test]
fn nothing_is_made_for_heads_that_hold() {
    let text = "person(1) . person(2) . parent(1, 7) .\nparent(?x, !p) :- person(?x) .";
    gives(text, "parent", &["1, 7", "2, _:0"]);
    // All heads together must hold, and by one thing.
    let text = "person(1) . parent(1, 7) . old(8) .\nparent(?x, !p), old(!p) :- person(?x) .";
    gives(text, "parent", &["1, 7", "1, _:0"]);
}

/// The contact of two things is one event, although each of them touches the other.
#[test]
fn a_thing_made_for_one_match_counts_for_the_next() {
    let text = "touches(1, 2) . touches(2, 1) . touches(2, 2) .\n\
                contact(!e, ?a, ?b), contact(!e, ?b, ?a) :- touches(?a, ?b) .";
    gives(text, "contact", &["_:0, 1, 2", "_:0, 2, 1", "_:1, 2, 2"]);
}

#[test]
fn one_thing_is_made_for_all_matches_with_the_same_heads() {
    gives(
        "p(1, 2) . p(1, 3) . p(2, 3) .\nq(?x, !v) :- p(?x, _) .",
        "q",
        &["1, _:0", "2, _:1"],
    );
    gives(
        "p(1, 2) . p(1, 3) .\nq(!v, !v) :- p(_, ?x), ?x > 2 .",
        "q",
        &["_:0, _:0"],
    );
    gives("p(1) .\nq(!v) :- p(2) .", "q", &[]);
}

#[test]
fn labels_avoid_those_of_the_facts() {
    gives(
        "p(_:0) . p(_:2) .\nq(?x, !v) :- p(?x) .",
        "q",
        &["_:0, _:1", "_:2, _:3"],
    );
}

#[test]
fn new_things_join_and_differ_but_have_no_value() {
    let text = "n(1) . n(2) .\nt(?x, !v) :- n(?x) .\n\
                same(?x, ?y) :- t(?x, ?v), t(?y, ?v) .\nother(?x, ?y) :- t(?x, ?v), t(?y, ?w), ?v != ?w .\n\
                less(?x) :- t(?x, ?v), ?v < 9 .\nsum(?y) :- t(?x, ?v), ?y = ?v + 1 .\nnull(?x) :- t(?x, ?v), isNull(?v) = true .";
    gives(text, "same", &["1, 1", "2, 2"]);
    gives(text, "other", &["1, 2", "2, 1"]);
    gives(text, "less", &[]);
    gives(text, "sum", &[]);
    gives(text, "null", &["1", "2"]);
}

#[test]
fn negation_and_aggregates_see_all_new_things() {
    let text = "n(1) . n(2) . n(3) . t(3, 4) .\nt(?x, !v) :- n(?x) .\nmade(?v) :- t(_, ?v), ~n(?v) .\n\
                count(#count(?v)) :- t(_, ?v) .\nlone(?x) :- n(?x), ~t(?x, 4) .";
    gives(text, "count", &["3"]);
    gives(text, "made", &["4", "_:0", "_:1"]);
    gives(text, "lone", &["1", "2"]);
}

/// The chase with rules without new things first is finite, although each thing could have a
/// successor.
#[test]
fn rules_without_new_things_come_first() {
    gives(
        "r(1, 2) .\nr(?y, !z) :- r(?x, ?y) .\nr(?y, ?x) :- r(?x, ?y) .",
        "r",
        &["1, 2", "2, 1"],
    );
}

#[test]
fn the_same_facts_give_the_same_labels() {
    let text = "p(\"b\", 10) . p(\"a\", 9) . p(\"c\", 2) .\nq(?x, !v) :- p(?x, ?n), ?m = ?n + 1, ?m > 0 .\n\
                r(?m, !w) :- p(_, ?n), ?m = ?n + 1 .";
    gives(text, "q", &["\"a\", _:0", "\"b\", _:1", "\"c\", _:2"]);
    gives(text, "r", &["10, _:4", "11, _:5", "3, _:3"]);
    // The order of the facts, which decides the ids of terms, does not matter.
    let turned = "p(\"c\", 2) . p(\"a\", 9) . p(\"b\", 10) .\n".to_owned()
        + text.split_once('\n').unwrap().1;
    gives(&turned, "q", &["\"a\", _:0", "\"b\", _:1", "\"c\", _:2"]);
    gives(&turned, "r", &["10, _:4", "11, _:5", "3, _:3"]);
}

#[test]
fn endless_rules_are_warned_of_and_stopped() {
    let text = "person(\"Eve\") .\nparent(?x, !mother), person(!mother) :- person(?x) .";
    let program = load(text);
    let warning = program.warnings.to_string();
    let place =
        "`!mother` gets into `person` (argument 1), for which the rule makes another `!mother`";
    assert!(
        warning.contains("R063") && warning.contains("things.rls:2:1") && warning.contains(place),
        "{warning}"
    );
    for engine in [Engine::Fast, Engine::Naive] {
        let budget = Budget {
            new_things: 50,
            ..Budget::default()
        };
        let fault = program.close(engine, &budget).unwrap_err().to_string();
        assert!(fault.contains("more than 50 new things (`!x`)"), "{fault}");
        assert!(
            engine == Engine::Naive || fault.contains("in the rule at things.rls:2"),
            "{fault}"
        );
    }
    // A condition that the new things don't satisfy.
    let bounded = "person(\"Eve\") . known(\"Eve\") .\n\
                   parent(?x, !mother), person(!mother) :- person(?x), known(?x) .";
    assert!(
        load(bounded).warnings.is_empty(),
        "{}",
        load(bounded).warnings
    );
}

#[test]
fn a_cycle_through_several_rules_is_named() {
    let text = "p(1) .\nq(?x, !a) :- p(?x) .\nr(?y) :- q(_, ?y) .\nowns(?y, !b), kept(!b) :- r(?y) .\np(?y) :- kept(?y) .";
    let warnings: Vec<String> = load(text)
        .warnings
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    let first = load(text)
        .warnings
        .iter()
        .next()
        .unwrap()
        .help
        .clone()
        .unwrap();
    assert!(
        first.starts_with(
            "`!a` gets into `q` (argument 2) and then `r` (argument 1), for which the rule at line 4 makes `!b`; \
             `!b` gets into `kept` (argument 1) and then `p` (argument 1), for which this rule makes another `!a`"
        ),
        "{first}"
    );
}

/// Joint acyclicity: a thing must get into every argument from which a variable is read.
#[test]
fn rules_that_end_need_no_budget() {
    let none = Budget {
        new_things: 0,
        ..Budget::default()
    };
    for text in [
        "n(1) . n(2) .\nt(?x, !v) :- n(?x) .\nu(?v, !w) :- t(_, ?v) .",
        "e(1, 2) . e(2, 3) .\np(?x, !v) :- e(?x, ?y) .\ne(?y, ?v) :- p(?x, ?v), e(?x, ?y), p(?y, ?v) .",
        "a(1) . b(1) .\nc(?x, !v), a(!v) :- a(?x), b(?x) .",
    ] {
        let program = load(text);
        assert!(
            program
                .warnings
                .iter()
                .all(|warning| warning.code != "R063"),
            "{}",
            program.warnings
        );
        assert!(closed(&program, Engine::Fast, &none).is_some(), "{text}");
    }
}

#[test]
fn a_new_thing_is_explained_by_the_match_it_was_made_for() {
    let program = load(
        "touch(\"cup\", \"plate\") .\n% A contact is an event.\nevent(!e, ?a) :- touch(?a, ?b), ?a != ?b .\n\
         late(?e) :- event(?e, _) .\nevent(?e, ?b) :- event(?e, ?a), touch(?a, ?b) .",
    );
    let why = program
        .explain("late(_:0)", &Budget::default())
        .unwrap()
        .to_text();
    assert_eq!(
        why,
        "late(_:0): is derived\n\
         \x20 late(_:0)  by things.rls:4\n\
         \x20   event(_:0, \"cup\")  by things.rls:3: A contact is an event.\n\
         \x20     touch(\"cup\", \"plate\")  (fact)\n\
         \x20     ?a != ?b, with \"cup\" != \"plate\"\n\
         \x20     !e is _:0, a new thing, which the rule made\n"
    );
    let why_not = program
        .explain("event(_, \"fork\")", &Budget::default())
        .unwrap()
        .to_text();
    assert!(
        why_not.contains("came closest by things.rls:3: A contact is an event."),
        "{why_not}"
    );
    assert!(
        why_not.contains("missing touch(\"fork\", _)") && !why_not.contains('~'),
        "{why_not}"
    );
    let other = program
        .explain("event(7, \"cup\")", &Budget::default())
        .unwrap()
        .to_text();
    assert!(
        other.contains("missing a new thing for this")
            && other.contains("nearest event(_:0, \"cup\")"),
        "{other}"
    );
}

/// The outcome of one property, its witness and explanation included, does not depend on the
/// properties judged with it.
#[test]
fn the_labels_of_a_property_are_its_own() {
    let mut ontology = Ontology::default();
    for name in ["a", "b", "c"] {
        let text = format!(
            "@prefix ex: <http://example.org/> .\nevent(!e, ?x) :- after(?x, ex:p, \"{name}\") .\n\
             success(?e, ?x) :- event(?e, ?x) ."
        );
        let rule = RuleFile::new(Source::new(format!("{name}.rls"), text));
        ontology
            .properties
            .insert(name.to_owned(), Property::new(name, rule));
    }
    let library = "@prefix ex: <http://example.org/> .\nstate(act:after, !new, ex:p, \"c\") :- after(_, ex:p, \"a\") .";
    ontology
        .libraries
        .push(RuleFile::new(Source::new("lib.rls", library)));
    let book = RuleBook::prepare(&ontology).unwrap_or_else(|faults| panic!("{faults}"));
    let facts = Triples::from_turtle(
        "@prefix : <http://example.org/> . :x :p \"a\", \"b\" . :y :p \"a\", \"b\" .",
    )
    .unwrap();
    let judged = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        book.judge(&facts.as_action(), &names, &Budget::default())
    };
    let explained = |names: &[&str]| -> Vec<String> {
        let found = book.explain_all(&facts.as_action(), names, &Budget::default());
        found
            .into_iter()
            .map(|explanation| explanation.unwrap().to_text())
            .collect()
    };
    let alone: Vec<String> = ["c", "b", "a"]
        .iter()
        .flat_map(|name| explained(&[name]))
        .collect();
    assert_eq!(explained(&["c", "b", "a"]), alone);
    assert!(alone[0].contains("_:1"), "{}", alone[0]);
    let unknown = book.explain_all(&facts.as_action(), &["d", "a"], &Budget::default());
    assert!(unknown[0].is_err() && unknown[1].is_ok());
    let all = judged(&["a", "b", "c"]);
    for (name, label) in [("a", "_:1"), ("b", "_:1"), ("c", "_:1")] {
        assert_eq!(judged(&[name])[name], all[name]);
        assert_eq!(judged(&["c", "b", "a"])[name], all[name]);
        assert_eq!(
            all[name].as_ref().unwrap().witness[0].values[0]
                .1
                .to_string(),
            label,
            "{name}"
        );
    }
}

#[test]
fn misplaced_new_things_are_refused() {
    let cases: BTreeSet<(&str, &str, &str)> = [
        ("p(!v) .", "R039", "new thing `!v` in a fact"),
        (
            "p(1) . q(?x) :- p(!x) .",
            "R039",
            "new thing `!x` in a body",
        ),
        (
            "p(1) . q(?x) :- p(?x), ~p(!v) .",
            "R039",
            "new thing `!v` in a body",
        ),
        (
            "p(1) . q(?x, !v + 1) :- p(?x) .",
            "R039",
            "new thing `!v` in a body or a computation",
        ),
        (
            "p(1) . q(!v, STR(!v)) :- p(?x) .",
            "R039",
            "new thing `!v` in a body or a computation",
        ),
        (
            "p(1) . q(!v, #count(?x)) :- p(?x) .",
            "R039",
            "can't aggregate and make new things",
        ),
        (
            "p(1) . q(!x, ?x) :- p(?x) .",
            "R039",
            "`?x` and `!x` in one rule",
        ),
        (
            "p(1) . q(!v, ?y) :- p(?x) .",
            "R020",
            "variable `?y` of the head is not bound in the body",
        ),
        ("p(1) . q(!v, _) :- p(?x) .", "R035", "`_` in a head"),
        (
            "p(1) . q(!v) :- p(?x), ~r(?x) .\nr(?x) :- q(?x) .",
            "R050",
            "`q` negates `r`, which depends on `q`",
        ),
    ]
    .into();
    for (text, code, message) in cases {
        let faults = Program::load(&Source::new("things.rls", text), Path::new(""))
            .unwrap_err()
            .to_string();
        assert!(
            faults.contains(code) && faults.contains(message),
            "{text}: {faults}"
        );
    }
}
