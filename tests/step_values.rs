//! Values of designators that a test gives to single actions.

use std::collections::BTreeSet;

use actcheck::base::Outcome;
use actcheck::campaign::Env;
use actcheck::config::Step;
use actcheck::data::{ChoiceName, Choices, Role};
use actcheck::history::RunRecord;
use serde_json::Value;

use crate::support::line::{env_of, nominal, report, run};
use crate::support::{COARSE, actcheck, edit, project, stderr, stdout};

/// A glass and two cans, and a second table.
fn env(test: &str) -> Env {
    env_of(&format!(
        "tests = [{test}]\ntest_count = 1\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [placeSurface]\nplace_object_surfaces = [\"table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
        [surfaceObjects]\nmodel_list = [\"can\"]\ncount = 2\n"
    ))
}

/// The value of a designator in an action of a run.
fn value<'a>(run: &'a RunRecord, step: usize, designator: &str) -> &'a str {
    &run.trace.actions[step].parameters[designator][0]
}

const OTHER: &str =
    "[\"Pick\", \"Place\", { action = \"Pick\", pickObject = \"other\" }, \"Place\"]";

#[test]
fn another_object_is_picked_and_placed_and_judged() {
    let env = env(OTHER);
    let run = nominal(&env, None);
    let values: Vec<&str> = (0..4).map(|step| value(&run, step, "pickObject")).collect();
    // The value holds for the later placement, too.
    assert_eq!(values[..2], ["glass_1", "glass_1"]);
    assert!(
        values[2].starts_with("can_") && values[3] == values[2],
        "{values:?}"
    );
    for (step, judgements) in run.judgements.iter().enumerate() {
        let passed = judgements
            .iter()
            .filter(|judgement| judgement.outcome == Outcome::Passed)
            .count();
        assert!(
            passed + 1 >= judgements.len(),
            "{}: {judgements:?}",
            report(&run, step).message
        );
    }
    assert_eq!(run.test, "Pick Place Pick(pickObject=other) Place");
    // The first target is now one of the things that must not be harmed, and the second one no
    // more.
    let others: BTreeSet<&str> = run.trace.actions[2].parameters["surfaceObjects"]
        .iter()
        .map(String::as_str)
        .collect();
    assert!(
        others.contains("glass_1") && !others.contains(values[2]),
        "{others:?}"
    );
}

#[test]
fn the_other_object_is_a_recorded_choice() {
    let env = env(OTHER);
    let mut drawn = BTreeSet::new();
    for index in 0..8 {
        let mut choices = Choices::random(5, index);
        let scene = actcheck::scenario::draw(&env.space, 0, &mut choices).unwrap();
        let name = ChoiceName::Step {
            number: 3,
            designator: "pickObject".to_owned(),
        };
        let made = choices.into_made();
        let choice = made
            .iter()
            .find(|choice| choice.name == name)
            .expect("no choice of the third action's object");
        assert_eq!(choice.name.to_string(), "step.3.pickObject");
        let chosen = scene.steps[2]["pickObject"][0].clone();
        let object = scene
            .objects
            .iter()
            .find(|object| object.id == chosen)
            .unwrap();
        assert_eq!(object.role, Role::Other);
        drawn.insert(chosen);
        // The same choices give the same object.
        let again = actcheck::scenario::draw(&env.space, 0, &mut Choices::recorded(&made)).unwrap();
        assert_eq!(again.steps, scene.steps);
    }
    assert_eq!(drawn.into_iter().collect::<Vec<_>>(), ["can_1", "can_2"]);
}

/// Names of actions give the same scenes, choices and names of tests as before, and so do tables
/// without values.
#[test]
fn plain_actions_keep_their_bits() {
    let [plain, table] = [
        "[\"Pick\", \"Place\"]",
        "[{ action = \"Pick\" }, { action = \"Place\" }]",
    ]
    .map(env);
    let [first, second] = [&plain, &table].map(|env| run(env, Choices::random(3, 1), None));
    assert_eq!(first.trace, second.trace);
    assert_eq!(first.choices, second.choices);
    assert_eq!(
        (first.test.as_str(), second.test.as_str()),
        ("Pick Place", "Pick Place")
    );
    assert!(
        !first
            .choices
            .iter()
            .any(|choice| matches!(choice.name, ChoiceName::Step { .. })),
        "{:?}",
        first.choices
    );
    assert_eq!(plain.campaign.tests[0], ["Pick", "Place"].map(Step::plain));
}

