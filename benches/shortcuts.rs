//! What does each shortcut of the simulation save, and how does it change physics?
//!
//! ```text
//! cargo bench --bench shortcuts [-- CONFIG [RUNS [ROUNDS]]]
//! ```
//!
//! The same scenes are simulated with the whole robot in the engine in every tick, and with
//! shortcuts, in turn, in one thread. CPU times are those of settling and of all actions, with
//! planning, images and recording. Goals for `configs/pick.toml`: at most 0.35 of the time without
//! shortcuts; for `configs/pick_and_place.toml`, at most 0.4.
//!
//! After the actions, a robot that holds an object keeps still for ten seconds. The slip is the way
//! of the object's middle in the hand in this time; the tilt, the largest change of its attitude
//! there. "Saves" is the share of the CPU without this shortcut that it saves beside all others.
//! Penetration and energy are the worst of all runs. The last column counts the runs whose
//! actions the robot reports as without shortcuts: as done or as failed. Try it with robots of
//! others too, and with `steps_per_second = 960` in `[physics]`: that shows whether the reports
//! without shortcuts are the right ones.

mod support;

use std::path::{Path, PathBuf};

use actcheck::actions::{self, ActionCall};
use actcheck::campaign::Env;
use actcheck::config::Overrides;
use actcheck::data::{Choices, Pose};
use actcheck::scenario;
use actcheck::world::{self, Shortcuts, World};
use nalgebra::{Isometry3, Point3};

use support::thread_secs;

/// Default number of runs and of rounds.
const DEFAULTS: [u32; 2] = [12, 3];
/// Time for which a robot holds its object still. Unit: seconds.
const HOLD_SECS: f64 = 10.0;

const VARIANTS: [(&str, Shortcuts); 8] = [
    ("none: the whole robot in the engine", Shortcuts::NONE),
    (
        "all but free motion without the engine",
        Shortcuts {
            free_motion: false,
            ..Shortcuts::ALL
        },
    ),
    (
        "all but objects that move without the robot",
        Shortcuts {
            robot_apart: false,
            ..Shortcuts::ALL
        },
    ),
    (
        "all but the hand alone",
        Shortcuts {
            hand_alone: false,
            ..Shortcuts::ALL
        },
    ),
    (
        "all but closed shells",
        Shortcuts {
            shells: false,
            ..Shortcuts::ALL
        },
    ),
    (
        "all but half the substeps",
        Shortcuts {
            few_substeps: false,
            ..Shortcuts::ALL
        },
    ),
    (
        "all but few sweeps",
        Shortcuts {
            few_sweeps: false,
            ..Shortcuts::ALL
        },
    ),
    ("all that a campaign takes", Shortcuts::ALL),
];

/// The sums and worst values of one variant.
#[derive(Default, Clone)]
struct Found {
    secs: f64,
    ticks: [u64; 4],
    penetration_m: f64,
    energy_j: f64,
    holds: Vec<Held>,
    /// Whether the robot reports each action as done, by run.
    reports: Vec<Vec<Option<bool>>>,
}

/// An object in a hand that keeps still.
#[derive(Clone, Copy)]
struct Held {
    slip_m: f64,
    tilt_rad: f64,
}

