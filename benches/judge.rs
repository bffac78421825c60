//! Cost of judging one pick from plain values, as a program does, compared with `recheck`'s cost of the same run: states to facts,
//! rules, outcomes.
//!
//! Wanted: at most 1 ms a pick, and at most twice `recheck`'s cost.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use actcheck::base::Files;
use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::{Choices, Trace};
use actcheck::facts::extract;
use actcheck::ontology::load;
use actcheck::rules::{Budget, RuleBook};
use actcheck::verdict::judge_action;
use actcheck_judge::{Call, Judge, Value};

#[path = "../tests/support/judge_values.rs"]
mod judge_values;

const RUNS: u64 = 12;
const ROUNDS: usize = 30;

fn main() {
    let traces = traces();
    let path = Path::new("ontology/actions.ttl");
    let ontology = load(&Files::Shipped, path).expect("the shipped ontology is sound");
    let rules = RuleBook::prepare(&ontology).expect("the shipped rules are sound");
    let judge = Judge::new(None, &[]).expect("the shipped rules are sound");
    let values: Vec<[Value; 5]> = traces
        .iter()
        .map(|trace| {
            let action = judge_values::action(trace, 0);
            ["action", "before", "after", "during", "parameters"]
                .map(|part| judge_values::plain(&action[part]))
        })
        .collect();
    let rechecked = || {
        for trace in &traces {
            let facts = extract(trace);
            let (action, budget) = (&ontology.actions["Pick"], Budget::default());
            let end = &trace.actions[0].end;
            let seen = (facts.start(), facts.action(0));
            let judged = judge_action(&ontology, &rules, action, end, seen, &budget);
            black_box(judged).expect("nothing interrupts it");
        }
    };
    let judged = |with_course: bool| {
        for [_, before, after, during, parameters] in &values {
            let call = Call {
                action: "Pick",
                before,
                after,
                during: if with_course { during } else { &Value::Null },
                parameters,
            };
            black_box(judge.judge(&call)).expect("the values are sound");
        }
    };
    let recheck = median_ms(rechecked);
    println!("{:44} {:>8} {:>24}", "", "ms", "times recheck's cost");
    for (what, ms) in [
        ("recheck of one run, in memory", recheck),
        ("judge, with the whole course", median_ms(|| judged(true))),
        ("judge, with the states alone", median_ms(|| judged(false))),
    ] {
        println!("{what:44} {ms:8.3} {:24.2}", ms / recheck);
    }
}

/// The median time of one of the runs.
fn median_ms(judge_all: impl Fn()) -> f64 {
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            judge_all();
            start.elapsed().as_secs_f64() * 1e3 / RUNS as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[ROUNDS / 2]
}

/// Picks in scenes of the shipped campaign.
fn traces() -> Vec<Trace> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/pick.toml");
    let env = Env::prepare(&config, &Overrides::default()).expect("the configuration is sound");
    let context = RunContext {
        clock: Clock {
            now: || "2026-01-01T00:00:00Z".to_owned(),
            secs: || 0.0,
        },
        disturb: None,
    };
    let runs = (0..).filter_map(|index| {
        let choices = Choices::random(env.campaign.seed, index);
        let run = run_line(&env, "bench", index, choices, &context).ok()?;
        run.trace.actions[0].end.was_begun().then_some(run.trace)
    });
    runs.take(RUNS.try_into().expect("a small number"))
        .collect()
}
