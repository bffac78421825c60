//! Cost of a pick run by stage, simulation speed relative to real time, and size of the history.
//!
//! Shares and ratios are within one process, because machines are noisy. Goals: everything but
//! physics takes at most 15 % of the wall time, judging one action at most 2 ms; simulation runs at
//! 20 times real time or faster on one core; a run takes at most 150 KB.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;
use std::time::Instant;

use actcheck::actions::{self, ActionCall};
use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::{CampaignEnd, History};
use actcheck::rules::Budget;
use actcheck::{facts, scenario, world};

const RUNS: u64 = 40;

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

fn now_secs() -> f64 {
    START.elapsed().as_secs_f64()
}

/// Total time of each stage, in the order of execution. Unit: seconds.
#[derive(Default)]
struct Costs {
    /// The engine's part of `simulation`. The rest is perception, planning, control and recording.
    engine_secs: f64,
    stages: Vec<(&'static str, f64)>,
}

impl Costs {
    fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let secs = start.elapsed().as_secs_f64();
        match self.stages.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, total)) => *total += secs,
            None => self.stages.push((stage, secs)),
        }
        result
    }

    fn of(&self, stage: &str) -> f64 {
        self.stages
            .iter()
            .find(|(name, _)| *name == stage)
            .map_or(0.0, |(_, secs)| *secs)
    }
}

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/five_others.toml");
    let history_dir = folder.path().join("history");
    let overrides = Overrides {
        history: Some(history_dir.clone()),
        ..Overrides::default()
    };
    let env = Env::prepare(&config, &overrides).expect("the benchmark's configuration is sound");
    // The size of the history is measured on the first shipped example: one to five other objects.
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/pick.toml");
    let kept = Env::prepare(
        &shipped,
        &Overrides {
            runs: Some(40),
            ..overrides
        },
    )
    .expect("the shipped configuration is sound");
    let history = History::open(&history_dir).expect("a fresh history");
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    history
        .begin_campaign(&kept.record("bench".into(), "bench".into(), (clock.now)()))
        .expect("a fresh history");
    let mut costs = Costs::default();
    let mut simulated_secs = 0.0;
    let mut made = 0;
    for index in 0..RUNS {
        let Some(secs) = by_stage(&env, index, &mut costs) else {
            continue;
        };
        simulated_secs += secs;
        made += 1;
        let context = RunContext {
            clock,
            disturb: None,
        };
        let record = run_line(
            &kept,
            "bench",
            index,
            Choices::random(kept.campaign.seed, index),
            &context,
        );
        let record = record.expect("the same scene can be built again");
        costs
            .time("history", || history.commit(&record))
            .expect("room on the disk");
    }
    let end = CampaignEnd {
        ended_by: None,
        ended: (clock.now)(),
        score: None,
        score_without_broken: None,
        outcomes: BTreeMap::new(),
        discards: 0,
        interrupted: false,
    };
    costs
        .time("history", || history.finish_campaign("bench", &end))
        .expect("room on the disk");
    drop(history);
    print_costs(&costs, made, simulated_secs, folder_bytes(&history_dir));
}

/// Makes one run stage by stage. Returns the simulated seconds of settling and actions, or `None`
/// if the scene is discarded.
fn by_stage(env: &Env, index: u64, costs: &mut Costs) -> Option<f64> {
    let mut choices = Choices::random(env.campaign.seed, index);
    let scene = costs
        .time("scene", || scenario::draw(&env.space, 0, &mut choices))
        .ok()?;
    let mut built = costs
        .time("build", || world::build(&scene))
        .expect("the shipped models are sound");
    built.watch(now_secs);
    let settling = costs.time("simulation", || built.settle());
    if !settling.settled || !settling.left.is_empty() {
        return None;
    }
    let calls = [ActionCall {
        action: "Pick".into(),
        parameters: scene.designators.clone(),
    }];
    let trace = costs.time("simulation", || {
        actions::perform(&calls, &mut built, &mut choices, &env.campaign.budget)
    });
    costs.engine_secs += built.engine().engine_secs();
    let run_facts = costs.time("facts", || facts::extract(&trace));
    let properties = &env.ontology.actions["Pick"].success_properties;
    let seen = run_facts.action(0)?;
    costs.time("rules", || {
        env.rules.judge(&seen, properties, &Budget::default())
    });
    Some(
        settling.secs
            + trace
                .actions
                .iter()
                .map(|action| action.duration_secs)
                .sum::<f64>(),
    )
}

fn print_costs(costs: &Costs, runs: u64, simulated_secs: f64, history_bytes: u64) {
    let total: f64 = costs.stages.iter().map(|(_, secs)| secs).sum();
    println!("{runs} pick runs with five other objects, one core");
    println!("{:10} {:>12} {:>8}", "stage", "ms per run", "share");
    for (stage, secs) in &costs.stages {
        println!(
            "{stage:10} {:12.3} {:7.2}%",
            secs * 1e3 / runs as f64,
            secs / total * 100.0
        );
    }
    let skill = costs.of("simulation") - costs.engine_secs;
    println!(
        "of simulation: the engine's steps {:.2} %, skill, control and recording {:.2} %",
        costs.engine_secs / total * 100.0,
        skill / total * 100.0
    );
    println!(
        "not physics: {:.2} % of the wall time (at most 15 %)",
        (1.0 - costs.engine_secs / total) * 100.0
    );
    println!(
        "facts and outcomes of one action: {:.3} ms (at most 2 ms)",
        (costs.of("facts") + costs.of("rules")) * 1e3 / runs as f64
    );
    println!(
        "simulation: {:.1} × real time (at least 20 ×)",
        simulated_secs / costs.of("simulation")
    );
    println!(
        "history: {:.1} KB/run of configs/pick.toml (at most 150 KB)",
        history_bytes as f64 / 1e3 / runs as f64
    );
}

fn folder_bytes(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(Result::ok);
    entries
        .map(|entry| match entry.metadata() {
            Ok(metadata) if metadata.is_dir() => folder_bytes(&entry.path()),
            Ok(metadata) => metadata.len(),
            Err(_) => 0,
        })
        .sum()
}
