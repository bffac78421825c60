//! Placing the picked object, from scenes to verdicts, based only on vision and touch.

use actcheck::base::Outcome;
use actcheck::campaign::{Disturbance, Env};
use actcheck::data::{ChoiceName, Choices, ObjectAxis, PlacedObject, Pose};
use actcheck::history::RunRecord;
use actcheck::verdict::action_score;
use actcheck::world::{Perturbation, Poison, World};
use serde_json::Value;

use crate::support::line::{env_of, nominal, outcomes, report, run};
use crate::support::{COARSE, actcheck, edit, project, stderr, stdout};

/// Two tables, a glass on the first, and further configuration text from the test.
fn env(actions: &str, more: &str) -> Env {
    env_of(&format!(
        "tests = [{actions}]\ntest_count = 1\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [placeSurface]\nplace_object_surfaces = [\"table\"]\n[pickObject]\nmodel_list = [\"glass\", \"can\"]\n{more}"
    ))
}

/// The nominal scene with a given target model, by its index.
fn with_target(env: &Env, model: usize) -> RunRecord {
    let mut choices = Choices::recorded(&[]);
    choices.index(
        ChoiceName::Object(PlacedObject::Target, ObjectAxis::Model),
        2,
    );
    let mut made = choices.into_made();
    made[0].value = model as f64;
    run(env, Choices::recorded(&made), None)
}

fn all_passed(run: &RunRecord, step: usize) {
    assert_eq!(
        outcomes(run, step).len(),
        if step + 1 == run.judgements.len() {
            4
        } else {
            5
        }
    );
    let context = format!("{}: {:?}", report(run, step).message, run.judgements[step]);
    assert!(
        outcomes(run, step)
            .values()
            .all(|outcome| *outcome == Outcome::Passed),
        "{context}"
    );
}

/// The final pose of a body.
fn at_end(run: &RunRecord, id: &str) -> Pose {
    let last = run.trace.snapshots.last().unwrap();
    last.bodies.iter().find(|body| body.id == id).unwrap().pose
}

#[test]
fn a_picked_object_is_placed_on_the_other_table() {
    let env = env("[\"Pick\", \"Place\"]", "");
    for (model, id) in ["glass_1", "can_1"].into_iter().enumerate() {
        let run = with_target(&env, model);
        all_passed(&run, 0);
        all_passed(&run, 1);
        let end = at_end(&run, id);
        assert!((end.position[2] - 0.74).abs() < 0.003, "{end:?}");
        assert!(
            report(&run, 1)
                .message
                .starts_with(&format!("set {id} down on table_1")),
            "{}",
            report(&run, 1).message
        );
    }
}

#[test]
fn after_a_look_around_the_goal_is_found_in_pictures() {
    let env = env("[\"PerceivePlane\", \"Pick\", \"Place\"]", "");
    let run = nominal(&env, None);
    all_passed(&run, 2);
    let looks = run.trace.actions[2]
        .phases
        .iter()
        .filter(|phase| phase.name.starts_with("look"))
        .count();
    assert!(looks >= 2, "{:?}", run.trace.actions[2].phases);
}

#[test]
fn an_empty_hand_reports_failure_at_once() {
    // Without its precondition, which keeps the action from being performed.
    let mut env = env("[\"Place\"]", "");
    env.ontology
        .actions
        .get_mut("Place")
        .unwrap()
        .preconditions
        .clear();
    let run = nominal(&env, None);
    assert_eq!(
        report(&run, 0).message,
        "nothing is in the hand: glass_1 can't be placed"
    );
    assert!(run.trace.actions[0].duration_secs < 1.0);
    let outcomes = outcomes(&run, 0);
    assert_eq!(
        (outcomes["PlaceReported"], outcomes["ObjectOnSurface"]),
        (Outcome::Failed, Outcome::Failed)
    );
    // An object that was not held can't be released, and a robot that does not move can't hit
    // anything: neither counts for the score.
    let inapplicable = (Outcome::Inapplicable, Outcome::Inapplicable);
    assert_eq!(
        (outcomes["ObjectReleased"], outcomes["NoPlaceCollisions"]),
        inapplicable
    );
    assert_eq!(action_score(outcomes.values().copied()), 0.0);
    let witness = |name: &str| {
        &run.judgements[0]
            .iter()
            .find(|found| found.property.ends_with(name))
            .unwrap()
            .witness
    };
    assert_eq!(witness("NoPlaceCollisions"), "the robot did not move");
    assert_eq!(
        witness("ObjectReleased"),
        "the gripper did not hold glass_1 before the action"
    );
}

