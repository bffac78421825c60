//! Histories of many runs: size, and the time and memory of each command.
//!
//! `cargo bench --bench scale -- [RUNS]…` (default: 1000 10000 100000): real runs of a small
//! configuration, multiplied by a generator that changes scenes, margins and outcomes, and kept as
//! outcomes. Each command runs in a process of its own. Required for a million runs: at most 10 kB
//! a run, and 10 s and 2 GB for each command that reads.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use actcheck::analysis::Mirror;
use actcheck::base::{Digest, Outcome, Shard};
use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::{CampaignEnd, History, RunRecord};

/// Number of simulated runs.
const SIMULATED: u64 = 64;
/// Required at a million runs.
const MOST_BYTES: f64 = 10_000.0;
/// Size of a shard, unless there would be too many.
const RUNS_IN_A_SHARD: u64 = 1_000;
const MOST_SHARDS: u64 = 1_000;
/// Number of runs that are stored together.
const RUNS_IN_A_BATCH: usize = 128;
/// Number of shards that are made at the same time.
const THREADS: usize = 2;

fn main() {
    let numbers = || std::env::args().filter_map(|arg| arg.parse::<u64>().ok());
    let sizes: Vec<u64> = if numbers().next().is_some() {
        numbers().collect()
    } else {
        vec![1_000, 10_000, 100_000]
    };
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/pick.toml");
    let env = Env::prepare(&config, &Overrides::default()).expect("it is shipped");
    let made: Vec<RunRecord> = (0..SIMULATED)
        .filter_map(|index| simulated(&env, index))
        .collect();
    println!("{} simulated runs, multiplied", made.len());
    for size in sizes {
        let folder = match std::env::var_os("ACTCHECK_SCALE") {
            Some(folder) => PathBuf::from(folder).join(size.to_string()),
            None => tempfile::tempdir().expect("a temporary folder").keep(),
        };
        measure(&env, &made, size, &folder);
    }
}

/// Makes a history in shards, merges them, and prints the size, time and memory of each command.
fn measure(env: &Env, made: &[RunRecord], size: u64, folder: &Path) {
    let count = (size / RUNS_IN_A_SHARD).clamp(1, MOST_SHARDS);
    println!("\n{size} runs in {}", folder.display());
    let shards = folder.with_extension("shards");
    let start = Instant::now();
    let complete = multiplied(env, made, size, count, &shards);
    println!(
        "{:40} {:8.1} s",
        format!("generating {complete} of {count} shards"),
        start.elapsed().as_secs_f64()
    );
    if !folder.join("VERSION").exists() {
        let names: Vec<String> = (1..=count)
            .map(|number| shards.join(number.to_string()).display().to_string())
            .collect();
        let into = folder.display().to_string();
        let args: Vec<&str> = ["merge"]
            .into_iter()
            .chain(names.iter().map(String::as_str))
            .chain(["--into", into.as_str()])
            .collect();
        print_timed(&format!("merge of {count} shards"), timed(&args));
    }
    let bytes = size_of(folder);
    let share = bytes / size as f64 / MOST_BYTES;
    println!(
        "{:40} {:8.0} MB {:8.0} bytes a run, {share:.2} of the limit",
        "size",
        bytes / 1e6,
        bytes / size as f64
    );
    let report = folder.with_extension("html").display().to_string();
    let commands: [(&str, &[&str]); 14] = [
        ("list", &["list", "--format", "csv"]),
        ("list, as text", &["list"]),
        ("list --failed", &["list", "--failed", "--format", "csv"]),
        ("show", &["show", "@last"]),
        ("analyse", &["analyse"]),
        ("analyse, again", &["analyse"]),
        ("compare", &["compare", "aaaa", "aaab"]),
        ("health", &["health", "aaaa"]),
        (
            "query --named failure-rates",
            &["query", "--named", "failure-rates"],
        ),
        (
            "query --named campaigns",
            &["query", "--named", "campaigns"],
        ),
        (
            "query --named closest-calls",
            &["query", "--named", "closest-calls"],
        ),
        (
            "query --named targets-of-failures",
            &["query", "--named", "targets-of-failures"],
        ),
        (
            "query --named wrong-reports",
            &["query", "--named", "wrong-reports"],
        ),
        ("report", &["report", "--html", &report]),
    ];
    let history = folder.display().to_string();
    for (name, args) in commands {
        let args: Vec<&str> = args
            .iter()
            .copied()
            .chain(["--history", history.as_str()])
            .collect();
        print_timed(name, timed(&args));
    }
}

fn print_timed(name: &str, (secs, megabytes, code): (f64, f64, i32)) {
    println!("{name:40} {secs:8.1} s  {megabytes:8.0} MB   exit code {code}");
}

fn simulated(env: &Env, index: u64) -> Option<RunRecord> {
    let clock = Clock {
        now: || "2026-01-01T00:00:00.000Z".to_owned(),
        secs: || 0.0,
    };
    let mut run = run_line(
        env,
        "aaaa",
        index,
        Choices::random(7, index),
        &RunContext {
            clock,
            disturb: None,
        },
    )
    .ok()?;
    // Outcomes are kept without motion.
    run.trace.frames.rows.clear();
    for course in &mut run.trace.robot_courses {
        (course.motion, course.samples) = Default::default();
    }
    Some(run)
}