#[test]
fn models_ids_and_places_are_values() {
    let of = |value: &str| {
        format!("[\"Pick\", \"Place\", {{ action = \"Pick\", pickObject = \"{value}\" }}]")
    };
    for (written, found) in [
        ("can", "can_1"),
        ("can_2", "can_2"),
        ("target", "glass_1"),
        ("glass", "glass_1"),
    ] {
        let env = env(&of(written));
        let scene = actcheck::scenario::draw(&env.space, 0, &mut Choices::recorded(&[])).unwrap();
        assert_eq!(scene.steps[2]["pickObject"], [found], "{written}");
        assert_eq!(scene.designators["pickObject"], ["glass_1"], "{written}");
    }
    // The object is put back on its own table.
    let env = env("[\"Pick\", { action = \"Place\", placeSurface = \"objectSurface\" }]");
    let scene = actcheck::scenario::draw(&env.space, 0, &mut Choices::recorded(&[])).unwrap();
    assert_eq!(
        scene.steps[1]["placeSurface"],
        scene.designators["objectSurface"]
    );
    assert_eq!(
        scene.steps[0]["placeSurface"],
        scene.designators["placeSurface"]
    );
}

fn json(folder: &std::path::Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

/// A history keeps the values: `list`, `show`, `replay`, `export-case` and `shrink` know them.
#[test]
fn commands_follow_a_run_with_values() {
    let project = project();
    let folder = project.path();
    let text = format!(
        "tests = [[\"Pick\"], [{{ action = \"Pick\", pickObject = \"other\" }}]]\ntest_count = 1\nseed = 7\n\
        [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
        [surfaceObjects]\nmodel_list = [\"can\"]\ncount = 2\n{COARSE}"
    );
    std::fs::write(folder.join("c.toml"), text).unwrap();
    let checked = actcheck(folder, &["check", "c.toml"]);
    assert!(checked.status.success(), "{}", stderr(&checked));
    let ran = actcheck(folder, &["run", "c.toml", "--jobs", "1", "--history", "h"]);
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    let listed = json(folder, &["list", "--history", "h"]);
    let row = listed
        .as_array()
        .unwrap()
        .iter()
        .find(|row| row["test"] == "Pick(pickObject=other)")
        .expect("the test");
    let id = row["run"].as_str().unwrap();
    let run = json(folder, &["show", id, "--history", "h"]);
    assert_eq!(
        run["designators"]["pickObject"],
        serde_json::json!(["glass_1"])
    );
    let picked = run["actions"][0]["parameters"]["pickObject"][0]
        .as_str()
        .unwrap();
    assert!(picked.starts_with("can_"), "{run:#}");
    let shown = stdout(&actcheck(folder, &["show", id, "--history", "h"]));
    assert!(
        shown.contains(&format!(
            "1. Pick with pickObject = {picked}; surfaceObjects = "
        )),
        "{shown}"
    );
    let replayed = actcheck(folder, &["replay", id, "--history", "h"]);
    assert!(
        replayed.status.success(),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

#[test]
fn cases_keep_the_values() {
    let project = project();
    let folder = project.path();
    let config = folder.join("configs/pick.toml");
    edit(
        &config,
        "tests = [[\"Pick\"]]",
        "tests = [[{ action = \"Pick\", pickObject = \"other\" }]]",
    );
    // More than any pick moves an object: all picks fail.
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d > 2.0",
    );
    let ran = actcheck(
        folder,
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            "1",
            "--jobs",
            "1",
            "--history",
            "h",
        ],
    );
    assert_eq!(ran.status.code(), Some(1), "{}", stderr(&ran));
    let listed = json(folder, &["list", "--history", "h"]);
    let id = listed[0]["run"].as_str().unwrap();
    let exported = actcheck(
        folder,
        &["export", "run", id, "--history", "h", "-o", "case.toml"],
    );
    assert!(exported.status.success(), "{}", stderr(&exported));
    let case = std::fs::read_to_string(folder.join("case.toml")).unwrap();
    assert!(
        case.contains("pickObject = \"other\"") && case.contains("\nstep.1.pickObject = \""),
        "{case}"
    );
    let again = actcheck(folder, &["run", "case.toml", "--history", "h2"]);
    assert!(
        stdout(&again).contains("same trace"),
        "{}{}",
        stdout(&again),
        stderr(&again)
    );
}