/// Sensors see the goal table half a metre farther to the side and 5 cm higher than it is.
fn deceive(_: u64, world: &mut World) {
    let decoy = Pose::upright([0.0, 2.41, 0.05], 0.0);
    assert!(world.poison("table_1", Poison::Decoy(decoy)));
}

/// The same, only 5 cm higher: its position agrees with the floor plan.
fn raise(_: u64, world: &mut World) {
    let decoy = Pose::upright([0.0, 1.91, 0.05], 0.0);
    assert!(world.poison("table_1", Poison::Decoy(decoy)));
}

#[test]
fn placing_acts_on_percepts_not_on_the_truth() {
    let cases: [(&str, Disturbance); 2] = [
        ("[\"Pick\", \"Place\"]", deceive),
        ("[\"PerceivePlane\", \"Pick\", \"Place\"]", raise),
    ];
    for (actions, disturb) in cases {
        let env = env(actions, "");
        let run = nominal(&env, Some(disturb));
        let last = run.trace.actions.len() - 1;
        // The hand opens at the perceived table: the glass falls, and no contact was felt below it.
        assert!(
            !report(&run, last).succeeded,
            "{}",
            report(&run, last).message
        );
        assert!(
            report(&run, last).message.contains("was not felt"),
            "{}",
            report(&run, last).message
        );
        assert_eq!(outcomes(&run, last)["PlaceReported"], Outcome::Failed);
    }
    let run = nominal(&env("[\"Pick\", \"Place\"]", ""), Some(deceive));
    let seen = run.trace.actions[1]
        .percepts
        .iter()
        .find(|percept| percept.id == "table_1")
        .unwrap();
    assert_eq!((seen.pose.position[1], seen.pose.position[2]), (2.41, 0.05));
}

/// The whole task with an obstacle on the floor, with pictures.
const TASK: &str = "[\"MoveTo\", \"PerceivePlane\", \"Pick\", \"Place\"]";
const OBSTACLES: &str = "[surfaceObjects]\nmodel_list = [\"can\"]\ncount = 2\n";

/// A robot that uses its camera uses no other perception: the output and errors of the abstract
/// detector change nothing, and it is never queried.
#[test]
fn a_camera_replaces_the_abstract_detector() {
    let of = |index: u64, sensing: &str| {
        let text = format!(
            "nav_obstacle_list = [\"bottle\", \"mini_coffee_table\"]\nnav_obstacle_count = 4\n\
            tests = [{TASK}]\ntest_count = 1\nseed = 5\n[objectLocation]\nlocation_list = [\"front\"]\n\
            [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[placeSurface]\nplace_object_surfaces = [\"table\"]\n[pickObject]\nmodel_list = [\"glass\", \"can\"]\n\
            {OBSTACLES}{COARSE}{sensing}"
        );
        run(&env_of(&text), Choices::random(5, index), None)
    };
    let looks_where_to_place = |run: &RunRecord| {
        run.trace.actions[3]
            .phases
            .iter()
            .any(|phase| phase.name == "look")
    };
    let quiet = (0..12)
        .map(|index| (index, of(index, "")))
        .find(|(_, run)| looks_where_to_place(run));
    let (index, quiet) = quiet.expect("in no run did the robot look at the goal of a placement");
    let noise = "[sensing]\nposition_noise_m = 0.4\nheight_noise_m = 0.4\nyaw_noise_rad = 1.5\nsize_noise_m = 0.4\n";
    let noisy = of(index, noise);
    let ids = || {
        quiet
            .scene
            .objects
            .iter()
            .map(|object| format!("sense.{}.", object.id))
    };
    let asked: Vec<String> = noisy
        .choices
        .iter()
        .map(|choice| choice.name.to_string())
        .collect();
    assert!(
        !asked
            .iter()
            .any(|name| ids().any(|id| name.starts_with(&id))),
        "{asked:?}"
    );
    assert_eq!(quiet.trace.hash, noisy.trace.hash);
    let percepts = quiet
        .trace
        .actions
        .iter()
        .flat_map(|action| &action.percepts);
    let targets = &quiet.scene.designators["pickObject"];
    assert!(
        percepts
            .clone()
            .all(|percept| targets.contains(&percept.id)),
        "{:?}",
        percepts.collect::<Vec<_>>()
    );
}

