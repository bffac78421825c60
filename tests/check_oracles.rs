//! Tests of the oracles: every fault is noticed, every property notices a fault, and a weak rule is
//! named.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use actcheck::actions::{Sabotage, Saboteur};
use actcheck::analysis::{Notice, OracleGap, OracleMatrix, OracleTrial, oracle_matrix};
use actcheck::campaign::oracles::{FAULTS, Fault, Trial, TrialOptions, try_faults};
use actcheck::campaign::{Clock, Env, RunContext, RunInput, run_line, run_sabotaged};
use actcheck::config::{Overrides, Step};
use actcheck::data::Choices;
use serde_json::Value;

use crate::support::{COARSE, COARSEST, actcheck, edit, project, root, stderr, stdout};

const CONTEXT: RunContext = RunContext {
    clock: Clock {
        now: String::new,
        secs: || 0.0,
    },
    disturb: None,
};

fn env(folder: &Path, runs: u32) -> Env {
    let overrides = Overrides {
        runs: Some(runs),
        ..Overrides::default()
    };
    Env::prepare(&folder.join("configs/pick.toml"), &overrides).unwrap()
}

fn named(names: &[&str]) -> Vec<Fault> {
    FAULTS
        .into_iter()
        .filter(|fault| names.contains(&fault.name))
        .collect()
}

fn trials(env: &Env, faults: &[Fault], jobs: usize) -> Vec<Trial> {
    try_faults(
        env,
        faults,
        &TrialOptions {
            jobs,
            context: CONTEXT,
        },
        &AtomicBool::new(false),
        || {},
    )
    .unwrap()
}

/// The matrix restricted to some of the properties.
fn matrix_of(
    env: &Env,
    faults: &[Fault],
    trials: &[Trial],
    is_asked: impl Fn(&str) -> bool,
) -> OracleMatrix {
    let mut properties = properties(env);
    properties.retain(|property| is_asked(property));
    matrix_over(&properties, faults, trials)
}

/// The properties of all actions of a campaign.
fn properties(env: &Env) -> Vec<String> {
    let actions = env.campaign.tests.iter().flatten();
    actions
        .flat_map(|action| {
            env.ontology.actions[&action.action]
                .success_properties
                .clone()
        })
        .collect()
}

fn matrix_over(properties: &[String], faults: &[Fault], trials: &[Trial]) -> OracleMatrix {
    let trials: Vec<OracleTrial> = trials
        .iter()
        .map(|trial| {
            let mut outcomes = trial.outcomes.clone();
            outcomes.retain(|property, _| properties.contains(property));
            let fault = trial.fault.map(str::to_owned);
            OracleTrial {
                index: trial.index,
                fault,
                came_about: trial.came_about,
                outcomes,
            }
        })
        .collect();
    let names: Vec<&str> = faults.iter().map(|fault| fault.name).collect();
    oracle_matrix(&names, properties, &trials)
}

