//! Skills that never end: budgets, limits and interrupts end their runs.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{actcheck, processes_in, root, signal, started, stderr, stdout};

/// A folder with a configuration `c.toml` whose program is one of `tests/protocol/`.
fn project(program: &str, skill: &str, budget: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in ["wire.py", program] {
        std::fs::copy(
            root().join("tests/protocol").join(file),
            folder.path().join(file),
        )
        .unwrap();
    }
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\ntest_launcher = \"{program}\"\nseed = 7\n\
         [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
         [skill]\n{skill}\n[budget]\n{budget}\n"
    );
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    folder
}

/// Status and reason of the only run.
fn end_of(folder: &Path) -> (String, String) {
    let output = actcheck(folder, &["run", "c.toml", "--format", "json"]);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let of = |key: &str| json["runs"][0][key].as_str().unwrap_or_default().to_owned();
    (of("status"), of("reason"))
}

#[test]
fn requests_for_perception_count_against_the_budget_of_the_action() {
    let folder = project("polls.py", "", "action_secs = 2");
    let (status, reason) = end_of(folder.path());
    assert_eq!(status, "timeout", "{reason}");
    assert!(
        reason.contains("more than 120 requests for perception")
            && reason.contains("budget of 2 s"),
        "{reason}"
    );
    let listed = actcheck(
        folder.path(),
        &["list", "--history", ".actcheck", "--format", "json"],
    );
    let listed: Value = serde_json::from_str(&stdout(&listed)).unwrap();
    // The budget does not depend on the clock, so a replay ends at the same request.
    let run = listed[0]["run"].as_str().unwrap();
    let replayed = actcheck(folder.path(), &["replay", run, "--history", ".actcheck"]);
    assert!(
        replayed.status.success(),
        "{}\n{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

/// The limit on wall-clock time also ends a run in which no simulated time passes.
#[test]
fn the_time_limit_ends_a_run_whose_skill_polls_or_is_silent() {
    let polls = project(
        "polls.py",
        "env = { WHAT = \"depth\" }",
        "action_secs = 3600\nrun_secs = 0.5",
    );
    let silent = project(
        "faulty.py",
        "timeout_s = 3600.0\nenv = { FAULT = \"silent\" }",
        "action_secs = 3600\nrun_secs = 0.5",
    );
    for folder in [polls, silent] {
        let (status, reason) = end_of(folder.path());
        assert_eq!(status, "timeout", "{reason}");
        assert!(reason.contains("run_secs"), "{reason}");
    }
}

#[test]
fn one_interrupt_ends_a_skill_that_polls_or_is_silent() {
    let faulty =
        |fault| format!("timeout_s = 3600.0\nstartup_s = 3600.0\nenv = {{ FAULT = \"{fault}\" }}");
    let programs = [
        ("polls.py", String::new()),
        ("faulty.py", faulty("silent")),
        ("faulty.py", faulty("never_connects")),
        ("faulty.py", faulty("silent_at_start")),
    ];
    for (program, skill) in programs {
        let folder = project(program, &skill, "action_secs = 3600");
        let mut simulator = started(folder.path(), &["run", "c.toml"]);
        // The program has begun its action, or at least runs.
        let here = std::fs::canonicalize(folder.path()).unwrap();
        let begun = || match program {
            "polls.py" => here.join("starts").exists(),
            _ => processes_in(&here).iter().any(|process| {
                let line = std::fs::read(process.join("cmdline"));
                line.is_ok_and(|line| line.windows(6).any(|part| part == b"python"))
            }),
        };
        let patience = Instant::now() + Duration::from_secs(60);
        while !begun() && Instant::now() < patience {
            std::thread::sleep(Duration::from_millis(20));
        }
        signal(simulator.id(), "INT");
        assert_eq!(simulator.wait().unwrap().code(), Some(130), "{program}");
        let listed = actcheck(
            folder.path(),
            &["list", "--history", ".actcheck", "--format", "csv"],
        );
        assert_eq!(
            stdout(&listed).lines().count(),
            1,
            "the run is not stored: {}",
            stdout(&listed)
        );
    }
}
