//! A killed campaign resumes with the same results as an uninterrupted one.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use actcheck::history::History;
use serde_json::Value;

use crate::support::look::looking;
use crate::support::{actcheck, edit, project, signal, stderr, stdout};

/// A look at a crowded small table, with some discarded scenes: runs that end within moments of
/// each other.
const CROWDED: &str = "tests = [[\"PerceivePlane\"]]\ntest_count = 24\nseed = 3\nontology = \"../ontology/actions.ttl\"\n\
    model_dir = \"../models\"\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\n\
    model_list = [\"glass\"]\n[surfaceObjects]\nmodel_list = [\"bottle\", \"plate\", \"bowl\", \"mug\"]\n\
    count = [6, 9]\n[camera]\nwidth = 80\nheight = 60\n";

fn crowded() -> tempfile::TempDir {
    let project = project();
    std::fs::write(project.path().join("configs/crowded.toml"), CROWDED).unwrap();
    project
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    let text = stdout(&output);
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", stderr(&output)))
}

fn listed(folder: &Path, history: &str) -> String {
    let output = actcheck(folder, &["list", "--history", history, "--format", "csv"]);
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
}

/// The number of stored runs.
fn stored(folder: &Path, history: &str) -> u64 {
    History::count_runs(&folder.join(history))
}

/// The summary without its paths: all outcomes, margins, witnesses, scores and discards.
fn without_place(mut summary: Value) -> Value {
    let history = summary.as_object_mut().unwrap().remove("history").unwrap();
    // Suggested commands name the history.
    let named = format!("--history {}", history.as_str().unwrap());
    let mut summary: Value =
        serde_json::from_str(&summary.to_string().replace(&named, "--history H")).unwrap();
    // The duration of runs is not part of the result.
    if let Some(health) = summary["health"].as_object_mut() {
        health.retain(|key, _| !key.starts_with("wall_"));
    }
    summary
}

/// The discards in the history, run by run.
fn discards(folder: &Path, history: &str) -> String {
    let query = "SELECT ?run ?n ?attempt ?reason WHERE { ?run act:discards ?n ; a act:Run \
                 OPTIONAL { ?d act:ofRun ?run ; a act:Discard ; act:attempt ?attempt ; act:reason ?reason } } \
                 ORDER BY ?run ?attempt";
    stdout(&actcheck(
        folder,
        &["query", "--history", history, "--format", "csv", query],
    ))
}

/// Twenty kills at pseudo-random moments: some before the first run, some within a run, some within
/// a write. The campaign equals an uninterrupted one bit by bit.
#[test]
fn twenty_kills_do_not_change_the_results() {
    let project = crowded();
    let folder = project.path();
    let whole = json(
        folder,
        &[
            "run",
            "configs/crowded.toml",
            "--history",
            "whole",
            "--jobs",
            "2",
        ],
    );
    let (expected, expected_discards) = (listed(folder, "whole"), discards(folder, "whole"));
    assert!(
        whole["discarded_scenes"].as_u64().unwrap() > 0,
        "the scenes are too spacious for this test"
    );
    let (mut kills, mut round, mut state) = (0, 0, 88_172_645_463_325_252_u64);
    while kills < 20 {
        round += 1;
        let history = format!("h{round}");
        let begin = [
            "run",
            "configs/crowded.toml",
            "--jobs",
            "2",
            "--history",
            &history,
        ];
        let go_on = ["run", "--resume", "--jobs", "2", "--history", &history];
        let mut before = 0;
        while kills < 20 && before < 20 {
            // A campaign that was killed before it was recorded can't be resumed, only started.
            let begun = folder.join(&history).join("VERSION").exists() && {
                let asked = "SELECT ?c WHERE { ?c a act:Campaign }";
                let known = actcheck(
                    folder,
                    &["query", "--history", &history, "--format", "csv", asked],
                );
                stdout(&known).lines().count() > 1
            };
            let mut child = start(folder, if begun { &go_on } else { &begin });
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            // Every third kill may come before there is a new run; the others wait for one, so that
            // the test ends.
            let started = Instant::now();
            while state % 3 != 0
                && stored(folder, &history) <= before
                && started.elapsed() < Duration::from_secs(60)
            {
                std::thread::sleep(Duration::from_millis(5));
            }
            std::thread::sleep(Duration::from_millis(state % 120));
            if child.try_wait().unwrap().is_some() {
                break;
            }
            child.kill().unwrap();
            child.wait().unwrap();
            kills += 1;
            before = stored(folder, &history);
        }
        let resumed = actcheck(folder, &[&go_on[..], &["--format", "json"]].concat());
        let text = stdout(&resumed);
        if resumed.status.code() == Some(2) {
            // The campaign had finished before the last kill.
            assert!(
                stderr(&resumed).contains("no unfinished campaign"),
                "{}",
                stderr(&resumed)
            );
        } else {
            let summary: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(
                without_place(summary),
                without_place(whole.clone()),
                "round {round}"
            );
        }
        assert_eq!(listed(folder, &history), expected, "round {round}");
        assert_eq!(
            discards(folder, &history),
            expected_discards,
            "round {round}"
        );
        assert_eq!(
            stored(folder, &history),
            24,
            "a run was stored twice, or was lost, in round {round}"
        );
        let (found, read) = History::examine(&folder.join(&history)).unwrap();
        assert_eq!(
            (found.damage, found.runs),
            (Vec::new(), 24),
            "round {round}"
        );
        let warning = read.tail_warning().unwrap();
        assert!(warning.is_none(), "round {round}: {warning:?}");
    }
    println!("{kills} kills in {round} campaigns");
}

