//! Driving to places, from scenes to verdicts: localisation, obstacle detection, and collisions.

use std::collections::BTreeMap;

use actcheck::base::Outcome;
use actcheck::campaign::{Disturbance, Env};
use actcheck::config::Overrides;
use actcheck::data::{ActionReport, ChoiceName, ChoiceValue, Choices, Pose};
use actcheck::history::RunRecord;
use actcheck::world::{Poison, World};

use crate::support::line::{self, env_of, run};
use crate::support::{actcheck, project, stderr, stdout};

/// The front of a table in the kitchen, and a table in the living room: the route goes through the
/// passage.
const KITCHEN: &str = "[world]\nworlds = [\"apartment\"]\n[objectLocation]\nlocation_list = [\"dining_table_front\"]\n\
    [objectSurface]\nobject_surfaces = [\"dining_table\"]\n";
/// A table on a floor without anything else.
const FLOOR: &str = "[objectLocation]\nlocation_list = [\"table_front\"]\n[objectSurface]\nobject_surfaces = [\"table\"]\n";
/// The possible obstacles.
const TABLE: &str = "nav_obstacle_list = [\"mini_coffee_table\"]\nnav_obstacle_count = 1\n";

fn env(before: &str, tables: &str) -> Env {
    env_of(&format!(
        "tests = [[\"MoveTo\"]]\ntest_count = 1\nseed = 5\n{before}{tables}"
    ))
}

/// The nominal scene with some given choices, and no noise.
fn nominal(env: &Env, choices: &[(&str, f64)], disturb: Option<Disturbance>) -> RunRecord {
    let values: BTreeMap<ChoiceName, Vec<ChoiceValue>> = choices
        .iter()
        .map(|(name, value)| ((*name).into(), vec![ChoiceValue::Number(*value)]))
        .collect();
    run(env, Choices::named(&values), disturb)
}

fn report(run: &RunRecord) -> &ActionReport {
    line::report(run, 0)
}

fn outcomes(run: &RunRecord) -> BTreeMap<&str, Outcome> {
    line::outcomes(run, 0)
}

/// Without rooms there is no zone to stay in.
fn nothing_failed(run: &RunRecord) -> bool {
    outcomes(run)
        .values()
        .all(|outcome| [Outcome::Passed, Outcome::Inapplicable].contains(outcome))
}

/// The final base pose: the true one, and the one that the robot believes.
fn ends(run: &RunRecord) -> [[f64; 3]; 2] {
    let robot = &run.trace.snapshots[1].robot;
    [robot.base_true, robot.base_believed]
}

