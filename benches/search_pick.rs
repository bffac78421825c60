//! In how many runs does a guided search find the commonest failure modes of a real pick, against random scenes?
//!
//! A failure mode is the set of properties that fail together. Each seed makes the same number of runs by each strategy;
//! the three commonest modes of all random runs are looked for, and the median over seeds of the first run that shows each
//! is printed, with its share among all runs. Runs that strategies share (guided ones begin alike) are made once.
//!
//! `cargo bench --bench search_pick` takes `configs/pick.toml`, 12 seeds, 40 runs, and all guided strategies;
//! `-- --config benches/quiet_pick.toml --seeds 10 --runs 120 --strategies bandit,boundary` says otherwise.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use actcheck::base::names;
use actcheck::campaign::{Clock, Env, Failure, Manner, Planned, Told, run_line, schedule_of};
use actcheck::config::Overrides;
use actcheck::search::Strategy;
use actcheck::verdict::Outcome;

/// Failure modes that are looked for.
const MODES: usize = 3;

type Signature = BTreeSet<String>;

/// What a run came to, by what decides it: seed, scene, and the bits of what a search steered.
type Known = BTreeMap<(u64, u64, Vec<u64>), Told>;

fn argument(name: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.next().and_then(|_| arguments.next())
}

fn number(name: &str, default: u32) -> u32 {
    argument(name).and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn signature(told: &Told) -> Signature {
    let failed = told.outcomes.iter().filter(|outcome| outcome.outcome == Outcome::Failed);
    failed.map(|outcome| names::local(&outcome.property).to_owned()).collect()
}

fn make(env: &Env, planned: &Planned) -> Told {
    let clock = Clock { now: || "2026-01-01T00:00:00Z".to_owned(), secs: || 0.0 };
    let manner = Manner { clock, disturb: None };
    for attempt in 0.. {
        match run_line(env, "k", planned.index, planned.choices(env.campaign.seed, attempt), &manner) {
            Ok(record) => return Told { discards: attempt, ..Told::of(&record) },
            Err(Failure::Discard(_)) => {}
            Err(failure) => panic!("nobody stops this benchmark: {failure}"),
        }
    }
    unreachable!("the shipped scenes can be built")
}

/// The signatures of a campaign's runs, in order.
fn campaign(config: &Path, (seed, runs): (u64, u32), strategy: Strategy, known: &mut Known) -> Vec<Signature> {
    let overrides = Overrides {
        runs: Some(runs),
        seed: Some(seed),
        search: Some(strategy),
        history: Some(PathBuf::from("none")),
        ..Overrides::default()
    };
    let env = Env::prepare(config, &overrides).expect("the configuration is sound");
    let mut schedule = schedule_of(&env);
    let (mut signatures, mut told): (Vec<Signature>, Vec<Told>) = (Vec::new(), Vec::new());
    loop {
        let batch = schedule.next_batch(&told);
        if batch.is_empty() {
            return signatures;
        }
        let one = |planned: &Planned| {
            let steered = planned.steering.iter().flat_map(|steering| steering.quantiles.values());
            let key = (seed, planned.scene, steered.map(|value| value.to_bits()).collect());
            known.entry(key).or_insert_with(|| make(&env, planned)).clone()
        };
        told = batch.iter().map(one).collect();
        signatures.extend(told.iter().map(signature));
    }
}

fn median(mut values: Vec<usize>) -> f64 {
    values.sort_unstable();
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] as f64 } else { (values[middle - 1] + values[middle]) as f64 / 2.0 }
}

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = root.join(argument("--config").unwrap_or_else(|| "configs/pick.toml".to_owned()));
    let (seeds, runs) = (u64::from(number("--seeds", 12)), number("--runs", 40));
    let named = argument("--strategies").unwrap_or_else(|| "cross-entropy,bandit,boundary".to_owned());
    let guided = named.split(',').map(|name| Strategy::by_name(name).expect("the name of a strategy"));
    let mut known = Known::new();
    let mut found: Vec<(Strategy, Vec<Vec<Signature>>)> = Vec::new();
    for strategy in std::iter::once(Strategy::Random).chain(guided) {
        let campaigns = (1..=seeds).map(|seed| campaign(&config, (seed, runs), strategy, &mut known));
        found.push((strategy, campaigns.collect()));
        eprintln!("{} done", strategy.name());
    }
    let mut counts: BTreeMap<&Signature, usize> = BTreeMap::new();
    for failed in found[0].1.iter().flatten().filter(|failed| !failed.is_empty()) {
        *counts.entry(failed).or_default() += 1;
    }
    let mut modes: Vec<(&Signature, usize)> = counts.into_iter().collect();
    modes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    println!("{}: {seeds} seeds of {runs} runs; not found counts as one run more", config.display());
    println!("strategy          share of runs  median first  ratio  mode");
    for (mode, _) in modes.iter().take(MODES) {
        let mut random = None;
        for (strategy, campaigns) in &found {
            let firsts = campaigns.iter().map(|campaign| campaign.iter().position(|failed| failed == *mode));
            let firsts: Vec<usize> = firsts.map(|first| first.map_or(runs as usize, |first| first) + 1).collect();
            let seen = campaigns.iter().flatten().filter(|failed| failed == mode).count();
            let first = median(firsts);
            let random = *random.get_or_insert(first);
            println!(
                "{:<16} {:>13.1} % {first:>13.1} {:>6.2}  {}",
                strategy.name(),
                100.0 * seen as f64 / (seeds * u64::from(runs)) as f64,
                first / random,
                mode.iter().map(String::as_str).collect::<Vec<_>>().join(" + ")
            );
        }
    }
}
