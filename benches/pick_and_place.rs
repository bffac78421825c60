//! Cost of a run with several actions by stage, speed relative to real time on one core, and
//! speedup of two workers.
//!
//! ```text
//! cargo bench --bench pick_and_place [-- CONFIG [RUNS]]
//! ```
//!
//! The default configuration is `configs/pick_and_place.toml`, or `configs/quick.toml` if it does
//! not exist. Shares of stages are wall time, which other load stretches evenly; the cost of a run
//! is CPU time. Goals: at least 15 times real time per core, and two workers at least 1.8 times as
//! fast as one. The latter is wall time and needs two free cores; the benchmark also prints the
//! additional CPU time of two workers, which is their mutual slowdown.

mod support;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use actcheck::actions::{self, ActionCall};
use actcheck::campaign::{CampaignOptions, Clock, Env, RunContext, run_all, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::History;
use actcheck::rules::Budget;
use actcheck::{facts, scenario, world};

use support::{thread_secs, wall_secs};

/// Default number of runs.
const RUNS: u32 = 12;
const CLOCK: Clock = Clock {
    now: || "2026-01-01T00:00:00Z".to_owned(),
    secs: wall_secs,
};
const CONTEXT: RunContext = RunContext {
    clock: CLOCK,
    disturb: None,
};

/// Total time of each stage, in the order of execution. Unit: seconds.
#[derive(Default)]
struct Costs {
    stages: Vec<(&'static str, f64)>,
}

impl Costs {
    fn add(&mut self, stage: &'static str, secs: f64) {
        match self.stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, total)) => *total += secs,
            None => self.stages.push((stage, secs)),
        }
    }

    fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = wall_secs();
        let result = work();
        self.add(stage, wall_secs() - start);
        result
    }
}

fn main() {
    // Cargo passes `--bench`.
    let mut arguments = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with("--"));
    let config = arguments.next().map_or_else(default_config, PathBuf::from);
    let runs = arguments
        .next()
        .and_then(|runs| runs.parse().ok())
        .unwrap_or(RUNS);
    let env = Env::prepare(
        &config,
        &Overrides {
            runs: Some(runs),
            ..Overrides::default()
        },
    );
    let env = env.unwrap_or_else(|faults| panic!("{faults}"));
    println!("{}, {runs} runs", config.display());
    by_stage(&env, runs);
    by_workers(&env, runs);
}

fn default_config() -> PathBuf {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let wanted = configs.join("pick_and_place.toml");
    if wanted.is_file() {
        wanted
    } else {
        configs.join("quick.toml")
    }
}

fn by_stage(env: &Env, runs: u32) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let history = History::open(folder.path()).expect("a fresh history");
    history
        .begin_campaign(&env.record("bench".into(), "bench".into(), (CLOCK.now)()))
        .expect("a fresh history");
    let mut costs = Costs::default();
    let (mut simulated_secs, mut made, mut processor_secs) = (0.0, 0, 0.0);
    for index in 0..u64::from(runs) {
        let start = thread_secs();
        let Some(secs) = one_run(env, index, &mut costs) else {
            continue;
        };
        simulated_secs += secs;
        made += 1;
        processor_secs += thread_secs() - start;
        let choices = Choices::random(env.campaign.seed, index);
        let record = run_line(env, "bench", index, choices, &CONTEXT)
            .expect("the same scene can be built again");
        costs
            .time("history", || history.commit(&record))
            .expect("room on the disk");
    }
    let total: f64 = costs.stages.iter().map(|(_, secs)| secs).sum();
    println!(
        "{:34} {:>12} {:>8}",
        "stage, wall time", "ms per run", "share"
    );
    for (stage, secs) in &costs.stages {
        println!(
            "{stage:34} {:12.3} {:7.2}%",
            secs * 1e3 / f64::from(made),
            secs / total * 100.0
        );
    }
    println!(
        "{:34} {:12.3}",
        "all but history, CPU time",
        processor_secs * 1e3 / f64::from(made)
    );
    println!(
        "simulated: {:.1} s per run, {:.1} × real time per core (at least 15 ×)",
        simulated_secs / f64::from(made),
        simulated_secs / processor_secs
    );
}

