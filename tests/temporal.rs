//! Temporal operators: properties over courses made by hand, and robustness by RTAMT.
//!
//! `tests/temporal/cases.toml` has the cases. `tests/temporal/rtamt.jsonl` has random formulas with
//! their robustness, made by `benches/stl.py`; `ACTCHECK_RTAMT=FILE` names another file of such
//! cases.

use std::collections::{BTreeMap, BTreeSet};

use actcheck::base::{Course, Files, Outcome, Signal, Term, names};
use actcheck::ontology;
use actcheck::rules::{Budget, Facts, RuleBook, Rules, When};

use crate::support::planted::Dice;
use crate::support::root;

/// The prefixes of facts in cases.
fn turtle(text: &str) -> String {
    let [act, obj] = [names::act(""), names::obj("")];
    format!(
        "@prefix act: <{act}> . @prefix obj: <{obj}> . @prefix w: <{}> . {text}",
        names::W
    )
}

/// Expands a prefixed name of a case.
fn iri(name: &str) -> String {
    let (prefix, local) = name
        .split_once(':')
        .unwrap_or_else(|| panic!("{name} has no prefix"));
    match prefix {
        "w" => names::w(local),
        "obj" => names::obj(local),
        "ex" => format!("http://example.org/{local}"),
        _ => panic!("unknown prefix {prefix}"),
    }
}

fn numbers(value: &toml::Value) -> Vec<f64> {
    let number = |value: &toml::Value| {
        value
            .as_float()
            .or_else(|| value.as_integer().map(|value| value as f64))
            .expect("a sample is a number")
    };
    value.as_array().map_or_else(
        || vec![number(value)],
        |values| values.iter().map(number).collect(),
    )
}

fn course_of(case: &toml::Value) -> Option<Course> {
    let signals = case
        .get("signals")?
        .as_table()
        .expect("signals are a table");
    let count = signals
        .values()
        .map(|values| numbers(values).len())
        .max()
        .unwrap_or(0);
    let period = case
        .get("period")
        .and_then(toml::Value::as_float)
        .unwrap_or(0.1);
    let mut course = Course::new(period, count);
    for (key, values) in signals {
        let mut parts = key.split(' ').map(iri);
        let mut next = || parts.next().unwrap_or_default();
        course.set([next(), next(), next()], Signal::Values(numbers(values)));
    }
    let phases = case.get("phases").and_then(toml::Value::as_table);
    course.phases = phases
        .into_iter()
        .flatten()
        .map(|(name, start)| (name.clone(), numbers(start)[0]))
        .collect();
    course.phases.sort_by(|a, b| a.1.total_cmp(&b.1));
    Some(course)
}

#[test]
fn formulas_over_courses_made_by_hand() {
    let text =
        std::fs::read_to_string("tests/temporal/cases.toml").expect("the cases are readable");
    let cases: toml::Table = text.parse().expect("the cases are TOML");
    for case in cases["case"].as_array().expect("cases are a list") {
        let name = case["name"].as_str().expect("a case has a name");
        let rules = Rules::parse(case["rules"].as_str().expect("a case has rules"))
            .unwrap_or_else(|found| panic!("{name}: {found}"));
        let mut facts = Facts::new();
        facts.set_parameter(
            Term::iri(names::act("pickObject")),
            Term::iri(names::obj("a")),
        );
        if let Some(text) = case.get("facts").and_then(toml::Value::as_str) {
            facts
                .add_turtle(When::After, &turtle(text))
                .expect("the facts are Turtle");
        }
        if let Some(course) = course_of(case) {
            facts.set_course(course);
        }
        let decision = rules.judge(&facts);
        assert_eq!(
            decision.outcome.to_string(),
            case["outcome"].as_str().unwrap_or_default(),
            "{name}: {decision:?}"
        );
        let why = match rules.why(&facts) {
            Ok(explanation) => explanation.to_text(),
            Err(fault) => fault.to_string(),
        };
        let margin = case.get("margin").map(|margin| numbers(margin)[0]);
        assert!(
            equal(decision.margin(), margin) || (margin.is_none() && name.contains("relation")),
            "{name}: {:?}\n{why}",
            decision.margin()
        );
        let wanted = case
            .get("why")
            .and_then(toml::Value::as_str)
            .unwrap_or_default();
        assert!(why.contains(wanted), "{name}:\n{why}");
    }
}

