//! Single runs of small configurations, from scenes to verdicts.

use std::collections::BTreeMap;

use actcheck::base::{Outcome, names};
use actcheck::campaign::{Clock, Disturbance, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::{ActionReport, Choices};
use actcheck::history::RunRecord;

/// Prepares a configuration that is written to a temporary folder.
pub fn env_of(text: &str) -> Env {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("config.toml");
    std::fs::write(&config, text).unwrap();
    Env::prepare(&config, &Overrides::default()).unwrap_or_else(|faults| panic!("{faults}"))
}

/// The run with the given choices.
pub fn run(env: &Env, choices: Choices, disturb: Option<Disturbance>) -> RunRecord {
    let clock = Clock {
        now: String::new,
        secs: || 0.0,
    };
    run_line(env, "test", 0, choices, &RunContext { clock, disturb }).unwrap()
}

/// The nominal scene with noiseless sensors.
pub fn nominal(env: &Env, disturb: Option<Disturbance>) -> RunRecord {
    run(env, Choices::recorded(&[]), disturb)
}

/// The report of an action.
pub fn report(run: &RunRecord, step: usize) -> &ActionReport {
    run.trace.actions[step]
        .report
        .as_ref()
        .expect("the action ended with a report")
}

/// The outcomes of an action, by property name.
pub fn outcomes(run: &RunRecord, step: usize) -> BTreeMap<&str, Outcome> {
    run.judgements[step]
        .iter()
        .map(|judgement| (names::local(&judgement.property), judgement.outcome))
        .collect()
}
