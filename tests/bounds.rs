//! Very large and deep rule texts are read, or refused with a bounded number of messages, a bounded
//! stack and no quadratic work.

use std::path::Path;

use actcheck::base::{Diagnostics, Files, Source, Term};
use actcheck::ontology::{self, Property, RuleFile};
use actcheck::rules::standalone::{Engine, Loading, Program};
use actcheck::rules::{Budget, RuleBook};

const TEN_MEGABYTES: usize = 10 << 20;

/// Checks a text as a standalone program.
fn program(text: &str) -> Result<Program, Diagnostics> {
    Program::load(&Source::new("p.rls", text), Path::new(""))
}

/// Checks a text as the rules of a property.
fn property(text: &str) -> Result<RuleBook, Diagnostics> {
    let mut ontology = ontology::load(&Files::Shipped, Path::new("ontology/actions.ttl")).unwrap();
    let property = ontology.properties.values_mut().next().unwrap();
    property.rule = RuleFile::new(Source::new("p.rls", text));
    let property: Property = property.clone();
    ontology.properties = [(property.iri.clone(), property)].into();
    RuleBook::prepare(&ontology)
}

/// Lines made from their numbers, up to a size in bytes.
fn lines(size: usize, line: impl Fn(usize) -> String) -> String {
    let mut text = String::with_capacity(size + 100);
    for number in 0.. {
        text.push_str(&line(number));
        text.push('\n');
        if text.len() >= size {
            break;
        }
    }
    text
}

/// Checks that the text is refused both as a program and as a property, with `code` among its
/// faults and few, short messages.
fn refused(what: &str, text: &str, code: &str) {
    for faults in [program(text).map(drop), property(text).map(drop)] {
        let faults = faults.expect_err(what);
        // The parser, the definitions and the rules of a file each report at most fifty faults.
        assert!(faults.len() <= 400, "{what}: {} faults", faults.len());
        assert!(
            faults.iter().any(|fault| fault.code == code),
            "{what}: no {code} in {faults}"
        );
        for fault in faults.iter().filter(|fault| fault.code == code) {
            assert!(
                fault.message.len() + fault.help.as_ref().map_or(0, String::len) < 2_000,
                "{what}: {fault}"
            );
        }
    }
}

#[test]
fn deep_nesting_is_refused() {
    let deep = 200_000;
    for (open, code) in [
        ("(", "R005"),
        ("-", "R005"),
        ("+ -", "R005"),
        ("SUM(", "R005"),
        ("-(", "R005"),
        ("f\"{", "R005"),
        ("1 + ", "R005"),
        ("#sum(", "R005"),
        ("\"a\" ^^ ", "R010"),
        ("{", "R012"),
    ] {
        let nested = open.repeat(deep);
        refused(open, &format!("p(?x) :- q(?x), ?x < {nested}1 ."), code);
        refused(open, &format!("p({nested}1) ."), code);
    }
    refused(
        "attributes",
        &format!("#{} p(1) .", "[".repeat(deep)),
        "R010",
    );
    refused(
        "comments",
        &format!("p(1) . {}", "/* ".repeat(deep)),
        "R001",
    );
}

#[test]
fn ten_megabytes_of_facts_are_read() {
    let text = lines(TEN_MEGABYTES, |number| {
        format!("edge(node{}, {number}) .", number % 1000)
    });
    let program = program(&text).unwrap_or_else(|faults| panic!("{faults}"));
    let closure = program.close(Engine::Fast, &Budget::default()).unwrap();
    assert_eq!(closure.count("edge"), text.lines().count());
    // A property's file must not contain facts.
    let faults = property(&text).unwrap_err();
    assert!(faults.iter().any(|fault| fault.code == "R006"), "{faults}");
}

#[test]
fn ten_megabytes_in_one_token_are_read() {
    let long = "a".repeat(TEN_MEGABYTES);
    for text in [
        format!("% {long}\np(1) ."),
        format!("/* {long} */ p(1) ."),
        format!("p(\"{long}\") ."),
        format!("p({long}) ."),
        format!("p(<{long}>) ."),
        format!("p({}) .", "9".repeat(TEN_MEGABYTES)),
        format!("{}p(1) .", " ".repeat(TEN_MEGABYTES)),
    ] {
        let program = program(&text).unwrap_or_else(|faults| panic!("{}", faults.len()));
        assert_eq!(
            program
                .close(Engine::Fast, &Budget::default())
                .unwrap()
                .count("p"),
            1
        );
    }
}

