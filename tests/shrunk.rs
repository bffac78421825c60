//! Shrinking of real runs, with the built program: every option, Ctrl-C, and `run --shrink`.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use crate::support::look::blurred;
use crate::support::{actcheck, edit, project, signal, stderr, stdout};

/// A project whose picks all fail slowly: percepts are decimetres off.
fn blind() -> tempfile::TempDir {
    let project = project();
    let config = project.path().join("configs/clutter.toml");
    edit(
        &config,
        "position_noise_m = 0.025",
        "position_noise_m = 0.2",
    );
    edit(&config, "seed = 11", "seed = 1");
    edit(&config, "count = [8, 12]", "count = [1, 2]");
    project
}

/// The configuration of a project whose runs all fail quickly.
const LOOK: &str = "configs/look.toml";

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(
        folder,
        &[arguments, &["--history", "h", "--format", "json"]].concat(),
    );
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

/// Names of the failed properties in each run of a new campaign, with the runs' ids.
fn campaign(folder: &Path, config: &str) -> Vec<(String, Vec<String>)> {
    let json = json(folder, &["run", config, "--runs", "1"]);
    let runs = json["runs"].as_array().unwrap();
    runs.iter()
        .map(|run| (run["run"].as_str().unwrap().to_owned(), failed(run)))
        .collect()
}

/// IRIs of the failed properties of a run, deduplicated and sorted.
fn failed(run: &Value) -> Vec<String> {
    let actions = run["actions"].as_array().unwrap();
    let outcomes = actions
        .iter()
        .flat_map(|action| action["outcomes"].as_array().unwrap());
    let failed = outcomes.filter(|outcome| outcome["outcome"] == "failed");
    let mut names: Vec<String> = failed
        .map(|outcome| outcome["property"].as_str().unwrap().to_owned())
        .collect();
    names.sort();
    names.dedup();
    names
}

fn names(list: &Value) -> Vec<String> {
    list.as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap().to_owned())
        .collect()
}

