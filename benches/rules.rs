//! Cost of the rule engine, which loads rules at run time, compared with rules compiled by hand;
//! and cost of judging an action.
//!
//! Ratios are measured within one process, because absolute times depend on the machine.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use actcheck::base::{Files, RunFacts, Source, Term, digest_of, names};
use actcheck::ontology::{self, RuleLanguage};
use actcheck::rules::standalone::{Engine, Program};
use actcheck::rules::{Budget, RuleBook};
use datafrog::{Iteration, Relation};

fn main() {
    closure_against_datafrog();
    if std::env::args().any(|argument| argument == "closure") {
        return;
    }
    closure_grows_linearly();
    twenty_rules();
    shipped_properties();
}

/// Time of the fastest of several runs. Unit: seconds.
fn fastest(runs: usize, mut work: impl FnMut()) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// Edges of a reproducible random graph.
fn edges(nodes: u64, count: u64) -> Vec<(u32, u32)> {
    let mut state = 88_172_645_463_325_252u64;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % nodes) as u32
    };
    (0..count).map(|_| (next(), next())).collect()
}

fn closure_program(edges: &[(u32, u32)]) -> Program {
    let mut text = String::from("p(?x, ?y) :- e(?x, ?y) .\np(?x, ?z) :- p(?x, ?y), e(?y, ?z) .\n");
    for (a, b) in edges {
        writeln!(text, "e({a}, {b}) .").expect("a string takes everything");
    }
    Program::load(&Source::new("closure.rls", text), Path::new("")).expect("the program is valid")
}

fn closure_by_hand(edges: &[(u32, u32)]) -> usize {
    let mut iteration = Iteration::new();
    // Keyed by the join node: paths by their end, edges by their start.
    let paths = iteration.variable::<(u32, u32)>("paths");
    let edges: Relation<(u32, u32)> = edges.iter().copied().collect();
    paths.extend(edges.iter().map(|(a, b)| (*b, *a)));
    while iteration.changed() {
        paths.from_join(&paths, &edges, |_, start, end| (*end, *start));
    }
    paths.complete().len()
}

fn budget() -> Budget {
    Budget {
        tuples: 100_000_000,
        secs: 600.0,
        ..Budget::default()
    }
}

fn closure_against_datafrog() {
    let edges = edges(2000, 6000);
    let program = closure_program(&edges);
    let mut tuples = (0, 0);
    let ours = fastest(3, || {
        tuples.0 = program
            .close(Engine::Fast, &budget())
            .expect("in its budget")
            .count("p")
    });
    let hand = fastest(3, || tuples.1 = closure_by_hand(&edges));
    assert_eq!(tuples.0, tuples.1);
    println!(
        "transitive closure, {} tuples: {ours:.2} s, by hand {hand:.2} s, ratio {:.2} (at most 3)",
        tuples.0,
        ours / hand
    );
    if let Some(peak) = peak_bytes() {
        println!(
            "  peak memory of the process so far: {:.0} bytes per tuple (at most 100)",
            peak / tuples.0 as f64
        );
    }
}

/// Peak memory of the process; `None` if the system does not report it.
fn peak_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace()
        .nth(1)?
        .parse::<f64>()
        .ok()
        .map(|kib| kib * 1024.0)
}

fn closure_grows_linearly() {
    for nodes in [500, 1000, 2000] {
        let program = closure_program(&edges(nodes, nodes * 3));
        let mut tuples = 0;
        let secs = fastest(3, || {
            tuples = program
                .close(Engine::Fast, &budget())
                .expect("in its budget")
                .count("p")
        });
        println!(
            "  {tuples} tuples: {:.0} ns per tuple",
            secs / tuples as f64 * 1e9
        );
    }
}

/// Facts of a scene with this number of bodies, before and after an action.
fn facts(bodies: usize) -> RunFacts {
    let mut facts = RunFacts::default();
    for phase in 0..2 {
        let mut triples = Vec::new();
        for body in 0..bodies {
            let name = names::obj(&format!("thing_{body}"));
            let mut say = |property: &str, value: Term| {
                let triple = [Term::iri(&name), Term::iri(names::w(property)), value]
                    .map(|term| facts.terms.intern(term));
                triples.push(triple);
            };
            let moved = if phase == 1 && body % 3 == 0 {
                0.05
            } else {
                0.0
            };
            let at = [body as f64 * 0.1 + moved, 0.3, 0.4];
            for (property, value) in ["x", "y", "z"].into_iter().zip(at) {
                say(property, Term::Double(value));
            }
            for (property, value) in ["minX", "minY", "minZ"].into_iter().zip(at) {
                say(property, Term::Double(value - 0.03));
            }
            for (property, value) in ["maxX", "maxY", "maxZ"].into_iter().zip(at) {
                say(property, Term::Double(value + 0.03));
            }
            for property in [
                "tilt",
                "yaw",
                "qx",
                "qy",
                "qz",
                "mass",
                "friction",
                "restitution",
            ] {
                say(property, Term::Double(0.01 * body as f64));
            }
            say("fixed", Term::Boolean(body == 1));
            say("asleep", Term::Boolean(true));
            say("restsOn", Term::iri(names::obj("thing_1")));
            say(
                "touches",
                Term::iri(names::obj(&format!("thing_{}", (body + 1) % bodies))),
            );
        }
        triples.sort_unstable();
        facts.snapshots.push(triples);
    }
    facts.during.push(Vec::new());
    let pair = [names::act("pickObject"), names::obj("thing_0")]
        .map(|iri| facts.terms.intern(Term::iri(iri)));
    facts.parameters.push(vec![pair]);
    facts
}