/// Ctrl-C keeps the runs in flight, and the campaign resumes with another number of workers;
/// budgets count the earlier runs.
#[test]
fn an_interrupted_campaign_resumes_with_its_budgets() {
    let project = looking();
    let budgets = ["--runs", "90", "--max-failures", "20", "--seed", "11"];
    assert_eq!(
        interrupted_and_resumed(project.path(), &budgets)["ended_by"],
        "failures"
    );
    // Campaigns are found by the path of their configuration; another configuration has none here.
    let other = actcheck(
        project.path(),
        &["run", "configs/clutter.toml", "--resume", "--history", "h"],
    );
    assert_eq!(other.status.code(), Some(2));
    assert!(
        stderr(&other).contains("X050") && stderr(&other).contains("clutter.toml"),
        "{}",
        stderr(&other)
    );
}

/// A guided search depends on the results of earlier scenes; those before the interruption count as
/// usual.
#[test]
fn an_interrupted_search_resumes_with_the_same_scenes() {
    let project = looking();
    let search = ["--runs", "30", "--strategy", "cross-entropy", "--seed", "5"];
    let whole = interrupted_and_resumed(project.path(), &search);
    assert_eq!(
        (&whole["finished_runs"], &whole["ended_by"]),
        (&Value::from(30), &Value::Null)
    );
}

/// Runs a campaign without interruption, and again with a Ctrl-C and another number of workers.
/// Both must give the same results. Returns the summary.
fn interrupted_and_resumed(folder: &Path, options: &[&str]) -> Value {
    let whole = json(
        folder,
        &[
            &["run", "configs/look.toml", "--history", "whole"][..],
            options,
        ]
        .concat(),
    );
    assert_eq!(whole["interrupted"], false);
    let begin = [
        &["run", "configs/look.toml", "--history", "h", "--jobs", "1"][..],
        options,
    ]
    .concat();
    let mut child = start(folder, &begin);
    let started = Instant::now();
    while stored(folder, "h") < 2 {
        assert!(
            started.elapsed() < Duration::from_secs(120),
            "no runs in two minutes"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    signal(child.id(), "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let there = listed(folder, "h").lines().count();
    assert!(
        there > 1 && there < listed(folder, "whole").lines().count(),
        "{there}"
    );
    let resumed = json(
        folder,
        &[
            "run",
            "configs/look.toml",
            "--resume",
            "--history",
            "h",
            "--jobs",
            "2",
        ],
    );
    assert_eq!(without_place(resumed), without_place(whole.clone()));
    assert_eq!(listed(folder, "h"), listed(folder, "whole"));
    whole
}

#[test]
fn campaigns_that_cannot_resume_are_refused_with_the_reason() {
    let project = project();
    let folder = project.path();
    let refused = |arguments: &[&str], words: &[&str]| {
        let output = actcheck(folder, arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        let text = text
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect::<Vec<_>>()
            .join(" ");
        for word in words {
            assert!(text.contains(word), "{arguments:?}: no `{word}` in {text}");
        }
    };
    refused(&["run", "--resume"], &["X002", "this folder has none"]);
    refused(&["run"], &["X014", "needs a configuration"]);
    refused(
        &["run", "configs/pick.toml", "--resume", "--runs", "3"],
        &["--runs"],
    );
    let done = json(
        folder,
        &["run", "configs/pick.toml", "--runs", "1", "--history", "h"],
    );
    let id = done["campaign"].as_str().unwrap();
    refused(
        &["run", "--resume", "--history", "h"],
        &["X050", "has no unfinished campaign"],
    );
    refused(
        &["run", &format!("--resume={id}"), "--history", "h"],
        &["X050", id, "is finished"],
    );
    refused(
        &["run", "--resume=zzzz", "--history", "h"],
        &["H014", "zzzz"],
    );
    let mut child = start(
        folder,
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            "400",
            "--history",
            "h",
        ],
    );
    let started = Instant::now();
    while stored(folder, "h") < 2 {
        assert!(
            started.elapsed() < Duration::from_secs(120),
            "no runs in two minutes"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    refused(
        &["run", "--resume", "--history", "h"],
        &["H002", "another process"],
    );
    child.kill().unwrap();
    child.wait().unwrap();
    edit(
        &folder.join("configs/pick.toml"),
        "position_noise_m = 0.025",
        "position_noise_m = 0.026",
    );
    refused(
        &["run", "--resume", "--history", "h"],
        &["X051", "the configuration `pick` was"],
    );
    edit(
        &folder.join("configs/pick.toml"),
        "position_noise_m = 0.026",
        "position_noise_m = 0.025",
    );
    edit(
        &folder.join("models/objects/glass.toml"),
        "mass_kg = ",
        "mass_kg = 1",
    );
    refused(
        &["run", "--resume", "--history", "h"],
        &["X051", "the model `glass` was"],
    );
    let before = listed(folder, "h");
    assert!(before.lines().count() > 1, "{before}");
}