/// Whether two margins are equal; `None`: no number changes the outcome.
fn equal(found: Option<f64>, wanted: Option<f64>) -> bool {
    match (found, wanted) {
        (Some(found), Some(wanted)) => (found - wanted).abs() < 1e-9,
        (found, wanted) => found == wanted,
    }
}

#[test]
fn shipped_properties_about_time_are_decided_as_their_descriptions_say() {
    let ontology = ontology::load(&Files::Disk, &root().join("ontology/time.ttl"))
        .expect("the ontology is valid");
    let book = RuleBook::prepare(&ontology).expect("the rules are valid");
    let text =
        std::fs::read_to_string("tests/temporal/shipped.toml").expect("the cases are readable");
    let properties: toml::Table = text.parse().expect("the cases are TOML");
    let properties = properties["property"]
        .as_array()
        .expect("properties are a list");
    let mut decided: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for property in properties {
        let name = property["name"].as_str().expect("a property has a name");
        let outcomes = decided.entry(name).or_default();
        for (idx, case) in property["case"]
            .as_array()
            .expect("cases are a list")
            .iter()
            .enumerate()
        {
            let mut facts = Facts::new();
            for (parameter, value) in [("pickObject", "a"), ("placeSurface", "table")] {
                facts.set_parameter(
                    Term::iri(names::act(parameter)),
                    Term::iri(names::obj(value)),
                );
            }
            if let Some(text) = property.get("before").and_then(toml::Value::as_str) {
                facts
                    .add_turtle(When::Before, &turtle(text))
                    .expect("the facts are Turtle");
            }
            // The robot moved.
            facts.add(
                When::During,
                [
                    Term::iri(names::w("joint/arm_lift_joint")),
                    Term::iri(names::w("maxSpeedShare")),
                    Term::Double(0.5),
                ],
            );
            facts.set_course(course_of(case).expect("a case has signals"));
            let mut found = book.judge(&facts.as_action(), &[names::act(name)], &Budget::default());
            let found = found.remove(&names::act(name)).expect("it was judged");
            let found = found.unwrap_or_else(|fault| panic!("{name}, case {idx}: {fault:?}"));
            let wanted = case["outcome"].as_str().unwrap_or_default();
            assert_eq!(
                found.outcome().to_string(),
                wanted,
                "{name}, case {idx}: {found:?}"
            );
            let margin = case.get("margin").map(|margin| numbers(margin)[0]);
            assert!(
                equal(found.margin, margin),
                "{name}, case {idx}: {:?}, not {margin:?}",
                found.margin
            );
            outcomes.insert(wanted);
        }
    }
    for (name, outcomes) in &decided {
        assert!(
            outcomes.is_superset(&BTreeSet::from(["passed", "failed"])),
            "{name} needs cases that pass and that fail"
        );
    }
    let described = |property: &str| decided.contains_key(property);
    let shipped = std::fs::read_to_string(root().join("ontology/time.ttl"))
        .expect("the ontology is readable");
    let names = shipped
        .lines()
        .filter_map(|line| line.strip_prefix("act:")?.strip_suffix(" a act:Property ;"));
    let missing: Vec<&str> = names.filter(|name| !described(name)).collect();
    assert!(missing.is_empty() && decided.len() == 20, "{missing:?}");
}

#[test]
fn robustness_equals_rtamt() {
    let file =
        std::env::var("ACTCHECK_RTAMT").unwrap_or_else(|_| "tests/temporal/rtamt.jsonl".to_owned());
    let text = std::fs::read_to_string(&file).expect("the cases are readable");
    let (mut cases, mut finite) = (0, 0);
    for line in text.lines() {
        let case: serde_json::Value = serde_json::from_str(line).expect("a case is JSON");
        let formula = case["formula"].as_str().expect("a case has a formula");
        let rules = Rules::parse(&format!(
            "@prefix ex: <http://example.org/> . success(1) :- {formula} ."
        ))
        .unwrap_or_else(|found| panic!("{formula}: {found}"));
        let samples = |name: &str| -> Vec<f64> {
            case[name]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(serde_json::Value::as_f64)
                .collect()
        };
        let mut course = Course::new(1.0, samples("x").len());
        for name in ["x", "y"] {
            course.set(
                [iri(&format!("ex:{name}")), iri("ex:a"), String::new()],
                Signal::Values(samples(name)),
            );
        }
        let mut facts = Facts::new();
        facts.set_course(course);
        let decision = rules.judge(&facts);
        let wanted = case["robustness"].as_f64();
        match (decision.margin(), wanted) {
            (Some(found), Some(wanted)) => {
                assert!(
                    (found - wanted).abs() <= 1e-9,
                    "{formula}: {found}, not {wanted}"
                );
                finite += 1;
                if wanted != 0.0 {
                    assert_eq!(
                        decision.outcome == Outcome::Passed,
                        wanted > 0.0,
                        "{formula}"
                    );
                }
            }
            (found, wanted) => assert_eq!(found, wanted, "{formula}"),
        }
        cases += 1;
    }
    println!("{cases} formulas, {finite} with finite robustness");
    assert!(
        cases >= 200 && finite > cases / 2,
        "{cases} cases, {finite} finite"
    );
}

