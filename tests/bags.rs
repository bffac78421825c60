//! `actcheck export RUN --mcap`: runs as ROS 2 bags, read back by libraries of others.

use std::path::Path;
use std::process::Command;

use actcheck::base::Outcome;
use actcheck::history::{History, RunDetail};
use serde_json::Value;

use crate::support::{actcheck, foreign, root, stderr, stdout};

/// Makes a run of a shipped configuration. Returns its details.
fn made(folder: &Path, config: &str) -> RunDetail {
    let config = root().join("configs").join(config);
    let arguments = ["--runs", "1", "--seed", "5", "-q", "--history", "h"];
    let made = actcheck(
        folder,
        &[&["run", config.to_str().unwrap()], &arguments[..]].concat(),
    );
    assert!(made.status.code() < Some(2), "{}", stderr(&made));
    let history = History::open_to_read(&folder.join("h")).unwrap();
    let campaign = history.campaigns().unwrap()[0].id.clone();
    history.run(&format!("{campaign}-1")).unwrap()
}

fn exported(folder: &Path, run: &str, file: &str) {
    let written = actcheck(folder, &["export", run, "--mcap", file, "--history", "h"]);
    assert!(written.status.success(), "{}", stderr(&written));
    assert!(stdout(&written).contains(file), "{}", stdout(&written));
}

/// A pick of the mobile robot, whose base drives, and a task of a fixed arm with a suction cup.
#[test]
fn bags_are_read_by_other_libraries() {
    let Some(python) = foreign::bags() else {
        return;
    };
    for config in ["pick_and_place.toml", "suction_arm.toml"] {
        let folder = tempfile::tempdir().unwrap();
        let run = made(folder.path(), config);
        exported(folder.path(), &run.row.run, "run.mcap");
        let read = Command::new(python)
            .arg(root().join("tests/foreign/check_bag.py"))
            .arg(folder.path().join("run.mcap"))
            .output()
            .unwrap();
        assert!(read.status.success(), "{config}: {}", stderr(&read));
        let read: Value = serde_json::from_str(&stdout(&read)).unwrap();
        check(&run, &read);
        let drives = config == "pick_and_place.toml";
        assert_eq!(
            read["counts"]["/base_believed"].is_number(),
            drives,
            "{config}"
        );
    }
}

/// Checks a bag against the history.
fn check(run: &RunDetail, read: &Value) {
    let outcomes = read["outcomes"].as_array().unwrap();
    let judged = run.actions.iter().flat_map(|action| {
        action
            .judgements
            .iter()
            .map(move |judged| (action.step, judged))
    });
    for (written, (step, judged)) in outcomes.iter().zip(judged.clone()) {
        assert_eq!(written["property"], judged.property);
        assert_eq!(written["step"], step.to_string());
        assert_eq!(written["outcome"], judged.outcome.word());
        assert_eq!(written["level"] == 2, judged.outcome == Outcome::Failed);
        let margin = written["margin"]
            .as_str()
            .map(|margin| margin.parse().unwrap());
        assert_eq!(margin, judged.margin);
    }
    assert_eq!(outcomes.len(), judged.count());
    let names = |key: &str| -> Vec<String> {
        let all = read[key].as_object().unwrap();
        all.keys().cloned().collect()
    };
    for object in &run.objects {
        assert!(names("frames").contains(&object.id), "{}", object.id);
    }
    assert!(read["links"].as_array().unwrap().len() > 5, "{read}");
    for kind in ["objects", "furniture", "contacts"] {
        assert!(
            !read["markers"][kind].as_array().unwrap().is_empty(),
            "{kind}"
        );
    }
    assert!(read["strongest"].as_f64().unwrap() > 0.0);
    let seconds: f64 = run.actions.iter().map(|action| action.duration_secs).sum();
    let spanned = (read["last"].as_f64().unwrap() - read["first"].as_f64().unwrap()) * 1e-9;
    assert!((spanned - seconds).abs() < 0.3, "{spanned} of {seconds} s");
}

#[test]
fn the_same_run_gives_the_same_bag() {
    let folder = tempfile::tempdir().unwrap();
    let run = made(folder.path(), "pick.toml").row.run;
    exported(folder.path(), &run, "a.mcap");
    exported(folder.path(), &run, "b.mcap");
    let [a, b] = ["a.mcap", "b.mcap"].map(|name| std::fs::read(folder.path().join(name)).unwrap());
    assert!(a.starts_with(b"\x89MCAP0\r\n") && a == b);
    let printed = actcheck(
        folder.path(),
        &["export", "run", &run, "--mcap", "-", "--history", "h"],
    );
    assert!(printed.stdout == a);
    let unknown = actcheck(
        folder.path(),
        &["export", "none-7", "--mcap", "c.mcap", "--history", "h"],
    );
    assert_eq!(unknown.status.code(), Some(2));
    assert!(stderr(&unknown).contains("H008"), "{}", stderr(&unknown));
    assert!(!folder.path().join("c.mcap").exists());
}

/// An imported episode has neither a robot of ours nor joints.
#[test]
fn a_bag_of_an_episode_has_frames_and_outcomes() {
    let folder = tempfile::tempdir().unwrap();
    let data = root().join("tests/data/episodes");
    let [episode, mapping] = ["good-000001.mcap", "made.toml"].map(|name| data.join(name));
    let imported = actcheck(
        folder.path(),
        &[
            "import",
            episode.to_str().unwrap(),
            "--mapping",
            mapping.to_str().unwrap(),
            "--history",
            "h",
        ],
    );
    assert!(imported.status.code() < Some(2), "{}", stderr(&imported));
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let run = format!("{}-1", history.campaigns().unwrap()[0].id);
    drop(history);
    exported(folder.path(), &run, "run.mcap");
    let Some(python) = foreign::bags() else {
        return;
    };
    let read = Command::new(python)
        .arg(root().join("tests/foreign/check_bag.py"))
        .arg(folder.path().join("run.mcap"))
        .output()
        .unwrap();
    assert!(read.status.success(), "{}", stderr(&read));
    let read: Value = serde_json::from_str(&stdout(&read)).unwrap();
    assert_eq!(read["frames"]["cube"], "map");
    assert!(read["counts"]["/robot_description"].is_null());
    assert!(!read["outcomes"].as_array().unwrap().is_empty());
}