fn main() {
    // Cargo passes `--bench`.
    let mut arguments = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with("--"));
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/pick.toml");
    let config = arguments.next().map_or(default, PathBuf::from);
    let [runs, rounds] = DEFAULTS.map(|default| {
        arguments
            .next()
            .and_then(|n| n.parse().ok())
            .unwrap_or(default)
    });
    let folder = tempfile::tempdir().expect("a temporary folder");
    let overrides = Overrides {
        history: Some(folder.path().join("history")),
        ..Overrides::default()
    };
    let env = Env::prepare(&config, &overrides).unwrap_or_else(|faults| panic!("{faults}"));
    let mut found = vec![Found::default(); VARIANTS.len()];
    for round in 0..rounds {
        for index in 0..u64::from(runs) {
            for ((_, shortcuts), found) in VARIANTS.iter().zip(&mut found) {
                simulate(&env, index, *shortcuts, round == 0, found);
            }
        }
    }
    println!("{}, {runs} runs, {rounds} rounds", config.display());
    println!(
        "{:42}{:>10}{:>7}{:>7}{:>24}{:>10}{:>10}{:>7}{:>10}{:>10}{:>7}",
        "shortcuts",
        "CPU s/run",
        "ratio",
        "saves",
        "ticks",
        "deepest",
        "energy",
        "holds",
        "slip",
        "tilt",
        "same"
    );
    let all_secs = found[VARIANTS.len() - 1].secs;
    for ((name, _), of) in VARIANTS.iter().zip(&found) {
        let same = of
            .reports
            .iter()
            .zip(&found[0].reports)
            .filter(|(one, other)| one == other)
            .count();
        let mean = |value: fn(&Held) -> f64| {
            of.holds.iter().map(value).sum::<f64>() / of.holds.len().max(1) as f64
        };
        println!(
            "{name:42}{:>10.3}{:>7.2}{:>6.0}%{:>24}{:>7.2} mm{:>8.4} J{:>7}{:>7.3} mm{:>8.2} °{same:>7}",
            of.secs / f64::from(runs * rounds),
            of.secs / found[0].secs,
            100.0 * (1.0 - all_secs / of.secs),
            format!("{:?}", of.ticks.map(|ticks| ticks / u64::from(runs))),
            of.penetration_m * 1e3,
            of.energy_j,
            of.holds.len(),
            mean(|held| held.slip_m) * 1e3,
            mean(|held| held.tilt_rad).to_degrees()
        );
    }
    println!(
        "ticks: free motion; objects move apart from the robot; the hand alone; the whole robot"
    );
}

/// Simulates a run of the configuration, and a hold after it in the first round.
fn simulate(env: &Env, index: u64, shortcuts: Shortcuts, first: bool, found: &mut Found) {
    let mut choices = Choices::random(env.campaign.seed, index);
    let number = env.test_of(index);
    let Ok(scene) = scenario::draw(&env.space, number, &mut choices) else {
        return;
    };
    let mut built = world::build(&scene).expect("the models are sound");
    built.take_shortcuts(shortcuts);
    let start = thread_secs();
    if !built.settle().settled {
        return;
    }
    let steps = env.campaign.tests[number].iter();
    let calls: Vec<ActionCall> = steps
        .map(|step| ActionCall {
            action: step.action.clone(),
            parameters: scene.designators.clone(),
        })
        .collect();
    let trace = actions::perform(&calls, &mut built, &mut choices, &env.campaign.budget);
    found.secs += thread_secs() - start;
    if first {
        let reports = trace
            .actions
            .iter()
            .map(|action| action.report.as_ref().map(|report| report.succeeded));
        found.reports.push(reports.collect());
        let quality = built.recorder().quality();
        found.penetration_m = found.penetration_m.max(quality.deepest_penetration_m);
        found.energy_j = found.energy_j.max(quality.energy_gain_j);
        for (total, ticks) in found
            .ticks
            .iter_mut()
            .zip(built.proximity().ticks_by_reach())
        {
            *total += ticks;
        }
        found.holds.extend(hold(&mut built));
    }
}

/// Keeps the robot still, and measures the motion of the object in its hand; `None` if it has none.
fn hold(world: &mut World) -> Option<Held> {
    let mut command = world.hold();
    // Its fingers close further, as in the grasp.
    command.gripper_opening_m = 0.0;
    let (id, middle, before) = held(world)?;
    let mut tilt_rad = 0.0_f64;
    let ticks = (HOLD_SECS / world.tick_secs()).round();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some hundred ticks"
    )]
    for _ in 0..ticks as u32 {
        world.step(&command);
        let (_, _, now) = held(world).filter(|(other, _, _)| *other == id)?;
        tilt_rad = tilt_rad.max(before.rotation.angle_to(&now.rotation));
    }
    let (_, _, after) = held(world)?;
    Some(Held {
        slip_m: (after * middle - before * middle).norm(),
        tilt_rad,
    })
}

/// Returns the object in the hand, its middle in its own frame, and its pose in the hand's.
fn held(world: &World) -> Option<(String, Point3<f64>, Isometry3<f64>)> {
    let now = world.snapshot();
    let id = now
        .robot
        .left_touches
        .iter()
        .find(|id| now.robot.right_touches.contains(id))?;
    let body = now
        .bodies
        .iter()
        .find(|body| body.id == *id && !body.fixed)?;
    let of = |pose: &Pose| pose.to_isometry();
    let in_hand = of(&now.robot.gripper).inverse() * of(&body.pose);
    let [_, _, height] = body.size_m;
    Some((id.clone(), Point3::new(0.0, 0.0, height / 2.0), in_hand))
}
