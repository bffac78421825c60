//! Pattern mining: speed, false alarms, and time and memory for a million outcomes.
//!
//! - `cargo bench --bench patterns`: finds planted patterns in 10,000 runs with twelve parameters
//!   and prints the time for each, counts false alarms in 100 tables with shuffled failures, then
//!   analyses 1,000,000 outcomes from the tables on disk and prints time and peak memory. Required:
//!   at most 5 alarms, under 10 s and under 1 GB on two cores.
//! - `cargo bench --bench patterns -- rows 50000`: the first part for another number of runs, as one row each.
//!   Required for 50,000: at most 0.5 s of a processor.
//! - `cargo bench --bench patterns -- tables DIR`: writes the planted tables as CSV for
//!   `patterns_peers.py`, which runs pysubgroup and SliceLine on them and compares times.

use std::path::Path;
use std::time::Instant;

use actcheck::analysis::{
    Hierarchy, Mirror, OutcomeTable, PatternInput, PatternOptions, TableFilter, Values, cascades,
    finding_columns, judged, mine, property_findings, table_failure_modes, trend,
};
use actcheck::base::Outcome;
use support::{made_up, planted};

#[path = "../tests/support"]
mod support {
    pub mod made_up;
    pub mod planted;
}

const RUNS: usize = 10_000;
const SHUFFLES: u64 = 100;
/// With five properties each.
const MANY_RUNS: u64 = 200_000;
const PROPERTIES: [&str; 5] = [
    "CloseObject",
    "MovedObject",
    "NoGraspCollisions",
    "ObjectGrasped",
    "ObjectInGripper",
];

fn main() {
    // Cargo passes `--bench`.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
        .collect();
    match arguments
        .iter()
        .map(String::as_str)
        .collect::<Vec<&str>>()
        .as_slice()
    {
        ["tables", folder] => write_tables(Path::new(folder)),
        ["rows", rows] => planted_patterns(rows.parse().expect("a number of rows")),
        _ => {
            planted_patterns(RUNS);
            false_alarms();
            many_outcomes();
        }
    }
}

fn planted_patterns(runs: usize) {
    println!("{runs} runs, 12 parameters, up to 3 conditions");
    println!(
        "{:20} {:>8} {:>8} {:>10} {:>14}  found",
        "planted", "secs", "CPU secs", "patterns", "tried"
    );
    for (name, planted) in planted::plantings() {
        let input = planted::input(runs, 1, &planted);
        let (start, before) = (Instant::now(), cpu_secs());
        let found = mine(&input, &PatternOptions::default());
        let (secs, cpu) = (start.elapsed().as_secs_f64(), cpu_secs() - before);
        let conditions: Vec<String> = found
            .confirmed()
            .map(|pattern| format!("{:?}", pattern.conditions))
            .collect();
        println!(
            "{name:20} {secs:>8.3} {cpu:>8.2} {:>10} {:>14}  {}",
            found.patterns.len(),
            found.tried,
            conditions.join(" ")
        );
    }
}

/// Processor time of this process so far, of all its threads; 0 if the system does not say it. Unit:
/// seconds.
fn cpu_secs() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let ticks = fields.split_whitespace().skip(11).take(2);
    ticks
        .filter_map(|field| field.parse::<f64>().ok())
        .sum::<f64>()
        / 100.0
}

fn false_alarms() {
    let input = planted::input(RUNS, 1, &planted::plantings().remove(5).1);
    let start = Instant::now();
    let alarms = (0..SHUFFLES)
        .filter(|seed| {
            !mine(
                &planted::shuffled(&input, *seed),
                &PatternOptions::default(),
            )
            .patterns
            .is_empty()
        })
        .count();
    println!(
        "shuffled failures: patterns in {alarms} of {SHUFFLES} ({:.1} s)",
        start.elapsed().as_secs_f64()
    );
}