/// Twenty rules with negation, arithmetic and recursion.
const TWENTY: &str = r#"
at0(?o, ?x, ?y, ?z) :- before(?o, w:x, ?x), before(?o, w:y, ?y), before(?o, w:z, ?z) .
at1(?o, ?x, ?y, ?z) :- after(?o, w:x, ?x), after(?o, w:y, ?y), after(?o, w:z, ?z) .
went(?o, ?d) :- at0(?o, ?x, ?y, ?z), at1(?o, ?u, ?v, ?w), ?d = SQRT((?u - ?x) * (?u - ?x) + (?v - ?y) * (?v - ?y) + (?w - ?z) * (?w - ?z)) .
still(?o) :- went(?o, ?d), ?d < 0.001 .
moving(?o) :- went(?o, ?d), ~still(?o) .
linked(?a, ?b) :- after(?a, w:touches, ?b) .
linked(?a, ?b) :- linked(?b, ?a) .
group(?a, ?b) :- linked(?a, ?b), ~loose(?a) .
group(?a, ?c) :- group(?a, ?b), linked(?b, ?c), moving(?a) .
loose(?a) :- after(?a, w:fixed, true) .
heavy(?o) :- after(?o, w:mass, ?m), ?m > 0.05 .
slippery(?o) :- after(?o, w:friction, ?m), ?m < 0.02 .
tilted(?o, ?t) :- after(?o, w:tilt, ?t), ?t > 0.03 .
tilted_more(?o) :- tilted(?o, ?t), before(?o, w:tilt, ?s), ?t - ?s > 0.01 .
carried(?o) :- after(?o, w:restsOn, ?p), ~loose(?p) .
free(?o) :- at1(?o, _, _, _), ~carried(?o), ~loose(?o) .
groups(?a, #count(?b)) :- group(?a, ?b) .
violation(?o) :- moving(?o), heavy(?o), slippery(?o), ~tilted_more(?o) .
margin(?m) :- went(?o, ?d), free(?o), ?m = 0.02 - ?d .
because(?t) :- groups(?a, ?n), ?n > 100, ?t = CONCAT(STR(?a), " touches all") .
"#;

fn book(rules: Option<&str>) -> (RuleBook, Vec<String>) {
    let mut ontology = ontology::load(&Files::Shipped, Path::new("ontology/actions.ttl"))
        .expect("the shipped ontology is valid");
    if let Some(text) = rules {
        ontology.libraries.clear();
        let mut property = ontology
            .properties
            .values()
            .next()
            .expect("it has properties")
            .clone();
        property.rule.source = Source::new("twenty.rls", text);
        property.rule.language = RuleLanguage::Datalog;
        property.rule.digest = digest_of(text);
        ontology.properties = BTreeMap::from([(property.iri.clone(), property)]);
    }
    let properties = ontology.properties.keys().cloned().collect();
    (
        RuleBook::prepare(&ontology).unwrap_or_else(|faults| panic!("{faults}")),
        properties,
    )
}

fn measure(title: &str, limit_ms: f64, book: &RuleBook, properties: &[String], facts: &RunFacts) {
    let action = facts.action(0).expect("there is one action");
    let count: usize = facts.snapshots.iter().map(Vec::len).sum();
    let mut derived = 0;
    let secs = fastest(300, || {
        derived += book.judge(&action, properties, &budget()).len()
    });
    assert!(derived > 0);
    println!(
        "{title}: {count} facts, {:.3} ms (at most {limit_ms})",
        secs * 1e3
    );
}

fn twenty_rules() {
    let (book, properties) = book(Some(TWENTY));
    let scene = facts(12);
    let action = scene.action(0).expect("there is one action");
    let found = book
        .judge(&action, &properties, &budget())
        .remove(&properties[0])
        .expect("it was judged");
    // The margin depends on negation, arithmetic and two other rules, so it shows that the rules
    // were evaluated.
    assert!(found.expect("in its budget").margin.is_some());
    measure("twenty rules", 0.3, &book, &properties, &facts(12));
}

fn shipped_properties() {
    let (book, properties) = book(None);
    measure(
        "the shipped properties",
        2.0,
        &book,
        &properties,
        &facts(12),
    );
    measure(
        "the shipped properties",
        2.0,
        &book,
        &properties,
        &facts(25),
    );
}
