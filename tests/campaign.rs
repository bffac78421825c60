//! The main job with the built program: campaigns, their exit codes, and the files and records they
//! leave.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use actcheck::campaign::Env;
use actcheck::config::Overrides;
use actcheck::history::History;
use serde_json::Value;

use crate::support::look::looking;
use crate::support::{actcheck, edit, project, shipped, signal, stderr, stdout};

const COUNT: &str = "PREFIX act: <http://actions#> SELECT (COUNT(?r) AS ?n) WHERE { ?r a act:Run }";

fn run_json(folder: &Path, arguments: &[&str]) -> (i32, Value) {
    let mut all = vec!["run", "configs/pick.toml", "--format", "json"];
    all.extend(arguments);
    let output = actcheck(folder, &all);
    let code = output.status.code().unwrap();
    let text = stdout(&output);
    let json =
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", stderr(&output)));
    (code, json)
}

/// The columns of `actcheck list` that must not depend on how or when the runs were made: all
/// except the campaign's id.
fn listed(folder: &Path, history: &str) -> Vec<String> {
    let output = actcheck(folder, &["list", "--history", history, "--format", "csv"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert_eq!(
        text.lines().next(),
        Some("run,index,test,status,score,trace_hash")
    );
    text.lines()
        .skip(1)
        .map(|line| line.split_once(',').unwrap().1.to_owned())
        .collect()
}

fn outcomes(json: &Value) -> Vec<(u64, String, f64)> {
    let runs = json["runs"].as_array().unwrap();
    runs.iter()
        .map(|run| {
            let actions = run["actions"].to_string();
            (
                run["index"].as_u64().unwrap(),
                actions,
                run["score"].as_f64().unwrap(),
            )
        })
        .collect()
}

#[test]
fn the_shipped_pick_has_passed_and_failed_runs_and_exits_with_1() {
    let (made, text) = (shipped("pick"), &shipped("pick").text);
    assert_eq!(made.code, Some(1), "{text}");
    let folder = made.copied();
    for property in [
        "CloseObject",
        "ObjectGrasped",
        "NoGraspCollisions",
        "MovedObject",
        "ObjectInGripper",
    ] {
        assert!(
            text.contains(property),
            "{property} is not in the table:\n{text}"
        );
    }
    assert!(text.contains("over 15 runs"), "{text}");
    assert!(
        text.contains("actcheck show "),
        "no suggested command that shows more:\n{text}"
    );
    let count = actcheck(
        folder.path(),
        &["query", "--history", "h", "--format", "csv", COUNT],
    );
    assert_eq!(stdout(&count), "n\n15\n", "{}", stderr(&count));
    let json = actcheck(
        folder.path(),
        &["list", "--history", "h", "--format", "json"],
    );
    let rows: Vec<Value> = serde_json::from_str(&stdout(&json)).unwrap();
    assert!(
        rows.iter().any(|row| row["score"] == 1.0),
        "no run passed fully"
    );
    assert!(
        rows.iter().any(|row| row["score"].as_f64().unwrap() < 1.0),
        "no run failed"
    );
}

/// Uses as many runs as needed, at most ninety-six: the test is not about one seed.
#[test]
fn a_campaign_shows_several_ways_to_fail() {
    let project = project();
    let (mut passed, mut finished) = (0, 0);
    let mut modes: BTreeSet<Vec<String>> = BTreeSet::new();
    for seed in 7..13 {
        let history = format!("h{seed}");
        let seed = seed.to_string();
        let (code, json) = run_json(
            project.path(),
            &["--runs", "16", "--seed", &seed, "--history", &history],
        );
        assert!(code <= 1 && json["finished_runs"] == 16, "{json:#}");
        assert_eq!(
            json["counts"]["broken"], 0,
            "a run of the shipped campaign is broken"
        );
        assert_eq!(
            json["counts"]["timeout"], 0,
            "a run of the shipped campaign timed out"
        );
        passed += json["runs_passed"]["count"].as_u64().unwrap();
        finished += 16;
        for run in json["runs"].as_array().unwrap() {
            let outcomes = run["actions"][0]["outcomes"].as_array().unwrap();
            let failed = outcomes
                .iter()
                .filter(|outcome| outcome["outcome"] == "failed");
            modes.insert(
                failed
                    .map(|outcome| outcome["property"].to_string())
                    .collect(),
            );
        }
        modes.remove(&Vec::new());
        if modes.len() >= 3 && finished >= 32 {
            break;
        }
    }
    assert!(
        (30..=95).contains(&(100 * passed / finished)),
        "{passed} of {finished} runs passed fully"
    );
    assert!(modes.len() >= 3, "only these failure modes: {modes:?}");
}

#[test]
fn a_lone_glass_is_picked_with_perfect_sensors() {
    let folder = shipped("lone_glass").copied();
    let listed = actcheck(
        folder.path(),
        &["list", "--history", "h", "--format", "json"],
    );
    let rows: Vec<Value> = serde_json::from_str(&stdout(&listed)).unwrap();
    let passed = rows.iter().filter(|row| row["score"] == 1.0).count();
    assert!(
        rows.len() == 20 && passed >= 19,
        "{passed} of 20 runs passed fully with a lone object and no noise"
    );
}

#[test]
fn results_do_not_depend_on_the_number_of_workers_or_the_date() {
    let project = project();
    let one = run_json(
        project.path(),
        &["--runs", "4", "--jobs", "1", "--history", "one"],
    );
    let two = run_json(
        project.path(),
        &["--runs", "4", "--jobs", "2", "--history", "two"],
    );
    let again = run_json(
        project.path(),
        &["--runs", "4", "--jobs", "2", "--history", "again"],
    );
    assert_eq!(outcomes(&one.1), outcomes(&two.1));
    assert_eq!(outcomes(&one.1), outcomes(&again.1));
    let lists = ["one", "two", "again"].map(|history| listed(project.path(), history));
    assert_eq!(lists[0].len(), 4);
    assert_eq!(lists[0], lists[1]);
    assert_eq!(lists[0], lists[2]);
    let other = run_json(
        project.path(),
        &["--runs", "2", "--seed", "99", "--history", "other"],
    );
    assert_ne!(outcomes(&one.1)[..2], outcomes(&other.1)[..]);
    assert_ne!(lists[0][..2], listed(project.path(), "other")[..]);
}

#[test]
fn a_new_rule_file_is_used_by_the_next_run_without_recompiling() {
    let project = project();
    std::fs::write(
        project.path().join("rules/short_pick.rls"),
        "@prefix w: <https://w3id.org/actcheck/world#> .\n\
         % The pick takes less than a tenth of a second. (No robot is that fast: it must fail.)\n\
         success(?d) :- during(w:action, w:duration, ?d), ?d < 0.1 .\n\
         margin(?m) :- during(w:action, w:duration, ?d), ?m = 0.1 - ?d .\n",
    )
    .unwrap();
    let ontology = project.path().join("ontology/actions.ttl");
    let text = std::fs::read_to_string(&ontology).unwrap();
    std::fs::write(
        &ontology,
        format!(
            "{text}\nact:ShortPick a act:Property ; rdfs:label \"short pick\" ; act:unit \"s\" ; \
             act:verifiedBy <../rules/short_pick.rls> .\nact:Pick act:successProperty act:ShortPick .\n"
        ),
    )
    .unwrap();
    let (code, json) = run_json(project.path(), &["--runs", "2", "--history", "h"]);
    assert_eq!(code, 1);
    let properties: Vec<&str> = json["properties"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["property"].as_str().unwrap())
        .collect();
    assert_eq!(properties.len(), 6, "{properties:?}");
    let new = json["properties"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["property"] == "http://actions#ShortPick");
    assert_eq!(new.unwrap()["counts"]["failed"], 2);
}

/// The largest number of runs that a progress bar has shown, from its terminal output.
fn runs_shown(typescript: &Path) -> usize {
    let text = String::from_utf8_lossy(&std::fs::read(typescript).unwrap_or_default()).into_owned();
    let counts = text
        .split("/400 runs")
        .filter_map(|before| before.rsplit(' ').next()?.parse().ok());
    counts.max().unwrap_or(0)
}

#[test]
fn a_killed_campaign_keeps_all_reported_runs_and_no_partial_run() {
    let project = looking();
    for round in 0..3 {
        let (history, seen) = (
            format!("h{round}"),
            project.path().join(format!("seen{round}")),
        );
        let program = env!("CARGO_BIN_EXE_actcheck");
        // Progress is shown only on terminals; `script` provides one. `exec` keeps the shell's
        // process id.
        let command = format!(
            "echo $$ > pid{round}; exec {program} run configs/look.toml --runs 400 --history {history}"
        );
        let mut child = Command::new("script")
            .args(["-qfc", &command, seen.to_str().unwrap()])
            // Sets `TERM`, since a dumb terminal shows no bar.
            .env("TERM", "xterm")
            .current_dir(project.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let start = Instant::now();
        while runs_shown(&seen) < 3 + round {
            assert!(
                start.elapsed() < Duration::from_secs(120),
                "no runs in two minutes"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        let kill = format!("kill -9 $(cat pid{round})");
        assert!(
            Command::new("sh")
                .args(["-c", &kill])
                .current_dir(project.path())
                .status()
                .unwrap()
                .success()
        );
        child.wait().unwrap();
        let reported = runs_shown(&seen);
        let rows = listed(project.path(), &history);
        assert!(
            rows.len() >= reported,
            "{} of {reported} reported runs are in the history",
            rows.len()
        );
        assert!(
            rows.len() < 400,
            "the campaign was over before it was killed"
        );
        // A complete run has its score and hash, its three graphs, and an outcome of each of the
        // three properties.
        let whole = "SELECT ?r WHERE { ?r a act:Run ; act:score ?s ; act:traceHash ?h . \
                     ?e act:ofRun ?r ; act:before ?b ; act:after ?a ; act:during ?d . \
                     ?assertion earl:subject ?e ; earl:result/act:outcome ?o . \
                     FILTER EXISTS { GRAPH ?b { ?x ?y ?z } } FILTER EXISTS { GRAPH ?a { ?x ?y ?z } } \
                     FILTER EXISTS { GRAPH ?d { ?x ?y ?z } } } GROUP BY ?r HAVING (COUNT(?assertion) = 3)";
        let output = actcheck(
            project.path(),
            &["query", "--history", &history, "--format", "csv", whole],
        );
        assert_eq!(
            stdout(&output).lines().count(),
            rows.len() + 1,
            "half-written runs\n{}",
            stderr(&output)
        );
    }
}

#[test]
fn an_interrupted_campaign_keeps_its_runs_and_says_so() {
    let project = project();
    let child = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "run",
            "configs/pick.toml",
            "--runs",
            "400",
            "--history",
            "h",
            "--format",
            "json",
        ])
        .current_dir(project.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while History::count_runs(&project.path().join("h")) < 2 {
        assert!(
            start.elapsed() < Duration::from_secs(120),
            "no runs in two minutes"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(json["interrupted"], true);
    let finished = json["finished_runs"].as_u64().unwrap();
    assert!(finished < 400);
    assert_eq!(listed(project.path(), "h").len() as u64, finished);
}

#[test]
fn a_second_writer_on_the_same_history_is_refused_and_a_reader_is_not() {
    let project = project();
    let mut child = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "run",
            "configs/pick.toml",
            "--runs",
            "400",
            "--history",
            "h",
        ])
        .current_dir(project.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while History::count_runs(&project.path().join("h")) == 0 {
        assert!(start.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(20));
    }
    let second = actcheck(
        project.path(),
        &["run", "configs/pick.toml", "--runs", "1", "--history", "h"],
    );
    let reader = actcheck(project.path(), &["list", "--history", "h"]);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(second.status.code(), Some(2));
    assert!(
        stderr(&second).contains("another process"),
        "{}",
        stderr(&second)
    );
    assert_eq!(reader.status.code(), Some(0), "{}", stderr(&reader));
    assert!(!listed(project.path(), "h").is_empty());
}

#[test]
fn embedded_files_are_used_outside_the_repository() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("mine.toml"),
        "tests = [[\"Pick\"]]\ntest_count = 2\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
         [pickObject]\nmodel_list = [\"glass\"]\n",
    )
    .unwrap();
    let output = actcheck(folder.path(), &["run", "mine.toml", "--format", "json"]);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(json["finished_runs"], 2);
    assert!(
        folder.path().join(".actcheck").is_dir(),
        "the history is beside the configuration"
    );
    let found = actcheck(folder.path(), &["list", "--format", "csv"]);
    assert_eq!(stdout(&found).lines().count(), 3, "{}", stderr(&found));
}

#[test]
fn invalid_input_exits_with_2_and_names_its_place() {
    let project = project();
    edit(
        &project.path().join("configs/pick.toml"),
        "test_count",
        "test_cuont",
    );
    let output = actcheck(project.path(), &["run", "configs/pick.toml"]);
    assert_eq!(output.status.code(), Some(2));
    let text = stderr(&output);
    assert!(
        text.contains("configs/pick.toml") && text.contains("did you mean `test_count`"),
        "{text}"
    );
    let missing = actcheck(project.path(), &["run", "configs/pcik.toml"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(
        stderr(&missing).contains("configs/pcik.toml"),
        "{}",
        stderr(&missing)
    );
    assert!(
        !project.path().join("configs/.actcheck").exists(),
        "a refused campaign must not create a history"
    );
}

#[test]
fn a_closed_output_pipe_does_not_panic() {
    let project = project();
    let (_, _) = run_json(project.path(), &["--runs", "1", "--history", "h"]);
    let output = Command::new("sh")
        .args([
            "-c",
            "\"$0\" list --history h | true",
            env!("CARGO_BIN_EXE_actcheck"),
        ])
        .current_dir(project.path())
        .output()
        .unwrap();
    assert_eq!(stderr(&output), "");
}

/// The history returns the campaign's configuration, also after the project's folder has moved.
#[test]
fn a_campaign_is_recalled_with_its_original_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let before = folder.path().join("before");
    std::fs::create_dir(&before).unwrap();
    let config = before.join("small.toml");
    let text = "tests = [[\"Pick\"]]\ntest_count = 3\nseed = 4\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
                [pickObject]\nmodel_list = [\"glass\"]\n[surfaceObjects]\nmodel_list = [\"mug\"]\ncount = 1\n";
    std::fs::write(&config, text).unwrap();
    let overrides = Overrides {
        runs: Some(2),
        seed: Some(9),
        ..Overrides::default()
    };
    let env = Env::prepare(&config, &overrides).unwrap();
    let record = {
        let history = History::open(&env.campaign.history).unwrap();
        let record = env.record(
            "k7f3".to_owned(),
            "small".to_owned(),
            "2026-08-01T12:00:00Z".to_owned(),
        );
        history.begin_campaign(&record).unwrap();
        assert_eq!(history.campaign("k7f3").unwrap(), record);
        record
    };
    assert_eq!(record.config_path, "../small.toml");
    // Later edits do not change the stored configuration, and a folder may move as a whole.
    std::fs::write(&config, text.replace("glass", "mug")).unwrap();
    let after = folder.path().join("after");
    std::fs::rename(&before, &after).unwrap();
    let history = History::open(&after.join(".actcheck")).unwrap();
    let (again, recalled) = Env::from_history(&history, "k7f3", None).unwrap();
    assert_eq!(recalled, record);
    assert_eq!((again.campaign.seed, again.planned_runs()), (9, 2));
    assert_eq!(again.campaign.candidates["pickObject"], ["glass"]);
    let edited = Env::from_history(&history, "k7f3", Some(&after.join("small.toml")))
        .unwrap()
        .0;
    assert_eq!(edited.campaign.candidates["pickObject"], ["mug"]);
    let fault = Env::from_history(&history, "k7f4", None)
        .err()
        .expect("no such campaign exists")
        .into_iter()
        .next()
        .unwrap();
    assert_eq!(
        (fault.code, fault.help.as_deref()),
        ("H014", Some("did you mean `k7f3`?"))
    );
}