/// Every rule file has its expected diagnostics below it.
#[test]
fn mistakes_in_formulas_are_named() {
    let mistakes: BTreeMap<&str, [&str; 2]> = BTreeMap::from([
        (
            "success(1) :- always(w:tild(obj:a) < 1) .",
            ["R052", "did you mean `tilt`?"],
        ),
        (
            "success(1) :- always(w:distance(obj:a) < 1) .",
            ["R052", "write `w:distance(?one, ?other)`"],
        ),
        (
            "success(1) :- always(tilt(obj:a) < 1) .",
            ["R027", "did you mean `w:tilt(…)`?"],
        ),
        (
            "success(1) :- w:tilt(obj:a) < 1 .",
            ["R053", "write a formula, such as `always(w:tilt(…) < 1)`"],
        ),
        (
            "success(1) :- always(ABS(w:z(obj:a), 1) < 1) .",
            ["R027", "`ABS` has 2 arguments, needs 1"],
        ),
        (
            "success(1) :- always[2, 1](w:z(obj:a) < 1) .",
            ["R051", "the interval is empty"],
        ),
        (
            "success(1) :- always[-1, 1](w:z(obj:a) < 1) .",
            ["R051", "`once` and `since` look back"],
        ),
        (
            "success(1) :- until(w:z(obj:a) < 1) .",
            ["R051", "`until` has two parts"],
        ),
        (
            "success(1) :- always(w:z(obj:a) < 1, w:z(obj:a) > 0) .",
            ["R051", "join conditions by `and`"],
        ),
        (
            "success(1) :- always(w:z(obj:a) < \"high\") .",
            ["R051", "is not a number"],
        ),
        (
            "success(1) :- always(w:z(?o) < 1) .",
            ["R021", "`?o` is not bound here"],
        ),
        (
            "success(1) :- always(w:z(obj:a) + 1) .",
            ["R010", "expected a comparison"],
        ),
        (
            "success(1) :- always(w:z(obj:a) < 1 .",
            ["R010", "expected `)`"],
        ),
        (
            "success(1) :- course(obj:a, ?p, _, 1), ?p = w:z .",
            ["R052", "`course` needs a constant property"],
        ),
        (
            "success(1) :- course(obj:a, w:distance, _, 1) .",
            ["R052", "not a quantity of one thing"],
        ),
        (
            "always(1) :- parameter(act:pickObject, _) . success(1) .",
            ["R038", "temporal operator"],
        ),
    ]);
    for (text, wanted) in mistakes {
        let found = Rules::parse(text).map(|_| ()).expect_err(text).to_string();
        for part in wanted {
            assert!(found.contains(part), "{text}\n{found}");
        }
    }
}

