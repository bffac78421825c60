//! Replay of stored runs, with the built program.

use std::path::Path;

use serde_json::Value;

use crate::support::look::looking;
use crate::support::{actcheck, edit, project, stderr, stdout};

/// The only campaign of a new history, with the given number of runs of the shipped pick.
fn campaign(folder: &Path, runs: &str) -> String {
    let output = actcheck(
        folder,
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            runs,
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    json["campaign"].as_str().unwrap().to_owned()
}

fn replayed(folder: &Path, arguments: &[&str]) -> (i32, Value) {
    let mut all = vec!["replay", "--history", "h", "--format", "json"];
    all.extend(arguments);
    let output = actcheck(folder, &all);
    let json =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    (output.status.code().unwrap(), json)
}

#[test]
fn replay_reproduces_stored_runs_in_a_new_process_with_any_number_of_workers() {
    let project = project();
    let id = campaign(project.path(), "6");
    let (code, one) = replayed(
        project.path(),
        &["--campaign", &id, "--jobs", "1", "--exact"],
    );
    let (_, two) = replayed(project.path(), &["--campaign", &id, "--jobs", "2"]);
    assert_eq!(code, 0, "{one:#}");
    assert_eq!(one, two);
    let runs = one.as_array().unwrap();
    assert_eq!(runs.len(), 6);
    for run in runs {
        assert_eq!(run["same"], true, "{run:#}");
        assert_eq!(run["outcomes"].as_array().unwrap().len(), 0, "{run:#}");
        assert_eq!(run["changes"].as_array().unwrap().len(), 0, "{run:#}");
    }
    let text = actcheck(
        project.path(),
        &["replay", &format!("{id}-1"), "--history", "h"],
    );
    assert!(
        stdout(&text).contains("the same, every bit of every state"),
        "{}",
        stdout(&text)
    );
}

#[test]
fn random_runs_are_the_same_with_one_and_two_workers() {
    let project = looking();
    let arguments = ["run", "configs/look.toml", "--runs", "12", "--history", "h"];
    assert_ne!(actcheck(project.path(), &arguments).status.code(), Some(2));
    let (code, one) = replayed(
        project.path(),
        &["--sample", "10", "--jobs", "1", "--exact"],
    );
    let (_, two) = replayed(
        project.path(),
        &["--sample", "10", "--jobs", "2", "--exact"],
    );
    assert_eq!((code, &one), (0, &two), "{one:#}");
    let runs = one.as_array().unwrap();
    assert_eq!(runs.iter().filter(|run| run["same"] == true).count(), 10);
    let (_, other) = replayed(project.path(), &["--sample", "2", "--seed", "1"]);
    let names = |list: &Value| {
        list.as_array()
            .unwrap()
            .iter()
            .map(|run| run["run"].clone())
            .collect::<Vec<_>>()
    };
    assert_ne!(
        names(&other),
        names(&replayed(project.path(), &["--sample", "2", "--seed", "2"]).1)
    );
    let digest = [
        "query",
        "SELECT ?d WHERE { ?c act:programDigest ?d }",
        "--history",
        "h",
        "--format",
        "csv",
    ];
    let answer = stdout(&actcheck(project.path(), &digest));
    assert!(
        answer
            .lines()
            .nth(1)
            .is_some_and(|digest| digest.len() == 32),
        "{answer}"
    );
}

#[test]
fn a_changed_model_is_named_with_the_first_difference() {
    let project = project();
    let id = campaign(project.path(), "1");
    let run = format!("{id}-1");
    edit(
        &project.path().join("models/objects/glass.toml"),
        "mass_kg = ",
        "mass_kg = 1",
    );
    let (code, json) = replayed(project.path(), &[&run, "--exact"]);
    assert_eq!(code, 1, "{json:#}");
    let replay = &json[0];
    assert_eq!(replay["same"], false);
    assert_eq!(replay["difference"]["body"], "glass_1", "{replay:#}");
    assert_eq!(replay["difference"]["quantity"], "mass", "{replay:#}");
    assert!(
        replay["difference"]["by"].as_f64().unwrap() > 0.0,
        "{replay:#}"
    );
    let changes = replay["changes"].as_array().unwrap();
    assert_eq!(changes.len(), 1, "{replay:#}");
    assert_eq!(
        (changes[0]["kind"].as_str(), changes[0]["name"].as_str()),
        (Some("model"), Some("glass"))
    );
    assert_ne!(changes[0]["was"], changes[0]["is"]);
    let text = stdout(&actcheck(
        project.path(),
        &["replay", &run, "--history", "h"],
    ));
    assert!(
        text.contains("mass of glass_1") && text.contains("changed since: model `glass`"),
        "{text}"
    );
}

#[test]
fn mismatched_choices_are_refused_by_name_or_clamped() {
    let project = project();
    let run = format!("{}-1", campaign(project.path(), "1"));
    let other = project.path().join("configs/other.toml");
    std::fs::copy(project.path().join("configs/pick.toml"), &other).unwrap();
    edit(&other, "mass_scale = [0.7, 1.3]", "mass_scale = [2.0, 3.0]");
    let config = ["--config", "configs/other.toml"];
    let exact = actcheck(
        project.path(),
        &[
            "replay",
            &run,
            "--history",
            "h",
            config[0],
            config[1],
            "--exact",
        ],
    );
    assert_eq!(exact.status.code(), Some(2));
    assert!(
        stderr(&exact).contains("S042") && stderr(&exact).contains("target.mass_scale"),
        "{}",
        stderr(&exact)
    );
    let (code, json) = replayed(project.path(), &[&run, config[0], config[1]]);
    assert_eq!(code, 1, "{json:#}");
    let choices = json[0]["choices"].to_string();
    assert!(
        choices.contains("`target.mass_scale` was") && choices.contains("is 2"),
        "{choices}"
    );
    assert_eq!(json[0]["changes"][0]["kind"], "configuration", "{json:#}");
}

#[test]
fn other_rules_change_outcomes_but_not_the_trace() {
    let project = project();
    let id = campaign(project.path(), "3");
    let rule = project.path().join("rules/moved_object.rls");
    std::fs::write(
        &rule,
        "@prefix w: <https://w3id.org/actcheck/world#> .\n\
         % The pick takes less than a tenth of a second. (No robot is that fast.)\n\
         success(?d) :- during(w:action, w:duration, ?d), ?d < 0.1 .\n",
    )
    .unwrap();
    let (code, json) = replayed(project.path(), &["--campaign", &id]);
    assert_eq!(code, 0, "{json:#}");
    let changed: Vec<&Value> = json
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|run| run["outcomes"].as_array().unwrap())
        .collect();
    assert!(
        changed
            .iter()
            .any(|change| change["was"] == "passed" && change["is"] == "failed"),
        "{json:#}"
    );
    assert_eq!(json[0]["changes"][0]["kind"], "rule", "{json:#}");
}

#[test]
fn runs_that_cannot_be_replayed_are_refused_with_the_reason() {
    let project = project();
    // A shipped model would take the place of one of its name.
    let objects = project.path().join("models/objects");
    std::fs::rename(objects.join("glass.toml"), objects.join("tumbler.toml")).unwrap();
    edit(
        &project.path().join("configs/pick.toml"),
        "[\"glass\"]",
        "[\"tumbler\"]",
    );
    let run = format!("{}-1", campaign(project.path(), "1"));
    let unknown = actcheck(project.path(), &["replay", "zzzz-9", "--history", "h"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(stderr(&unknown).contains("H008"), "{}", stderr(&unknown));
    let none = actcheck(
        project.path(),
        &["replay", "--campaign", "zzzz", "--history", "h"],
    );
    assert_eq!(none.status.code(), Some(2));
    assert!(stderr(&none).contains("H014"), "{}", stderr(&none));
    std::fs::remove_file(objects.join("tumbler.toml")).unwrap();
    let gone = actcheck(project.path(), &["replay", &run, "--history", "h"]);
    assert_eq!(gone.status.code(), Some(2));
    assert!(stderr(&gone).contains("tumbler"), "{}", stderr(&gone));
}
