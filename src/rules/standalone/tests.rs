//! Small programs at the edges of the language, with the tuples that they derive.

use std::path::Path;

use crate::Budget;
use crate::standalone::{Engine, Program};
use actcheck_base::Source;

fn load(text: &str) -> Program {
    Program::load(&Source::new("edge.rls", text), Path::new("")).unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

/// Evaluates a program with both engines. Returns the tuples of a predicate, as text.
fn derived(text: &str, predicate: &str) -> String {
    let program = load(text);
    let [fast, naive] = [Engine::Fast, Engine::Naive].map(|engine| {
        let closure = program.close(engine, &Budget::default()).unwrap_or_else(|fault| panic!("{fault}\n{text}"));
        let tuples = closure.tuples(predicate);
        let row = |tuple: &Vec<_>| tuple.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        tuples.iter().map(row).collect::<Vec<_>>().join(", ")
    });
    assert_eq!(fast, naive, "{text}");
    fast
}

#[test]
fn a_rule_with_several_heads_applies_as_a_whole_or_not_at_all() {
    let facts = "e(1) . e(\"x\") .";
    for (rule, q) in [
        ("p(?v + 1), q(?v) :- e(?v) .", "1"),
        ("q(?v), p(?v + 1) :- e(?v) .", "1"),
        ("q(?v), p(?v), r(ABS(?v), UCASE(?v)) :- e(?v) .", ""),
        ("p(?v + 1, !n), q(?v, !n) :- e(?v) .", "1 _:0"),
        // Texts of f-strings always have a value.
        ("p(f\"{?v}!\"), q(?v) :- e(?v) .", "\"x\", 1"),
        ("p(#count(?v)), q(?v + 1) :- e(?v) .", "2"),
        ("p(?v + 1), q(#count(?v)) :- e(?v) .", "1"),
    ] {
        assert_eq!(derived(&format!("{facts} {rule}"), "q"), q, "{rule}");
    }
}

#[test]
fn faults_of_a_rule_with_several_heads_are_reported_once() {
    let text = "p(?w + 1), q(?v), r(ABSS(?v)) :- e(?v) .";
    let faults = Program::load(&Source::new("edge.rls", text), Path::new("")).expect_err("it has two faults");
    let mut codes: Vec<_> = faults.iter().map(|fault| fault.code).collect();
    codes.sort_unstable();
    assert_eq!(codes, ["R021", "R027"], "{faults}");
}

#[test]
fn a_sum_is_right_or_an_error_whatever_the_order_of_the_facts() {
    let facts = ["v(9223372036854775807) .", "v(1) .", "v(-2) ."];
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let facts: String = order.map(|idx| facts[idx]).concat();
        assert_eq!(derived(&format!("{facts} s(#sum(?x)) :- v(?x) ."), "s"), "9223372036854775806");
    }
    let program = load("v(9223372036854775807) . v(1) . s(#sum(?x)) :- v(?x) .");
    for engine in [Engine::Fast, Engine::Naive] {
        let fault = program.close(engine, &Budget::default()).expect_err("the sum does not fit");
        assert!(fault.to_string().contains("the sum 9223372036854775808 does not fit in 64 bits"), "{fault}");
    }
}