#[test]
fn formulas_that_say_nothing_are_named() {
    let warned: [(&str, &[&str]); 9] = [
        (
            "success(1) :- always(w:speed(obj:a) >= 0) .",
            &["R054", "always holds"],
        ),
        (
            "success(1) :- always[0, 0](w:distance(obj:a, obj:b) > -1) .",
            &["R054"],
        ),
        ("success(1) :- eventually(0 <= w:time()) .", &["R054"]),
        (
            "success(1) :- always(w:z(obj:a) > 1 or w:z(obj:a) < 2) .",
            &["R054", "one of the conditions holds"],
        ),
        (
            "success(1) :- always(w:held(obj:a) or ~w:held(obj:a)) .",
            &["R054"],
        ),
        (
            "success(1) :- always(w:z(obj:a) > 2 implies w:z(obj:a) > 1) .",
            &["R054"],
        ),
        (
            "success(1) :- always[0.001, 0.002](w:z(obj:a) > 2) .",
            &["R055", "contains no sample"],
        ),
        (
            "success(1) :- always(w:z(obj:a) > 0 and w:z(obj:a) < 1) .",
            &[],
        ),
        (
            "success(1) :- always[0.1, 0.1](w:speed(obj:a) > 0 or w:z(obj:a) < 1 or w:held(obj:a)) .",
            &[],
        ),
    ];
    for (text, wanted) in warned {
        let found = Rules::parse(text)
            .unwrap_or_else(|found| panic!("{text}: {found}"))
            .warnings()
            .to_string();
        assert_eq!(found.is_empty(), wanted.is_empty(), "{text}\n{found}");
        wanted
            .iter()
            .for_each(|part| assert!(found.contains(part), "{text}\n{found}"));
    }
    for text in [
        "success(1) :- eventually(w:z(obj:a) > 3 and w:z(obj:a) < 2) .",
        "success(1) :- eventually(w:z(obj:a) > 3 and (w:held(obj:a) and ~(w:z(obj:a) >= 3))) .",
        "success(1) :- eventually(w:held(obj:a) and ~w:held(obj:a)) .",
        "success(1) :- after(_, w:z, ?x), eventually(w:held(obj:a) and ?x > 3 and 2 > ?x) .",
        "success(1) :- eventually(w:contactForce(w:robot, obj:a) < 0) .",
    ] {
        let found = Rules::parse(text)
            .unwrap_or_else(|found| panic!("{text}: {found}"))
            .warnings()
            .to_string();
        assert!(
            found.contains("R054") && found.contains("can never hold"),
            "{text}\n{found}"
        );
    }
}

