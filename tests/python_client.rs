//! The Python client: its own tests and type checks, installed as a user installs it.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::support::{actcheck, foreign, project, root, stderr, stdout};

/// Runs Python in the client's folder without leaving files there.
fn python(arguments: &[&str]) -> Output {
    Command::new(foreign::client_python())
        .args(arguments)
        .current_dir(root().join("clients/python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap()
}

#[test]
fn the_clients_tests_pass_on_the_installed_package() {
    let place = stdout(&python(&[
        "-c",
        "import actcheck; print(actcheck.__file__)",
    ]));
    assert!(place.contains("site-packages"), "{place}");
    let output = python(&["-W", "error::DeprecationWarning", "-m", "unittest"]);
    let text = stderr(&output);
    assert!(output.status.success(), "{text}");
    let ran = text.lines().find_map(|line| {
        line.strip_prefix("Ran ")?
            .split(' ')
            .next()?
            .parse::<u32>()
            .ok()
    });
    assert!(ran.is_some_and(|ran| ran >= 40), "{text}");
}

#[test]
fn the_client_passes_its_type_checks() {
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mypy");
    let output = python(&[
        "-m",
        "mypy",
        "--strict",
        "--cache-dir",
        &cache.to_string_lossy(),
    ]);
    assert!(output.status.success(), "{}", stdout(&output));
}

/// Runs a configuration whose launcher is an example. Returns the printed output and the state
/// digests, by run.
fn campaign(folder: &Path, example: &str, arguments: &[&str]) -> (Value, String) {
    let launcher = root().join("clients/python/examples").join(example);
    let config = folder.join("configs/python.toml");
    let pick = std::fs::read_to_string(root().join("configs/pick.toml")).unwrap();
    let named = pick.replace(
        "test_launcher = \"reference\"",
        &format!("test_launcher = {:?}", launcher.display()),
    );
    assert_ne!(named, pick);
    std::fs::write(&config, named).unwrap();
    let history = folder
        .join(format!("{example}{}", arguments.join("")))
        .display()
        .to_string();
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "run",
            "configs/python.toml",
            "--format",
            "json",
            "--history",
            &history,
        ])
        .args(arguments)
        .current_dir(folder)
        .env("PATH", foreign::client_path())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    let hashes = "SELECT ?index ?hash { ?run a act:Run ; act:index ?index ; act:traceHash ?hash } ORDER BY ?index";
    let kept = actcheck(
        folder,
        &["query", hashes, "--history", &history, "--format", "csv"],
    );
    (
        serde_json::from_slice(&output.stdout).unwrap(),
        stdout(&kept),
    )
}

