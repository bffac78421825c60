//! Repeated runs of a scene: the same scene, other noise, and the resulting statistics.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use crate::support::look::looking;
use crate::support::{actcheck, edit, project, stderr, stdout};

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

fn list(folder: &Path, history: &str) -> Vec<Value> {
    json(folder, &["list", "--history", history])
        .as_array()
        .unwrap()
        .clone()
}

/// Initial object poses and the start of the robot.
fn scene(folder: &Path, run: &Value, history: &str) -> String {
    let shown = json(
        folder,
        &["show", run["run"].as_str().unwrap(), "--history", history],
    );
    let placed = |object: &Value| {
        let of = |key: &str| object[key].to_string();
        ["id", "x", "y", "yaw", "mass_kg", "friction", "restitution"]
            .map(of)
            .join(" ")
    };
    let objects: Vec<String> = shown["objects"]
        .as_array()
        .unwrap()
        .iter()
        .map(placed)
        .collect();
    format!("{} {}", objects.join("; "), shown["robot_base"])
}

#[test]
fn repetitions_share_the_scene_and_differ_in_noise() {
    let project = looking();
    let folder = project.path();
    let run = ["run", "configs/look.toml", "--runs", "3"];
    actcheck(
        folder,
        &[
            &run[..],
            &["--repeat", "3", "--jobs", "1", "--history", "one"],
        ]
        .concat(),
    );
    edit(
        &folder.join("configs/look.toml"),
        "test_count = 15",
        "test_count = 15\nrepeat = 3",
    );
    actcheck(
        folder,
        &[&run[..], &["--jobs", "2", "--history", "two"]].concat(),
    );
    actcheck(
        folder,
        &[&run[..], &["--repeat", "1", "--history", "single"]].concat(),
    );

    let (one, two, single) = (
        list(folder, "one"),
        list(folder, "two"),
        list(folder, "single"),
    );
    let of =
        |rows: &[Value], key: &str| rows.iter().map(|row| row[key].clone()).collect::<Vec<_>>();
    assert_eq!(
        of(&one, "index"),
        (0..9).map(Value::from).collect::<Vec<_>>()
    );
    assert_eq!(
        of(&one, "scene"),
        [0, 0, 0, 1, 1, 1, 2, 2, 2].map(Value::from)
    );
    assert_eq!(
        of(&one, "repetition"),
        [0, 1, 2, 0, 1, 2, 0, 1, 2].map(Value::from)
    );
    assert!(
        single[0].get("scene").is_none() && one[0].get("weight").is_none(),
        "no empty columns"
    );
    // Neither the number of workers nor the source of the repetition count changes the result.
    assert_eq!(of(&one, "trace_hash"), of(&two, "trace_hash"));

    for (number, alone) in single.iter().enumerate() {
        let scenes = one[3 * number..3 * number + 3]
            .iter()
            .map(|run| scene(folder, run, "one"));
        let expected = scene(folder, alone, "single");
        scenes.for_each(|scene| assert_eq!(scene, expected));
        let hashes = of(&one[3 * number..3 * number + 3], "trace_hash");
        assert!(
            hashes[0] != hashes[1] && hashes[1] != hashes[2] && hashes[0] != hashes[2],
            "noise must differ"
        );
    }
}

