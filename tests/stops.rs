//! Evaluations stop at their budget and on request, and leave no partial output.

use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use actcheck::base::{Files, Findings, RuleFault, RunFacts, Source, digest_of};
use actcheck::campaign::{Clock, Env, Failure, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::ontology::{self, RuleLanguage};
use actcheck::rules::standalone::{Engine, Program, run};
use actcheck::rules::{Budget, RuleBook};

use crate::support::{root, signal, stderr};

/// Nonterminating programs, each in another part of an evaluation, with a fact whose explanation
/// needs the evaluation.
const ENDLESS: [(&str, &str); 2] = [
    // Endless rounds.
    ("n(0) .\nn(?y) :- n(?x), ?y = ?x + 1 .", "n(-1)"),
    // One round of 10¹² rows.
    (
        "d(0) .\nd(?y) :- d(?x), ?x < 99, ?y = ?x + 1 .\nq(1) :- d(?a), d(?b), d(?c), d(?d), d(?e), d(?f), ?a + ?b + ?c + ?d + ?e + ?f < 0 .",
        "q(1)",
    ),
];

fn asked() -> Budget {
    Budget {
        tuples: usize::MAX,
        bytes: usize::MAX,
        secs: f64::MAX,
        new_things: usize::MAX,
        stop: Arc::new(AtomicBool::new(true)),
    }
}

#[test]
fn both_engines_stop_on_request() {
    for (text, fact) in ENDLESS {
        let program = Program::load(&Source::new("endless.rls", text), Path::new("")).unwrap();
        for engine in [Engine::Fast, Engine::Naive] {
            assert_eq!(
                program.close(engine, &asked()).unwrap_err(),
                RuleFault::Interrupted,
                "{engine:?}: {text}"
            );
        }
        assert_eq!(
            program.explain(fact, &asked()).unwrap_err(),
            RuleFault::Interrupted,
            "{text}"
        );
    }
}

#[test]
fn a_stopped_program_writes_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("rows.csv", "1\n2\n");
    write(
        "import.rls",
        "@import p :- csv{resource = \"rows.csv\"} .\nq(?x) :- p(?x) .\n@export q :- csv{} .",
    );
    write("export.rls", "q(1) .\n@export q :- csv{} .");
    for program in ["import.rls", "export.rls"] {
        let out = folder.path().join("out");
        let faults = run(&folder.path().join(program), &out, &asked())
            .unwrap_err()
            .to_string();
        assert!(faults.contains("interrupted"), "{faults}");
        assert_eq!(
            std::fs::read_dir(&out).map_or(0, Iterator::count),
            0,
            "{program}"
        );
    }
    let done = run(
        &folder.path().join("export.rls"),
        folder.path(),
        &Budget::default(),
    )
    .unwrap();
    assert_eq!(std::fs::read_to_string(&done.written[0].0).unwrap(), "1\n");
}

/// Three patterns without shared variables: a product of the third power.
const PRODUCT: &str = "GRAPH act:during { ?a ?p ?x } GRAPH act:during { ?b ?q ?y } GRAPH act:after { ?c ?r ?z } GRAPH act:before { ?d ?t ?w }";

/// A condition that no row of the product satisfies, and that needs a whole row.
const NEVER: &str = "FILTER(STRLEN(CONCAT(STR(?x), STR(?y), STR(?z), STR(?w))) < 0)";

/// Queries that multiply their patterns before the first result.
fn multiplying() -> [(&'static str, String); 5] {
    let named = |name, text: String| (name, text);
    [
        named("filter.rq", format!("ASK {{ {PRODUCT} {NEVER} }}")),
        named(
            "order.rq",
            format!("SELECT ?a ?b {{ {PRODUCT} }} ORDER BY ?x ?z"),
        ),
        named(
            "count.rq",
            format!("SELECT (COUNT(*) AS ?n) {{ {PRODUCT} }} HAVING (?n < 0)"),
        ),
        named(
            "group.rq",
            format!("SELECT ?a (MAX(?y) AS ?n) {{ {PRODUCT} }} GROUP BY ?a HAVING (?n < 0)"),
        ),
        named(
            "optional.rq",
            format!("ASK {{ OPTIONAL {{ {PRODUCT} {NEVER} }} FILTER(BOUND(?a)) }}"),
        ),
    ]
}

/// The shipped ontology with one property: a query.
fn book(file: &str, text: &str) -> (RuleBook, String) {
    let mut ontology = ontology::load(&Files::Shipped, Path::new("ontology/actions.ttl")).unwrap();
    let mut property = ontology.properties.values().next().unwrap().clone();
    property.rule.source = Source::new(file, text);
    property.rule.language = RuleLanguage::Sparql;
    property.rule.digest = digest_of(text);
    let iri = property.iri.clone();
    ontology.properties = [(iri.clone(), property)].into();
    (
        RuleBook::prepare(&ontology).unwrap_or_else(|faults| panic!("{faults}")),
        iri,
    )
}

const CONTEXT: RunContext = RunContext {
    clock: Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    },
    disturb: None,
};

fn env(budget: Budget) -> Env {
    Env::prepare_within(
        &root().join("configs/pick.toml"),
        &Overrides::default(),
        budget,
    )
    .unwrap()
}

