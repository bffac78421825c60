//! Cost of `recheck`: one new property over 5,000 stored pick runs, compared with simulating them.
//!
//! A few dozen runs are simulated and stored many times under new ids, so that their states are real.
//! Wanted: at least 4,000 runs/s on two cores, end to end (preparing the rules, finding the runs,
//! states, facts, rules, writing), and two workers 1.9 times as fast as one.

use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use actcheck::base::Files;
use actcheck::campaign::{
    Clock, Ending, Env, RecheckOptions, RuleSet, RunContext, recheck, run_line, side_by_side,
};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::{CampaignEnd, History, RunFilter, RunRow};

const SIMULATED: u64 = 40;
const STORED: u64 = 5_000;
const ROUNDS: usize = 5;

const RULE: &str = "
@prefix act: <http://actions#> .
@prefix w: <https://w3id.org/actcheck/world#> .
success(?o) :- parameter(act:pickObject, ?o), during(?o, w:maxTilt, ?tilt), ?tilt < 0.5 .
margin(?m)  :- parameter(act:pickObject, ?o), during(?o, w:maxTilt, ?tilt), ?m = 0.5 - ?tilt .
";
const ENTRY: &str = "
act:StaysUpright a act:Property ; rdfs:label \"stays upright\" ; act:unit \"rad\" ;
    act:needsParameter act:pickObject ; act:verifiedBy <../rules/stays_upright.rls> .
act:Pick act:successProperty act:StaysUpright .
";

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let simulated_per_sec = fill(&folder.path().join("history"));
    let history =
        History::open_existing(&folder.path().join("history")).expect("it was just written");
    let ontology = with_new_property(folder.path());
    let jobs = std::thread::available_parallelism().map_or(1, NonZero::get);
    println!(
        "{STORED} stored pick runs, {jobs} cores; simulation makes {simulated_per_sec:.1} runs/s on one core"
    );
    println!(
        "{:44} {:>8} {:>8} {:>8} {:>22}",
        "", "workers", "runs/s", "written", "times as fast as simulating"
    );
    let judge = |what: &str, jobs: usize, properties: &[String]| {
        history.use_threads(jobs);
        let start = Instant::now();
        // As `actcheck recheck` does.
        let prepare =
            || RuleSet::prepare(&Files::Disk, &ontology).and_then(|rules| rules.only(properties));
        let (rules, runs) = side_by_side(jobs, prepare, || history.runs(&RunFilter::default()))
            .expect("workers can be started");
        let rules = rules.expect("the shipped rules are sound");
        let written = judge_all(&history, &runs.expect("a whole history"), &rules, jobs);
        let rate = STORED as f64 / start.elapsed().as_secs_f64();
        println!(
            "{what:44} {jobs:8} {rate:8.0} {written:8} {:22.0}",
            rate / simulated_per_sec / jobs as f64
        );
        rate
    };
    judge("one new property", jobs, &["StaysUpright".to_owned()]);
    for (what, properties) in [
        (
            "one property again: nothing changes",
            vec!["StaysUpright".to_owned()],
        ),
        ("all six properties: nothing changes", vec![]),
    ] {
        let several: Vec<f64> = (0..ROUNDS)
            .flat_map(|_| [1, jobs].map(|jobs| judge(what, jobs, &properties)))
            .collect();
        println!(
            "{what}: {jobs} workers are {:.2} times as fast as one",
            median(&several, 1) / median(&several, 0)
        );
    }
}

/// The median of every second rate, from the given one on.
fn median(rates: &[f64], first: usize) -> f64 {
    let mut rates: Vec<f64> = rates.iter().skip(first).step_by(2).copied().collect();
    rates.sort_by(f64::total_cmp);
    rates[rates.len() / 2]
}

/// Simulates some runs and stores them many times. Returns the simulated runs per second on one
/// core.
fn fill(dir: &Path) -> f64 {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/pick.toml");
    let overrides = Overrides {
        history: Some(dir.to_owned()),
        runs: STORED.try_into().ok(),
        ..Overrides::default()
    };
    let env = Env::prepare(&config, &overrides).expect("the shipped configuration is sound");
    let context = RunContext {
        clock: Clock {
            now: || "2026-01-01T00:00:00Z".to_owned(),
            secs: || 0.0,
        },
        disturb: None,
    };
    let start = Instant::now();
    let records: Vec<_> = (0..SIMULATED)
        .filter_map(|index| {
            run_line(
                &env,
                "bench",
                index,
                Choices::random(env.campaign.seed, index),
                &context,
            )
            .ok()
        })
        .collect();
    let per_sec = records.len() as f64 / start.elapsed().as_secs_f64();
    let history = History::open(dir).expect("a fresh history");
    history
        .begin_campaign(&env.record("bench".into(), "bench".into(), (context.clock.now)()))
        .expect("room on the disk");
    for (index, record) in (0..STORED).zip(records.iter().cycle()) {
        let mut record = record.clone();
        record.id = format!("bench-{}", index + 1);
        record.index = index;
        history.commit(&record).expect("room on the disk");
    }
    let end = CampaignEnd {
        ended: (context.clock.now)(),
        ..CampaignEnd::default()
    };
    history
        .finish_campaign("bench", &end)
        .expect("room on the disk");
    per_sec
}

/// Copies the shipped ontology and rules and adds one property.
fn with_new_property(folder: &Path) -> std::path::PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (from, to) in [
        ("ontology", "ontology"),
        ("rules", "rules"),
        ("rules/lib", "rules/lib"),
    ] {
        std::fs::create_dir_all(folder.join(to)).expect("room on the disk");
        for path in Files::Disk.list(&root.join(from)) {
            let name = path.file_name().expect("a file has a name");
            std::fs::copy(&path, folder.join(to).join(name)).expect("room on the disk");
        }
    }
    let ontology = folder.join("ontology/actions.ttl");
    let text = std::fs::read_to_string(&ontology).expect("it was just copied");
    std::fs::write(&ontology, text + ENTRY).expect("room on the disk");
    std::fs::write(folder.join("rules/stays_upright.rls"), RULE).expect("room on the disk");
    ontology
}

/// Judges all runs. Returns the number of changed judgements.
fn judge_all(history: &History, runs: &[RunRow], rules: &RuleSet, jobs: usize) -> usize {
    let options = RecheckOptions {
        jobs,
        batch: RecheckOptions::BATCH,
        at: "2026-01-02T00:00:00Z".to_owned(),
    };
    let mut written = 0;
    let end = recheck(
        history,
        runs,
        |_| rules,
        &options,
        &AtomicBool::new(false),
        |_, batch| {
            written += batch.iter().filter(|recheck| recheck.is_news()).count();
        },
    );
    assert!(
        matches!(end.ending, Ending::Finished) && end.judged == STORED,
        "{end:?}"
    );
    written
}
