//! The report of 10,000 runs: size, rendering time, and speed in a browser.
//!
//! `cargo bench --bench report`: synthetic outcomes of five properties in tables on disk, replays
//! of real runs that are simulated first, and Debian's headless Chromium. Required: under 10 MB,
//! rendered from the tables in under 5 s, first paint under 1 s, filter response under 100 ms.
//! Every line prints its share of the limit.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use actcheck::base::Outcome;
use actcheck::data::Trace;
use actcheck::history::{History, RunDetail};
use actcheck::report::Replays;
use support::chromium::Chromium;
use support::{made_up, paged, planted};

#[path = "../tests/support"]
mod support {
    #[expect(dead_code, reason = "tests ask the browser for more")]
    pub mod chromium;
    pub mod made_up;
    pub mod paged;
    #[expect(dead_code, reason = "only its random numbers are needed")]
    pub mod planted;
}

const RUNS: u64 = 10_000;
const PROPERTIES: [&str; 5] = [
    "CloseObject",
    "MovedObject",
    "NoGraspCollisions",
    "ObjectGrasped",
    "ObjectInGripper",
];
/// Maximum size of replays, the default of `actcheck report`. Unit: bytes.
const ROOM: usize = 5_000_000;
/// Repetitions of each filter; the median is printed.
const TIMES: usize = 5;
/// Number of simulated runs, which are replayed under many ids.
const WATCHED: &str = "12";

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let watched = simulated(folder.path());
    let mirror = paged::mirror(&folder.path().join("tables"), "k", made_up_runs());
    let start = Instant::now();
    let (replays, embedded) = replays(&watched);
    let packed = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let page = paged::page(&mirror, "made up", &BTreeMap::new(), &replays);
    let secs = start.elapsed().as_secs_f64();
    let file = folder.path().join("report.html");
    std::fs::write(&file, &page).expect("the folder is there");
    println!(
        "{RUNS} runs × {} properties, {embedded} of them replayed",
        PROPERTIES.len()
    );
    print_share("size", page.len() as f64 / 1e6, 10.0, "MB");
    print_share("packing the replays", packed, 5.0, "s");
    print_share("rendering from the tables", secs, 5.0, "s");
    in_a_browser(&file);
}

/// Synthetic runs that fail more often if the target is a slippery bottle.
fn made_up_runs() -> impl Iterator<Item = RunDetail> {
    let mut dice = planted::Dice::new(1);
    (0..RUNS).map(move |index| {
        let mut run = made_up::run("k", index, &mut dice, &["Pick"], |target, _, dice| {
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
        });
        for judgement in run
            .actions
            .iter_mut()
            .flat_map(|action| &mut action.judgements)
        {
            judgement.witness = format!(
                "it is {} cm from the gripper, needs less than 5 cm",
                index % 777
            );
        }
        run
    })
}

/// The same runs under many ids, up to the maximum size.
fn replays(watched: &[(RunDetail, Trace)]) -> (Replays, usize) {
    let mut replays = Replays::default();
    let mut embedded = 0;
    while replays.bytes() < ROOM {
        let (run, trace) = &watched[embedded % watched.len()];
        let mut run = run.clone();
        embedded += 1;
        run.row.run = format!("k-{embedded}");
        replays.add(&run, Some(trace), &[]);
    }
    (replays, embedded)
}

fn print_share(name: &str, value: f64, demanded: f64, unit: &str) {
    println!(
        "{name:28} {value:>9.2} {unit:3} {:>6.2} of the limit of {demanded} {unit}",
        value / demanded
    );
}

/// Real runs with their traces.
fn simulated(folder: &Path) -> Vec<(RunDetail, Trace)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let history = folder.join("h");
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(["run", "configs/pick.toml", "--runs", WATCHED, "--history"])
        .arg(&history)
        .current_dir(root)
        .output()
        .expect("the program is built");
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let history = History::open_existing(&history).expect("it was just written");
    let runs = history
        .runs(&actcheck::history::RunFilter::default())
        .expect("it can be read");
    let read = |id: &str| Some((history.run(id).ok()?, history.traces().whole(id).ok()?));
    runs.iter().filter_map(|row| read(&row.run)).collect()
}

fn in_a_browser(file: &Path) {
    let mut browser = Chromium::start();
    browser.size(1280, 860);
    // Exclude the start of the browser itself.
    browser.call(
        "Page.navigate",
        serde_json::json!({ "url": "data:text/html,begun" }),
    );
    browser.picture();
    browser.open(file, "/");
    let paint = browser.value(
        "new Promise((done) => { const poll = () => { const it = performance.getEntriesByName('first-contentful-paint')[0]; \
         if (it) done(it.startTime); else setTimeout(poll, 10); }; poll(); })",
    );
    print_share(
        "first paint",
        paint.as_f64().unwrap_or(f64::NAN) / 1e3,
        1.0,
        "s",
    );
    // The first paint comes before the data.
    print_share(
        "overview ready",
        browser
            .value("Number(document.documentElement.dataset.ready)")
            .as_f64()
            .unwrap_or(f64::NAN)
            / 1e3,
        1.0,
        "s",
    );
    browser.open(file, "/runs");
    for (name, control, value, event) in [
        ("filter: failed", "outcome", "failed", "change"),
        ("filter: one property", "slot", "2", "change"),
        ("filter: any outcome", "outcome", "", "change"),
        ("search, first letter", "text", "b", "input"),
        ("search, more letters", "text", "bottle 77", "input"),
        ("worst first", "sort", "score", "change"),
        ("no filter", "text", "", "input"),
    ] {
        // Measure until the next frame is painted.
        let ask = format!(
            "new Promise((done) => {{ const it = document.querySelector('[data-filter={control}]'); const start = performance.now(); \
             it.value = '{value}'; it.dispatchEvent(new Event('{event}')); \
             requestAnimationFrame(() => setTimeout(() => done(performance.now() - start), 0)); }})"
        );
        let mut millis: Vec<f64> = (0..TIMES)
            .map(|_| browser.value(&ask).as_f64().unwrap_or(f64::NAN))
            .collect();
        millis.sort_by(f64::total_cmp);
        print_share(name, millis[TIMES / 2], 100.0, "ms");
    }
}