/// Each of these inputs once took hours or gigabytes: the lexer reported every invalid character,
/// the line of every definition was counted from the start, prefixes and variables were looked up
/// in long lists, and each fault searched for similar names.
#[test]
fn ten_megabytes_of_faults_give_few_messages() {
    refused("strange characters", &"'".repeat(TEN_MEGABYTES), "R002");
    refused(
        "unterminated strings",
        &"\"\n".repeat(TEN_MEGABYTES / 2),
        "R003",
    );
    refused("no statements", &". ".repeat(TEN_MEGABYTES / 2), "R010");
    refused(
        "prefixes",
        &lines(TEN_MEGABYTES, |n| format!("@prefix p{n}: <a:> .")),
        "R006",
    );
    refused(
        "arguments",
        &format!(
            "p(1) :- q(1), 1 < SUM({}) .",
            lines(TEN_MEGABYTES, |n| format!("?x{n},"))
        ),
        "R006",
    );
    refused(
        "conditions",
        &format!(
            "p(1) :- {} q(1) .",
            lines(TEN_MEGABYTES, |n| format!("q({n}),"))
        ),
        "R006",
    );
    let calls: String = (0..200)
        .map(|n| format!("1 = SUM(?a{n}, ?b{n}, ?c{n}, ?d{n}, ?e{n}, ?f{n}, ?g{n}),"))
        .collect();
    refused("variables", &format!("p(1) :- {calls} q(1) ."), "R006");
    refused(
        "arities",
        &lines(TEN_MEGABYTES, |n| {
            format!("p({}) :- q(1) .", "1, ".repeat(1 + n % 3))
        }),
        "R022",
    );
}

#[test]
fn ten_megabytes_of_predicates_are_read_or_refused() {
    let text = lines(TEN_MEGABYTES, |number| format!("p{number}(1) ."));
    assert!(program(&text).is_ok());
    let text = lines(TEN_MEGABYTES, |number| {
        format!("success({number}) :- undefined{number}(?x) .")
    });
    let faults = property(&text).unwrap_err();
    assert!(
        faults.len() <= 400 && faults.iter().any(|fault| fault.code == "R006"),
        "{} faults",
        faults.len()
    );
}

#[test]
fn texts_over_the_largest_size_are_refused() {
    refused("size", &" ".repeat((32 << 20) + 1), "R006");
}

#[test]
fn a_chain_of_a_thousand_rules_reaches_its_closure() {
    let text = "p0(1) .\n".to_owned();
    let chain: String = (0..1000)
        .map(|n| format!("p{}(?x + 1) :- p{n}(?x), ~q{n}(?x) .\n", n + 1))
        .collect();
    let program = program(&(text + &chain)).unwrap();
    let closure = program.close(Engine::Fast, &Budget::default()).unwrap();
    assert_eq!(closure.tuples("p1000"), [[Term::Integer(1001)]]);
}

#[test]
fn a_negation_cycle_of_a_thousand_rules_is_refused_with_a_short_message() {
    let cycle: String = (0..1000)
        .map(|n| format!("p{}(?x) :- e(?x), ~p{n}(?x) .\n", (n + 1) % 1000))
        .collect();
    let text = format!("e(1) .\n{cycle}success(?x) :- p1(?x) .\n");
    refused("a cycle", &text, "R050");
    let help = program(&text)
        .unwrap_err()
        .iter()
        .next()
        .unwrap()
        .help
        .clone()
        .unwrap();
    assert!(help.contains("→ (987 more) →"), "{help}");
}

