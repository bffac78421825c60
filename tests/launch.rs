//! Campaigns in shards side by side: the results are those of one campaign, whichever process is
//! lost.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use actcheck::history::History;

use crate::support::look::looking;
use crate::support::{actcheck, edit, stderr, stdout};

const LAUNCH: [&str; 8] = [
    "launch",
    "configs/look.toml",
    "--runs",
    "12",
    "--shards",
    "4",
    "--history",
    "parts",
];

/// Columns of `actcheck list` without the ids: trace digests, scores and counts of outcomes.
fn listed(folder: &Path, history: &str) -> Vec<String> {
    let output = actcheck(folder, &["list", "--history", history, "--format", "csv"]);
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
        .lines()
        .skip(1)
        .map(|line| line.split_once(',').unwrap().1.to_owned())
        .collect()
}

/// The exit code of one whole campaign in `whole`.
fn whole(folder: &Path) -> Option<i32> {
    actcheck(
        folder,
        &[
            "run",
            "configs/look.toml",
            "--runs",
            "12",
            "--history",
            "whole",
        ],
    )
    .status
    .code()
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    command
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Waits until a condition holds.
fn until(condition: impl Fn() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "nothing happened"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_launch_equals_one_campaign() {
    let project = looking();
    let folder = project.path();
    let code = whole(folder);
    let output = actcheck(folder, &LAUNCH);
    assert_eq!(output.status.code(), code, "{}", stderr(&output));
    assert_eq!(listed(folder, "parts"), listed(folder, "whole"));
    assert_eq!(listed(folder, "parts").len(), 12);
    assert!(!folder.join("parts.launch").exists());
    let again = actcheck(folder, &LAUNCH);
    assert_eq!(
        (again.status.code(), listed(folder, "parts").len()),
        (code, 12),
        "{}",
        stderr(&again)
    );
}

/// The launch is killed at several moments; its shards end with it, and the same command continues.
#[test]
fn a_killed_launch_continues() {
    let project = looking();
    let folder = project.path();
    let code = whole(folder);
    for millis in [300, 700, 1_100] {
        let mut child = start(folder, &LAUNCH);
        std::thread::sleep(Duration::from_millis(millis));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let output = actcheck(folder, &LAUNCH);
    assert_eq!(output.status.code(), code, "{}", stderr(&output));
    assert_eq!(listed(folder, "parts"), listed(folder, "whole"));
}

/// A task that was killed in the middle resumes its campaign, and a complete one does nothing.
#[test]
fn a_task_may_be_started_any_number_of_times() {
    let project = looking();
    let folder = project.path();
    whole(folder);
    let mut child = start(folder, &LAUNCH);
    until(|| folder.join("parts.launch/plan.json").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let shard = folder.join("parts.launch/shards/2");
    let task = ["launch-task", "parts.launch", "2"];
    let mut child = start(folder, &task);
    until(|| History::count_runs(&shard) > 0 || folder.join("parts.launch/done/2").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    for _ in 0..2 {
        let output = actcheck(folder, &task);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert_eq!(History::count_runs(&shard), 3);
    }
    actcheck(folder, &LAUNCH);
    assert_eq!(listed(folder, "parts"), listed(folder, "whole"));
}

#[test]
fn wrong_launches_are_refused() {
    let project = looking();
    let folder = project.path();
    let refused = |arguments: &[&str], text: &str| {
        let output = actcheck(folder, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains(text),
            "{arguments:?}: {}",
            stderr(&output)
        );
    };
    refused(
        &["launch", "configs/look.toml", "--shards", "0"],
        "0 is not in 1..",
    );
    refused(&["launch", "configs/look.toml", "--shards", "16"], "X072");
    refused(&["launch-task", "nowhere", "1"], "X073");
    fs::write(folder.join("taken"), "").unwrap();
    refused(
        &[
            "launch",
            "configs/look.toml",
            "--shards",
            "2",
            "--history",
            "taken/history",
        ],
        "X074",
    );
    let dry = actcheck(folder, &[&LAUNCH[..], &["--dry-run"]].concat());
    assert_eq!(
        stdout(&dry)
            .matches("actcheck launch-task parts.launch")
            .count(),
        4,
        "{}",
        stderr(&dry)
    );
    assert!(!folder.join("parts.launch").exists());

    let mut child = start(folder, &LAUNCH);
    until(|| folder.join("parts.launch/plan.json").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let three = LAUNCH.map(|word| if word == "4" { "3" } else { word });
    refused(&three, "X073");
    refused(&["launch-task", "parts.launch", "5"], "X073");
    edit(&folder.join("configs/look.toml"), "seed = 3", "seed = 4");
    refused(&LAUNCH, "X073");
    edit(&folder.join("configs/look.toml"), "seed = 4", "seed = 5");
    let plan = fs::read_to_string(folder.join("parts.launch/plan.json")).unwrap();
    assert!(plan.contains("\"shards\": 4"), "{plan}");
}
