//! Runs until a guided search finds the most common failure modes of a real pick, compared with
//! random scenes.
//!
//! A failure mode is the set of properties that fail together. Random scenes are run first; their
//! three most common modes are the goals. Random scenes are independent, so every gap between two
//! finds is a sample of the time to the first find. A guided search is repeated with many seeds,
//! and ends once it has found all three modes. The benchmark prints the median number of the first
//! run with a mode, interpolated as for grouped data, and its ratio to that of random scenes with a
//! bootstrap confidence interval.
//!
//! The defaults are `configs/pick.toml`, 2,000 random scenes, 200 searches of at most 60 runs, and
//! all guided strategies. With `--only FILE.rls`, the rules in this file are the only property, and
//! its violation the only mode: `--only benches/near_another.rls` plants a rare violation of a
//! formula about time. To change them: `cargo bench --bench search_pick -- --config
//! benches/quiet_pick.toml --random 500 --seeds 40 --runs 120 --strategies bandit,boundary
//! --first-seed 7001`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use actcheck::base::{Outcome, names};
use actcheck::campaign::{
    Clock, Env, Failure, Planned, RunContext, RunResult, run_line, schedule_of,
};
use actcheck::config::Overrides;
use actcheck::search::Strategy;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Number of failure modes to find.
const MODES: usize = 3;

/// Bootstrap samples for a 95 % interval.
const RESAMPLED: usize = 2_000;

type Signature = BTreeSet<String>;

/// Results of the runs of one seed, by scene number and the bits of the steered quantiles, which
/// determine the run.
type Known = BTreeMap<(u64, Vec<u64>), RunResult>;

fn argument(name: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.next().and_then(|_| arguments.next())
}

fn number(name: &str, default: u32) -> u32 {
    argument(name)
        .and_then(|text| text.parse().ok())
        .unwrap_or(default)
}

fn signature(result: &RunResult) -> Signature {
    let failed = result
        .outcomes
        .iter()
        .filter(|outcome| outcome.outcome == Outcome::Failed);
    failed
        .map(|outcome| names::local(&outcome.property).to_owned())
        .collect()
}

fn make(env: &Env, planned: &Planned) -> RunResult {
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    let context = RunContext {
        clock,
        disturb: None,
    };
    for attempt in 0.. {
        match run_line(
            env,
            "k",
            planned.index,
            planned.choices(env.campaign.seed, attempt),
            &context,
        ) {
            Ok(record) => {
                return RunResult {
                    discards: attempt,
                    ..RunResult::of(&record)
                };
            }
            Err(Failure::Discard(_)) => {}
            Err(failure) => panic!("the benchmark is never interrupted: {failure}"),
        }
    }
    unreachable!("the shipped scenes can be built")
}

/// The signatures of a campaign's runs, in order, until `enough` returns `true`.
fn campaign(
    config: &Path,
    (seed, runs): (u64, u32),
    strategy: Strategy,
    known: &mut Known,
    enough: impl Fn(&[Signature]) -> bool,
) -> Vec<Signature> {
    let overrides = Overrides {
        runs: Some(runs),
        seed: Some(seed),
        search: Some(strategy),
        history: Some(PathBuf::from("none")),
        ..Overrides::default()
    };
    let env = Env::prepare(config, &overrides).expect("the configuration is sound");
    let mut schedule = schedule_of(&env);
    let (mut signatures, mut results): (Vec<Signature>, Vec<RunResult>) = (Vec::new(), Vec::new());
    loop {
        let batch = schedule.next_batch(&results);
        if batch.is_empty() {
            return signatures;
        }
        results.clear();
        for planned in &batch {
            let steered = planned
                .steering
                .iter()
                .flat_map(|steering| steering.quantiles.values());
            let key = (
                planned.scene,
                steered.map(|value| value.to_bits()).collect(),
            );
            let run = known
                .entry(key)
                .or_insert_with(|| make(&env, planned))
                .clone();
            signatures.push(signature(&run));
            results.push(run);
            if enough(&signatures) {
                return signatures;
            }
        }
    }
}

/// The most common failure modes, with their numbers of runs.
fn commonest(runs: &[Signature]) -> Vec<(Signature, usize)> {
    let mut counts: BTreeMap<&Signature, usize> = BTreeMap::new();
    for failed in runs.iter().filter(|failed| !failed.is_empty()) {
        *counts.entry(failed).or_default() += 1;
    }
    let mut modes: Vec<(Signature, usize)> = counts
        .into_iter()
        .map(|(mode, count)| (mode.clone(), count))
        .collect();
    modes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    modes.truncate(MODES);
    modes
}

/// The number of runs from each find to the next.
fn waits(runs: &[Signature], mode: &Signature) -> Vec<usize> {
    let finds = runs
        .iter()
        .enumerate()
        .filter(|(_, failed)| *failed == mode)
        .map(|(at, _)| at + 1);
    finds
        .scan(0, |last, at| Some(at - std::mem::replace(last, at)))
        .collect()
}

/// The median of grouped data: interpolated within the middle value, because many of the small
/// numbers are equal.
fn median(values: &[usize]) -> f64 {
    let mut values = values.to_vec();
    values.sort_unstable();
    let half = values.len() as f64 / 2.0;
    let middle = values[values.len() / 2];
    let below = values.partition_point(|value| *value < middle);
    let equal = values.partition_point(|value| *value <= middle) - below;
    middle as f64 - 1.0 + (half - below as f64) / equal as f64
}