/// The glass has no friction.
fn oil(_: u64, world: &mut World) {
    assert!(world.perturb("glass_1", Perturbation::Friction(0.0)));
}

#[test]
fn a_slipping_object_is_felt_and_not_placed() {
    let mut env = env("[\"Pick\", \"Place\"]", "");
    env.ontology
        .actions
        .get_mut("Place")
        .unwrap()
        .preconditions
        .clear();
    let run = nominal(&env, Some(oil));
    assert!(
        report(&run, 0).message.contains("slipped out of the hand"),
        "{}",
        report(&run, 0).message
    );
    assert_eq!(outcomes(&run, 0)["ObjectGrasped"], Outcome::Failed);
    assert_eq!(
        report(&run, 1).message,
        "nothing is in the hand: glass_1 can't be placed"
    );
}

fn json(folder: &std::path::Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

/// (`determinism` tests that the number of workers changes nothing.)
#[test]
fn the_whole_task_is_reported_by_action() {
    let project = project();
    let output = actcheck(
        project.path(),
        &[
            "run",
            "configs/pick_and_place.toml",
            "--runs",
            "2",
            "--history",
            "text",
        ],
    );
    let text = stdout(&output);
    for title in [
        "A1 MoveTo",
        "A2 PerceivePlane",
        "A3 Pick",
        "A4 Place",
        "mean",
    ] {
        assert!(text.contains(title), "{title} is missing:\n{text}");
    }
    // Seventeen properties, by action.
    let lines = |line: &&str| line.contains(" % [");
    assert_eq!(
        text.lines()
            .skip_while(|line| !line.contains("pass rate"))
            .filter(lines)
            .take(17)
            .count(),
        17
    );
    let listed = json(project.path(), &["list", "--history", "text"]);
    let statuses = listed
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["status"].clone())
        .collect::<Vec<_>>();
    assert_eq!(statuses, ["completed", "completed"], "{text}");
}

/// Without obstacles, clutter and noise, the task succeeds as a whole.
#[test]
fn without_noise_clutter_and_obstacles_nearly_all_runs_pass() {
    let project = project();
    let config = project.path().join("configs/pick_and_place.toml");
    edit(&config, "nav_obstacle_count = 5", "nav_obstacle_count = 0");
    edit(
        &config,
        "\ncount = [1, 4] # next to the target",
        "\ncount = 0",
    );
    edit(&config, "\ncount = [1, 4] # on this surface", "\ncount = 0");
    let text = std::fs::read_to_string(&config).unwrap();
    // All noise is stated as `…_noise…`, `…_drift` or `dropout`.
    let is_noise = |line: &str| {
        ["_noise", "_drift", "dropout"]
            .iter()
            .any(|word| line.split('=').next().unwrap().contains(word))
    };
    let quiet: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with('#') || !is_noise(line))
        .collect();
    std::fs::write(&config, quiet.join("\n")).unwrap();
    let whole = json(
        project.path(),
        &[
            "run",
            "configs/pick_and_place.toml",
            "--runs",
            "4",
            "--history",
            "h",
        ],
    );
    assert!(whole["score"].as_f64().unwrap() > 0.9, "{whole:#}");
}

#[test]
fn the_same_choices_give_the_same_placement() {
    let noise = "[sensing]\nposition_noise_m = 0.02\nheight_noise_m = 0.01\nyaw_noise_rad = 0.05\n\
        localisation_noise_m = 0.01\ngripper_noise_m = 0.001\n";
    let env = env("[\"Pick\", \"Place\"]", noise);
    let first = run(&env, Choices::random(3, 0), None);
    let again = run(&env, Choices::recorded(&first.choices), None);
    assert_eq!(first.trace, again.trace);
}
