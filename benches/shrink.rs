//! Shrinking of failing runs on a crowded table: size of the result, and cost.
//!
//! Shrinks the failing runs of `configs/clutter.toml` (eight to twelve other objects) in order, at
//! most eight of each failure mode, with the noise as recorded. Goals: at least 20 runs of three
//! modes; medians of at most two other objects left and at most 60 simulations; the same set of
//! failed properties in all. `--runs N` sets the number of runs; `--pictures DIR` draws every
//! shrunk scene.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use actcheck::base::{Outcome, names};
use actcheck::campaign::shrink::{ShrinkOptions, Shrunk, shrink};
use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::{Choices, Role};
use actcheck::history::RunRecord;
use actcheck::report::{Caption, run_picture};

/// Default number of failing runs.
const RUNS: usize = 24;
/// Maximum number of runs of one failure mode.
const OF_A_MODE: usize = 8;
/// Maximum number of scenes.
const SCENES: u64 = 400;

type Signature = BTreeSet<String>;

/// Figures of a shrunk run.
struct Line {
    index: u64,
    mode: Signature,
    same: bool,
    others: (usize, usize),
    special: (usize, usize),
    simulations: u64,
    explaining: u64,
    minimal: bool,
}

fn main() {
    let wanted = argument("--runs")
        .and_then(|text| text.parse().ok())
        .unwrap_or(RUNS);
    let pictures = argument("--pictures").map(PathBuf::from);
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/clutter.toml");
    let env =
        Env::prepare(&config, &Overrides::default()).expect("the shipped configuration is sound");
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    let context = RunContext {
        clock,
        disturb: None,
    };
    let mut modes: BTreeMap<Signature, usize> = BTreeMap::new();
    let mut lines = Vec::new();
    let (mut drawn, mut discarded) = (0u64, 0u64);
    println!(
        "{:>5} {:>9} {:>9} {:>6} {:>8} {:>8} {:>5}  fails",
        "run", "others", "special", "tries", "explain", "minimal", "same"
    );
    while lines.len() < wanted && drawn < SCENES {
        let index = drawn;
        drawn += 1;
        let Ok(record) = run_line(
            &env,
            "bench",
            index,
            Choices::random(env.campaign.seed, index),
            &context,
        ) else {
            discarded += 1;
            continue;
        };
        let mode = signature(&record);
        let seen = modes.entry(mode.clone()).or_default();
        if mode.is_empty() || *seen == OF_A_MODE {
            continue;
        }
        *seen += 1;
        let line = shrunk_line(&env, &record, mode, &context, pictures.as_deref());
        print_line(&line);
        lines.push(line);
    }
    print_summary(&lines, drawn, discarded);
}

fn shrunk_line(
    env: &Env,
    record: &RunRecord,
    mode: Signature,
    context: &RunContext,
    pictures: Option<&Path>,
) -> Line {
    let stop = || false;
    let options = ShrinkOptions {
        property: None,
        trials: 200,
        jobs: 2,
        repeat: None,
        context: *context,
        stop: &stop,
    };
    let shrunk = shrink(env, record.index, &record.choices, &options, &mut |_| {})
        .expect("it has just failed");
    let again = run_line(
        env,
        "bench",
        record.index,
        Choices::recorded(&shrunk.choices),
        context,
    )
    .expect("it was made before");
    if let Some(folder) = pictures {
        draw(&again, &mode, folder);
    }
    let Shrunk {
        others_before,
        special_before,
        simulations,
        explaining,
        minimal,
        ..
    } = shrunk;
    Line {
        index: record.index,
        same: signature(&again) == mode,
        mode,
        others: (
            others_before,
            again
                .scene
                .objects
                .iter()
                .filter(|object| matches!(object.role, Role::Other | Role::Obstacle))
                .count(),
        ),
        special: (special_before, shrunk.explained.influences.len()),
        simulations,
        explaining,
        minimal,
    }
}

fn signature(record: &RunRecord) -> Signature {
    let failed = record
        .judgements
        .iter()
        .flatten()
        .filter(|judgement| judgement.outcome == Outcome::Failed);
    failed
        .map(|judgement| names::local(&judgement.property).to_owned())
        .collect()
}

fn draw(record: &RunRecord, mode: &Signature, folder: &Path) {
    let caption = Caption {
        title: format!(
            "run {} of clutter.toml, shrunk: {}",
            record.index + 1,
            words(mode)
        ),
        roles: record
            .scene
            .objects
            .iter()
            .map(|object| (object.id.clone(), object.role))
            .collect(),
        ..Caption::default()
    };
    if let Some(picture) = run_picture(&caption, &record.trace) {
        let file = folder.join(format!(
            "{:03}-{}.svg",
            record.index + 1,
            words(mode).replace(" + ", "-")
        ));
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(file, picture.to_svg()))
            .expect("a folder to write to");
    }
}

fn words(mode: &Signature) -> String {
    mode.iter()
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(" + ")
}

fn print_line(line: &Line) {
    println!(
        "{:>5} {:>9} {:>9} {:>6} {:>8} {:>8} {:>5}  {}",
        line.index + 1,
        format!("{} → {}", line.others.0, line.others.1),
        format!("{} → {}", line.special.0, line.special.1),
        line.simulations,
        line.explaining,
        if line.minimal { "yes" } else { "no" },
        if line.same { "yes" } else { "NO" },
        words(&line.mode)
    );
}

fn print_summary(lines: &[Line], drawn: u64, discarded: u64) {
    let modes: BTreeSet<&Signature> = lines.iter().map(|line| &line.mode).collect();
    let same = lines.iter().filter(|line| line.same).count();
    println!(
        "{} failing runs of {} modes; {discarded} of {drawn} scenes discarded (at most 30 %)",
        lines.len(),
        modes.len()
    );
    println!("same failed properties in {same} of {}", lines.len());
    println!(
        "other objects left, median: {} (at most 2)",
        median(lines, |line| line.others.1 as u64)
    );
    println!(
        "choices not nominal, median: {}, before {}",
        median(lines, |line| line.special.1 as u64),
        median(lines, |line| line.special.0 as u64)
    );
    println!(
        "simulations to shrink, median: {} (at most 60)",
        median(lines, |line| line.simulations)
    );
    println!(
        "simulations with the explanation, median: {}",
        median(lines, |line| line.simulations + line.explaining)
    );
}

/// The median; the upper one of two middle values.
fn median(lines: &[Line], of: impl Fn(&Line) -> u64) -> u64 {
    let mut values: Vec<u64> = lines.iter().map(of).collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or(0)
}

fn argument(name: &str) -> Option<String> {
    std::env::args()
        .skip_while(|argument| argument != name)
        .nth(1)
}