fn off(a: &[f64], b: &[f64]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

const GOAL: [f64; 2] = [1.31, 1.3];

#[test]
fn without_noise_and_obstacles_every_place_is_reached() {
    let lab = "[world]\nworlds = [\"apartment\", \"lab\"]\n[objectLocation]\nlocation_list = [\"dining_table_front\", \
        \"kitchen_cabinet_front\", \"side_table_front\", \"left_bench_front\", \"assembly_table_front\"]\n[objectSurface]\n\
        object_surfaces = [\"dining_table\", \"kitchen_cabinet\", \"side_table\", \"left_bench\", \"assembly_table\"]\n";
    for (tables, n_runs) in [(lab, 8), (FLOOR, 3)] {
        let env = env("", tables);
        for index in 0..n_runs {
            let run = run(&env, Choices::random(5, index), None);
            assert!(nothing_failed(&run), "run {index}: {:?}", run.judgements);
            let [truly, believed] = ends(&run);
            let name = &run.scene.designators["objectLocation"][0];
            let goal = run
                .trace
                .map
                .locations
                .iter()
                .find(|location| location.name == *name);
            let goal = goal.expect("the goal is a place on the map");
            assert!(
                off(&truly, &goal.at) < 0.01 && off(&truly, &believed) < 1e-6,
                "run {index}: {truly:?} for {goal:?}"
            );
        }
    }
}

/// The paper's robot failed if an obstacle was on its goal. Ours detects this, and touches nothing.
#[test]
fn an_occupied_goal_is_not_reached() {
    let env = env(TABLE, KITCHEN);
    let run = nominal(
        &env,
        &[("obstacle.1.x", GOAL[0]), ("obstacle.1.y", GOAL[1])],
        None,
    );
    assert_eq!(
        report(&run).message,
        "dining_table_front: the goal is occupied"
    );
    let outcomes = outcomes(&run);
    assert_eq!(
        (outcomes["GoalReported"], outcomes["GoalReached"]),
        (Outcome::Failed, Outcome::Failed)
    );
    assert_eq!(
        (outcomes["NoDriveCollisions"], outcomes["StayedInZone"]),
        (Outcome::Passed, Outcome::Passed)
    );
    assert!(off(&ends(&run)[0], &GOAL) > 0.5);
}

/// The robot starts two metres before the front of a table, with one obstacle.
fn from_afar(obstacle: [f64; 2], disturb: Option<Disturbance>) -> RunRecord {
    let env = env(TABLE, FLOOR);
    let [x, y] = obstacle;
    let start = [("robot.x", -3.4), ("robot.y", 0.0), ("robot.heading", 0.0)];
    nominal(
        &env,
        &[&start[..], &[("obstacle.1.x", x), ("obstacle.1.y", y)]].concat(),
        disturb,
    )
}

const IN_THE_WAY: [f64; 2] = [-2.3, 0.1];
const ASIDE: [f64; 2] = [-3.4, 2.0];
const FRONT: [f64; 2] = [-1.29, 0.0];

#[test]
fn the_base_drives_around_obstacles() {
    let (free, blocked) = (from_afar(ASIDE, None), from_afar(IN_THE_WAY, None));
    assert!(
        nothing_failed(&free) && nothing_failed(&blocked),
        "{:?} {:?}",
        free.judgements,
        blocked.judgements
    );
    let plans = |run: &RunRecord| {
        run.trace.actions[0]
            .phases
            .iter()
            .filter(|phase| phase.name == "plan")
            .count()
    };
    assert_eq!(plans(&free), 1);
    assert!(
        plans(&blocked) > 1,
        "it must see that the mapped route is blocked"
    );
}

/// Sensors always see the obstacle off the route.
fn hide(_: u64, world: &mut World) {
    assert!(world.poison(
        "mini_coffee_table_1",
        Poison::Decoy(Pose::upright([ASIDE[0], ASIDE[1], 0.0], 0.0))
    ));
}

/// Sensors always see the obstacle on the goal.
fn pretend(_: u64, world: &mut World) {
    assert!(world.poison(
        "mini_coffee_table_1",
        Poison::Decoy(Pose::upright([FRONT[0], FRONT[1], 0.0], 0.0))
    ));
}

#[test]
fn the_robot_knows_only_the_obstacles_it_sees() {
    let hit = from_afar(IN_THE_WAY, Some(hide));
    assert_eq!(outcomes(&hit)["NoDriveCollisions"], Outcome::Failed);
    let found = hit.judgements[0]
        .iter()
        .find(|judgement| judgement.property.ends_with("NoDriveCollisions"))
        .unwrap();
    assert!(
        found.witness.contains("mini_coffee_table_1"),
        "{}",
        found.witness
    );
    let deceived = from_afar(ASIDE, Some(pretend));
    assert_eq!(
        report(&deceived).message,
        "table_front: the goal is occupied"
    );
    assert_eq!(outcomes(&deceived)["NoDriveCollisions"], Outcome::Passed);
}

#[test]
fn drift_causes_a_localisation_error_that_landmarks_reduce() {
    let failures = |sensing: &str| {
        let env = env("", &format!("{KITCHEN}[sensing]\n{sensing}"));
        let runs: Vec<RunRecord> = (0..5)
            .map(|index| run(&env, Choices::random(9, index), None))
            .collect();
        // It ends where it believes the goal to be.
        for run in &runs {
            assert!(
                off(&ends(run)[1], &GOAL) < 0.03,
                "{:?}: {}",
                ends(run),
                report(run).message
            );
        }
        let agree = runs.iter().map(|run| outcomes(run)["LocalisationAgrees"]);
        agree.filter(|outcome| *outcome == Outcome::Failed).count()
    };
    let drift = "odometry_drift = 0.1\nheading_drift = 0.03\n";
    assert!(failures(drift) >= 3);
    let landmarks = "landmark_every_m = 0.3\nlandmark_noise_m = 0.01\nlandmark_noise_rad = 0.01\n";
    assert_eq!(failures(&format!("{drift}{landmarks}")), 0);
}

#[test]
fn every_run_is_the_same_with_one_and_two_workers_and_differs_without_noise() {
    let project = project();
    let hashes = |jobs: &str| {
        let all = [
            "run",
            "configs/move_to.toml",
            "--runs",
            "2",
            "--jobs",
            jobs,
            "--history",
            jobs,
            "--format",
            "json",
        ];
        assert!(
            actcheck(project.path(), &all)
                .status
                .code()
                .is_some_and(|code| code < 2)
        );
        let text = stdout(&actcheck(
            project.path(),
            &["list", "--history", jobs, "--format", "csv"],
        ));
        let hashes = text
            .lines()
            .skip(1)
            .filter_map(|line| line.rsplit(',').next().map(str::to_owned));
        hashes.collect::<Vec<String>>()
    };
    let one = hashes("1");
    assert_eq!(one.len(), 2);
    assert_eq!(one, hashes("2"));
    // A run can be exported as a case, including all odometry errors.
    let listed = stdout(&actcheck(
        project.path(),
        &["list", "--history", "1", "--format", "csv"],
    ));
    let id = listed
        .lines()
        .nth(1)
        .and_then(|line| line.split(',').next())
        .expect("the campaign has runs")
        .to_owned();
    actcheck(
        project.path(),
        &[
            "export",
            "run",
            &id,
            "--history",
            "1",
            "-o",
            "configs/case.toml",
        ],
    );
    let case = actcheck(project.path(), &["check", "configs/case.toml"]);
    assert_eq!(case.status.code(), Some(0), "{}", stderr(&case));
    let env = Env::prepare(
        &project.path().join("configs/move_to.toml"),
        &Overrides::default(),
    )
    .unwrap();
    let first = run(&env, Choices::random(env.campaign.seed, 0), None);
    let again = run(&env, Choices::recorded(&first.choices), None);
    assert_eq!(first.trace, again.trace);
    let of_odometry =
        |name: &ChoiceName| matches!(name, ChoiceName::Odometry(_) | ChoiceName::Landmark(_));
    let quiet: Vec<_> = first
        .choices
        .iter()
        .filter(|c| !of_odometry(&c.name))
        .cloned()
        .collect();
    assert!(quiet.len() < first.choices.len());
    assert_ne!(
        run(&env, Choices::recorded(&quiet), None).trace.hash,
        first.trace.hash
    );
}