/// The scripted pick, in another process and another language, is as deterministic as ours.
#[test]
fn a_python_pick_is_the_same_with_any_number_of_workers() {
    let folder = project();
    let (one, hashes) = campaign(folder.path(), "pick.py", &["--runs", "3", "--jobs", "1"]);
    let (two, again) = campaign(folder.path(), "pick.py", &["--runs", "3", "--jobs", "2"]);
    assert_eq!(hashes.lines().count(), 4, "{hashes}");
    assert_eq!(hashes, again);
    let actions = |campaign: &Value| {
        campaign["runs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|run| run["actions"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(actions(&one), actions(&two));
    // It succeeds in most scenes of any campaign.
    let score = one["runs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|run| run["score"].as_f64().unwrap())
        .sum::<f64>()
        / 3.0;
    assert!(score > 0.5, "{one:#}");
}

/// The careless and the learned example end their action with their own reports, and are judged.
#[test]
fn the_other_examples_perform_their_actions() {
    let folder = project();
    for (example, words) in [("clumsy_pick.py", "of course"), ("learned_pick.py", "hold")] {
        let (summary, _) = campaign(folder.path(), example, &["--runs", "2"]);
        for run in summary["runs"].as_array().unwrap() {
            assert_eq!(
                (&run["status"], &run["reason"]),
                (&"completed".into(), &Value::Null),
                "{example}: {run:#}"
            );
        }
        let messages = "SELECT ?message { [] act:ofRun ?run ; act:message ?message }";
        let history = folder
            .path()
            .join(format!("{example}--runs2"))
            .display()
            .to_string();
        let kept = stdout(&actcheck(
            folder.path(),
            &["query", messages, "--history", &history, "--format", "csv"],
        ));
        assert!(
            kept.lines().skip(1).all(|line| !line.contains("Error")),
            "{example}: {kept}"
        );
        assert!(
            kept.contains(words) || kept.contains("the hand is empty"),
            "{example}: {kept}"
        );
    }
}

/// Regression: a report could not have a plane, so a Python look at a surface always failed
/// `PlaneFound`.
#[test]
fn a_python_look_finds_the_plane() {
    let folder = project();
    let launcher = root().join("clients/python/examples/perceive.py");
    let config = std::fs::read_to_string(root().join("configs/perceive.toml")).unwrap();
    let named = config.replace(
        "test_launcher = \"reference\"",
        &format!("test_launcher = {:?}", launcher.display()),
    );
    assert_ne!(named, config);
    std::fs::write(folder.path().join("configs/look.toml"), named).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "run",
            "configs/look.toml",
            "--runs",
            "4",
            "--history",
            "h",
            "--format",
            "json",
        ])
        .current_dir(folder.path())
        .env("PATH", foreign::client_path())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    let summary: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let properties = summary["properties"].as_array().unwrap();
    let found = properties
        .iter()
        .find(|line| line["property"].as_str().unwrap().ends_with("#PlaneFound"))
        .unwrap();
    assert_eq!(found["counts"]["passed"], 4, "{found:#}");
}

/// A typing error in a skill was a failure of the robot, in every run.
#[test]
fn an_exception_in_a_skill_breaks_the_run_and_soon_ends_the_campaign() {
    let folder = project();
    let skill = "import actcheck\n\n\n@actcheck.skill(\"Pick\")\ndef pick(robot, pickObject):\n    \
                 robot.look_fro(pickObject)\n\n\nactcheck.serve()\n";
    std::fs::write(folder.path().join("configs/mistyped.py"), skill).unwrap();
    let pick = std::fs::read_to_string(folder.path().join("configs/pick.toml")).unwrap();
    let named = pick.replace(
        "test_launcher = \"reference\"",
        "test_launcher = \"mistyped.py\"",
    );
    std::fs::write(folder.path().join("configs/mistyped.toml"), named).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "run",
            "configs/mistyped.toml",
            "--runs",
            "50",
            "--format",
            "json",
            "--history",
            "h",
        ])
        .current_dir(folder.path())
        .env("PATH", foreign::client_path())
        .output()
        .unwrap();
    let (json, said): (Value, String) = (
        serde_json::from_slice(&output.stdout).unwrap(),
        stderr(&output),
    );
    assert_eq!(
        (output.status.code(), json["finished_runs"].as_u64()),
        (Some(2), Some(5)),
        "{said}"
    );
    assert!(
        said.contains("S033") && said.contains("the first 5 runs were all broken"),
        "{said}"
    );
    assert_eq!(
        [&json["counts"]["failed"], &json["counts"]["broken"]],
        [0, 25],
        "{json:#}"
    );
    let reason = json["runs"][0]["reason"].as_str().unwrap();
    assert!(
        reason.contains("no attribute 'look_fro'") && reason.contains("mistyped.py, line 6"),
        "{reason}"
    );
    let shown = stdout(&actcheck(
        folder.path(),
        &[
            "show",
            json["runs"][0]["run"].as_str().unwrap(),
            "--history",
            "h",
        ],
    ));
    assert!(
        shown.contains("Traceback (most recent call last)"),
        "{shown}"
    );
}