/// Makes one run stage by stage. Returns the simulated seconds, or `None` if the scene is
/// discarded.
fn one_run(env: &Env, index: u64, costs: &mut Costs) -> Option<f64> {
    let mut choices = Choices::random(env.campaign.seed, index);
    let number = env.test_of(index);
    let scene = costs
        .time("scene", || scenario::draw(&env.space, number, &mut choices))
        .ok()?;
    let mut built = costs
        .time("world", || world::build(&scene))
        .expect("the models are sound");
    let settling = costs.time("settling", || built.settle());
    if !settling.settled || !settling.left.is_empty() {
        return None;
    }
    let settled_secs = built.time_secs();
    built.watch(wall_secs);
    let names: Vec<&String> = env.campaign.tests[number]
        .iter()
        .map(|step| &step.action)
        .collect();
    let call = |name: &&String| ActionCall {
        action: (*name).clone(),
        parameters: scene.designators.clone(),
    };
    let calls: Vec<ActionCall> = names.iter().map(call).collect();
    let start = wall_secs();
    let trace = actions::perform(&calls, &mut built, &mut choices, &env.campaign.budget);
    let performed = wall_secs() - start;
    let (engine, pictures) = (built.engine().engine_secs(), built.engine().camera_secs());
    costs.add("actions: physics", engine);
    costs.add("actions: camera images", pictures);
    costs.add(
        "actions: plans, control, recording",
        performed - engine - pictures,
    );
    let run_facts = costs.time("facts", || facts::extract(&trace));
    costs.time("rules", || {
        for (step, name) in names.iter().enumerate() {
            let properties = &env.ontology.actions[*name].success_properties;
            if let Some(seen) = run_facts.action(step) {
                env.rules.judge(&seen, properties, &Budget::default());
            }
        }
    });
    let acted_secs: f64 = trace
        .actions
        .iter()
        .map(|action| action.duration_secs)
        .sum();
    Some(settled_secs + acted_secs)
}

fn by_workers(env: &Env, runs: u32) {
    let [one, two] = [1, 2].map(|jobs| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let history = History::open(folder.path()).expect("a fresh history");
        history
            .begin_campaign(&env.record("bench".into(), "bench".into(), (CLOCK.now)()))
            .expect("a fresh history");
        let (wall, processors) = (wall_secs(), process_secs());
        run_all(
            env,
            &history,
            "bench",
            &CampaignOptions {
                jobs,
                context: CONTEXT,
            },
            &AtomicBool::new(false),
            |_| {},
        );
        (wall_secs() - wall, process_secs() - processors)
    });
    println!(
        "{runs} runs with one worker: {:.2} s wall time, {:.2} s CPU time",
        one.0, one.1
    );
    println!(
        "{runs} runs with two workers: {:.2} s wall time, {:.2} s CPU time",
        two.0, two.1
    );
    println!(
        "two workers are {:.2} × as fast in wall time (at least 1.8 × with two free cores)",
        one.0 / two.0
    );
    println!(
        "speedup with a core each, from CPU time: {:.2} ×",
        2.0 * one.1 / two.1
    );
}

/// CPU time of all threads of this process, in the system's ticks of 10 ms; wall time if the system
/// does not report it.
fn process_secs() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").ok();
    // The name in parentheses may hold spaces; user and system time are the 12th and 13th after it.
    let ticks = stat
        .as_deref()
        .and_then(|text| text.rsplit_once(')'))
        .map(|(_, rest)| {
            let mut fields = rest
                .split_whitespace()
                .skip(11)
                .filter_map(|field| field.parse::<f64>().ok());
            fields.next().unwrap_or(0.0) + fields.next().unwrap_or(0.0)
        });
    ticks.map_or_else(wall_secs, |ticks| ticks / 100.0)
}
