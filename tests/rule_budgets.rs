//! Budgets of rules bound memory and time while a rule produces, and count new tuples only.

use std::fmt::Write as _;
use std::path::Path;

use actcheck::base::{Outcome, RuleFault, Source};
use actcheck::rules::standalone::{Engine, Program};
use actcheck::rules::{Budget, Facts, Rules};

use crate::support::{actcheck, made_history, stderr, stdout};

const MEBIBYTE: usize = 1 << 20;

fn load(text: &str) -> Program {
    Program::load(&Source::new("budget.rls", text), Path::new("")).unwrap()
}

fn numbers(count: usize) -> String {
    (0..count).fold(String::new(), |mut text, number| {
        write!(text, "d({number}) . ").unwrap();
        text
    })
}

/// The reason why a program stopped at its budget.
fn reason(text: &str, budget: &Budget) -> String {
    match load(text).close(Engine::Fast, budget).map(|_| ()) {
        Err(RuleFault::BudgetSpent(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

/// 10¹⁰ tuples are not produced before they are counted.
#[test]
fn a_cross_product_stops_at_the_number_of_tuples() {
    let budget = Budget {
        tuples: 1000,
        ..Budget::default()
    };
    let facts = numbers(100_000);
    for rules in [
        "q(?x, ?y) :- d(?x), d(?y) .",
        "q(?x, ?x) :- d(?x) . q(?x, ?y) :- q(?x, _), d(?y) .",
    ] {
        let reason = reason(&format!("{facts}{rules}"), &budget);
        assert!(
            reason.contains("more than 1000 derived tuples in the rule at budget.rls:1"),
            "{reason}"
        );
    }
}

#[test]
fn duplicates_and_given_facts_are_not_counted() {
    let budget = Budget {
        tuples: 700,
        bytes: 64 * MEBIBYTE,
        ..Budget::default()
    };
    let facts = numbers(700);
    for (rules, predicate, count) in [
        ("q(?x) :- d(?x), d(?y) .", "q", 700),
        ("q(?x) :- d(?x) . q(?y) :- q(?x), d(?y) .", "q", 700),
        (
            "q(?x) :- d(?x) . q(?x) :- d(?x), d(?y) . q(7) :- d(_) .",
            "q",
            700,
        ),
        ("d(?x) :- d(?x), d(?y) .", "d", 700),
        (
            "d(?y) :- d(?x), d(?y), ?x < ?y . d(700) :- d(_) .",
            "d",
            701,
        ),
        ("n(#count(?x)) :- d(?x), d(?y) .", "n", 1),
    ] {
        let closure = load(&format!("{facts}{rules}"))
            .close(Engine::Fast, &budget)
            .unwrap();
        assert_eq!(closure.count(predicate), count, "{rules}");
    }
    let budget = Budget {
        tuples: 50,
        ..Budget::default()
    };
    for engine in [Engine::Fast, Engine::Naive] {
        let program = load(&format!("{}q(?x) :- d(?x), d(?y) .", numbers(50)));
        assert_eq!(
            program.close(engine, &budget).unwrap().count("q"),
            50,
            "{engine:?}"
        );
    }
}

#[test]
fn tuples_texts_matches_and_proofs_count_as_memory() {
    let budget = Budget {
        tuples: usize::MAX,
        bytes: 32 * MEBIBYTE,
        secs: 60.0,
        ..Budget::default()
    };
    let facts = numbers(3000);
    let doubling = "s(0, \"a\") . s(?n, ?y) :- s(?m, ?x), ?n = ?m + 1, ?y = CONCAT(?x, ?x) .";
    for rules in [
        format!("{facts}q(?x, ?y) :- d(?x), d(?y) ."),
        format!("{facts}q(?x, ?x) :- d(?x) . q(?x, ?y) :- q(?x, _), d(?y) ."),
        format!("{facts}n(?x, #count(?y)) :- d(?x), d(?y) ."),
        doubling.to_owned(),
        // Texts within one expression.
        doubling.replace("CONCAT(?x, ?x)", "f\"{?x}{?x}\""),
        // 64 texts of 0.5 MiB.
        format!(
            "{} t(?n) :- s(19, ?x), ?n = STRLEN(CONCAT({})) .",
            doubling.replace(", ?n =", ", ?m < 19, ?n ="),
            vec!["STRREV(?x)"; 64].join(", ")
        ),
    ] {
        let reason = reason(&rules, &budget);
        assert!(
            reason.contains("more than 32 MiB of memory in the rule at"),
            "{reason}"
        );
    }
    let naive = load(doubling)
        .close(Engine::Naive, &budget)
        .unwrap_err()
        .to_string();
    assert!(naive.contains("32 MiB"), "{naive}");
    let explained = load(doubling)
        .explain("s(1, _)", &budget)
        .unwrap_err()
        .to_string();
    assert!(explained.contains("32 MiB"), "{explained}");
}

#[test]
fn time_ends_a_single_built_in() {
    let text = "s(0, \"abcdefgh\") . s(?n, ?y) :- s(?m, ?x), ?m < 17, ?n = ?m + 1, ?y = CONCAT(?x, ?x) .\n\
                far(?d) :- s(17, ?x), ?d = LEVENSHTEIN(?x, STRREV(?x)) .";
    let reason = reason(
        text,
        &Budget {
            secs: 0.2,
            ..Budget::default()
        },
    );
    assert!(
        reason.contains("more than 0.2 s in the rule at budget.rls:2"),
        "{reason}"
    );
}

#[test]
fn distances_of_short_texts_are_exact() {
    let closure = load(
        "d(1, LEVENSHTEIN(\"kitten\", \"sitting\")) . d(2, LEVENSHTEIN(\"\", \"äöü\")) . d(3, LEVENSHTEIN(\"same\", \"same\")) .\n\
         d(4, LEVENSHTEIN(\"flaw\", \"lawn\")) . d(5, LEVENSHTEIN(\"a\", \"\")) .",
    )
    .close(Engine::Fast, &Budget::default())
    .unwrap();
    let found: Vec<String> = closure
        .tuples("d")
        .iter()
        .map(|row| row[1].to_string())
        .collect();
    assert_eq!(found, ["3", "3", "0", "2", "1"]);
}

/// A query whose text grows in `steps` steps.
fn nested(first: &str, step: impl Fn(usize) -> String, steps: usize) -> String {
    let mut query = format!("SELECT ?x{steps} {{ BIND({first} AS ?x0) ");
    for number in 0..steps {
        write!(query, "BIND({} AS ?x{}) ", step(number), number + 1).unwrap();
    }
    query + &format!("FILTER(STRLEN(?x{steps}) < 0) }}")
}

#[test]
fn queries_that_make_long_texts_stop_at_the_memory() {
    for query in [
        nested(
            "\"a\"",
            |number| format!("CONCAT(?x{number}, ?x{number})"),
            36,
        ),
        nested(
            "\"aa\"",
            |number| format!("REPLACE(?x{number}, \"a\", ?x{number})"),
            36,
        ),
        nested(
            "\"aa\"",
            |number| format!("REPLACE(?x{number}, \".*\", \"$0$0\")"),
            36,
        ),
        // Within one expression.
        format!(
            "ASK {{ FILTER(STRLEN({}) > 0) }}",
            (0..12).fold("\"aa\"".to_owned(), |text, _| format!(
                "REPLACE({text}, \"a\", \"aaaaaa\")"
            ))
        ),
    ] {
        let rules = Rules::builder().build("long.rq", &query).unwrap();
        let decision = rules.judge(&Facts::new());
        assert_eq!(decision.outcome, Outcome::Timeout, "{query}");
        let fault = decision.result.unwrap_err().to_string();
        assert!(
            fault.contains("long.rq made a text that is too long for a budget of 1024 MiB"),
            "{fault}"
        );
    }
}

#[test]
fn a_query_of_a_history_that_makes_long_texts_is_refused() {
    let folder = made_history();
    for (query, code) in [
        (
            nested(
                "\"a\"",
                |number| format!("CONCAT(?x{number}, ?x{number})"),
                36,
            ),
            Some(2),
        ),
        (
            "SELECT (UCASE(REPLACE(CONCAT(\"a\", \"b\"), \"b\", \"c\")) AS ?x) {}".to_owned(),
            Some(0),
        ),
    ] {
        let output = actcheck(
            folder.path(),
            &["query", &query, "--history", ".", "--format", "csv"],
        );
        assert_eq!(output.status.code(), code, "{}", stderr(&output));
        match code {
            Some(2) => {
                assert!(
                    stderr(&output).contains("H012") && stderr(&output).contains("512 MiB"),
                    "{}",
                    stderr(&output)
                )
            }
            _ => assert!(stdout(&output).contains("AC"), "{}", stdout(&output)),
        }
    }
}

#[test]
fn functions_of_texts_keep_their_meaning_in_queries() {
    for (condition, holds) in [
        ("CONCAT(\"a\", \"b\") = \"ab\"", true),
        ("LANG(CONCAT(\"a\"@en, \"b\"@en)) = \"en\"", true),
        ("ucase(\"straße\") = \"STRASSE\"", true),
        ("REPLACE(\"abcd\", \"b(.)\", \"[$1]\") = \"a[c]d\"", true),
        ("\"CONCAT(\" = CONCAT(\"CONCAT\", \"(\")", true),
        (
            "EXISTS { { SELECT (GROUP_CONCAT(DISTINCT ?x; SEPARATOR=\";\") AS ?y) { VALUES ?x { \"a\" \"b\" \"a\" } } } FILTER(?y = \"a;b\") }",
            true,
        ),
        ("BOUND(?none) || ENCODE_FOR_URI(\"a b\") = \"a b\"", false),
    ] {
        let rules = Rules::builder()
            .build("text.rq", &format!("ASK {{ FILTER({condition}) }}"))
            .unwrap();
        let wanted = if holds {
            Outcome::Passed
        } else {
            Outcome::Failed
        };
        assert_eq!(rules.judge(&Facts::new()).outcome, wanted, "{condition}");
    }
}