/// Ontologies that import each other are each read once.
#[test]
fn cyclic_imports_terminate() {
    let folder = tempfile::tempdir().unwrap();
    let head = "@prefix act: <http://actions#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .\n";
    for (name, other, action) in [("a", "b", "Wait"), ("b", "c", "Look"), ("c", "a", "Nod")] {
        let text = format!(
            "{head}<> owl:imports <{other}.ttl>, <{name}.ttl> . act:{action} a act:Action .\n"
        );
        std::fs::write(folder.path().join(format!("{name}.ttl")), text).unwrap();
    }
    let ontology = ontology::load(&Files::Disk, &folder.path().join("a.ttl"))
        .unwrap_or_else(|found| panic!("{found}"));
    assert_eq!(
        ontology.actions.keys().collect::<Vec<_>>(),
        ["Look", "Nod", "Wait"]
    );
}

/// They are exact and equal to themselves, whatever their spelling; arithmetic on them gives no
/// result rather than a rounded one.
#[test]
fn integers_beyond_64_bits_are_exact_and_give_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let number = "99999999999999999999";
    std::fs::write(
        folder.path().join("t.csv"),
        format!("{number}\n+0{number}\n{number}.0\n"),
    )
    .unwrap();
    std::fs::write(folder.path().join("i.csv"), format!("{number}\n1\nno\n")).unwrap();
    let text = format!(
        "@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
        @import table :- csv{{resource = \"t.csv\", format = (any)}} .
        @import whole :- csv{{resource = \"i.csv\", format = (int)}} .
        big({number}) . big(\"+00{number}\"^^xsd:integer) . big(\"{number}.00\"^^xsd:decimal) .
        big(?x) :- table(?x) .
        last(9223372036854775807) . first(-9223372036854775808) . behind(9223372036854775808) .
        same(?x) :- big(?x), ?x = {number} .
        plus(?y) :- big(?x), ?y = ?x + 1 .
        more(?x) :- big(?x), ?x > 0 .
        more(?x) :- big(?x), ?x <= 0 .
        over(?y) :- last(?x), ?y = ?x + 1 .
        over(?y) :- first(?x), ?y = -?x .
        over(?y) :- first(?x), ?y = ABS(?x) .
        over(?y) :- first(?x), ?y = ?x / -1 .
        near(?x) :- last(?x), behind(?x) .
        total(#sum(?x)) :- whole(?x) .
        least(#min(?x)) :- whole(?x) .
        how_many(#count(?x)) :- whole(?x) .
        long({}) .\n",
        "7".repeat(400)
    );
    // One row is not an integer.
    let loading = Loading {
        lenient: true,
        ..Loading::default()
    };
    let program = Program::load_as(&Source::new("p.rls", text), folder.path(), &loading)
        .unwrap_or_else(|faults| panic!("{faults}"));
    for engine in [Engine::Fast, Engine::Naive] {
        let closure = program.close(engine, &Budget::default()).unwrap();
        let integer = "http://www.w3.org/2001/XMLSchema#integer";
        assert_eq!(
            closure.tuples("big"),
            [[Term::Literal(number.into(), integer.into())]]
        );
        assert_eq!(closure.count("same"), 1);
        assert_eq!(closure.count("whole"), 2);
        for empty in ["plus", "more", "over", "near", "total", "least"] {
            assert_eq!(closure.tuples(empty), Vec::<Vec<Term>>::new(), "{empty}");
        }
        assert_eq!(closure.tuples("how_many"), [[Term::Integer(2)]]);
        assert_eq!(
            closure.tuples("long"),
            [[Term::Literal("7".repeat(400).into(), integer.into())]]
        );
    }
}

/// A fault in a line of ten megabytes is shown with its surroundings only: rendering the whole line
/// took minutes.
#[test]
fn a_fault_in_a_very_long_line_is_shown_with_nearby_text_only() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("quotes", "'".repeat(10_000_000)),
        ("dots", ". ".repeat(5_000_000)),
        ("umlauts", "ä".repeat(5_000_000)),
    ] {
        std::fs::write(folder.path().join(format!("{name}.rls")), text).unwrap();
        let output = crate::support::actcheck(folder.path(), &["datalog", &format!("{name}.rls")]);
        let printed = crate::support::stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {printed}");
        assert!(
            printed.contains(&format!("{name}.rls:1:")) && printed.len() < 200_000,
            "{name}: {} bytes",
            printed.len()
        );
    }
}
