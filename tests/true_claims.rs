//! Explanations never make false claims, and invalid goals are reported with their place.

use std::path::Path;

use actcheck::base::{Source, Term};
use actcheck::rules::standalone::{Engine, Program};
use actcheck::rules::{Budget, Facts, Rules};

use crate::support::{actcheck, stderr, stdout};

fn load(text: &str) -> Program {
    Program::load(&Source::new("claims.rls", text), Path::new("")).unwrap()
}

fn explained(program: &Program, goal: &str) -> (bool, String) {
    let found = program.explain(goal, &Budget::default()).unwrap();
    let json = found.to_json();
    assert_eq!(json["holds"], found.holds(), "{goal}");
    (found.holds(), found.to_text())
}

/// Every statement over the constants of a program gets the right answer.
#[test]
fn a_goal_is_derived_exactly_if_its_tuple_is() {
    for text in [
        "q(1) . p(?x) :- q(?x) .",
        "q(1) . q(2) . r(2) . p(?x) :- q(?x), ~r(?x) .",
        "e(1, 2) . e(2, 3) . p(?x, ?y) :- e(?x, ?y) . p(?x, ?z) :- p(?x, ?y), e(?y, ?z) .",
        "q(1) . q(2) . p(?y) :- q(?x), ?y = ?x + 1 . r(3, ?x) :- q(?x) .",
        "q(1, 2) . q(1, 3) . q(2, 2) . s(?x, #sum(?y)) :- q(?x, ?y) . m(#max(?y)) :- q(_, ?y) . c(#count(?x)) :- q(?x, _) .",
        "a(1) . a(2) . b(3) . t(#sum(?x)) :- a(?x) . t(#max(?x)) :- b(?x) . t(#sum(?x)) :- a(?x), b(?x) .",
    ] {
        let program = load(text);
        let closure = program.close(Engine::Naive, &Budget::default()).unwrap();
        for predicate in closure.predicates() {
            let arity = closure.arity(predicate).unwrap();
            let tuples = closure.tuples(predicate);
            for number in 0..6_i64.pow(arity as u32) {
                let args: Vec<i64> = (0..arity)
                    .map(|place| number / 6_i64.pow(place as u32) % 6)
                    .collect();
                let tuple: Vec<Term> = args.iter().map(|arg| Term::Integer(*arg)).collect();
                let args: Vec<String> = args.iter().map(i64::to_string).collect();
                let goal = format!("{predicate}({})", args.join(", "));
                let (holds, text) = explained(&program, &goal);
                assert_eq!(holds, tuples.contains(&tuple), "{goal}: {text}");
                let verdict = if holds {
                    "is derived"
                } else {
                    "is not derived"
                };
                assert!(text.starts_with(&format!("{goal}: {verdict}\n")), "{text}");
            }
        }
    }
}

#[test]
fn an_underivable_goal_names_the_missing_condition() {
    for (text, goal, words) in [
        (
            "q(1) .",
            "q(2)",
            "q(2) is not a fact, and no rule has a matching head",
        ),
        ("p(1, 2) .", "p(1, 3)", "nearest p(1, 2)"),
        (
            "q(1) . p(?x, 7) :- q(?x) .",
            "p(1, 8)",
            "no rule has a matching head",
        ),
        (
            "q(1) . p(?y) :- q(?x), ?y = ?x + 1 .",
            "p(9)",
            "missing ?y = ?x + 1, which gives 2, not 9",
        ),
        (
            "q(1) . q(2) . s(#sum(?x)) :- q(?x) .",
            "s(4)",
            "missing a group whose aggregate is s(4)",
        ),
        (
            "q(1) . q(2) . s(#sum(?x)) :- q(?x) .",
            "s(4)",
            "nearest s(3)",
        ),
        // The value of one rule is not explained by another.
        (
            "a(1) . b(5) . t(#sum(?x)) :- a(?x) . t(#sum(?x)) :- b(?x) .",
            "t(6)",
            "is not derived",
        ),
    ] {
        let (holds, explanation) = explained(&load(text), goal);
        assert!(
            !holds && explanation.contains(words),
            "{text} {goal}: {explanation}"
        );
    }
    // A value is explained by the rule that computes it.
    let (_, text) = explained(
        &load("a(1) .\nb(5) .\nt(#sum(?x)) :- a(?x) .\nt(#sum(?x)) :- b(?x) ."),
        "t(5)",
    );
    assert!(
        text.contains("by claims.rls:4") && text.contains("b(5)") && !text.contains("a(1)"),
        "{text}"
    );
}