/// The failed properties of a stored run.
fn failed_of(folder: &Path, run: &str) -> Vec<String> {
    let output = actcheck(folder, &["show", run, "--history", "h", "--format", "csv"]);
    let table = stdout(&output);
    let rows = table
        .lines()
        .filter(|line| line.split(',').nth(4) == Some("failed"));
    let mut names: Vec<String> = rows
        .map(|line| line.split(',').nth(3).unwrap().to_owned())
        .collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn the_shrunk_run_is_stored_fails_the_same_and_can_be_drawn() {
    let project = blurred();
    let (run, failing) = campaign(project.path(), LOOK).remove(0);
    let small = json(project.path(), &["shrink", &run, "--picture", "small.svg"]);
    assert_eq!(names(&small["failed"]), failing, "{small:#}");
    let id = small["run"].as_str().unwrap();
    assert_eq!(failed_of(project.path(), id), failing);
    assert!(
        small["others"].as_u64() <= small["others_before"].as_u64(),
        "{small:#}"
    );
    let picture = std::fs::read_to_string(project.path().join("small.svg")).unwrap();
    assert!(
        picture.starts_with("<svg") && picture.contains(id) && picture.contains("glass_1"),
        "{picture}"
    );
    let nowhere = actcheck(
        project.path(),
        &[
            "shrink",
            &run,
            "--trials",
            "1",
            "--history",
            "h",
            "--picture",
            "no/such/folder.svg",
        ],
    );
    assert_eq!(nowhere.status.code(), Some(2));
    assert!(stderr(&nowhere).contains("X007"), "{}", stderr(&nowhere));
}

#[test]
fn limits_and_repetitions_are_respected() {
    let project = blurred();
    let (run, failing) = campaign(project.path(), LOOK).remove(0);
    let short = json(project.path(), &["shrink", &run, "--time", "1ms"]);
    assert_eq!(
        (&short["minimal"], &short["simulations"]),
        (&false.into(), &0.into()),
        "{short:#}"
    );
    assert_eq!(short["others"], short["others_before"]);
    let few = json(
        project.path(),
        &["shrink", &run, "--trials", "5", "--jobs", "1"],
    );
    assert!(
        few["simulations"].as_u64().unwrap() + few["explaining_simulations"].as_u64().unwrap() <= 5,
        "{few:#}"
    );
    let noisy = json(
        project.path(),
        &["shrink", &run, "--must-fail", "2/3", "--trials", "15"],
    );
    assert_eq!(noisy["fresh_noise"]["of"], 3, "{noisy:#}");
    assert_eq!(
        failed_of(project.path(), noisy["run"].as_str().unwrap()),
        failing
    );
    if noisy["noise_kept"] == false {
        assert!(
            noisy["fresh_noise"]["failed"].as_u64().unwrap() >= 2,
            "confirmed in 2 of 3: {noisy:#}"
        );
    }
    for wrong in [
        ["--must-fail", "4/3"],
        ["--repeat", "5"],
        ["--time", "0"],
        ["--time", "soon"],
        ["--trials", "0"],
    ] {
        let output = actcheck(
            project.path(),
            &["shrink", &run, wrong[0], wrong[1], "--history", "h"],
        );
        assert_eq!(output.status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn a_single_failed_property_can_be_preserved() {
    let project = blurred();
    let (run, failing) = campaign(project.path(), LOOK).remove(0);
    let name = failing[0].rsplit('#').next().unwrap();
    let small = json(
        project.path(),
        &["shrink", &run, "--property", name, "--trials", "8"],
    );
    assert!(
        failed_of(project.path(), small["run"].as_str().unwrap()).contains(&failing[0]),
        "{small:#}"
    );
    let unknown = actcheck(
        project.path(),
        &["shrink", &run, "--property", "Nothing", "--history", "h"],
    );
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        stderr(&unknown).contains("S050") && stderr(&unknown).contains(name),
        "{}",
        stderr(&unknown)
    );
}

/// Regression: a run of the configuration's second test that was shrunk to fewer actions was taken
/// for a run of the first.
#[test]
fn shrinking_drops_unneeded_actions() {
    let project = blurred();
    edit(
        &project.path().join("configs/look.toml"),
        "[[\"PerceivePlane\"]]",
        "[[\"PerceivePlane\"], [\"PerceivePlane\", \"PerceivePlane\", \"PerceivePlane\"]]",
    );
    let (run, failing) = campaign(project.path(), LOOK).remove(1);
    let small = json(project.path(), &["shrink", &run, "--trials", "10"]);
    let id = small["run"].as_str().unwrap();
    assert_eq!(failed_of(project.path(), id), failing, "{small:#}");
    let shown = json(project.path(), &["show", id]);
    assert!(shown["actions"].as_array().unwrap().len() < 3, "{shown:#}");
    let again = json(project.path(), &["shrink", id, "--trials", "3"]);
    assert_eq!(
        (&again["shrunk_from"], names(&again["failed"])),
        (&small["run"], failing),
        "{again:#}"
    );
}

#[test]
fn a_campaign_that_shrinks_prints_one_document() {
    let project = blurred();
    let run = ["run", LOOK, "--runs", "1", "--shrink"];
    let all = json(project.path(), &run);
    let [small] = all["shrunk"].as_array().unwrap().as_slice() else {
        panic!("{all:#}")
    };
    assert_eq!(small["shrunk_from"], all["runs"][0]["run"]);
    let output = actcheck(
        project.path(),
        &[&run[..], &["--history", "h", "--format", "csv"]].concat(),
    );
    let table = stdout(&output);
    let mut lines = table.lines();
    assert!(lines.next().unwrap().ends_with(",shrunk_to"), "{table}");
    assert!(
        lines.all(|line| line.rsplit(',').next().unwrap().ends_with("-1")),
        "{table}"
    );
    assert_eq!(output.status.code(), Some(1));
}

/// Regression: a value with which the run failed in another way was printed as passing. Every
/// printed value is replayed here, as a user would: the shrunk run as a configuration, with the
/// printed value.
#[test]
fn printed_values_that_pass_do_pass() {
    let looks = blurred();
    let picks = project();
    edit(
        &picks.path().join("configs/pick.toml"),
        "position_noise_m = 0.025",
        "position_noise_m = 0.08",
    );
    let replayed = replayed_values(looks.path(), LOOK, ["12", "60"], 6)
        + replayed_values(picks.path(), "configs/pick.toml", ["4", "40"], 2);
    assert!(replayed >= 4, "{replayed} values were replayed");
}

/// Shrinks some failing runs of a campaign, replays every value that is printed as passing, and
/// returns their number.
fn replayed_values(folder: &Path, config: &str, [runs, trials]: [&str; 2], take: usize) -> usize {
    let output = actcheck(
        folder,
        &[
            "run",
            config,
            "--runs",
            runs,
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let runs: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let mut replayed = 0;
    let failing = runs["runs"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|run| !failed(run).is_empty());
    for (number, run) in failing.take(take).enumerate() {
        // Some with one property, some with all.
        let (id, was) = (run["run"].as_str().unwrap(), failed(run));
        let property = was[0].rsplit('#').next().unwrap();
        let one: &[&str] = if number % 2 == 0 {
            &[]
        } else {
            &["--property", property]
        };
        let arguments = [&["shrink", id, "--trials", trials, "--jobs", "2"], one].concat();
        let small = json(folder, &arguments);
        let case = folder.join("case.toml");
        let shrunk = small["run"].as_str().unwrap();
        let exported = actcheck(
            folder,
            &["export", "run", shrunk, "-o", "case.toml", "--history", "h"],
        );
        assert!(exported.status.success(), "{}", stderr(&exported));
        let text = std::fs::read_to_string(&case).unwrap();
        for choice in small["choices"].as_array().unwrap() {
            for side in ["below", "above"] {
                let Some(value) = choice[format!("passes_{side}")].as_f64() else {
                    continue;
                };
                let name = choice["name"].as_str().unwrap();
                let Some(edited) =
                    with_choice(&text, name, choice["value"].as_f64().unwrap(), value)
                else {
                    continue;
                };
                std::fs::write(&case, edited).unwrap();
                let again = json_of_case(folder);
                let others = if one.is_empty() {
                    0
                } else {
                    choice[format!("others_fail_{side}")]
                        .as_array()
                        .unwrap()
                        .len()
                };
                let fails = names(&again["failed"]);
                assert!(
                    again["recurrence"] != "undecided"
                        && !fails.iter().any(|name| name == property),
                    "{again:#}"
                );
                assert_eq!(
                    fails.len(),
                    others,
                    "{name} = {value} in {shrunk}: {again:#}"
                );
                replayed += 1;
            }
        }
    }
    replayed
}

/// Runs `case.toml` again.
fn json_of_case(folder: &Path) -> Value {
    let again = actcheck(
        folder,
        &["run", "case.toml", "--history", "again", "--format", "json"],
    );
    let mut again: Value =
        serde_json::from_str(&stdout(&again)).unwrap_or_else(|_| panic!("{}", stderr(&again)));
    again["case"].take()
}

/// A case's text with another number for a choice. Repeated choices, such as `sense.glass_1.y (2)`,
/// are a list in the text; the present number finds its place there. Returns `None` for a choice
/// that the text writes in words.
fn with_choice(text: &str, name: &str, was: f64, value: f64) -> Option<String> {
    let name = name.split(" (").next().unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let key = |line: &str| line.split(" = ").next().unwrap().trim_matches('"') == name;
    let line = lines
        .iter_mut()
        .find(|line| line.contains(" = ") && key(line))?;
    let (key, written) = line.split_once(" = ").unwrap();
    let written = written.split('#').next().unwrap().trim();
    let mut numbers: Vec<&str> = written.trim_matches(['[', ']']).split(", ").collect();
    let nth = numbers
        .iter()
        .position(|number| number.parse() == Ok(was))?;
    let value = format!("{value:?}");
    numbers[nth] = &value;
    let joined = numbers.join(", ");
    *line = if numbers.len() == 1 {
        format!("{key} = {joined}")
    } else {
        format!("{key} = [{joined}]")
    };
    Some(lines.join("\n"))
}

fn started(folder: &Path, arguments: &[&str]) -> Child {
    let program = env!("CARGO_BIN_EXE_actcheck");
    let mut command = Command::new(program);
    command
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn interrupt(child: &Child) {
    signal(child.id(), "INT");
}

/// Waits until a process catches Ctrl-C, according to `/proc`.
fn until_it_catches(child: &mut Child) {
    loop {
        let status =
            std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let mask = caught
            .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
            .unwrap_or(0);
        // SIGINT is signal 2.
        if mask & 0b10 != 0 {
            return;
        }
        assert!(
            child.try_wait().unwrap().is_none(),
            "it ended before it could be interrupted"
        );
        std::thread::yield_now();
    }
}

#[test]
#[cfg(target_os = "linux")]
fn an_interrupt_returns_the_smallest_run_so_far() {
    let project = blind();
    let (run, failing) = campaign(project.path(), "configs/clutter.toml").remove(0);
    let mut child = started(
        project.path(),
        &["shrink", &run, "--history", "h", "--format", "json"],
    );
    until_it_catches(&mut child);
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    let small: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(
        failed_of(project.path(), small["run"].as_str().unwrap()),
        failing,
        "{small:#}"
    );
}

#[test]
fn an_interrupt_while_a_campaign_shrinks_sets_the_exit_code() {
    let project = blind();
    let arguments = [
        "run",
        "configs/clutter.toml",
        "--runs",
        "1",
        "--shrink",
        "--history",
        "h",
    ];
    let mut child = started(project.path(), &arguments);
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut text = String::new();
    while !text.contains("; campaign ") {
        assert_ne!(out.read_line(&mut text).unwrap(), 0, "{text}");
    }
    interrupt(&child);
    out.read_to_string(&mut text).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{text}{}", stderr(&output));
}