/// The shipped pick by a robot with perfect sensors: without an injected fault, nothing fails.
fn sure(folder: &Path) {
    let config = folder.join("configs/pick.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    let (before, rest) = text.split_once("[sensing]").unwrap();
    let (_, after) = rest.split_once("[budget]").unwrap();
    std::fs::write(&config, format!("{before}[budget]{after}")).unwrap();
}

/// The faults that can occur in a pick.
fn of_pick() -> usize {
    let robot = env(root(), 1).campaign.robot;
    FAULTS
        .iter()
        .filter(|fault| fault.concerns(&[Step::plain("Pick")], &robot.core))
        .count()
}

/// In the scenes of the shipped campaign: every fault is noticed, every property notices one, and
/// an idle robot passes in no scene.
#[test]
fn the_shipped_properties_notice_every_fault() {
    let project = project();
    sure(project.path());
    let output = actcheck(
        project.path(),
        &[
            "check-oracles",
            "configs/pick.toml",
            "--runs",
            "8",
            "--format",
            "json",
        ],
    );
    let printed: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(output.status.code(), Some(0), "{}", printed["gaps"]);
    assert_eq!(printed["gaps"], serde_json::json!([]));
    let faults = printed["faults"].as_array().unwrap();
    assert_eq!(faults.len(), of_pick());
    let notices = |fault: &Value, idx: usize| fault["properties"][idx]["verdict"] == "noticed";
    for fault in faults {
        assert!((0..5).any(|idx| notices(fault, idx)), "{fault}");
        assert!(fault["came_about"].as_u64().unwrap() >= 7, "{fault}");
        // A fault that occurred spoils every action.
        assert_eq!(fault["passed_anyway"], 0, "{fault}");
    }
    for idx in 0..5 {
        assert!(
            faults.iter().any(|fault| notices(fault, idx)),
            "property {idx}: {faults:?}"
        );
    }
    // Faults that only the world shows are noticed whatever the report says.
    let noticing = |name: &str| -> Vec<&str> {
        let fault = faults.iter().find(|fault| fault["fault"] == name).unwrap();
        let properties = fault["properties"].as_array().unwrap();
        let noticing = properties
            .iter()
            .filter(|property| property["verdict"] == "noticed");
        noticing
            .map(|property| {
                property["property"]
                    .as_str()
                    .unwrap()
                    .rsplit('#')
                    .next()
                    .unwrap()
            })
            .collect()
    };
    assert!(noticing("false-success").contains(&"ObjectInGripper"));
    assert!(!noticing("false-success").contains(&"ObjectGrasped"));
    assert_eq!(noticing("false-failure"), ["ObjectGrasped"]);
    assert_eq!(noticing("neighbour-falls"), ["NoGraspCollisions"]);
    // The robot is back in place when its skill begins, so that only the collision shows.
    assert_eq!(noticing("base-pushed"), ["NoGraspCollisions"]);
    assert_eq!(noticing("arm-through-head"), ["NoGraspCollisions"]);
    // So does a neighbour that is back in its place.
    assert_eq!(noticing("neighbour-put-back"), ["NoGraspCollisions"]);
    // The action reports success, and the object is in the hand, but not off its place.
    assert!(noticing("drag-and-lift").contains(&"MovedObject"));
    assert!(noticing("percepts-swapped").contains(&"ObjectInGripper"));
    assert!(noticing("runaway-motor").contains(&"CloseObject"));
}

/// A robot without a base can't be pushed against furniture, and one without a head has no head to
/// hit.
#[test]
fn faults_that_a_robot_can_not_have_are_left_out() {
    let robots = ["pick", "fixed_arm"].map(|name| {
        let config = root().join(format!("configs/{name}.toml"));
        Env::prepare(&config, &Overrides::default())
            .unwrap()
            .campaign
            .robot
    });
    let pick = [Step::plain("Pick")];
    let left_out = FAULTS.iter().filter(|fault| {
        fault.concerns(&pick, &robots[0].core) && !fault.concerns(&pick, &robots[1].core)
    });
    assert_eq!(
        left_out.map(|fault| fault.name).collect::<Vec<_>>(),
        ["base-pushed", "arm-through-head"]
    );
}

/// The actions of the whole task, each with its preceding actions, in a room with nothing unusual.
/// (An object displaced by half a metre from a cabinet is never still on it.)
const TASK: &str = "test_count = 8\nseed = 3\n\
    nav_obstacle_list = [\"bottle\"]\nnav_obstacle_count = 1\n[world]\nworlds = [\"empty_room\"]\n\
    [objectLocation]\nlocation_list = [\"left_corner\"]\n[objectSurface]\nobject_surfaces = [\"table\"]\n\
    [placeSurface]\nplace_object_surfaces = [\"cabinet\"]\n[pickObject]\nmodel_list = [\"glass\", \"can\"]\n\
    [surfaceObjects]\nmodel_list = [\"box\"]\ncount = 1\n";

const LOOKS: &str = "[[\"MoveTo\"], [\"PerceivePlane\"]]";
const GRASPS: &str = "[[\"Pick\", \"Place\"]]";

/// Each of the seventeen properties notices a fault, and each fault of a drive or of a placement is
/// noticed.
#[test]
fn every_property_of_the_whole_task_notices_a_fault() {
    let folder = tempfile::tempdir().unwrap();
    let faults: Vec<Fault> = FAULTS
        .into_iter()
        .filter(|fault| {
            let of_pick = fault.sabotage.actions == ["Pick"] && fault.name != "neighbour-falls";
            !of_pick && fault.name != "frozen-sensors" && !fault.sabotage.needs_load()
        })
        .collect();
    let mut asked = Vec::new();
    let mut tried = Vec::new();
    // Without a grasp, the coarsest physics is enough.
    for (tests, physics) in [(LOOKS, COARSEST), (GRASPS, COARSE)] {
        std::fs::write(
            folder.path().join("task.toml"),
            format!("tests = {tests}\n{TASK}{physics}"),
        )
        .unwrap();
        let env = Env::prepare(&folder.path().join("task.toml"), &Overrides::default()).unwrap();
        asked.extend(properties(&env));
        // Scenes of different tests have different indices.
        let before = tried
            .iter()
            .map(|trial: &Trial| trial.index + 1)
            .max()
            .unwrap_or(0);
        tried.extend(trials(&env, &faults, 2).into_iter().map(|trial| Trial {
            index: trial.index + before,
            ..trial
        }));
    }
    let matrix = matrix_over(&asked, &faults, &tried);
    assert_eq!(matrix.properties.len(), 17);
    assert_eq!(matrix.gaps("no-op"), [], "{matrix:#?}");
    let noticing = |name: &str| -> Vec<&str> {
        let row = matrix.rows.iter().find(|row| row.fault == name).unwrap();
        let noticing = row
            .cells
            .iter()
            .filter(|cell| cell.notice == Notice::Noticed);
        noticing
            .map(|cell| cell.property.rsplit('#').next().unwrap())
            .collect()
    };
    assert_eq!(noticing("obstacle"), ["NoDriveCollisions"]);
    let carried_off = noticing("carried-off");
    for property in ["GoalReached", "LocalisationAgrees", "StayedInZone"] {
        assert!(carried_off.contains(&property), "{carried_off:?}");
    }
    // The action reports success; only the world shows the fault.
    assert!(noticing("dropped-on-the-way").contains(&"ObjectOnSurface"));
    assert!(!noticing("dropped-on-the-way").contains(&"PlaceReported"));
    assert_eq!(noticing("placed-and-fallen"), ["ObjectOnSurface"]);
    assert!(noticing("hand-jams").contains(&"ObjectReleased"));
    assert_eq!(noticing("place-neighbour-falls"), ["NoPlaceCollisions"]);
    assert_eq!(noticing("other-kind"), ["ObjectsDetected"]);
    assert_eq!(noticing("false-height"), ["ObjectsDetected"]);
    assert!(noticing("sweep").contains(&"ObjectsDetected"));
    let swapped = noticing("percepts-swapped");
    assert!(
        swapped.contains(&"ObjectsDetected") && swapped.contains(&"ObjectInGripper"),
        "{swapped:?}"
    );
}

/// A robot that drives with an object in its hand: it loses it on the way, or pushes another object
/// with it before.
#[test]
fn the_drive_notices_an_object_that_is_lost_or_pushes_another() {
    let folder = tempfile::tempdir().unwrap();
    let faults = named(&["lost-on-the-way", "held-object-pushes"]);
    std::fs::write(
        folder.path().join("task.toml"),
        format!("tests = [[\"Pick\", \"MoveTo\"]]\n{TASK}{COARSE}"),
    )
    .unwrap();
    let env = Env::prepare(&folder.path().join("task.toml"), &Overrides::default()).unwrap();
    let matrix = matrix_over(&properties(&env), &faults, &trials(&env, &faults, 2));
    for row in &matrix.rows {
        let noticing = row
            .cells
            .iter()
            .filter(|cell| cell.notice == Notice::Noticed)
            .map(|cell| cell.property.as_str());
        assert!(row.came_about >= 7, "{matrix:#?}");
        assert!(
            noticing
                .clone()
                .any(|property| property.ends_with("#NoDriveCollisions")),
            "{matrix:#?}"
        );
    }
    // A hand that picked nothing has nothing to lose.
    let drives = [Step::plain("MoveTo")];
    assert!(
        faults
            .iter()
            .all(|fault| !fault.concerns(&drives, &env.campaign.robot.core))
    );
}

/// Adds a variant of the shipped rule that ignores reported failures, so it notices no false report
/// of one.
#[test]
fn a_deliberately_weakened_rule_is_named() {
    let project = project();
    sure(project.path());
    let rules = project.path().join("rules");
    std::fs::copy(rules.join("object_grasped.rq"), rules.join("weak.rq")).unwrap();
    edit(
        &rules.join("weak.rq"),
        "FILTER (?report != \"succeeded\")",
        "FILTER (?report = \"something else\")",
    );
    let ontology = project.path().join("ontology/actions.ttl");
    let text = std::fs::read_to_string(&ontology).unwrap();
    let weak = "\nact:Weak a act:Property ; act:verifiedBy <../rules/weak.rq> .\nact:Pick act:successProperty act:Weak .\n";
    std::fs::write(&ontology, text + weak).unwrap();

    let (env, faults) = (env(project.path(), 8), named(&["no-op", "false-failure"]));
    let trials = trials(&env, &faults, 2);
    let weak = matrix_of(&env, &faults, &trials, |property| {
        !property.ends_with("#ObjectGrasped")
    });
    let gaps = weak.gaps("no-op");
    assert!(
        gaps.contains(&OracleGap::FaultUnnoticed("false-failure".into())),
        "{gaps:?}"
    );
    assert!(
        gaps.contains(&OracleGap::PropertyNoticesNothing(
            "http://actions#Weak".into()
        )),
        "{gaps:?}"
    );
    let noticed = |matrix: &OracleMatrix, property: &str| {
        let cells = matrix.rows.iter().flat_map(|row| &row.cells);
        cells
            .filter(|cell| cell.property.ends_with(property))
            .any(|cell| cell.notice == Notice::Noticed)
    };
    assert!(noticed(&weak, "MovedObject"));
    let shipped = matrix_of(&env, &faults, &trials, |property| {
        !property.ends_with("#Weak")
    });
    assert!(noticed(&shipped, "ObjectGrasped"));
}

#[test]
fn too_few_scenes_are_reported_as_inconclusive() {
    let folder = tempfile::tempdir().unwrap();
    let config = root().join("configs/pick.toml");
    let output = actcheck(
        folder.path(),
        &[
            "check-oracles",
            config.to_str().unwrap(),
            "--runs",
            "1",
            "--format",
            "csv",
        ],
    );
    assert_eq!(output.status.code(), Some(1));
    let (rows, printed) = (stdout(&output), stderr(&output));
    assert_eq!(rows.lines().count(), 1 + 5 * of_pick(), "{rows}");
    assert!(
        rows.lines().skip(1).all(|line| line.ends_with(",too few")),
        "{rows}"
    );
    assert!(
        printed.contains("V003") && printed.contains("V004") && printed.contains("--runs"),
        "{printed}"
    );
    assert!(
        !printed.contains("V001") && !printed.contains("V002"),
        "too few scenes must not prove a gap:\n{printed}"
    );
    // Sabotaged runs are not counted among the robot's runs.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let missing = actcheck(folder.path(), &["check-oracles", "nowhere.toml"]);
    assert_eq!(missing.status.code(), Some(2));
}

/// Sabotage that changes neither the robot nor the world leaves every bit of every state unchanged.
#[test]
fn false_reports_do_not_change_the_physics() {
    let env = env(root(), 2);
    let choices = || Choices::random(env.campaign.seed, 0);
    let sound = run_line(&env, "k", 0, choices(), &CONTEXT).unwrap();
    let mut saboteur = Saboteur::new(Sabotage {
        actions: &[],
        robot: None,
        world: None,
        report: Some(false),
    });
    let lied = run_sabotaged(
        &env,
        RunInput {
            campaign: "k",
            index: 0,
            choices: choices(),
        },
        &CONTEXT,
        &mut saboteur,
    )
    .unwrap();
    assert_eq!(lied.trace.hash, sound.trace.hash);
    assert_eq!(lied.choices, sound.choices);
    let reported = |record: &actcheck::history::RunRecord| {
        record.trace.actions[0].report.clone().unwrap().succeeded
    };
    assert_eq!(
        (reported(&sound), reported(&lied), saboteur.came_about()),
        (true, false, true)
    );
}

#[test]
fn faults_are_the_same_for_any_number_of_workers() {
    let project = project();
    sure(project.path());
    let env = env(project.path(), 2);
    let faults = named(&["release", "wrong-object"]);
    assert_eq!(trials(&env, &faults, 1), trials(&env, &faults, 2));
}