/// Shards of two campaigns with the same scenes; in the second, runs fail more often. Complete
/// shards are kept. Returns their number.
fn multiplied(env: &Env, made: &[RunRecord], size: u64, count: u64, shards: &Path) -> u64 {
    let next = AtomicU64::new(1);
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                loop {
                    let Some(shard) = Shard::new(next.fetch_add(1, Ordering::Relaxed), count)
                    else {
                        return;
                    };
                    let folder = shards.join(shard.number().to_string());
                    if !folder.with_extension("done").exists() {
                        // Of a process that was killed.
                        let _ = std::fs::remove_dir_all(&folder);
                        make_shard(env, made, size, shard, &folder);
                        std::fs::write(folder.with_extension("done"), "")
                            .expect("the disk has room");
                    }
                }
            });
        }
    });
    count
}

fn make_shard(env: &Env, made: &[RunRecord], size: u64, shard: Shard, folder: &Path) {
    let history = History::open(folder).expect("the folder is new");
    for (campaign, seed, rate) in [("aaaa", 1, 0.10), ("aaab", 2, 0.12)] {
        let mut record = env.record(
            campaign.to_owned(),
            "pick".to_owned(),
            "2026-01-01T00:00:00.000Z".to_owned(),
        );
        (record.planned_runs, record.seed, record.shards) = (size / 2, seed, vec![shard]);
        history.begin_campaign(&record).expect("the disk has room");
        let indices: Vec<u64> = (0..size / 2).filter(|index| shard.has(*index)).collect();
        for indices in indices.chunks(RUNS_IN_A_BATCH) {
            let changed =
                |index: &u64| changed(&made[*index as usize % made.len()], campaign, *index, rate);
            let runs: Vec<RunRecord> = indices.iter().map(changed).collect();
            runs.iter()
                .for_each(|run| history.commit_outcomes(run).expect("the disk has room"));
        }
        let end = CampaignEnd {
            ended: "2026-01-02T00:00:00.000Z".to_owned(),
            ..CampaignEnd::default()
        };
        history
            .finish_campaign(campaign, &end)
            .expect("the disk has room");
    }
    // As the task of a launch does.
    Mirror::update(&history).expect("the disk has room");
}

/// A run with another number, scene and outcome.
fn changed(run: &RunRecord, campaign: &str, index: u64, rate: f64) -> RunRecord {
    let mut run = run.clone();
    (run.id, run.campaign, run.index) = (
        format!("{campaign}-{}", index + 1),
        campaign.to_owned(),
        index,
    );
    let mut digest = Digest::new();
    digest.update(&index.to_le_bytes());
    digest.update(campaign.as_bytes());
    run.trace.hash = digest.finish();
    let mut dice = Dice(index + 1);
    for choice in &mut run.choices {
        choice.value += 1e-3 * dice.next();
    }
    for object in &mut run.scene.objects {
        object.pose.position[0] += 0.1 * (dice.next() - 0.5);
        object.pose.position[1] += 0.1 * (dice.next() - 0.5);
        object.friction *= 0.5 + dice.next();
        object.mass_kg *= 0.5 + dice.next();
    }
    let slips = run
        .scene
        .objects
        .iter()
        .any(|object| object.model == "glass" && object.friction < 0.3);
    let mut other = Dice(digest_of(campaign, index));
    for judgement in run.judgements.iter_mut().flatten() {
        let rate = if slips { 3.0 * rate } else { rate };
        judgement.outcome = if other.next() < rate {
            Outcome::Failed
        } else {
            Outcome::Passed
        };
        judgement.margin = judgement.margin.map(|_| {
            if judgement.outcome == Outcome::Failed {
                -other.next()
            } else {
                other.next()
            }
        });
    }
    run
}

fn digest_of(campaign: &str, index: u64) -> u64 {
    campaign
        .bytes()
        .fold(index.wrapping_mul(0x9e37_79b9_7f4a_7c15), |sum, byte| {
            sum.wrapping_mul(31) + u64::from(byte)
        })
}

/// Numbers from 0 to 1 (xorshift).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(0x9e37_79b9_7f4a_7c15)
            .wrapping_add(0x1234_5678_9abc_def1);
        let mixed = (self.0 ^ (self.0 >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (mixed >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn size_of(folder: &Path) -> f64 {
    let entries = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(Result::ok);
    entries
        .map(|entry| {
            let path = entry.path();
            if path.is_dir() {
                size_of(&path)
            } else {
                entry.metadata().map_or(0.0, |found| found.len() as f64)
            }
        })
        .sum()
}

/// Wall time, the largest memory, and the exit code of a command. Units: seconds, megabytes.
fn timed(args: &[&str]) -> (f64, f64, i32) {
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(args)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it is built");
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0.0_f64;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:"))
            .unwrap_or_default();
        let kilobytes: f64 = line.trim().trim_end_matches(" kB").parse().unwrap_or(0.0);
        most = most.max(kilobytes / 1e3);
        if let Some(ended) = child.try_wait().expect("it runs") {
            return (
                start.elapsed().as_secs_f64(),
                most,
                ended.code().unwrap_or(-1),
            );
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