fn many_outcomes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut dice = planted::Dice::new(1);
    let runs = (0..MANY_RUNS).map(|index| {
        made_up::run("k", index, &mut dice, &["Pick"], |target, _, dice| {
            let slips = target.category.ends_with("Bottle") && target.friction < 0.5;
            let of = |(at, name): (usize, &'static str)| {
                let rate = if slips && at > 2 {
                    0.6
                } else {
                    0.03 * (at + 1) as f64
                };
                (
                    name,
                    if dice.share() < rate {
                        Outcome::Failed
                    } else {
                        Outcome::Passed
                    },
                )
            };
            PROPERTIES.into_iter().enumerate().map(of).collect()
        })
    });
    let mirror = Mirror::of_runs(folder.path(), "k", runs).expect("the tables can be written");
    let bytes: u64 = std::fs::read_dir(folder.path())
        .expect("it was just written")
        .filter_map(|entry| Some(entry.ok()?.metadata().ok()?.len()))
        .sum();
    reset_most_memory();
    let start = Instant::now();
    let table = OutcomeTable::read(&mirror, &TableFilter::default(), &finding_columns())
        .expect("the tables can be read");
    let read = start.elapsed().as_secs_f64();
    let modes = table_failure_modes(&table).len();
    let cascades = cascades(&table, 0.05).len();
    let mut patterns = 0;
    for of in judged(&table) {
        let found = property_findings(&table, &of, &Hierarchy::new(), &PatternOptions::default());
        patterns += found.patterns.confirmed().count() + trend(&table, &of, 0.05).changes.len();
    }
    println!(
        "{} outcomes ({:.0} MB on disk): {:.1} s ({read:.1} s for reading), peak memory {} MB; {modes} failure modes, \
         {cascades} cascades, {patterns} patterns",
        table.len(),
        bytes as f64 / 1e6,
        start.elapsed().as_secs_f64(),
        most_memory_mb()
    );
}

/// Resets the peak memory counter; no effect if the system does not support it.
fn reset_most_memory() {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn most_memory_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    most.and_then(|text| text.split_whitespace().next()?.parse::<u64>().ok())
        .unwrap_or_default()
        / 1024
}

fn write_tables(folder: &Path) {
    std::fs::create_dir_all(folder).expect("the folder can be created");
    for (name, planted) in planted::plantings() {
        let input = planted::input(RUNS, 1, &planted);
        let start = Instant::now();
        let found = mine(&input, &PatternOptions::default());
        let secs = start.elapsed().as_secs_f64();
        println!("{name}\t{secs}\t{}", found.confirmed().count());
        let file = folder.join(format!("{}.csv", name.replace(' ', "_")));
        std::fs::write(file, text(&input)).expect("the table can be written");
    }
}

/// A CSV table with a column for each parameter and each superclass; the last column is the
/// failure.
fn text(input: &PatternInput) -> String {
    let mut columns: Vec<(String, Vec<String>)> = Vec::new();
    for parameter in &input.parameters {
        match &parameter.values {
            Values::Numbers(numbers) | Values::Angles(numbers) => {
                columns.push((
                    parameter.name.clone(),
                    numbers.iter().map(|number| format!("{number}")).collect(),
                ));
            }
            Values::Kinds {
                of_run,
                names,
                above,
            } => {
                let kind =
                    |of: &Option<u32>| of.map_or(String::new(), |of| names[of as usize].clone());
                columns.push((parameter.name.clone(), of_run.iter().map(kind).collect()));
                let mut higher: Vec<&String> = above.iter().flatten().collect();
                higher.sort();
                higher.dedup();
                for class in higher {
                    let is = |of: &Option<u32>| {
                        of.is_some_and(|of| above[of as usize].contains(class))
                            .to_string()
                    };
                    columns.push((format!("is_{class}"), of_run.iter().map(is).collect()));
                }
            }
        }
    }
    columns.push((
        "failed".to_owned(),
        input
            .failed
            .iter()
            .map(|failed| u8::from(*failed).to_string())
            .collect(),
    ));
    let header: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let rows = (0..input.len()).map(|run| {
        columns
            .iter()
            .map(|(_, values)| values[run].as_str())
            .collect::<Vec<&str>>()
            .join(",")
    });
    std::iter::once(header.join(","))
        .chain(rows)
        .map(|line| line + "\n")
        .collect()
}