/// Joins by equal and by computed values: facts, rule, and the tuples of `q`.
#[test]
fn joins_by_equal_values_derive_the_same_as_nested_loops() {
    let facts = "r(1) . r(2) . r(1.0) . r(\"1\") . r(x) . r(-3) . s(2) . s(3) . s(2.0) . s(\"1\") . s(1) . s(x) .
        s(9223372036854775807) . r(9223372036854775807) . t(1, 2) . t(2, 3) . t(2, 4) . t(3, 4) . t(1.0, 2.0) . t(2, x) .";
    for rule in [
        "q(?a, ?b) :- r(?a), s(?b), ?a = ?b .",
        "q(?a, ?b) :- r(?a), s(?b), EQUALITY(?a, ?b) .",
        "q(?a, ?b) :- r(?a), s(?b), ?b = ?a + 1 .",
        "q(?a, ?b) :- r(?a), s(?b), ?a = ?b - 1 .",
        "q(?a, ?b) :- r(?a), s(?b), ?b - 1 = ?a * 1 .",
        "q(?a, ?b) :- r(?a), s(?b), STR(?a) = STR(?b) .",
        "q(?a, ?b) :- r(?a), s(?b), DATATYPE(?a) = DATATYPE(?b), ?a != ?b .",
        "q(?a, ?a) :- r(?a), s(?a + 1) .",
        "q(?a, ?b) :- r(?a), s(?b), ?n = ?a + 1, ?n = ?b .",
        "q(?a, ?b) :- r(?a), s(?b), ?n = ?a + 1, ?n = ?b * 1 .",
        "q(?a, ?c) :- t(?a, ?b), t(?c, ?d), ?d = ?b + 1 .",
        "q(?a, ?d) :- t(?a, ?b), t(?b, ?d), ?d = ?a + 2 .",
        "q(?a, ?d) :- t(?a, ?b), t(?a, ?d), ?d * 2 = ?b + ?b .",
        "q(?a, ?b) :- t(?a, ?b), r(?c), ?c + 1 = ?a + ?b - 1 .",
        "q(?a, ?b) :- t(?a, ?b), ?a = 2, UCASE(STR(?b)) = \"X\" .",
        "q(?a, #count(?b)) :- r(?a), s(?b), ?a = ?b .",
        "q(?a, ?b) :- r(?a), s(?b), ?a = ?b, ~t(?a, ?b + 1) .",
        "q(1, 1) . q(?b, ?j) :- q(?i, ?a), ?j = ?i + 1, s(?j), ?b = ?a + 1, ?b < 6 .",
        "q(1, 0) . q(?b, ?a) :- q(?a, _), t(?c, ?b), ?c = ?a * 1 .",
        "q(1, 2) . q(?a, ?d) :- q(?a, ?b), q(?c, ?d), ?b = ?c * 1 . q(?a, ?b) :- t(?a, ?b), r(?a) .",
        "q(1, 2) . q(?d, ?b) :- q(?a, ?b), q(?c, ?d), ?d = ?b + 1, t(?a, ?c - 0) . q(?a, ?b) :- t(?a, ?b) .",
    ] {
        let text = format!("{facts} {rule}");
        derived(&text, "q");
    }
}

#[test]
fn programs_of_current_nemo_are_understood() {
    for (text, expected) in [
        ("n(3) . q(INVERTSIGN(?x), SUBTRACTION(?x, 1)) :- n(?x) .", "-3 2"),
        ("q(.05) . q(-.5e1) . q(1.5).", "-5 0.05 1.5"),
        ("<http://a/b>(1) . q(?x) :- <http://a/b>(?x) .", "1"),
        ("@prefix e: <http://e/> . e:p(<http://x>) . q(?x) :- <http://e/p>(?x), ~<http://e/none>(?x) .", "<http://x>"),
        ("p(\"a1b22\") . q(REPLACE(?x, \"([0-9]+)\", \"<$1>\"), REPLACE(?x, \"A\", \"\", \"i\")) :- p(?x) .", "\"a<1>b<22>\" \"1b22\""),
        ("p(\"a\\nB\") . q(?x) :- p(?x), REGEX(?x, \"a.b\", \"si\"), ~r(?x) .", "\"a\\nB\""),
        ("p(\" a \") . q(TRIM(?x), LTRIM(?x), RTRIM(?x)) :- p(?x) .", "\"a\" \"a \" \" a\""),
        ("p(\"7\") . q(STRDT(?x, xsd:integer), STRDT(?x, xsd:byte)) :- p(?x) .", "7 7"),
        ("p(\"a\"@en-GB) . q(LANGMATCHES(LANG(?x), \"EN\"), langMatches(LANG(?x), \"e\")) :- p(?x) .", "true false"),
        (
            "p(\"2024-02-29T23:05:09.5+02:00\"^^xsd:dateTime) .
             q(YEAR(?x), MONTH(?x), DAY(?x), HOURS(?x), MINUTES(?x), SECONDS(?x), TZ(?x), STR(TIMEZONE(?x))) :- p(?x) .",
            "2024 2 29 23 5 9.5 \"+02:00\" \"PT2H\"",
        ),
        ("p(\"-0044-03-15\"^^xsd:date) . q(YEAR(?x), DAY(?x)) :- p(?x) .", "-44 15"),
        ("p(\"2024-03-15-05:00\"^^xsd:date) . q(DAY(?x), TZ(?x)) :- p(?x) .", "15 \"-05:00\""),
        ("p(\"abc\") . q(MD5(?x), SHA1(?x)) :- p(?x) .", "\"900150983cd24fb0d6963f7d28e17f72\" \"a9993e364706816aba3e25717850c26c9cd0d89d\""),
        ("p(\"abc\") . q(SUBSTR(SHA256(?x), 1, 8), SUBSTR(SHA512(?x), 1, 8)) :- p(?x) .", "\"ba7816bf\" \"ddaf35a1\""),
        ("year(2024) . q(?y) :- year(?y) .", "2024"),
    ] {
        let text = format!("@prefix xsd: <http://www.w3.org/2001/XMLSchema#> . {text}");
        assert_eq!(derived(&text, "q").replace(", ", " "), expected, "{text}");
    }
}