#[test]
fn a_proof_that_is_too_long_is_not_said_to_be_shown() {
    let program = load("n(0) . n(?y) :- n(?x), ?x < 60, ?y = ?x + 1 .");
    let (holds, text) = explained(&program, "n(60)");
    assert!(
        holds && text.contains("(derived; its proof is too long)") && !text.contains("shown above"),
        "{text}"
    );
}

/// Each invalid goal with its place and words of its message.
const INVALID: [(&str, &str, &str); 9] = [
    ("q(1", "goal:1:4", "expected"),
    ("q(1, 2)", "goal:1:1", "`q` has 1 argument, not 2"),
    ("qq(1)", "goal:1:1", "no predicate `qq`"),
    ("q(1), q(2)", "goal:1:1", "not several"),
    ("q(1) . q(2)", "goal:1:1", "one statement"),
    ("q(?x) :- p(?x, ?x)", "goal:1:1", "without conditions"),
    ("p(?x, ?x)", "goal:1:7", "occurs twice"),
    ("q(1 + 1)", "goal:1:3", "only constants"),
    ("", "goal:1:1", ""),
];

#[test]
fn invalid_goals_are_reported_with_their_place() {
    let program = load("@prefix ex: <http://example.org/> .\nq(1) . p(ex:a, 2) .");
    for (goal, place, words) in INVALID {
        let faults = program.check_goal(goal).unwrap_err();
        let fault = faults.iter().next().unwrap();
        assert_eq!(
            (fault.code, fault.place().as_deref()),
            ("R092", Some(place)),
            "{goal}: {fault}"
        );
        assert!(
            fault.message.contains(words) && fault.help.is_some(),
            "{goal}: {fault}"
        );
        let fault = program
            .explain(goal, &Budget::default())
            .unwrap_err()
            .to_string();
        assert!(
            fault.contains(place) && fault.contains(words),
            "{goal}: {fault}"
        );
    }
    assert!(program.check_goal(" p(ex:a, _) . ").is_ok());
    // The same for the rules of a property.
    let rules = Rules::parse("success(?x) :- after(?x, <http://x/p>, 1) .").unwrap();
    let fault = rules
        .why_not(&Facts::new(), "succes(_)")
        .unwrap_err()
        .to_string();
    assert!(
        fault.contains("goal:1:1") && fault.contains("no predicate `succes`"),
        "{fault}"
    );
}

#[test]
fn a_trace_has_the_exit_code_of_its_answer() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.rls"), "q(apple) . p(?x) :- q(?x) .\n").unwrap();
    let trace = |goal: &str| actcheck(folder.path(), &["datalog", "p.rls", "--trace", goal]);
    for (goal, code) in [
        ("p(apple)", 0),
        ("p(_)", 0),
        ("q(aple)", 1),
        ("p(q)", 1),
        ("p(1, 2)", 2),
        ("p(", 2),
        ("r(1)", 2),
    ] {
        let output = trace(goal);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{goal}: {}{}",
            stdout(&output),
            stderr(&output)
        );
        assert_eq!(
            stderr(&output).contains("goal:1:"),
            code == 2 || goal == "q(aple)" || goal == "p(q)",
            "{}",
            stderr(&output)
        );
    }
    let unknown = trace("q(aple)");
    assert!(
        stderr(&unknown).contains("R093") && stderr(&unknown).contains("did you mean `apple`?"),
        "{}",
        stderr(&unknown)
    );
    assert!(
        stdout(&unknown).starts_with("q(aple): is not derived\n"),
        "{}",
        stdout(&unknown)
    );
}