/// The ratio of two medians with its 95 % bootstrap interval.
fn ratio(guided: &[usize], random: &[usize]) -> [f64; 3] {
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    let mut again = |values: &[usize]| {
        let drawn: Vec<usize> = values
            .iter()
            .map(|_| values[generator.next_u64() as usize % values.len()])
            .collect();
        median(&drawn)
    };
    let mut ratios: Vec<f64> = (0..RESAMPLED)
        .map(|_| again(guided) / again(random))
        .collect();
    ratios.sort_by(f64::total_cmp);
    [
        median(guided) / median(random),
        ratios[RESAMPLED / 40],
        ratios[RESAMPLED - 1 - RESAMPLED / 40],
    ]
}

/// Copies the files of a campaign into a folder, where the rules of a file become the only property
/// of a pick. Returns the configuration there.
fn with_only(folder: &Path, config: &Path, rules: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["ontology", "rules", "models", "configs"] {
        copy(&root.join(name), &folder.join(name));
    }
    let text = std::fs::read_to_string(root.join(rules)).expect("the file of rules is readable");
    std::fs::write(folder.join("rules/only.rls"), text).expect("room on the disk");
    let ontology = folder.join("ontology/actions.ttl");
    let text = std::fs::read_to_string(&ontology).expect("it was just copied");
    let (before, rest) = text
        .split_once("act:Pick a act:Action")
        .expect("the shipped ontology has a pick");
    let (pick, after) = rest
        .split_once("act:successProperty")
        .expect("a pick has success properties");
    let (_, after) = after.split_once(" .\n").expect("the statement ends");
    let only = "act:Only a act:Property ; rdfs:label \"the only property\" ; act:verifiedBy <../rules/only.rls> .\n";
    let text =
        format!("{before}act:Pick a act:Action{pick}act:successProperty act:Only .\n{only}{after}");
    std::fs::write(&ontology, text).expect("room on the disk");
    let copied = folder.join("configs/only.toml");
    std::fs::copy(config, &copied).expect("room on the disk");
    copied
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("room on the disk");
    for entry in std::fs::read_dir(from)
        .expect("the folder is readable")
        .flatten()
    {
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).expect("room on the disk");
        }
    }
}

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut config =
        root.join(argument("--config").unwrap_or_else(|| "configs/pick.toml".to_owned()));
    let folder = tempfile::tempdir().expect("a temporary folder");
    if let Some(rules) = argument("--only") {
        config = with_only(folder.path(), &config, &rules);
    }
    let (seeds, runs, scenes) = (
        u64::from(number("--seeds", 200)),
        number("--runs", 60),
        number("--random", 2_000),
    );
    let named =
        argument("--strategies").unwrap_or_else(|| "cross-entropy,bandit,boundary".to_owned());
    let guided: Vec<Strategy> = named
        .split(',')
        .map(|name| Strategy::by_name(name).expect("the name of a strategy"))
        .collect();
    let first = u64::from(number("--first-seed", 1));
    // Seeds beyond those of the searches, with a campaign for each, so that they can run in
    // parallel.
    let part = |at: u64| {
        campaign(
            &config,
            (first + seeds + at, 50),
            Strategy::Random,
            &mut Known::new(),
            |_| false,
        )
    };
    let parts: Vec<Vec<Signature>> = (0..u64::from(scenes.div_ceil(50)))
        .into_par_iter()
        .map(part)
        .collect();
    let random = parts.concat();
    let modes = commonest(&random);
    println!(
        "{}: {} random scenes, {seeds} searches of at most {runs} runs",
        config.display(),
        random.len()
    );
    println!("strategy       finds  share of runs  median first  ratio [95 %]         mode");
    for (mode, count) in &modes {
        let share = 100.0 * *count as f64 / random.len() as f64;
        line(
            ("random", *count),
            share,
            &waits(&random, mode),
            [1.0; 3],
            mode,
        );
    }
    let all = |found: &[Signature]| modes.iter().all(|(mode, _)| found.contains(mode));
    let search = |seed: u64| {
        let mut known = Known::new();
        let one = |strategy: &Strategy| campaign(&config, (seed, runs), *strategy, &mut known, all);
        guided.iter().map(one).collect::<Vec<_>>()
    };
    let searches: Vec<Vec<Vec<Signature>>> =
        (first..first + seeds).into_par_iter().map(search).collect();
    for (at, strategy) in guided.iter().enumerate() {
        for (mode, _) in &modes {
            let of =
                |search: &Vec<Vec<Signature>>| search[at].iter().position(|failed| failed == mode);
            let found = searches
                .iter()
                .filter(|search| of(search).is_some())
                .count();
            // A search that never found the mode counts as one run more than its maximum.
            let firsts: Vec<usize> = searches
                .iter()
                .map(|search| of(search).unwrap_or(runs as usize) + 1)
                .collect();
            let made: usize = searches.iter().map(|search| search[at].len()).sum();
            let seen: usize = searches
                .iter()
                .map(|search| search[at].iter().filter(|failed| *failed == mode).count())
                .sum();
            let ratio = ratio(&firsts, &waits(&random, mode));
            line(
                (strategy.name(), found),
                100.0 * seen as f64 / made as f64,
                &firsts,
                ratio,
                mode,
            );
        }
    }
}

fn line(
    (strategy, finds): (&str, usize),
    share: f64,
    firsts: &[usize],
    [ratio, low, high]: [f64; 3],
    mode: &Signature,
) {
    let mode = mode
        .iter()
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(" + ");
    let first = median(firsts);
    println!(
        "{strategy:<14} {finds:>5} {share:>12.1} % {first:>13.1}  {ratio:.2} [{low:.2}, {high:.2}]  {mode}"
    );
}
