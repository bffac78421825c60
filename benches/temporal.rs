//! Cost of formulas about time.
//!
//! - The formulas of a file of cases. `python3 benches/stl.py --seconds` writes such a file, and
//!   prints the cost of peers for the same formulas and signals.
//! - Growth with the bound of an operator: linear in the samples, whatever the bound.
//! - The shipped properties about time, over a simulated pick of the given length.
//!
//! ```text
//! python3 benches/stl.py --cases 500 --samples 1320 --common --seconds > /tmp/cases.jsonl
//! ACTCHECK_RTAMT=/tmp/cases.jsonl cargo bench --bench temporal
//! ```

use std::path::Path;

use actcheck::base::{Course, Files, RunFacts, Signal, names};
use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::rules::{Budget, Facts, RuleBook, Rules};
use actcheck::{facts, ontology};

mod support;

use support::thread_secs;

fn main() {
    cases();
    bounds();
    shipped();
}

/// Mean CPU time of the work, over at least a fifth of a second: some systems count CPU time in
/// steps of 4 ms. Unit: seconds.
fn cost(mut work: impl FnMut()) -> f64 {
    work();
    let (start, mut count) = (thread_secs(), 0);
    loop {
        work();
        count += 1;
        let spent = thread_secs() - start;
        if spent > 0.2 {
            return spent / f64::from(count);
        }
    }
}

fn facts_of(signals: impl IntoIterator<Item = (&'static str, Vec<f64>)>) -> Facts {
    let signals: Vec<_> = signals.into_iter().collect();
    let mut course = Course::new(
        1.0,
        signals
            .iter()
            .map(|(_, values)| values.len())
            .max()
            .unwrap_or(0),
    );
    for (name, values) in signals {
        let [quantity, thing] = [name, "a"].map(|local| format!("http://example.org/{local}"));
        course.set([quantity, thing, String::new()], Signal::Values(values));
    }
    let mut facts = Facts::new();
    facts.set_course(course);
    facts
}

fn rules_of(formula: &str) -> Rules {
    Rules::parse(&format!(
        "@prefix ex: <http://example.org/> . success(1) :- {formula} ."
    ))
    .expect("the formula is valid")
}

fn cases() {
    let file =
        std::env::var("ACTCHECK_RTAMT").unwrap_or_else(|_| "tests/temporal/rtamt.jsonl".to_owned());
    let text = std::fs::read_to_string(&file).expect("the cases are readable");
    let cases: Vec<(String, Facts)> = text
        .lines()
        .map(|line| {
            let case: serde_json::Value = serde_json::from_str(line).expect("a case is JSON");
            let values = |name: &str| -> Vec<f64> {
                case[name]
                    .as_array()
                    .into_iter()
                    .flatten()
                    .filter_map(serde_json::Value::as_f64)
                    .collect()
            };
            let formula = case["formula"].as_str().expect("a case has a formula");
            (
                formula.to_owned(),
                facts_of(["x", "y"].map(|name| (name, values(name)))),
            )
        })
        .collect();
    let count = cases.len();
    let parsing = cost(|| {
        cases
            .iter()
            .for_each(|(formula, _)| drop(rules_of(formula)))
    });
    let parsed: Vec<Rules> = cases.iter().map(|(formula, _)| rules_of(formula)).collect();
    let judging = cost(|| {
        parsed
            .iter()
            .zip(&cases)
            .for_each(|(rules, (_, facts))| drop(rules.judge(facts)))
    });
    println!("{count} formulas: {judging:.4} s, and {parsing:.4} s for parsing");
}

fn bounds() {
    let values = |phase: usize| {
        (0..20_000)
            .map(|at| ((at * 37 + phase) % 1_009) as f64)
            .collect::<Vec<_>>()
    };
    let facts = facts_of([("x", values(0)), ("y", values(500))]);
    for bound in [10, 100, 1_000, 10_000] {
        let formulas = [
            format!("always[0, {bound}](eventually[0, {bound}](ex:x(ex:a) < 900))"),
            format!("always(until[0, {bound}](ex:x(ex:a) < 1000, ex:y(ex:a) > 500))"),
            format!("historically(since[0, {bound}](ex:x(ex:a) < 1000, ex:y(ex:a) > 500))"),
        ];
        let secs = formulas.map(|formula| {
            let rules = rules_of(&formula);
            cost(|| drop(rules.judge(&facts))) * 1e3
        });
        println!(
            "20,000 samples, bound {bound:6}: nested {:.2} ms, until {:.2} ms, since {:.2} ms",
            secs[0], secs[1], secs[2]
        );
    }
}

fn shipped() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let time = ontology::load(&Files::Disk, &root.join("ontology/time.ttl")).expect("it is valid");
    let book = RuleBook::prepare(&time).expect("the rules are valid");
    let shipped = time
        .properties
        .values()
        .filter(|property| property.rule.source.name.contains("rules/time/"));
    let properties: Vec<String> = shipped.map(|property| property.iri.clone()).collect();
    for (config, action) in [("pick", "Pick"), ("pick_and_place", "Place")] {
        let (facts, step, length) = typical(
            &root.join(format!("configs/{config}.toml")),
            &names::act(action),
        );
        let action_facts = facts.action(step).expect("the action was reached");
        let judge = |properties: &[String]| {
            cost(|| drop(book.judge(&action_facts, properties, &Budget::default()))) * 1e3
        };
        let all = judge(&properties);
        println!(
            "{} properties about time on a {action} of {length:.1} s: {all:.2} ms (at most 2)",
            properties.len()
        );
        if std::env::args().any(|argument| argument == "each") {
            for property in &properties {
                println!(
                    "  {:7.3} ms {}",
                    judge(std::slice::from_ref(property)),
                    names::local(property)
                );
            }
        }
    }
}

/// The action of this kind in six runs whose length is closest to 22 s: the facts of its run, its
/// place, and its length.
fn typical(config: &Path, action: &str) -> (RunFacts, usize, f64) {
    let env =
        Env::prepare(config, &Overrides::default()).expect("the shipped configuration is sound");
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    let context = RunContext {
        clock,
        disturb: None,
    };
    let seed = env.campaign.seed;
    let runs = (0..6).filter_map(|index| {
        run_line(&env, "bench", index, Choices::random(seed, index), &context).ok()
    });
    let lengths = runs.flat_map(|run| {
        let steps = run
            .actions
            .iter()
            .enumerate()
            .filter(|(_, name)| *name == action)
            .map(|(step, _)| step);
        let lengths: Vec<_> = steps
            .filter_map(|step| {
                let samples = &run.trace.robot_courses.get(step)?.samples;
                Some((
                    run.trace.clone(),
                    step,
                    samples.count as f64 * samples.period_secs,
                ))
            })
            .collect();
        lengths
    });
    let (trace, step, length) = lengths
        .min_by(|a, b| (a.2 - 22.0).abs().total_cmp(&(b.2 - 22.0).abs()))
        .expect("the action is in a run");
    (facts::extract(&trace), step, length)
}