/// Choices of a scene that can be built.
fn choices() -> Choices {
    static STREAM: OnceLock<u64> = OnceLock::new();
    let made =
        |env: &Env, stream| run_line(env, "c", 0, Choices::random(1, stream), &CONTEXT).is_ok();
    let stream = STREAM.get_or_init(|| {
        let env = env(Budget::default());
        (0..50).find(|stream| made(&env, *stream)).unwrap()
    });
    Choices::random(1, *stream)
}

/// Facts of a simulated pick.
fn facts() -> &'static RunFacts {
    static FACTS: OnceLock<RunFacts> = OnceLock::new();
    FACTS.get_or_init(|| {
        run_line(&env(Budget::default()), "c", 0, choices(), &CONTEXT)
            .unwrap()
            .facts
    })
}

fn judged(
    file: &str,
    text: &str,
    facts: &RunFacts,
    budget: &Budget,
) -> Result<Findings, RuleFault> {
    let (book, iri) = book(file, text);
    let started = std::time::Instant::now();
    let found = book
        .judge(
            &facts.action(0).unwrap(),
            std::slice::from_ref(&iri),
            budget,
        )
        .remove(&iri)
        .unwrap();
    println!(
        "{file}: {:.2} s with a budget of {:.1e} s",
        started.elapsed().as_secs_f64(),
        budget.secs
    );
    found
}

#[test]
fn queries_that_multiply_stop_at_their_budget() {
    let facts = facts();
    for (file, text) in multiplying() {
        let budget = Budget {
            secs: 0.3,
            tuples: 50_000_000,
            ..Budget::default()
        };
        let fault = judged(file, &text, facts, &budget).unwrap_err();
        let RuleFault::BudgetSpent(words) = &fault else {
            panic!("{file}: {fault}")
        };
        assert!(
            words.contains(file) && words.contains("0.3 s") && words.contains("share"),
            "{words}"
        );
        assert_eq!(
            judged(file, &text, facts, &asked()).unwrap_err(),
            RuleFault::Interrupted,
            "{file}"
        );
    }
    // A query's memory is bounded as well, long before memory is full.
    let (file, text) = &multiplying()[1];
    let budget = Budget {
        tuples: 100_000,
        secs: f64::MAX,
        ..Budget::default()
    };
    let fault = judged(file, text, facts, &budget).unwrap_err().to_string();
    assert!(fault.contains("held more than 100000 terms"), "{fault}");
}

#[test]
fn a_query_that_joins_its_patterns_stays_in_a_small_budget() {
    let text = "SELECT ?o ?z { GRAPH act:after { ?o w:z ?z ; w:mass ?m } GRAPH act:before { ?o w:z ?y } FILTER(?z > 1e6) } ORDER BY ?z";
    let budget = Budget {
        tuples: 10_000,
        ..Budget::default()
    };
    assert!(judged("joined.rq", text, facts(), &budget).unwrap().holds);
}

#[test]
fn a_run_in_flight_is_judged_whole_unless_its_rules_take_long() {
    let env = env(Budget::default());
    let made = |env: &Env| run_line(env, "c", 0, choices(), &CONTEXT).map(|run| run.score);
    env.rule_budget.stop.store(true, Ordering::Relaxed);
    assert!(made(&env).is_ok());
    let (file, text) = &multiplying()[0];
    let (rules, property) = book(file, text);
    let mut env = env;
    env.rules = rules;
    for action in env.ontology.actions.values_mut() {
        action.success_properties = vec![property.clone()];
        action.preconditions.clear();
    }
    env.rule_budget = asked();
    assert_eq!(made(&env).unwrap_err(), Failure::Interrupted);
}

/// The program, waiting for rows from a pipe; `rest` is appended after the import.
fn waiting(folder: &Path, rest: &str) -> Child {
    let text = format!("@import p :- csv{{resource = \"pipe\", format = (int)}} .\n{rest}");
    std::fs::write(folder.join("waits.rls"), text).unwrap();
    assert!(
        Command::new("mkfifo")
            .arg(folder.join("pipe"))
            .status()
            .unwrap()
            .success()
    );
    Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(["datalog", "waits.rls", "-D", "out", "--max-time", "1e9"])
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn interrupted(child: Child) {
    signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("interrupted"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn an_interrupt_stops_a_program_at_any_moment() {
    let endless = "n(?x) :- p(?x) .\nn(?y) :- n(?x), ?y = ?x + 1 .\n@export n :- csv{} .";
    // While it waits for its import, where the flag is not checked.
    let folder = tempfile::tempdir().unwrap();
    let child = waiting(folder.path(), endless);
    let pipe = std::fs::OpenOptions::new()
        .write(true)
        .open(folder.path().join("pipe"))
        .unwrap();
    interrupted(child);
    drop(pipe);
    // While it derives.
    let folder = tempfile::tempdir().unwrap();
    let child = waiting(folder.path(), endless);
    let mut pipe = std::fs::OpenOptions::new()
        .write(true)
        .open(folder.path().join("pipe"))
        .unwrap();
    pipe.write_all(b"1\n").unwrap();
    drop(pipe);
    std::thread::sleep(Duration::from_millis(300));
    interrupted(child);
    assert_eq!(
        std::fs::read_dir(folder.path().join("out")).map_or(0, Iterator::count),
        0
    );
}