#[test]
fn repeated_runs_can_be_replayed_and_shrunk() {
    let project = looking();
    let folder = project.path();
    let printed = json(
        folder,
        &[
            "run",
            "configs/look.toml",
            "--runs",
            "12",
            "--repeat",
            "2",
            "--history",
            "h",
        ],
    );
    let rows = list(folder, "h");
    let runs: Vec<&str> = rows
        .iter()
        .map(|row| row["run"].as_str().unwrap())
        .collect();
    let replayed = actcheck(folder, &[&["replay", "--history", "h"], &runs[..]].concat());
    assert_eq!(
        replayed.status.code(),
        Some(0),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
    let failing = printed["runs"]
        .as_array()
        .unwrap()
        .iter()
        .rev()
        .find(|run| run["score"].as_f64().unwrap() < 1.0);
    let failing = failing.expect("one in four looks misses a thing or sees a wrong one")["run"]
        .as_str()
        .unwrap();
    let shrunk = actcheck(
        folder,
        &["shrink", failing, "--history", "h", "--trials", "8"],
    );
    assert_eq!(
        shrunk.status.code(),
        Some(0),
        "{}{}",
        stdout(&shrunk),
        stderr(&shrunk)
    );
    // The shrunk run is a separate run.
    let last = list(folder, "h").pop().unwrap();
    assert_eq!(
        (&last["scene"], &last["repetition"]),
        (&Value::Null, &Value::Null)
    );
    let replayed = actcheck(
        folder,
        &["replay", "--history", "h", last["run"].as_str().unwrap()],
    );
    assert_eq!(
        replayed.status.code(),
        Some(0),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

/// The shares are computed again here, from the outcomes of the runs.
#[test]
fn the_report_agrees_with_the_runs() {
    let project = looking();
    let folder = project.path();
    let printed = json(
        folder,
        &[
            "run",
            "configs/look.toml",
            "--runs",
            "6",
            "--repeat",
            "3",
            "--history",
            "h",
        ],
    );
    let whole = printed["repetitions"]
        .as_array()
        .unwrap()
        .last()
        .unwrap()
        .clone();
    assert_eq!(whole["property"], Value::Null);
    let mut passed: BTreeMap<u64, u64> = (0..6).map(|scene| (scene, 0)).collect();
    for run in printed["runs"].as_array().unwrap() {
        let all = run["actions"][0]["outcomes"]
            .as_array()
            .unwrap()
            .iter()
            .all(|outcome| outcome["outcome"] == "passed");
        *passed
            .get_mut(&(run["index"].as_u64().unwrap() / 3))
            .unwrap() += u64::from(all);
    }
    let with = |count: u64| passed.values().filter(|passed| **passed == count).count();
    assert_eq!(
        (
            whole["always_passed"].as_u64().unwrap(),
            whole["always_failed"].as_u64().unwrap()
        ),
        (with(3) as u64, with(0) as u64)
    );
    let flaky: Vec<u64> = whole["flaky"]
        .as_array()
        .unwrap()
        .iter()
        .map(|scene| scene["scene"].as_u64().unwrap())
        .collect();
    assert_eq!(
        flaky,
        passed
            .iter()
            .filter(|(_, passed)| (1..3).contains(*passed))
            .map(|(scene, _)| *scene)
            .collect::<Vec<_>>()
    );
    assert_eq!(
        whole["flaky"]
            .as_array()
            .unwrap()
            .iter()
            .map(|scene| scene["runs"].as_array().unwrap().len())
            .sum::<usize>(),
        3 * flaky.len()
    );
    // All choices of k of three runs, by hand.
    for (k, share) in [
        (1, [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]),
        (2, [0.0, 0.0, 1.0 / 3.0, 1.0]),
        (3, [0.0, 0.0, 0.0, 1.0]),
    ] {
        let expected = passed
            .values()
            .map(|passed| share[*passed as usize])
            .sum::<f64>()
            / 6.0;
        let power = &whole["pass_powers"][k - 1];
        assert_eq!(
            (
                power["k"].as_u64().unwrap(),
                power["scenes"].as_u64().unwrap()
            ),
            (k as u64, 6)
        );
        assert!(
            (power["probability"].as_f64().unwrap() - expected).abs() < 1e-12,
            "{power}"
        );
    }
    let text = stdout(&actcheck(
        folder,
        &[
            "run",
            "configs/look.toml",
            "--runs",
            "2",
            "--repeat",
            "2",
            "--history",
            "t",
        ],
    ));
    assert!(
        text.contains("pass^2") && text.contains("always passed"),
        "{text}"
    );
    let once = stdout(&actcheck(
        folder,
        &["run", "configs/look.toml", "--runs", "1", "--history", "o"],
    ));
    assert!(!once.contains("pass^"), "{once}");
}

#[test]
fn the_number_of_repetitions_must_be_from_1_to_1000() {
    let project = project();
    for repeat in ["0", "1001", "-1", "\"three\""] {
        let config = project.path().join("configs/pick.toml");
        let text = std::fs::read_to_string(&config).unwrap();
        std::fs::write(&config, format!("repeat = {repeat}\n{text}")).unwrap();
        let refused = actcheck(project.path(), &["check", "configs/pick.toml"]);
        assert_eq!(refused.status.code(), Some(2), "{repeat}");
        assert!(stderr(&refused).contains("repeat"), "{}", stderr(&refused));
        std::fs::write(&config, text).unwrap();
    }
    assert_eq!(
        actcheck(
            project.path(),
            &["run", "configs/pick.toml", "--repeat", "0"]
        )
        .status
        .code(),
        Some(2)
    );
}