/// A library of formulas is evaluated with the properties that use it.
fn with_library(text: &str) -> Result<Rules, actcheck::base::Diagnostics> {
    let library = "calm(?o) :- parameter(act:pickObject, ?o), always(w:speed(?o) < 1) .
        highest(?o, #max(?z)) :- course(?o, w:z, _, ?z) .
        calm_and_low(?o) :- calm(?o), highest(?o, ?z), ?z < 2 .";
    Rules::builder()
        .library("calm.rls", library)
        .build("property.rls", text)
}

#[test]
fn a_property_can_use_a_library_predicate_that_is_defined_by_a_formula() {
    let rules = with_library("success(?o) :- calm_and_low(?o) .").expect("the rules are valid");
    for (speed, outcome) in [(0.5, Outcome::Passed), (1.5, Outcome::Failed)] {
        let mut course = Course::new(0.1, 2);
        for (quantity, values) in [("speed", vec![0.1, speed]), ("z", vec![0.0, 1.0])] {
            course.set(
                [names::w(quantity), names::obj("a"), String::new()],
                Signal::Values(values),
            );
        }
        let mut facts = Facts::new();
        facts
            .set_parameter(
                Term::iri(names::act("pickObject")),
                Term::iri(names::obj("a")),
            )
            .set_course(course);
        assert_eq!(rules.judge(&facts).outcome, outcome);
        let why = rules
            .why(&facts)
            .expect("the rules are evaluated")
            .to_text();
        assert!(why.contains("calm.rls"), "{why}");
    }
}

#[test]
fn without_a_course_only_properties_that_use_the_formulas_of_a_library_are_broken() {
    let mut facts = Facts::new();
    facts.set_parameter(
        Term::iri(names::act("pickObject")),
        Term::iri(names::obj("a")),
    );
    let rules = with_library("success(?o) :- calm(?o) .").expect("the rules are valid");
    let decision = rules.judge(&facts);
    assert_eq!(decision.outcome, Outcome::Broken);
    assert!(
        format!("{decision:?}").contains("the course of the action was not recorded"),
        "{decision:?}"
    );
    let rules = with_library("success(?o) :- parameter(act:pickObject, ?o) .")
        .expect("the rules are valid");
    assert_eq!(rules.judge(&facts).outcome, Outcome::Passed);
}

#[test]
fn a_library_cannot_derive_facts_of_the_snapshots_from_the_course() {
    let library = "state(act:after, ?o, w:calm, true) :- before(?o, w:fixed, false), always(w:speed(?o) < 1) .";
    let rules = Rules::builder()
        .library("calm.rls", library)
        .build("property.rls", "success(1) :- before(_, w:x, _) .");
    let found = rules
        .map(|_| ())
        .expect_err("the library is refused")
        .to_string();
    assert!(
        found.contains("R053") && found.contains("calm.rls"),
        "{found}"
    );
}

#[test]
fn programs_may_have_predicates_with_the_names_of_operators() {
    let source = actcheck::base::Source::new(
        "p.rls",
        "until(1, 2) . once(3) . q(?x) :- until(?x, ?y), ~once(?x), ?y > 1 .",
    );
    let (syntax, found) = actcheck::rules::parse(&source);
    assert!(found.is_empty() && syntax.statements.len() == 3, "{found}");
}

/// The words of random texts: half of them make formulas, half of them break these.
const WORDS: [&str; 44] = [
    "always",
    "eventually",
    "until",
    "since",
    "once",
    "historically",
    "and",
    "or",
    "implies",
    "~",
    "(",
    ")",
    "[",
    "]",
    ",",
    "0",
    "1",
    "0.5",
    "-1",
    "1e300",
    "w:z(obj:a)",
    "w:speed(obj:a)",
    "w:held(obj:a)",
    "w:tilt(?o)",
    "?o",
    "?x",
    "<",
    "<=",
    ">",
    "=",
    "!=",
    "+",
    "-",
    "*",
    "/",
    "ABS",
    "MIN",
    "w:phase(\"lift\")",
    "w:time()",
    "w:distance(obj:a, obj:a)",
    "w:unknown(?o)",
    ".",
    ":-",
    "course(?o, w:z, ?t, ?x)",
];

/// Returns a formula in which a random word is inserted now and then.
fn random_formula(dice: &mut Dice, depth: u64) -> String {
    if dice.below(16) == 0 {
        return WORDS[dice.below(WORDS.len() as u64) as usize].to_owned();
    }
    let part = |dice: &mut Dice| random_formula(dice, depth.saturating_sub(1));
    match if depth == 0 { 0 } else { dice.below(6) } {
        0 => "w:speed(obj:a) < 0.5".to_owned(),
        1 => format!("~({})", part(dice)),
        2 => format!("({}) implies ({})", part(dice), part(dice)),
        3 => format!("w:held(?o) and {} or w:z(?o) > -1e300", part(dice)),
        4 => format!("once[0, 0.5]({})", part(dice)),
        _ => format!("until({}, {})", part(dice), part(dice)),
    }
}

/// Whatever the text, parsing, judging and explaining end without a panic. `ACTCHECK_FUZZ_MINUTES`
/// sets how long.
#[test]
fn no_text_of_a_formula_causes_a_panic() {
    let minutes: Option<f64> = std::env::var("ACTCHECK_FUZZ_MINUTES")
        .ok()
        .and_then(|text| text.parse().ok());
    let end = minutes.map(|minutes| {
        std::time::Instant::now() + std::time::Duration::from_secs_f64(60.0 * minutes)
    });
    let mut course = Course::new(0.1, 30);
    for (seed, quantity) in ["x", "y", "z", "held", "qx", "qy", "qz", "qw"]
        .into_iter()
        .enumerate()
    {
        let values = (0..30)
            .map(|idx| f64::from(idx * (seed as i32 + 3) % 7) / 7.0)
            .collect();
        course.set(
            [names::w(quantity), names::obj("a"), String::new()],
            Signal::Values(values),
        );
    }
    let mut facts = Facts::new();
    facts.set_parameter(
        Term::iri(names::act("pickObject")),
        Term::iri(names::obj("a")),
    );
    facts.set_course(course);
    let (mut cases, mut judged) = (0u64, 0u64);
    while end.map_or(cases < 3_000, |end| std::time::Instant::now() < end) {
        let mut dice = Dice::new(cases);
        let part = random_formula(&mut dice, 3);
        let text = match dice.below(2) {
            0 => format!("success(?o) :- parameter(_, ?o), always({part}) ."),
            _ => format!("success(?o) :- parameter(_, ?o), until[0, 1](w:z(?o) > 0, {part}) ."),
        };
        if let Ok(rules) = Rules::parse(&text) {
            let decision = rules.judge(&facts);
            let why = rules.why(&facts).map(|why| why.to_text());
            assert!(
                why.is_ok() || decision.outcome == Outcome::Broken,
                "{text}: {decision:?}"
            );
            judged += 1;
        }
        cases += 1;
    }
    println!("{cases} texts, {judged} judged");
    assert!(
        judged * 200 > cases,
        "{judged} of {cases} texts were judged"
    );
}

/// Whether each rule passes, and whether it passes vacuously, over a tilt that rises and a speed
/// that stays.
#[test]
fn a_pass_without_any_left_side_is_vacuous() {
    let never = "w:z(obj:a) > 9";
    let once = "w:z(obj:a) > 1";
    // Rule, outcome, and whether it is vacuous; `None`: it has no `implies` that a pass needs.
    let cases: &[(String, &str, Option<bool>)] = &[
        (
            format!("success(1) :- always({never} implies w:tilt(obj:a) < 0.5) ."),
            "passed",
            Some(true),
        ),
        (
            format!("success(1) :- always({once} implies w:tilt(obj:a) < 0.5) ."),
            "passed",
            Some(false),
        ),
        (
            format!("success(1) :- always({once} implies w:tilt(obj:a) < 0.1) ."),
            "failed",
            Some(false),
        ),
        (
            format!("violation(1) :- ~always({never} implies w:tilt(obj:a) < 0.5) ."),
            "passed",
            Some(true),
        ),
        (
            format!("violation(1) :- ~always({once} implies w:tilt(obj:a) < 0.5) ."),
            "passed",
            Some(false),
        ),
        // The left side holds only outside the window.
        (
            format!("success(1) :- always[0, 0.1]({once} implies w:tilt(obj:a) < 0.5) ."),
            "passed",
            Some(true),
        ),
        // Nested: the inner left side never holds.
        (
            format!("success(1) :- always({once} implies ({never} implies w:tilt(obj:a) < 0.5)) ."),
            "passed",
            Some(true),
        ),
        // A condition with a part that a pass needs beside the `implies`.
        (
            format!(
                "success(1) :- always(({never} implies w:tilt(obj:a) < 0.5) and w:tilt(obj:a) < 0.5) ."
            ),
            "passed",
            Some(true),
        ),
        // Through predicates, also negated ones.
        (
            format!(
                "bad(1) :- ~always({never} implies w:tilt(obj:a) < 0.5) . success(1) :- ~bad(1) ."
            ),
            "passed",
            Some(true),
        ),
        (
            format!(
                "good(1) :- always({once} implies w:tilt(obj:a) < 0.5) . violation(1) :- ~good(1) ."
            ),
            "passed",
            Some(false),
        ),
        // One of two conditions was tested.
        (
            format!(
                "success(1) :- always({never} implies w:tilt(obj:a) < 0.5), always({once} implies w:tilt(obj:a) < 0.5) ."
            ),
            "passed",
            Some(false),
        ),
        // No right side that a pass needs.
        (
            format!("violation(1) :- always({once} implies w:tilt(obj:a) > 0.5) ."),
            "passed",
            None,
        ),
        (
            format!("violation(1) :- eventually({never} and w:tilt(obj:a) > 0.5) ."),
            "passed",
            None,
        ),
        (
            "success(1) :- always(w:tilt(obj:a) < 0.5) .".to_owned(),
            "passed",
            None,
        ),
    ];
    for (text, outcome, vacuous) in cases {
        let property = "http://example.org/p".to_owned();
        let rule = ontology::RuleFile::new(actcheck::base::Source::new("p.rls", text.clone()));
        let mut ontology = ontology::Ontology::default();
        ontology
            .properties
            .insert(property.clone(), ontology::Property::new(&property, rule));
        let book = RuleBook::prepare(&ontology).unwrap_or_else(|found| panic!("{text}: {found}"));
        let mut course = Course::new(0.1, 4);
        for (quantity, values) in [("z", [0.5, 0.5, 2.0, 2.0]), ("tilt", [0.1, 0.2, 0.3, 0.4])] {
            let key = [names::w(quantity), names::obj("a"), String::new()];
            course.set(key, Signal::Values(values.to_vec()));
        }
        let mut facts = Facts::new();
        facts.set_course(course);
        let asked = [property.clone()];
        let found = book.judge(&facts.as_action(), &asked, &Budget::default());
        assert_eq!(
            found[&property].as_ref().unwrap().outcome().to_string(),
            *outcome,
            "{text}"
        );
        assert_eq!(
            book.can_pass_vacuously(&property),
            vacuous.is_some(),
            "{text}"
        );
        if let Some(vacuous) = vacuous {
            let found = book.without_consequents(&facts.as_action(), &asked, &Budget::default());
            assert_eq!(found[&property].as_ref().unwrap().holds, *vacuous, "{text}");
        }
    }
}
